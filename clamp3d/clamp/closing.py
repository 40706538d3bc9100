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

from clamp3d.clamp.dimensions import Pair
from clamp3d.clamp.section import SIZE, D, Gaps, Section
from clamp3d.errors import SolverError
from clamp3d.geometry.pose import Array

STRIDE = 0.01
"""How far a step moves any coordinate, in parts of the down splint's half width (0.7 mm for the reference clamp)."""
CLOSING = np.eye(SIZE)[D]
"""What the bolt does: it lowers d."""
SADDLE: Pair = ("P2", "P3")
"""The round back lies in the saddle from the outset."""

OnContact = Callable[[Pair, Array], None]
"""Called with a pair and the state when the pair first carries force."""

_AT_REST = 1e-4
"""Speed over the bolt's at which nothing moves: what certifies a final state takes it from there."""
STILL = 1e-9
"""The same where that is on the ridge of a saddle, from which the motion leaves slowly at first."""
_STEPS, _ROUNDS = 2000, 12  # many times the reference clamp's: less than a hundred steps of a few rounds
_SETTLED, _OVERLAP = 2e-2, 1e-3
"""A step is solved when a round moves it by this part of a stride, and it overlaps by no more than this part."""
_SHORTEST = 1e-9
"""Shortest stride, in parts of the half width: below it nothing is left to go."""
_NONE = 1e-12
"""What rounding leaves of a distance of 1 where there is no step."""


def open_start(section: Section) -> Array:
    """Where every closing begins: the clamp wide open, the up splint resting on the line, the jumper in its groove."""
    q = section.seated(section.open_state(section.open_distance()))
    for y in (1, 3):
        q = descend(section, q, np.eye(SIZE)[y], free=(y,))
    return q


def descend(
    section: Section,
    q: Array,
    goal: Array = CLOSING,
    *,
    free: tuple[int, ...] | None = None,
    stride: float = STRIDE,
    on_contact: OnContact | None = None,
    at_rest: float = _AT_REST,
) -> Array:
    """Where the motion from ``q`` that lowers ``goal . q`` comes to rest; ``stride`` as `STRIDE`.

    Only the coordinates ``free`` move, by default all that the joints let. It rests when it is slower than
    ``at_rest`` over the bolt's speed. Raises SolverError if that takes too many steps.
    """
    longest = stride * section.lever
    motion = _Motion(section, goal, np.array(section.free if free is None else free), longest)
    gaps, h = section.gaps(q), longest
    loaded: set[Pair] = {SADDLE}
    for _ in range(_STEPS):
        step = motion.step(q, gaps, h)
        if step is None:
            h *= 0.25
            if h < _SHORTEST * section.lever:
                return q
            continue
        new, new_gaps, force = step
        speed = float(np.abs(new - q).max()) / h
        if on_contact is not None:
            for pair in dict.fromkeys(new_gaps.pair[k] for k in np.flatnonzero(force > _AT_REST)):
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
        f"closing takes more than {_STEPS} steps of {longest:.3g} mm: the down splint's width "
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

        The gaps of the pair ``without`` do not count.
        """
        moving, here, force = self.moving, q, np.zeros(len(gaps.value))
        target = q - h * self.goal
        counts = np.array([pair != without for pair in gaps.pair])
        for _ in range(_ROUNDS):
            A, H = gaps.gradient[:, moving], np.eye(len(moving))
            if force.any():
                size, axes = np.linalg.eigh(-self.section.hessian(here, gaps, force)[np.ix_(moving, moving)])
                H += h * (axes * np.maximum(size, 0.0)) @ axes.T
            # Nor do gaps that no coordinate changes, nor those further than two strides and what a step closes.
            near = counts & A.any(axis=1) & (gaps.value <= 2.0 * self.longest + np.abs(gaps.gradient[:, D]) * h)
            least = _least_move(H, (here - target)[moving], A[near], gaps.value[near], h)
            if least is None:
                return None
            move, force = least[0], np.zeros(len(force))
            force[near] = least[1] / h
            here = here.copy()
            here[moving] += move
            if np.abs(here - q).max() > 3.0 * max(self.longest, h):
                return None
            gaps = self.section.gaps(here)
            overlap = -float(gaps.value[counts].min())
            if (np.abs(move).max() <= _SETTLED * self.longest and overlap <= _OVERLAP * self.longest) or (
                not force.any() and overlap <= 0.0
            ):
                return here, gaps, force
        return None

    def meeting(self, q: Array, gaps: Gaps, h: float, pair: Pair, new: Array) -> Array:
        """The state in a step of ``h`` from q to ``new`` at which ``pair`` meets: the step without it, cut short."""
        states = {0.0: q}

        def gap(part: float) -> float:
            if part not in states:
                step = self.step(q, gaps, part * h, without=pair)
                states[part] = q + part * (new - q) if step is None else step[0]
            own = self.section.gaps(states[part])
            return min(float(v) for v, p in zip(own.value, own.pair, strict=True) if p == pair)

        if gap(0.0) <= 0.0:
            return q
        return states[float(brentq(gap, 0.0, 1.0, xtol=1e-9))] if gap(1.0) < 0.0 else new


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
