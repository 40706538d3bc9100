"""A body in closed form: the common part of convex pieces, less grooves and round holes.

Bounds of two bodies come from pieces that hold them (each gives a distance that is never too large) and from points
that both really have (each gives one that is never too small). Where the nearest point of the exact groove lies on
the body the two agree, and the distance is exact; the body's outer faces are among the pieces.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.convex import Ball, Convex, Rod, convex_distance
from clamp3d.engine.hull import MEMBER
from clamp3d.geometry.pose import Array, cross, inverse, norm, to_source
from clamp3d.geometry.primitives import AnyCylinder, Capsule, Cylinder, SweptArc
from clamp3d.kernel.distance import SignedDistance, signed_distance

_ROUNDING = 1e-13
"""Relative to a bore's radius and place: points this deep in it still count as on its surface."""
_POINT = 1e-12
"""Length of a capsule that stands for a ball in the kernel, relative to its radius."""
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


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """The points that lie in all ``outers`` and in no bore; part frame, mm.

    ``error`` (mm): the true surface is this near the stated one (0 for designed parts, the bound of a fit otherwise).
    ``surface`` replaces the membership test of a body whose pieces only enclose it: depth (k,) of points (k, 3).
    """

    outers: tuple[Convex, ...]
    bores: tuple[Bore, ...] = ()
    error: float = 0.0
    surface: Callable[[Array], Array] | None = None

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside, never too much; negative outside."""
        if self.surface is not None:
            return self.surface(points)
        depth = np.min([piece.depth(points) for piece in self.outers], axis=0)
        for bore in self.bores:
            local = to_source(bore.T, points)
            away = np.hypot(local[:, 0], local[:, 1]) - bore.radius
            # A bore that just opens a face leaves its rim far from there: a point in it by more than rounding is none.
            lost = away < -_ROUNDING * (bore.radius + np.abs(bore.T[:3, 3]).max())
            depth = np.where(lost, -np.inf, np.minimum(depth, away))
        return np.asarray(depth)

    @cached_property
    def bounds(self) -> Array:
        """Box (2, 3) along the frame's axes that holds the body."""
        axes = np.eye(3)
        high = np.min([np.diag(piece.support(axes)) for piece in self.outers], axis=0)
        low = np.max([np.diag(piece.support(-axes)) for piece in self.outers], axis=0)
        return np.array([low, high])


