"""Whether an equilibrium of the section is one in space: its second order along motions out of the section's plane.

All bodies are cylinders along the wires, and their contacts are lines of finite length. A motion out of the plane tilts
a wire's axis, or turns the down splint about the bolt: at the place y along the wires it is a motion of the section by
y times its slopes. A loaded contact of the length L, force f and normal n at which the slopes differ by s resists
at first order with f L / 2 |n . s|; so what is left to second order are the slopes that keep every loaded line closed.
The down splint does not pitch, for the saddle carries the whole bolt force on a line; saddle, bolt and nut sit flat on
each other. The saddle turns with the down splint about the bolt's axis, which leaves all their contacts as they are;
so it does those of the inner faces that the slopes keep closed, and it remains what the wires' contacts say.

Along such slopes each gap is quadratic: in an arc the ends of the line close first, on a lip and a face the middle. The
gaps are those of the kernel in three dimensions, their second derivatives are differences. Both halves of the motion
are mirror images: nothing couples it with one in the plane, whose own second order `curvature` has.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.curvature import rounding_of_normals
from clamp3d.clamp.dimensions import TITLES, PartName
from clamp3d.clamp.final_state import TOLERANCE, FinalState
from clamp3d.clamp.matrix import Pair, plain
from clamp3d.clamp.section import EDGE, SPLINTS, WIRES, B, Section, V
from clamp3d.core.linear import dot, eigh, svd
from clamp3d.core.pieces import groove_pieces
from clamp3d.core.pose import Array, unit

_SLOPES = (0, 1, 2, 3, V)
"""Coordinates of the state whose slopes along the wires are the motion: the wires' centres, the down splint's x."""
_STEP = 0.02
"""Step of the differences, in parts of what closes the tightest loaded arc at its ends."""
_WIDEST = 1e-3
"""Largest slope of a difference."""
_NAMED = 0.1
"""A part takes part in a motion if its slope is this part of the largest one."""


@dataclass(frozen=True, slots=True)
class OutOfPlane:
    """Whether the distance can fall when parts tilt or turn out of the section's plane.

    Shifts of wires and down splint along the wires, and a wire's turn about its own axis, change no gap as long as the
    splints are well inside the wires: they are level in every equilibrium and not told.

    Attributes
    ----------
    stable : bool or None
        True: the distance rises along all motions. False: it falls along ``motions``. None: it is level along
        ``motions`` to second order, or to what ``uncertainty`` lets tell, or contacts without force may hold them.
    curvature : float
        Least second derivative of the distance along unit slopes that keep the loaded contacts closed, mm; inf if no
        motion does: all are resisted at first order.
    uncertainty : float
        Bound on its error, mm.
    slopes : tuple of float
        The motion of least curvature: slopes of line (right, down), jumper (right, down) and down splint (right).
    motions : tuple of str
        What does not raise the distance, in words.
    """

    stable: bool | None
    curvature: float
    uncertainty: float
    slopes: tuple[float, ...]
    motions: tuple[str, ...]

    def __str__(self) -> str:
        if self.stable:
            return "stable"
        level = "level" if self.curvature >= -self.uncertainty else "undecided"
        return f"{'not stable' if self.stable is False else level}: {', '.join(self.motions)}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; ``curvature_mm`` is null where all motions are resisted at first order."""
        data = plain(self, curvature="curvature_mm", uncertainty="uncertainty_mm")
        return data | {"curvature_mm": self.curvature if math.isfinite(self.curvature) else None}


def out_of_plane(section: Section, final: FinalState) -> OutOfPlane | None:
    """The second order of an equilibrium out of the plane; None where a wire has left the clamp, or other models than
    the exact arcs measure.

    >>> from clamp3d.clamp.final_state import solve_final_state
    >>> from clamp3d.clamp.loader import load_clamp
    >>> section = Section(load_clamp(), Cas())
    >>> str(out_of_plane(section, solve_final_state(section)))
    'stable'
    """
    gaps = final.gaps
    named = list(zip(gaps.pair, gaps.feature, strict=True))
    strong = np.flatnonzero(final.multipliers).tolist()
    if type(section.model) is not Cas or any(named[k][1] == EDGE for k in strong):
        return None
    lines = [k for k in range(len(named)) if named[k][0] in (("P1", "P2"), *itertools.product(SPLINTS, WIRES))]
    moves = np.array([wire not in final.loose for wire in WIRES for _ in "xy"] + [True])
    rates = gaps.gradient[:, _SLOPES]
    loaded = [k for k in lines if k in strong]
    found = _least(section, final, strong, _kept(rates[loaded], moves))
    if found.curvature < -found.uncertainty:  # it falls, unless what touches without force closes
        touching = [k for k in lines if gaps.value[k] <= TOLERANCE]
        kept = _least(section, final, strong, _kept(rates[touching], moves))
        return replace(kept, stable=False) if kept.curvature < -kept.uncertainty else replace(found, stable=None)
    return found


def _kept(rates: Array, moves: NDArray[np.bool_]) -> Array:
    """Unit slopes (n, 5) of the parts that move, which change no gap whose ``rates`` (m, 5) are given."""
    rows = np.eye(len(moves))[moves]
    if len(rates):
        _, sizes, rows_of = svd(rates[:, moves])
        rows = dot(rows_of[int((sizes > 1e-9).sum()) :], rows)
    return np.asarray(rows)


