"""The closing path: the quasi-static motion of the clamp while its bolt is drawn, without friction.

The parts move as if each coordinate of the state (`section`) met the same slight drag and nothing overlapped: the
velocity is the force of the bolt, projected on the motions that keep every closed gap closed or open it (a sweeping
process). One step of the length h solves "least |q' - q|^2 / 2 + h d', no gap negative", Moreau's catching-up scheme
[J. J. Moreau, Evolution problem associated with a moving convex set, J. Differential Equations 26 (1977) 347-374], by
sequential quadratic programming. It is implicit: a long step is as stable as a short one. The multipliers of a step
over h are the contact forces in parts of the bolt force.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, nnls

from clamp3d.clamp.curvature import lagrangian_hessian
from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.section import SIZE, WIRES, B, D, Gaps, S, Section, U, V, W
from clamp3d.errors import SolverError
from clamp3d.geometry.pose import Array

STRIDE = 0.01
"""How far a step moves any coordinate, in parts of the down splint's half width (0.7 mm for the reference clamp)."""
CLOSING = np.eye(SIZE)[D]
"""What the bolt does: it lowers d."""

HELD = (0, 1, 2, 3, D, S, U)
"""Coordinates that move while the down splint is closed by hand: what play the joints have the nut takes up."""
OnContact = Callable[[Pair, Array], None]
"""Told a pair and the state when the pair first carries force."""

_AT_REST = 1e-4
"""Speed over the bolt's at which nothing moves: what certifies a final state takes it from there."""
STILL = 1e-9
"""The same where that is on the ridge of a saddle, from which the motion leaves slowly at first."""
_STEPS, _ROUNDS = 2000, 12
_SETTLED, _OVERLAP = 1e-3, 1e-8
"""A step is found when a round moves it by this part of a stride, and it overlaps by no more than this part."""
_SLOW = 16.0
"""A step that is longer than so many strides is one near rest."""
_FULL = 1e-9
"""Clearance in parts of the groove's radius below which a wire fills it: there is no round to roll in."""
_SHORTEST = 1e-9
"""Shortest stride, in parts of the half width."""
_NONE = 1e-12
"""What is left of a distance of 1 where there is no step."""


def open_start(section: Section, *, open_by: float = 0.0, open_tilt: float = 0.0) -> Array:
    """Where every closing begins: the clamp wide open, the up splint resting on the line, the jumper in its groove.

    Parameters
    ----------
    section : Section
    open_by, open_tilt : float
        How much further than needed the clamp is open, and how its down splint is tilted; mm and rad.
    """
    q = section.open_state(section.open_distance() + open_by, open_tilt)
    for i, wire in enumerate(WIRES):
        y = 2 * i + 1
        q = descend(section, q, np.eye(SIZE)[y], free=(y,))
        overlap = -float(section.wire_gaps(q, wire).value.min())
        if overlap > 0.0:  # the descent's rounding
            q[y] += 2.0 * overlap
    return q


def descend(
    section: Section,
    q: Array,
    goal: Array = CLOSING,
    *,
    free: tuple[int, ...] | None = None,
    stride: float = STRIDE,
    on_contact: OnContact | None = None,
    most: int | None = None,
    at_rest: float = _AT_REST,
) -> Array:
    """Where the motion from ``q`` that lowers ``goal . q`` comes to rest; ``stride`` as `STRIDE`.

    Only the coordinates ``free`` move, by default all that the joints let. It rests when it is slower than
    ``at_rest`` over the bolt's speed. Raises SolverError if that takes more than ``most`` steps.
    """
    longest = stride * section.lever
    motion = _Motion(section, goal, np.array(section.free if free is None else free, np.int64), longest)
    gaps, h = section.gaps(q), longest
    loaded: set[Pair] = set()
    for _ in range(most or _STEPS):
        found = motion.step(q, gaps, h)
        if found is None:
            h *= 0.25
            if h < _SHORTEST * section.lever:
                return q
            continue
        new, new_gaps, force = found
        speed = float(np.abs(new - q).max()) / h
        if on_contact is not None:
            for pair in dict.fromkeys(new_gaps.pair[k] for k in np.flatnonzero(force[:-1] > _AT_REST)):
                if pair not in loaded:
                    loaded.add(pair)
                    on_contact(pair, motion.meeting(q, gaps, h, pair, new))
        q, gaps = new, new_gaps
        if speed <= at_rest:
            return q
        h = min(longest / speed, 4.0 * h)
        if not force.any():  # nothing is pushed: no gap closes faster than the motion goes
            closing = gaps.gradient @ goal > 0.0
            h = max(h, float(gaps.value[closing].min(initial=math.inf))) if closing.any() else h
    raise SolverError(
        f"closing takes more than {most or _STEPS} steps of {longest:.3g} mm: the down splint's width "
        f"({2.0 * section.lever:.3g} mm) is too small beside the way it closes"
    )