def bodies_distance(a: ClosedForm, b: ClosedForm, T: Array, enough: Callable[[Distance], bool]) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame; stops asking as soon as ``enough`` says so.

    One question for each pair of pieces: grooves and holes with cylinders, then convex pieces.
    """
    error = a.error + b.error
    distance = Distance()
    for new in _answers(a, b, T):
        distance = distance.meet(new)
        if enough(distance.widened(error)):
            break
    return distance.widened(error)


def _answers(a: ClosedForm, b: ClosedForm, T: Array) -> Iterator[Distance]:
    """Bounds of the distance of two bodies from each pair of their pieces."""
    for first, second, place, swapped in ((a, b, T, False), (b, a, inverse(T), True)):
        rods = [piece for piece in second.outers if isinstance(piece, (Rod, Ball))] if second.surface is None else []
        for bore, rod in itertools.product(first.bores, rods):
            new = _with_witnesses(bore_rod(bore, rod, place), (None, rod), first, second, place)
            yield new.moved(T).swapped() if swapped else new
    for piece, other in itertools.product(a.outers, b.outers):
        yield _with_witnesses(convex_distance(piece, np.eye(4), other, T), (piece, other), a, b, T)


def kernel_distance(answer: SignedDistance) -> Distance:
    """The kernel's answer as a `Distance` in the groove's frame."""
    d, e = answer.distance, answer.error_bound
    p, q = answer.point_on_groove, answer.point_on_cylinder
    return Distance(d - e, d + e, p, q, answer.normal, method="groove kernel")


def bore_rod(bore: Bore, rod: Rod | Ball, T: Array) -> Distance:
    """The kernel's answer for a bore of the first body and a rod or ball of the second, placed by ``T``.

    In an overlap the capsule that holds the rod gives a lower bound, and the rod's own answer is how deep a point lies.
    """
    covers = [(groove, place, inverse(place) @ T @ rod.T) for groove, place in bore.covers()]
    own: AnyCylinder
    if isinstance(rod, Ball):
        own = capsule = Capsule(rod.radius, _POINT * rod.radius)
        is_parallel = False  # it has no axis
    else:
        own, capsule = Cylinder(rod.radius, rod.length), Capsule(rod.radius, rod.length)
        is_parallel = norm(cross(bore.T[:3, 2], T[:3, :3] @ rod.T[:3, 2])) < 1e-12
    gaps = [(signed_distance(groove, own, P), place) for groove, place, P in covers]
    answer, place = min(gaps, key=lambda cover: cover[0].distance)
    distance = replace(kernel_distance(answer).moved(place), unique=False if is_parallel else None)
    if answer.distance > answer.error_bound:
        return distance
    answers = [signed_distance(groove, capsule, P) for groove, _, P in covers]
    if len(answers) > 1 and any(answer.distance <= answer.error_bound - rod.radius for answer in answers):
        return Distance()  # in the material the two halves' depths end where they meet, that of the whole does not
    return replace(distance, lower=min(answer.distance - answer.error_bound for answer in answers))


def _with_witnesses(
    raw: Distance, pieces: tuple[Convex | None, Convex], a: ClosedForm, b: ClosedForm, T: Array
) -> Distance:
    """``raw`` of two ``pieces`` with its upper side kept only if points that both bodies have attest it.

    Apart, two points must lie on the bodies. Overlapping, a point that lies in both attests the depth it has in either.
    A hole or the mouth of a groove may have taken the named points away, so others of the faces that look at each other
    are tried too. ``T`` (4, 4) places b in a's frame, where the points are.
    """
    distance = replace(raw, upper=math.inf, point_a=None, point_b=None)
    expensive = a.surface is not None or b.surface is not None
    if expensive and raw.lower < -0.01:  # the meshes attest a depth for less
        return distance
    if raw.point_a is not None and raw.point_b is not None:
        attest = _on_both if raw.upper >= 0.0 else _in_both
        distance = attest(raw, a, b, T, raw.point_a[None], raw.point_b[None])
    if distance.upper - raw.lower <= 1e-10 or raw.normal is None:
        return distance
    attest = _on_both if raw.lower >= 0.0 else _in_both
    return distance.meet(attest(raw, a, b, T, *_facing(raw.normal, raw.lower, pieces, T)))


def _facing(n: Array, gap: float, pieces: tuple[Convex | None, Convex], T: Array) -> tuple[Array, Array]:
    """Points of the faces of two pieces that look at each other along ``n``, and those ``gap`` mm across (k, 3)."""
    first, second = pieces
    q = second.face(-n @ T[:3, :3]) @ T[:3, :3].T + T[:3, 3]
    p = q - gap * n
    if first is not None:
        own = first.face(n)
        p, q = np.vstack([own, p]), np.vstack([own + gap * n, q])
    return p, q


def _on_both(raw: Distance, a: ClosedForm, b: ClosedForm, T: Array, p: Array, q: Array) -> Distance:
    """``raw`` with the first of the pairs ``p``, ``q`` (k, 3) that lie on the bodies, or without points."""
    slack = MEMBER * (1.0 + float(max(np.abs(p).max(), np.abs(q).max())))
    depth = np.minimum(a.depth(p), b.depth(to_source(T, q)))
    on_both = np.flatnonzero(depth >= -slack)
    if not len(on_both):
        return replace(raw, upper=math.inf, point_a=None, point_b=None)
    k = int(on_both[0])
    outside = 4.0 * max(0.0, -float(depth[k])) if a.surface is None and b.surface is None else slack
    return replace(raw, upper=norm(q[k] - p[k]) + outside, point_a=p[k], point_b=q[k])


def _in_both(raw: Distance, a: ClosedForm, b: ClosedForm, T: Array, p: Array, q: Array) -> Distance:
    """``raw`` with the deepest point of the pairs ``p``, ``q`` (k, 3), and between them, that lies in both bodies.

    Where that is one of ``p``, and ``q`` lies on the other body, the two are the pair of points.
    """
    trials = np.vstack([p, q, 0.5 * (p + q)])
    slack = MEMBER * (1.0 + float(np.abs(trials).max()))
    in_a, in_b = a.depth(trials), b.depth(to_source(T, trials))
    both = np.where(np.minimum(in_a, in_b) >= -slack, np.maximum(in_a, in_b), -np.inf)
    k = int(np.argmax(both))
    if both[k] == -np.inf:
        return replace(raw, upper=math.inf, point_a=None, point_b=None)
    outside = max(0.0, -float(min(in_a[k], in_b[k])))
    upper = max(raw.lower, min(0.0, 4.0 * outside - float(both[k])))
    other = q[k] if k < len(p) and in_b[len(p) + k] >= -slack else trials[k]
    return replace(raw, upper=upper, point_a=trials[k], point_b=other)