def _least(section: Section, final: FinalState, strong: list[int], slopes: Array) -> OutOfPlane:
    """The least second derivative of the Lagrangian along unit sums of ``slopes`` (n, 5)."""
    n = len(slopes)
    if not n:
        return OutOfPlane(True, math.inf, 0.0, (), ())
    own = [_second(section, final, strong, slope) for slope in slopes]
    second, error = np.diag([found for found, _ in own]), max(off for _, off in own)
    for a, b in itertools.combinations(range(n), 2):  # of a sum: what the two have in common
        found, off = _second(section, final, strong, slopes[a] + slopes[b])
        second[a, b] = second[b, a] = 0.5 * (found - own[a][0] - own[b][0])
        error = max(error, off)
    sizes, axes = eigh(second)
    error *= 2.0 * n
    motions = tuple(_words(dot(axes[:, k], slopes)) for k in np.flatnonzero(sizes <= error))
    least = tuple(dot(axes[:, 0], slopes).tolist())
    return OutOfPlane(None if motions else True, float(sizes[0]), error, least, motions)


def _second(section: Section, final: FinalState, strong: list[int], slope: Array) -> tuple[float, float]:
    """Second derivative of the Lagrangian along ``slope`` (5,), by the kernel's gaps in space, and its error; mm."""
    q, force = final.q, final.multipliers
    loaded: dict[Pair, list[tuple[int, float]]] = {}
    found, step = 0.0, _WIDEST
    for k in strong:
        pair = final.gaps.pair[k]
        if pair[0] in SPLINTS and pair[1] in WIRES:
            first = final.gaps.pair.index(pair)
            loaded.setdefault(pair, []).append((k - first, float(force[k])))
            groove, wire = section.pairs[pair].groove, section.pairs[pair].cylinder
            if final.gaps.feature[k] == "arc":
                step = min(step, _STEP * abs(groove.radius - wire.radius) / (0.5 * groove.length))
        elif pair[0] == "P4" and pair[1] in WIRES:  # two crossed cylinders come nearer when one turns
            apart = 0.5 * section.clamp.bolt.diameter + section.pairs["P1", pair[1]].cylinder.radius
            found += float(force[k]) * apart * float(slope[2 * WIRES.index(pair[1])]) ** 2

    def closed(part: float) -> float:
        """The sum of force and gap, less, at a part of the step."""
        total = 0.0
        for (splint, wire), rows in loaded.items():
            pair = section.pairs[splint, wire]
            T = _in_groove(section, q, splint, wire, part * step * slope)
            distance = groove_pieces(pair.groove, pair.cylinder, T).distance
            total -= sum(push * float(distance[row]) for row, push in rows)
        return total

    here = closed(0.0)
    whole, half = (2.0 * (closed(part) - here) / (part * step) ** 2 for part in (1.0, 0.5))
    carried = sum(push for rows in loaded.values() for _, push in rows)
    longest = max((section.pairs[pair].groove.length for pair in loaded), default=0.0)
    rounding = 160.0 * float(np.spacing(np.abs(q).max() + longest)) / step**2
    turned = longest * rounding_of_normals(section, q) / (0.5 * step)  # of normals: the slopes keep no gap quite closed
    return found + (4.0 * half - whole) / 3.0, abs(half - whole) / 3.0 + carried * (rounding + turned)


def _in_groove(section: Section, q: Array, splint: PartName, wire: PartName, slope: Array) -> Array:
    """Pose (4, 4) of a wire in a splint's groove when their axes have slopes."""
    i, pair = 2 * WIRES.index(wire), section.pairs[splint, wire]
    # Of point and direction: right, along, down.
    place = np.array([[q[i], 0.0, q[i + 1]], [slope[i], 1.0, slope[i + 1]]])
    mouth = 1.0 if splint == "P1" else -1.0
    if splint == "P2":
        axis, down, turn = section.bolt_x + float(q[B]), section.down_splint(q), float(slope[4])
        place[0, 0] -= axis
        long = math.hypot(1.0, turn)
        place[:, :2] = dot(place[:, :2], np.array([[1.0, turn], [-turn, 1.0]])) / long
        place[0] += axis - down.x, 0.0, -down.y
        c, s = math.cos(down.angle), math.sin(down.angle)
        place[:, ::2] = dot(place[:, ::2], np.array([[c, s], [-s, c]]))
    place[0, ::2] -= pair.T_a_groove[0, 3], -pair.T_a_groove[2, 3]
    T = np.eye(4)
    z = unit(place[1, [0, 2, 1]] * (1.0, mouth, mouth))
    x = unit(np.array([z[2], 0.0, -z[0]]))
    T[:3, :3] = np.column_stack(
        [x, (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]), z]
    )
    T[:3, 3] = place[0, [0, 2, 1]] * (1.0, mouth, mouth)
    return T


def _words(slope: Array) -> str:
    """What moves: 'jumper turns out of the section'."""
    large = np.abs(slope) > _NAMED * np.abs(slope).max()
    moving: list[PartName] = [wire for i, wire in enumerate(WIRES) if large[2 * i : 2 * i + 2].any()]
    moving += ["P2"] if large[4] else []
    return f"{' and '.join(TITLES[part] for part in moving)} turn{'s' if len(moving) == 1 else ''} out of the section"