@dataclass(frozen=True)
class _Motion:
    """The motion that lowers ``goal`` by the coordinates ``moving``, in steps of about ``longest`` mm."""

    section: Section
    goal: Array
    moving: NDArray[np.int64]
    longest: float

    def step(self, q: Array, gaps: Gaps, h: float, without: Pair | None = None) -> tuple[Array, Gaps, Array] | None:
        """State after a step of ``h`` from q, its gaps and forces; None if the linearised gaps do not lead there.

        The gaps of the pair ``without`` do not count, but for the saddle's arc: it carries from the outset.
        """
        longest, moving, n = self.longest, self.moving, len(self.moving)
        target = q - h * self.goal
        at, force = q, np.zeros(len(gaps.value))
        apart = np.zeros(len(force), np.bool_)
        if without is not None:
            apart[:-1] = [pair == without for pair in gaps.pair[:-1]]
        for k in range(_ROUNDS):
            if h <= _SLOW * longest or k == 1:
                bend = self._bend(at, gaps, force, exact=h > _SLOW * longest)
            elif k == 0:
                bend = np.zeros((n, n))
            found = self._move(at, target, bend, gaps, apart, h)
            if found is None:
                return None
            move, force = found
            new = at.copy()
            new[moving] += move
            if np.abs(new - q).max() > 3.0 * max(longest, h):
                return None
            gaps, at = self.section.gaps(new), new
            if len(gaps.value) != len(force):
                return None
            least = float(gaps.value.min() if without is None else gaps.value[~apart].min())
            if (np.abs(move).max() <= _SETTLED * longest and least >= -_OVERLAP * longest) or (
                not force.any() and least >= 0.0
            ):
                return at, gaps, force
        return None

    def _move(
        self, at: Array, target: Array, bend: Array, gaps: Gaps, apart: NDArray[np.bool_], h: float
    ) -> tuple[Array, Array] | None:
        """Move (n,) of a round and forces (k,) of the gaps; None where they cannot open.

        Gaps that are ``apart`` do not count, nor those that no coordinate changes, nor those further than two strides
        and what a step of h closes.
        """
        moving, forces = self.moving, np.zeros(len(gaps.value))
        A, H = gaps.gradient[:, moving], np.eye(len(moving)) + h * bend
        near = ~apart & A.any(axis=1) & (gaps.value <= 2.0 * self.longest + np.abs(gaps.gradient[:, D]) * h)
        least = _least_move(H, (at - target)[moving], A[near], gaps.value[near], h)
        if least is None:
            return None
        move, multipliers = least
        forces[near] = multipliers / h
        return move, forces

    def meeting(self, q: Array, gaps: Gaps, h: float, pair: Pair, new: Array) -> Array:
        """The state in a step of ``h`` from q to ``new`` at which ``pair`` meets: the step without it, cut short."""
        states = {0.0: q}

        def gap(part: float) -> float:
            if part not in states:
                step = self.step(q, gaps, part * h, without=pair)
                states[part] = new if step is None else step[0]
            at = self.section.gaps(states[part])
            return float(min(v for v, p in zip(at.value[:-1], at.pair[:-1], strict=True) if p == pair))

        if gap(0.0) <= 0.0:
            return q
        return states[float(brentq(gap, 0.0, 1.0, xtol=1e-9))] if gap(1.0) < 0.0 else new

    def _bend(self, q: Array, gaps: Gaps, force: Array, *, exact: bool) -> Array:
        """Curvature of the loaded gaps: on a short step what keeps a wire, or the round back, in the round of its arc
        (force over radius difference), on a long one all there is, by differences."""
        section, moving = self.section, self.moving
        if exact:
            size, axes = np.linalg.eigh(lagrangian_hessian(section, q, gaps, force)[np.ix_(moving, moving)])
            return np.asarray(axes * np.maximum(size, 0.0) @ axes.T)
        bend = np.zeros((SIZE, SIZE))
        bend[W, W] = max(0.0, section.lift(float(q[W]))[2]) * force[-1] * gaps.normal[-1, 1]
        for k in np.flatnonzero(force):
            (splint, wire), feature = gaps.pair[k], gaps.feature[k]
            if feature == "arc" and wire in WIRES:
                along, slack = self._along(q, gaps.gradient[k], splint, wire)
                bend += force[k] / slack * np.outer(along, along)
        return bend[np.ix_(moving, moving)]

    def _along(self, q: Array, gradient: Array, splint: PartName, wire: PartName) -> tuple[Array, float]:
        """How the wire moves along its groove's arc by the state (10,), and the difference of the radii, mm."""
        pair, i, angle = self.section.pairs[splint, wire], 2 * WIRES.index(wire), float(q[S]) / self.section.lever
        tx, ty, along = -gradient[i + 1], gradient[i], np.zeros(SIZE)
        along[i], along[i + 1] = tx, ty
        if splint == "P2":
            c, s, u, v = math.cos(angle), math.sin(angle), pair.T_a_groove[0, 3], -pair.T_a_groove[2, 3]
            along[D], along[U] = -ty, ty
            along[S] = (ty * (u * c + v * s) - tx * (v * c - u * s)) / self.section.lever
            along[B] = along[V] = along[W] = -tx
        return along, max(abs(pair.groove.radius - pair.cylinder.radius), _FULL * pair.groove.radius)


def _least_move(H: Array, x: Array, A: Array, value: Array, scale: float) -> tuple[Array, Array] | None:
    """The y with the least y . H y / 2 + x . y and A y >= -value, with the multipliers; None where no y is so.

    A least-distance problem, solved by non-negative least squares [Lawson & Hanson, Solving Least Squares Problems,
    1974, chapter 23]; ``scale`` is about the length of y.
    """
    L = np.linalg.cholesky(H)
    turned = np.linalg.solve(L, np.column_stack([x, A.T]))
    z, G = turned[:, 0], turned[:, 1:]
    M = np.vstack([G, (z @ G - value) / scale])
    try:
        u = nnls(M, np.append(np.zeros(len(x)), 1.0))[0] if len(value) else np.zeros(0)
    except RuntimeError:
        raise SolverError(f"a step of the closing path does not end: {len(value)} gaps, {len(x)} coordinates") from None
    rest = 1.0 - float(M[-1] @ u)
    if not rest > _NONE:
        return None
    u *= scale / rest
    return np.linalg.solve(L.T, G @ u - z), u
