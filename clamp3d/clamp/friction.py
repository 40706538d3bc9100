"""The friction band: between which splint distances a clamp stays where it is, if its wires rub in their grooves.

Without friction the clamp ends in one state. With friction it stays in every state in which forces within the friction
cones of its closed contacts balance every part. The band is of the states with all four contacts of wire and groove
closed, both wires in the arcs, the down splint held on the bolt's axis, and friction in the grooves alone.

A wire that has jammed on a lip is not looked at: it can hold the clamp further open.

A wire is then pushed at two points only, so both forces lie on the line through them, which leaves either normal by the
same angle a. The centres of its two arcs are s apart, ``s^2 = p^2 + q^2 + 2 p q cos 2a``, with p and q by which the
radii of the arcs exceed the wire's. The state has an equilibrium if neither wire's a exceeds the friction angle
``atan(friction)``: the sizes of the two wires' forces then balance the bolt's force and the tilt. So at each tilt
equilibrium exists in one interval of distances.

The ends of the band are found in this closed form and proven apart from it, by the section's own contacts: forces that
balance at the end, and a little beyond it, for states at many tilts, a Farkas certificate each that no forces do
[G. Farkas, Theorie der einfachen Ungleichungen, J. reine angew. Math. 124 (1902) 1-27].
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import bisect, nnls

from clamp3d.clamp.closing import CLOSING
from clamp3d.clamp.dimensions import Clamp, Joints
from clamp3d.clamp.final_state import closed, world_force
from clamp3d.clamp.plain import plain
from clamp3d.clamp.result import Force
from clamp3d.clamp.section import HELD, SIZE, SPLINTS, WIRES, D, Gaps, S, Section
from clamp3d.clamp.torque import coefficients
from clamp3d.errors import InputError, SolverError
from clamp3d.geometry.pose import Array

MARGIN = 1e-3
"""How far beyond an end of the band it is proven that nothing balances, mm: the last digit that is printed."""
CLOSED = 1e-7
"""Gaps up to this many mm carry force: the closed form and the section differ by rounding."""
BALANCED = 1e-6
"""Largest unbalanced force of a certificate in parts of the bolt force: what gaps of `CLOSED` turn normals by."""
MOST_FRICTION = 1.0  # chosen: a friction angle of 45 degrees
_TILTS, _SHARES, _ROUNDS = 300, 11, 7
"""Samples of the search: tilts to either side, distances a tilt, and how often it is narrowed (30-fold each)."""
_BESIDE = 10  # samples to either side that stay: where an arc ends, the best of all is not next to the best sample
_TILTS_BEYOND = 201  # chosen: each costs some linear programs


@dataclass(frozen=True, slots=True, eq=False)
class NoEquilibrium:
    """Proof that a state has no equilibrium: a motion that the bolt drives and no force of a closed contact resists.

    Attributes
    ----------
    motion : ndarray (9,)
        Wire centres x6, y6, x7, y7 in mm, distance, scaled tilt and height over the saddle's arc in mm (see `section`),
        turns of both wires over their radius in mm; each at most 1.
    drive : float
        Work of the bolt's unit force on it, > 0.
    resistance : float
        Largest work of a unit force along any edge of any friction cone against it: 0 but for rounding.
    """

    motion: Array
    drive: float
    resistance: float


@dataclass(frozen=True, slots=True, eq=False)
class End:
    """An end of the friction band.

    Attributes
    ----------
    distance : float
        Height between the splints' inner edges on the line side, mm.
    tilt : float
        Of the down splint, rad.
    forces : tuple of Force
        Contact forces per newton of bolt force that balance every part.
    unbalanced : float
        What they leave, N per newton of bolt force.
    states_beyond : int
        How many states `MARGIN` beyond the end were tried.
    weakest : NoEquilibrium or None
        Their certificate with the least drive; None if no state beyond has all contacts closed.
    """

    distance: float
    tilt: float
    forces: tuple[Force, ...]
    unbalanced: float
    states_beyond: int
    weakest: NoEquilibrium | None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return plain(self, distance="distance_mm", tilt="tilt_deg")


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Between which splint distances equilibrium exists with ``friction`` in the grooves."""

    friction: float
    least: End
    greatest: End

    def __contains__(self, distance: float) -> bool:
        return self.least.distance <= distance <= self.greatest.distance

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return plain(self)


