"""A body in closed form: the common part of convex pieces, less grooves, round holes and slots.

Distance of two bodies come from pieces that hold them (each gives a distance that is never too large) and from points
that both really have (each gives one that is never too small). Where the nearest point of the exact groove lies on
the body the two agree, and the distance is exact; the body's outer faces are among the pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.convex import MEMBER, Convex, Rod, convex_distance
from clamp3d.core.distance import SignedDistance, signed_distance
from clamp3d.core.pose import Array, inverse
from clamp3d.core.primitives import Cylinder, SweptArc

_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Bore:
    """Round hollow that goes right through a body: axis on z of ``T`` (4, 4), ``length`` at least the body's, mm.

    ``half_angle`` (rad) is that of the arc about -y that is left of it: a groove with its mouth to +y, and all of
    the body behind that mouth's plane; pi for a hole.
    """

    radius: float
    half_angle: float
    length: float
    T: Array

    def covers(self) -> tuple[tuple[SweptArc, Array], ...]:
        """Grooves whose materials together hold the body: the groove itself, or the two halves of a hole."""
        if self.half_angle < math.pi:
            return ((SweptArc(self.radius, self.half_angle, self.length), self.T),)
        half = SweptArc(self.radius, 0.5 * math.pi, self.length)
        return ((half, self.T), (half, self.T @ _TURN))


@dataclass(frozen=True, slots=True, eq=False)
class Slot:
    """Straight-sided hollow right through a body: side ``planes`` (m, 4), outward normals, normal . x + d <= 0."""

    planes: Array


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """The points that lie in all ``outers`` and in no bore or slot; part frame, mm.

    ``error`` (mm): the true surface is this near the stated one (0 for designed parts, the bound of a fit otherwise).
    ``surface`` replaces the membership test of a body whose pieces only enclose it: depth (k,) of points (k, 3).
    """

    outers: tuple[Convex, ...]
    bores: tuple[Bore, ...] = ()
    slots: tuple[Slot, ...] = ()
    error: float = 0.0
    surface: Callable[[Array], Array] | None = None

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside, never too much; negative outside."""
        if self.surface is not None:
            return self.surface(points)
        found = np.min([piece.depth(points) for piece in self.outers], axis=0)
        for bore in self.bores:
            local = (points - bore.T[:3, 3]) @ bore.T[:3, :3]
            found = np.minimum(found, np.hypot(local[:, 0], local[:, 1]) - bore.radius)
        for slot in self.slots:
            found = np.minimum(found, (points @ slot.planes[:, :3].T + slot.planes[:, 3]).max(axis=1))
        return np.asarray(found)


def bodies_distance(a: ClosedForm, b: ClosedForm, T: Array, enough: Callable[[Distance], bool]) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame; stops asking as soon as ``enough`` says so."""
    found, back = Distance(), inverse(T)
    error = a.error + b.error
    here = np.eye(4)
    for first, second, swapped in ((a, b, False), (b, a, True)):
        place = back if swapped else T
        rods = [piece for piece in second.outers if isinstance(piece, Rod)]
        for bore in first.bores:
            for rod in rods:
                new = _with_witnesses(bore_rod(bore, rod, place), first, second, place)
                found = found.meet(new.moved(T).swapped() if swapped else new)
                if enough(found.widened(error)):
                    return found.widened(error)
    for piece in a.outers:
        for other in b.outers:
            raw = convex_distance(piece, here, other, T)
            new = _with_witnesses(raw, a, b, T)
            expensive = a.surface is not None or b.surface is not None
            if new.upper == math.inf and raw.normal is not None and (raw.lower > -0.01 or not expensive):
                new = _face_to_face(raw, piece, other, a, b, T)
            found = found.meet(new)
            if enough(found.widened(error)):
                return found.widened(error)
    for first, second, swapped in ((a, b, False), (b, a, True)):
        place = back if swapped else T
        for slot in first.slots:
            for piece in second.outers:
                new = _with_witnesses(_slot_convex(slot, piece, place), first, second, place)
                found = found.meet(new.moved(T).swapped() if swapped else new)
                if enough(found.widened(error)):
                    return found.widened(error)
    return found.widened(error)


def kernel_distance(answer: SignedDistance, error: float = 0.0) -> Distance:
    """The kernel's answer as a `Distance` in the groove's frame, with ``error`` mm more uncertainty."""
    d, e = answer.distance, answer.error_bound + error
    p, q = answer.point_on_groove, answer.point_on_cylinder
    return Distance(d - e, d + e, p, q, answer.normal, None, "features", "groove kernel")


def bore_rod(bore: Bore, rod: Rod, T: Array) -> Distance:
    """The kernel's answer for a bore of the first body and a rod of the second, placed by ``T``."""
    answers = [
        (signed_distance(groove, Cylinder(rod.radius, rod.length), inverse(place) @ T @ rod.T), place)
        for groove, place in bore.covers()
    ]
    if len(answers) > 1 and any(answer.axis_inside for answer, _ in answers):
        return Distance()  # in the material the two halves' depths end where they meet, that of the whole does not
    answer, place = min(answers, key=lambda found: found[0].distance)
    return kernel_distance(answer).moved(place)


