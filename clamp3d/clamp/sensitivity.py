"""How much the splint distance changes with each dimension: derivatives at the exact final state.

The final state x(p) with its contact forces l(p) solves the Karush-Kuhn-Tucker conditions of "least d, no gap
negative": F = [grad_x (d - l . g), g] = 0 over the strongly active gaps g. The implicit function theorem gives
dx/dp = -(dF/d(x, l))^-1 dF/dp [Fiacco, Introduction to Sensitivity and Stability Analysis in Nonlinear Programming,
1983, section 3.2]; one solve with the transposed matrix (the adjoint) serves all dimensions at once. The distance of
Table 4 is not d itself: the tilt moves it too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from clamp3d.checks import choice
from clamp3d.clamp.dimensions import Clamp, Wire
from clamp3d.clamp.final_state import FinalState, closed
from clamp3d.clamp.section import SIZE, D, S, Section, U
from clamp3d.errors import NotClampedError, SolverError
from clamp3d.geometry.pose import Array

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
    "up_splint.hole_diameter",
    "bolt.diameter",
    "saddle.hole_diameter",
    "saddle.radius",
    "down_splint.back_radius",
)
"""Dimensions that place splints and wires in the section, and then those that limit play, by their names in clamp
files; all in mm."""

_WELL_POSED = 1e-10  # least singular value over the largest: rounding leaves six digits of a derivative
_NONE = 1e-8
"""Derivatives below are rounding of the differences."""


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
    choice("dimension", name, DIMENSIONS)
    if name in ("line.diameter", "jumper.diameter"):
        wire: Wire = getattr(clamp, name.split(".")[0])
        return 2.0 * wire.radius
    return float(attrgetter(name)(clamp))


def with_dimensions(clamp: Clamp, values: Mapping[str, float]) -> Clamp:
    """The clamp with some of `DIMENSIONS` changed to ``values`` in mm.

    The tilt that its file names goes: it is that of the nominal clamp, and the bodies say where the tilt ends.

    Raises InputError for an unknown name and for dimensions that are no clamp, with the rule that they break.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> with_dimensions(load_clamp(), {"up_splint.thickness": 28.0}).up_splint.thickness
    28.0
    """
    for name in values:
        choice("dimension", name, DIMENSIONS)
    conductors = {f"{wire}.conductor": None for wire in ("line", "jumper") if f"{wire}.diameter" in values}
    changed: Clamp = _changed(clamp, {**values, **conductors, "down_splint.max_tilt_deg": None})
    return changed


def sensitivity(clamp: Clamp) -> tuple[Sensitivity, ...]:
    """Derivatives of the splint distance by each of `DIMENSIONS` that it depends on, largest effect first.

    They hold while the active set stays the same.

    Raises
    ------
    NotClampedError
        If the clamp does not hold both wires.
    SolverError
        If the final state cannot be proven, or is not an isolated one (the derivative then does not exist).

    Examples
    --------
    >>> from clamp3d.clamp.loader import load_clamp
    >>> {s.name: round(s.derivative, 4) for s in sensitivity(load_clamp())}["line.diameter"]
    1.2144
    """
    section, final, status = closed(clamp)
    if not status.clamped:
        raise NotClampedError(f"no sensitivity: {status}")
    derivative = _derivatives(section, final)
    rows = [
        Sensitivity(n, dimension(clamp, n), float(v))
        for n, v in zip(DIMENSIONS, derivative, strict=True)
        if abs(v) > _NONE
    ]
    return tuple(sorted(rows, key=lambda row: -round(abs(row.derivative), 9)))


def _changed(part: Any, values: Mapping[str, Any]) -> Any:
    """A part with other values at dotted names, all at once."""
    new = {}
    for head in {name.partition(".")[0] for name in values}:
        inner = {name.removeprefix(f"{head}."): v for name, v in values.items() if name.startswith(f"{head}.")}
        new[head] = _changed(getattr(part, head), inner) if inner else values[head]
    return replace(part, **new)


def _derivatives(section: Section, final: FinalState) -> Array:
    """Splint distance by `DIMENSIONS` (n,), through the adjoint of the KKT system."""
    clamp, q, free = section.clamp, final.q, list(section.free)
    active = np.flatnonzero(final.multipliers)
    # Central differences of closed forms: the step balances rounding and the turn of a normal within the groove.
    h = float((np.spacing(np.abs(q).max()) * section.least_slack**2) ** (1.0 / 3.0))

    def conditions(name: str, by: float) -> Array:
        """Gradient of the Lagrangian (n, up to a constant), active gaps (k), and the splint distance."""
        at = Section(with_dimensions(clamp, {name: dimension(clamp, name) + by}), section.model)
        gaps = at.gaps(q)
        gradient = -final.multipliers[active] @ gaps.gradient[active][:, free]
        return np.array([*gradient, *gaps.value[active], at.splint_distance(q)])

    by_p = np.column_stack([conditions(n, h) - conditions(n, -h) for n in DIMENSIONS]) / (2.0 * h)
    A, k = final.gaps.gradient[active][:, free], len(active)
    hessian = -section.hessian(q, final.gaps, final.multipliers)[np.ix_(free, free)]
    kkt = np.block([[hessian, A.T], [A, np.zeros((k, k))]])  # symmetric, so its own adjoint: the forces by -l
    # The inner edge moves with the down splint's place and tilt.
    lever, down, rows = section.lever, clamp.down_splint, np.zeros(SIZE)
    angle = float(q[S]) / lever
    rows[[D, U, S]] = 1.0, -1.0, math.cos(angle) - down.face_depth * math.sin(angle) / lever
    adjoint, _, rank, _ = np.linalg.lstsq(kkt, np.append(rows[free], np.zeros(k)), _WELL_POSED)
    if rank < len(kkt):
        raise SolverError("no sensitivity: the final state is not isolated, its KKT matrix is singular")
    return np.asarray(by_p[-1] - adjoint @ by_p[:-1])