class _Arcs:
    """Both wires and their arcs in P1 and P2: arrays (splint, wire), mm and rad, x right and y down.

    ``centre`` (2, 2, 2) of P1's arcs from P1's corner, of P2's from P2's origin; ``half_angle`` of the arcs, and
    ``slack``, what an arc's radius is larger than the wire's.
    """

    def __init__(self, section: Section) -> None:
        pairs = [[section.pairs[splint, wire] for wire in WIRES] for splint in SPLINTS]
        self.bolt_x = section.bolt_x
        self.centre = np.array([[pair.T_a_groove[[0, 2], 3] * (1.0, -1.0) for pair in row] for row in pairs])
        self.half_angle = np.array([[pair.groove.half_angle for pair in row] for row in pairs])
        self.slack = np.array([[pair.groove.radius - pair.cylinder.radius for pair in row] for row in pairs])

    def offset(self, i: int, tilt: Array) -> tuple[Array, Array]:
        """From P1's arc centre of wire ``i`` to P2's, mm, with P2's origin at P1's height."""
        c, s, (x, y), (u, v) = np.cos(tilt), np.sin(tilt), *self.centre[:, i]
        return self.bolt_x + u * c + v * s - x, v * c - u * s - y

    def distance(self, tilt: Array, friction: float) -> Array:
        """How far (2, n) P2's origin is below P1's, mm, where a wire's forces are on the edges of the friction cones;
        NaN where it cannot be."""
        (p, q), (x, y) = self.slack, np.swapaxes([self.offset(i, tilt) for i in range(len(WIRES))], 0, 1)
        separation = p * p + q * q + 2.0 * p * q * math.cos(2.0 * math.atan(friction))  # squared
        with np.errstate(invalid="ignore"):
            return np.asarray(-y - np.sqrt(separation[:, None] - x * x))

    def places(self, i: int, d: Array, tilt: Array) -> list[tuple[Array, Array, NDArray[np.bool_]]]:
        """Both places of a wire's centre with both contacts closed, mm, and whether both are on the arcs."""
        (p, q), (x, y) = self.slack[:, i], self.offset(i, tilt)
        y = y + d
        apart, c, s = np.maximum(np.hypot(x, y), 1e-300), np.cos(tilt), np.sin(tilt)
        along = (p * p - q * q + apart * apart) / (2.0 * apart)
        aside, places = np.sqrt(np.maximum(p * p - along * along, 0.0)), []
        for sign in (-1.0, 1.0):
            right, below = (along * x - sign * aside * y) / apart, (along * y + sign * aside * x) / apart
            dx, dy = right - x, below - y
            on_arcs = np.abs(np.arctan2(right, -below)) <= self.half_angle[0, i]
            on_arcs &= np.abs(np.arctan2(dx * c - dy * s, dx * s + dy * c)) <= self.half_angle[1, i]
            places.append((self.centre[0, i, 0] + right, self.centre[0, i, 1] + below, on_arcs))
        return places