def _slot_convex(slot: Slot, piece: Convex, T: Array) -> Distance:
    """All around a slot are half-spaces; the body lies in their union."""
    found = Distance(np.inf, np.inf)
    for plane in slot.planes:
        n = plane[:3]
        q = T[:3, :3] @ piece.support(T[:3, :3].T @ n) + T[:3, 3]
        gap = -float(n @ q + plane[3])
        slack = 4.0 * 2.0**-52 * (float(np.abs(q).sum()) + abs(float(plane[3])))
        new = Distance(gap - slack, gap + slack, q + gap * n, q, -n, None, "features", "slot")
        found = found.union(new)
    return found


def _with_witnesses(bounds: Distance, a: ClosedForm, b: ClosedForm, T: Array) -> Distance:
    """``bounds`` with its upper side kept only if points that both bodies have attest it; ``T`` places b, points in a.

    Apart, the two witnesses must lie on the bodies. Overlapping, a point that lies in both attests the depth it has
    in either; tried at the witnesses and between them.
    """
    p, q = bounds.point_a, bounds.point_b
    if p is None or q is None:
        return Distance(bounds.lower, normal=bounds.normal, method=bounds.method)
    slack = MEMBER * (1.0 + float(max(np.abs(p).max(), np.abs(q).max())))
    # The two may be slid along a cylinder together: of a line of contact the named point may not be on the body.
    shifts = np.vstack(
        [np.zeros((1, 3)), *(_along(piece, None) for piece in a.outers), *(_along(w, T) for w in b.outers)]
    )
    if bounds.upper >= 0.0:
        for s in (shifts[:1], *np.array_split(shifts[1:], max(1, len(shifts) // 8))):
            k = _first_on_both(a, b, T, p + s, q + s, slack)
            if k is not None:
                return replace(bounds, upper=bounds.upper + 2.0 * slack, point_a=p + s[k], point_b=q + s[k])
        return Distance(bounds.lower, normal=bounds.normal, method=bounds.method)
    if a.surface is not None or b.surface is not None:
        shifts = shifts[:1]
    trials = np.vstack([x + shifts for x in (p, q, 0.5 * (p + q))])
    in_a, in_b = a.depth(trials), b.depth((trials - T[:3, 3]) @ T[:3, :3])
    both = np.where(np.minimum(in_a, in_b) >= -slack, np.maximum(in_a, in_b), -np.inf)
    k = int(np.argmax(both))
    if both[k] == -np.inf:
        return Distance(bounds.lower, normal=bounds.normal, method=bounds.method)
    return replace(bounds, upper=min(0.0, slack - float(both[k])), point_a=trials[k], point_b=trials[k])


def _first_on_both(a: ClosedForm, b: ClosedForm, T: Array, p: Array, q: Array, slack: float) -> int | None:
    """First row of which ``p`` (k, 3) lies on a and ``q`` (k, 3) on b, both in a's frame; the cheap body goes first."""
    index = np.arange(len(p))
    tests = [(a, p), (b, (q - T[:3, 3]) @ T[:3, :3])]
    for body, points in sorted(tests, key=lambda test: test[0].surface is not None):
        if not len(index):
            return None
        index = index[body.depth(points[index]) >= -slack]
    return int(index[0]) if len(index) else None


def _face_to_face(bounds: Distance, piece: Convex, other: Convex, a: ClosedForm, b: ClosedForm, T: Array) -> Distance:
    """``bounds`` with points of the two faces that look at each other across its planes, where both bodies have them.

    A hole or the mouth of a groove may take the solver's own points away.
    """
    n, R, t = bounds.normal, T[:3, :3], T[:3, 3]
    assert n is not None
    p, q = piece.face(n), other.face(-n @ R) @ R.T + t
    gap = bounds.lower
    p, q = np.vstack([p, q - gap * n]), np.vstack([p + gap * n, q])
    slack = MEMBER * (1.0 + float(np.abs(p).max()))
    if gap < 0.0:
        trials = 0.5 * (p + q)
        p, q = np.vstack([p, q, trials]), np.vstack([p, q, trials])
    in_a, in_b = a.depth(p), b.depth((q - t) @ R)
    good = (in_a >= -slack) & (in_b >= -slack)
    if not good.any():
        return Distance(bounds.lower, normal=bounds.normal, method=bounds.method)
    if gap >= 0.0:
        k = int(np.argmax(good))
        return replace(bounds, upper=gap + 2.0 * slack, point_a=p[k], point_b=q[k])
    reached = np.where(good, np.maximum(in_a, in_b), -np.inf)
    k = int(np.argmax(reached))
    return replace(bounds, upper=min(0.0, slack - float(reached[k])), point_a=p[k], point_b=q[k])


def _along(piece: Convex, T: Array | None) -> Array:
    """Shifts (k, 3) along a rod's axis in steps of a 32nd of its length; none for other pieces."""
    if not isinstance(piece, Rod):
        return np.empty((0, 3))
    axis = piece.T[:3, 2] if T is None else T[:3, :3] @ piece.T[:3, 2]
    return np.outer(np.arange(-32, 33) / 32.0 * piece.length, axis)
