"""How much the splint distance changes with each dimension: closed-form derivatives at the exact final state.

The final state x(p) with its contact forces l(p) solves the Karush-Kuhn-Tucker conditions of "least d, no gap
negative": F = [grad_x (d - l . g), g] = 0 over the strongly active gaps g. The implicit function theorem gives
dx/dp = -(dF/d(x, l))^-1 dF/dp [Fiacco, Introduction to Sensitivity and Stability Analysis in Nonlinear Programming,
1983, section 3.2]; one solve with the transposed matrix (the adjoint) serves all dimensions at once. The distance of
Table 4 is not d itself: the tilt moves it too.

Here x = (x6, y6, x7, y7, d, tilt), seen from where the bolt axis meets the up splint's top face, mm and rad.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.dimensions import Clamp, GrooveDimensions, Wire
from clamp3d.clamp.final_state import FinalState, solve_final_state
from clamp3d.clamp.section import WIRES, D, S, Section
from clamp3d.clamp.status import CLAMPED, final_status
from clamp3d.core.pose import Array
from clamp3d.errors import InputError, SolverError

_GROOVES = ("line_groove", "jumper_groove")
DIMENSIONS: tuple[str, ...] = (
    "line.diameter",
    "jumper.diameter",
    "up_splint.width",
    "up_splint.thickness",
    *(f"up_splint.{g}.{key}" for g in _GROOVES for key in ("radius", "offset", "centre_depth")),
    "down_splint.width",
    "down_splint.face_depth",
    *(f"down_splint.{g}.{key}" for g in _GROOVES for key in ("radius", "offset", "centre_depth")),
)
"""Dimensions that place the splints and wires in the section, by their names in clamp files; all in mm."""

_WELL_POSED = 1e-10


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """One dimension: its ``name`` and ``value`` in mm, and ``derivative``, mm of splint distance per mm of it."""

    name: str
    value: float
    derivative: float


def dimension(clamp: Clamp, name: str) -> float:
    """Value in mm of one of `DIMENSIONS`.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> dimension(load_clamp(), "line.diameter"), dimension(load_clamp(), "down_splint.line_groove.radius")
    (32.67, 23.8012)
    """
    _check_name(name)
    if name in ("line.diameter", "jumper.diameter"):
        wire: Wire = getattr(clamp, name.split(".")[0])
        return 2.0 * wire.radius
    value: Any = clamp
    for key in name.split("."):
        value = getattr(value, key)
    return float(value)


def with_dimensions(clamp: Clamp, values: Mapping[str, float]) -> Clamp:
    """The clamp with some of `DIMENSIONS` changed to ``values`` in mm.

    Raises InputError for an unknown name and for dimensions that are no clamp, with the rule that they break.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> with_dimensions(load_clamp(), {"up_splint.thickness": 28.0}).up_splint.thickness
    28.0
    """
    tree: dict[str, Any] = {}
    for name, value in values.items():
        _check_name(name)
        *path, last = name.split(".")
        node = tree
        for key in path:
            node = node.setdefault(key, {})
        node[last] = float(value)
    for wire in ("line", "jumper"):
        if wire in tree:
            tree[wire]["conductor"] = None
    changed: Clamp = _replaced(clamp, tree)
    return changed


def sensitivity(clamp: Clamp) -> tuple[Sensitivity, ...]:
    """Derivatives of the splint distance by each of `DIMENSIONS` that it depends on, largest effect first.

    Exact while the active set stays the same. Raises SolverError if the final state cannot be proven, does not hold
    both wires, or is not an isolated one (the derivative then does not exist).

    >>> from clamp3d.clamp.loader import load_clamp
    >>> {s.name: round(s.derivative, 4) for s in sensitivity(load_clamp())}["line.diameter"]
    1.2144
    """
    section = Section(clamp, Cas())
    final = solve_final_state(section)
    status = final_status(clamp, final, 0.0)
    if status != CLAMPED:
        raise SolverError(f"no sensitivity: {status}")
    derivative = _derivatives(section, final)
    rows = [
        Sensitivity(n, dimension(clamp, n), float(v)) for n, v in zip(DIMENSIONS, derivative, strict=True) if v != 0.0
    ]
    return tuple(sorted(rows, key=lambda row: -round(abs(row.derivative), 9)))


def _check_name(name: str) -> None:
    if name not in DIMENSIONS:
        raise InputError(f"unknown dimension {name!r}; available: {', '.join(DIMENSIONS)}")


def _replaced(part: Any, tree: Mapping[str, Any]) -> Any:
    return replace(part, **{k: _replaced(getattr(part, k), v) if isinstance(v, dict) else v for k, v in tree.items()})


def _derivatives(section: Section, final: FinalState) -> Array:
    """Splint distance by `DIMENSIONS` (n,), through the adjoint of the KKT system."""
    clamp, gaps = section.clamp, final.gaps
    tilt = float(final.q[S]) / section.lever
    active = np.flatnonzero(final.multipliers)
    k, n = len(active), len(DIMENSIONS)
    A, hessian, mixed, by_p = np.zeros((k, 6)), np.zeros((6, 6)), np.zeros((6, n)), np.zeros((k, n))
    for row, i in enumerate(active):
        splint, wire = gaps.pair[i]
        if wire not in WIRES or not (gaps.feature[i] == "arc" or gaps.feature[i].startswith("lip")):
            raise SolverError(f"no sensitivity: the contact of {splint} and {wire} is on a {gaps.feature[i]}")
        at, by_point, by_local, second = _gap(section, final, int(i))
        A[row, at] = by_point
        hessian[np.ix_(at, at)] -= final.multipliers[i] * second[:4, :4]
        mixed[at] -= final.multipliers[i] * (second[:4, 4:] @ by_local[:2])
        by_p[row] = by_local[2]
    kkt = np.block([[hessian, -A.T], [A, np.zeros((k, k))]])
    sizes = np.linalg.svd(kkt, compute_uv=False)
    if sizes[-1] < _WELL_POSED * sizes[0]:
        raise SolverError("no sensitivity: the final state is not isolated, its KKT matrix is singular")
    # Splint distance = d - u sin(tilt) + v cos(tilt) - thickness at the down splint's corner (u, v).
    u, v = -clamp.down_splint.width / 2, clamp.down_splint.face_depth
    s, c = math.sin(tilt), math.cos(tilt)
    goal = np.zeros(6 + k)
    goal[D], goal[S] = 1.0, -u * c - v * s
    own = np.zeros(n)
    own[DIMENSIONS.index("down_splint.width")] = 0.5 * s
    own[DIMENSIONS.index("down_splint.face_depth")] = c
    own[DIMENSIONS.index("up_splint.thickness")] = -1.0
    adjoint = np.linalg.solve(kkt.T, goal)
    return np.asarray(own - adjoint @ np.vstack([mixed, by_p]))


def _gap(section: Section, final: FinalState, i: int) -> tuple[list[int], Array, Array, Array]:
    """A wire's gap to an arc, R - r - |W - C|, or to its lip, |W - C| - r, with C = the feature's point on the splint.

    Returns where (wire x, wire y, d, tilt) stand in x; the gap's derivatives (4,) by them; ``by_local`` (3, n): the
    splint-frame point (2) and the gap itself by `DIMENSIONS`; and second derivatives (4, 6) of the gap by
    (wire x, wire y, d, tilt) and (the same, point).
    """
    clamp, (splint, wire), feature = section.clamp, final.gaps.pair[i], final.gaps.feature[i]
    which = WIRES.index(wire)
    side, key = (-1, 1)[which], _GROOVES[which]
    up = splint == "P1"
    part, face = ("up_splint", "thickness") if up else ("down_splint", "face_depth")
    groove: GrooveDimensions = getattr(getattr(clamp, part), key)
    face_depth: float = getattr(getattr(clamp, part), face)
    column = {name: DIMENSIONS.index(f"{part}.{key}.{name}") for name in ("radius", "offset", "centre_depth")}
    tilt = 0.0 if up else float(final.q[S]) / section.lever
    s, c = math.sin(tilt), math.cos(tilt)
    T, T1 = np.array([[c, s], [-s, c]]), np.array([[-s, c], [-c, -s]])  # rotation of the splint, and by its tilt
    origin = np.array([0.0, 0.0 if up else float(final.q[D])])
    bolt = np.array([section.bolt_x, 0.0])

    by_local = np.zeros((3, len(DIMENSIONS)))
    by_local[0, column["offset"]] = side
    by_local[2, which] = -0.5  # the wire's radius by its diameter
    if feature == "arc":
        sign, point = -1.0, np.array([side * groove.offset, groove.centre_depth])
        by_local[1, column["centre_depth"]] = 1.0
        by_local[2, column["radius"]] = 1.0
    else:
        depth = groove.centre_depth - face_depth
        half_mouth = math.sqrt(groove.radius**2 - depth**2)
        lips = [np.array([side * groove.offset + end * half_mouth, face_depth]) for end in (-1, 1)]
        touched = final.gaps.point[i] - bolt
        end = min((0, 1), key=lambda e: float(np.linalg.norm(origin + T @ lips[e] - touched)))
        sign, point = 1.0, lips[end]
        by_local[0, column["radius"]] = (-1, 1)[end] * groove.radius / half_mouth
        by_local[0, column["centre_depth"]] = -(-1, 1)[end] * depth / half_mouth
        by_local[0, DIMENSIONS.index(f"{part}.{face}")] = (-1, 1)[end] * depth / half_mouth
        by_local[1, DIMENSIONS.index(f"{part}.{face}")] = 1.0

    # w = W - C by (wire x, wire y, d, tilt, point x, point y); |w|'' = w'^T (I - n n^T) / |w| w' + n . w''
    w = final.q[2 * which : 2 * which + 2] - bolt - origin - T @ point
    length = float(np.linalg.norm(w))
    normal = w / length
    J = np.zeros((2, 6))
    J[:, :2], J[:, 4:] = np.eye(2), -T
    if not up:
        J[:, 2], J[:, 3] = (0.0, -1.0), -T1 @ point
    second = J.T @ ((np.eye(2) - np.outer(normal, normal)) / length) @ J
    if not up:
        second[3, 3] += normal @ T @ point  # the rotation's second derivative is minus itself
        second[3, 4:] -= normal @ T1
        second[4:, 3] -= normal @ T1
    first = sign * normal @ J
    by_local[2] += first[4:] @ by_local[:2]
    return [2 * which, 2 * which + 1, D, S], first[:4], by_local, sign * second[:4]