class FrictionBand:
    """The friction bands of a clamp.

    Raises InputError for a clamp that does not hold both wires in the arcs of all four grooves.

    Examples
    --------
    >>> from clamp3d.clamp.loader import load_clamp
    >>> bands = FrictionBand(load_clamp())
    >>> f"{bands.ends(0.1)[0]:.3f} to {bands.ends(0.1)[1]:.3f} mm"
    '31.496 to 31.620 mm'
    """

    def __init__(self, clamp: Clamp) -> None:
        self.section, self.final, status = closed(replace(clamp, joints=Joints()))
        if not (status.clamped and all(seat.seated for seat in status.seats)):
            raise InputError(f"friction band: needs both wires in the arcs of all four grooves, got {status.text!r}")
        self._arcs = _Arcs(self.section)

    @property
    def distance(self) -> float:
        """Splint distance without friction, mm."""
        return self.section.splint_distance(self.final.q)

    def ends(self, friction: float) -> tuple[float, float]:
        """The least and the greatest splint distance at which equilibrium exists, mm, without certificates."""
        (friction,) = coefficients("groove friction", [friction])
        least, greatest = (self._extreme(friction, sense)[0] for sense in (1.0, -1.0))
        return least, greatest

    def band(self, friction: float) -> Band:
        """The band of a friction with certificates at both ends. Raises SolverError if they cannot be had."""
        (friction,) = coefficients("groove friction", [friction])
        least, greatest = (self._end(friction, sense) for sense in (1.0, -1.0))
        return Band(friction, least, greatest)

    def friction_for(self, distance: float) -> float | None:
        """The least friction whose band holds a splint distance; None if none up to `MOST_FRICTION` does."""
        below = distance < self.distance

        def lacking(friction: float) -> float:
            end = self._extreme(friction, 1.0 if below else -1.0)[0] if friction else self.distance
            return distance - end if below else end - distance

        if distance == self.distance:
            return 0.0
        return float(bisect(lacking, 0.0, MOST_FRICTION, xtol=1e-5)) if lacking(MOST_FRICTION) >= 0.0 else None

    def _splint_distance(self, d: Array, tilt: Array) -> Array:
        clamp = self.section.clamp
        edge = clamp.down_splint.face_depth * np.cos(tilt) + self.section.lever * np.sin(tilt)
        return np.asarray(d + edge - clamp.up_splint.thickness)

    def _extreme(self, friction: float, sense: float) -> tuple[float, float, float]:
        """Least splint distance (greatest for ``sense`` -1) of all states in equilibrium, with its d and tilt.

        Tilts crowd around that without friction, which every band holds: a narrow band is not stepped over.
        """
        first, stop = float(self.final.q[S]) / self.section.lever, self.section.clamp.tilt_stop
        aside = np.geomspace(1e-9, 2.0 * stop, _TILTS)
        tilt, share = np.sort(np.concatenate([first - aside, [first], first + aside])), np.linspace(0.0, 1.0, _SHARES)
        best = (math.inf, math.nan, first)
        for _ in range(_ROUNDS):
            d, valid = self._states(tilt, share, friction)
            score = np.where(valid, sense * self._splint_distance(d, tilt[:, None]), np.inf)
            i, j = divmod(int(score.argmin()), len(share))
            best = min(best, (float(score[i, j]), float(d[i, j]), float(tilt[i])))
            low, high = max(i - _BESIDE, 0), min(i + _BESIDE, len(tilt) - 1)
            tilt = np.append(np.linspace(tilt[low], tilt[high], 2 * _TILTS), best[2])
            tilt.sort()
            near = np.linspace(share[max(j - 1, 0)], share[min(j + 1, len(share) - 1)], _SHARES)
            share = np.unique(np.concatenate([near, [0.0, 1.0]]))
        if not math.isfinite(best[0]):
            raise SolverError(f"friction band: no state with friction {friction:g} was found")
        return sense * best[0], best[1], best[2]

    def _states(self, tilt: Array, share: Array, friction: float) -> tuple[Array, NDArray[np.bool_]]:
        """Distances d (n, m) at shares (m,) of each tilt's interval (n,), and whether all contacts are closed there."""
        clamp = self.section.clamp
        low, high = self._arcs.distance(tilt, 0.0).max(axis=0), self._arcs.distance(tilt, friction).min(axis=0)
        d, column = low[:, None] + share * (high - low)[:, None], tilt[:, None]
        valid = (low <= high)[:, None] & (np.abs(column) <= clamp.tilt_stop)
        half, up = min(self.section.lever, self.section.bolt_x), clamp.up_splint.thickness
        valid = valid & (d + clamp.down_splint.face_depth * np.cos(column) - half * np.abs(np.sin(column)) >= up)
        for i in range(len(WIRES)):
            valid = valid & np.any([on_arcs for _, _, on_arcs in self._arcs.places(i, d, column)], axis=0)
        return d, valid

    def _end(self, friction: float, sense: float) -> End:
        distance, d, tilt = self._extreme(friction, sense)
        best, unbalanced, forces = None, math.inf, np.zeros(0)
        for q, gaps in self._closed_states(d, tilt):
            balance = Balance(self.section, q, gaps, friction)
            multipliers, left = balance.forces()
            if left < unbalanced:
                best, unbalanced, forces = balance, left, multipliers
        if best is None or unbalanced > BALANCED:
            raise SolverError(f"friction band: end at {distance:.6g} mm not proven, {unbalanced:.3g} N/N are left over")
        certificates = list(self._beyond(friction, distance - sense * MARGIN, tilt))
        weakest = min(certificates, key=lambda proof: proof.drive - proof.resistance, default=None)
        if weakest is not None and not weakest.drive > 1e-5 > 1e3 * weakest.resistance:
            raise SolverError(f"friction band: beyond its end at {distance:.6g} mm a state may be in equilibrium")
        return End(distance, tilt, best.world_forces(forces), unbalanced, len(certificates), weakest)

    def _beyond(self, friction: float, distance: float, first: float) -> Iterator[NoEquilibrium]:
        """A certificate for each state of a splint distance, tilts around ``first``, with all four contacts closed."""
        stop = self.section.clamp.tilt_stop
        aside = np.geomspace(1e-6, 2.0 * stop, _TILTS_BEYOND // 2)
        for tilt in np.concatenate([first - aside, [first], first + aside]):
            d = distance - float(self._splint_distance(np.zeros(1), np.array([tilt]))[0])
            for q, gaps in self._closed_states(d, float(tilt)):
                yield Balance(self.section, q, gaps, friction).refute()

    def _closed_states(self, d: float, tilt: float) -> Iterator[tuple[Array, Gaps]]:
        """States (10,) of the section at d and tilt in which both wires touch both their arcs and nothing overlaps.

        Each with its gaps.
        """
        places = [self._arcs.places(i, np.array(d), np.array(tilt)) for i in range(len(WIRES))]
        for (x6, y6, _), (x7, y7, _) in itertools.product(*places):
            q = np.zeros(SIZE)
            q[:4], q[D], q[S] = (x6, y6, x7, y7), d, self.section.lever * tilt
            gaps = self.section.gaps(q)
            touching = {pair for pair, gap in zip(gaps.pair, gaps.value, strict=True) if abs(gap) <= CLOSED}
            if gaps.value.min() >= -CLOSED and {(a, b) for a in ("P1", "P2") for b in WIRES} <= touching:
                yield q, gaps


class Balance:
    """Which forces can act at a state of the section (joints without play), with friction between wires and splints.

    ``A`` (m, 9) is the work of ``push`` (m, 2), unit forces along the edges of the friction cones, for unit motions of
    the seven coordinates that move and of the turns of both wires; ``gap`` (m,) is the gap that each belongs to.
    """

    def __init__(self, section: Section, q: Array, gaps: Gaps, friction: float) -> None:
        self.q, self.gaps = q, gaps
        edges = []
        for k in np.flatnonzero(np.abs(self.gaps.value) <= CLOSED).tolist():
            a, b = self.gaps.pair[k]
            x, y = self.gaps.normal[k]
            sides = (friction, -friction) if b in WIRES and a != "P4" else (0.0,)
            edges += [(k, (x - side * y, y + side * x)) for side in sides]
        self.gap, self.push = [k for k, _ in edges], np.array([push for _, push in edges]).reshape(-1, 2)
        work = section.work(q, [self.gaps.pair[k] for k in self.gap], self.gaps.point[self.gap], self.push)
        self.A = work[:, [*HELD, SIZE, SIZE + 1]]
        self.load = np.append(CLOSING[list(HELD)], np.zeros(len(WIRES)))

    def forces(self) -> tuple[Array, float]:
        """Forces >= 0 (m,) along the cones' edges that balance the bolt's unit force best, and what they leave."""
        forces, left = nnls(self.A.T, self.load)
        return np.asarray(forces), float(left)

    def refute(self) -> NoEquilibrium:
        """A motion of at most 1 in each coordinate that the bolt drives and no contact force resists.

        If any forces f >= 0 balanced the load, ``load = A.T f``, the drive ``load . y = f . A y`` would be <= 0. What
        the forces that balance it best leave over is such a y, or nothing (the optimality conditions of least squares).
        """
        left = self.load - self.forces()[0] @ self.A
        motion = left / max(float(np.abs(left).max()), 1e-300)
        return NoEquilibrium(motion, float(self.load @ motion), max(0.0, float((self.A @ motion).max(initial=0.0))))

    def world_forces(self, forces: Array) -> tuple[Force, ...]:
        """The contact forces in the world, those of both edges of a cone together."""
        total = np.zeros_like(self.gaps.normal)
        np.add.at(total, self.gap, forces[:, None] * self.push)
        return tuple(
            world_force(self.q, *self.gaps.pair[k], self.gaps.feature[k], total[k], self.gaps.point[k])
            for k in np.flatnonzero(np.hypot(*total.T) > BALANCED)
        )
