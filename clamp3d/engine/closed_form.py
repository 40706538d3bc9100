"""A body in closed form: the common part of convex pieces, less grooves and round holes.

Bounds of two bodies come from pieces that hold them (each gives a distance that is never too large) and from points
that both really have (each gives one that is never too small). Where the nearest point of the exact groove lies on
the body the two agree, and the distance is exact; the body's outer faces are among the pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.convex import Convex, Rod, convex_distance
from clamp3d.engine.hull import MEMBER, Hull
from clamp3d.engine.nearest import segment_pairs, to_faces
from clamp3d.geometry.pose import Array, cross, inverse, norm, to_source, to_target
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc
from clamp3d.kernel.distance import SignedDistance, signed_distance

_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
_THIN = 1e-30
_SHIFTS = 33
"""Places along a cylinder's axis where a point of a line of contact is looked for."""


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
        found = np.min([piece.depth(points) for piece in self.outers], axis=0)
        for bore in self.bores:
            local = to_source(bore.T, points)
            found = np.minimum(found, np.hypot(local[:, 0], local[:, 1]) - bore.radius)
        return np.asarray(found)

    @cached_property
    def bounds(self) -> Array:
        """Box (2, 3) along the frame's axes that holds the body."""
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        for piece in self.outers:
            if isinstance(piece, Rod):
                axis = piece.T[:3, 2]
                half = 0.5 * piece.length * np.abs(axis) + piece.radius * np.sqrt(np.maximum(1.0 - axis * axis, 0.0))
                ends = piece.T[:3, 3] - half, piece.T[:3, 3] + half
            else:
                ends = piece.vertices.min(axis=0), piece.vertices.max(axis=0)
            low, high = np.maximum(low, ends[0]), np.minimum(high, ends[1])
        return np.array([low, high])


def bodies_distance(a: ClosedForm, b: ClosedForm, T: Array, enough: Callable[[Distance], bool]) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame; stops asking as soon as ``enough`` says so.

    One question for each pair of pieces: grooves and holes with cylinders, convex pieces, grooves with polyhedra.
    """
    back, here = inverse(T), np.eye(4)
    error = a.error + b.error
    found = Distance()
    for kind in ("bore and cylinder", "convex", "bore and polyhedron"):
        if kind == "convex":
            for piece in a.outers:
                for other in b.outers:
                    for rims in (False, True):
                        new = _convex(piece, other, a, b, here, T, rims)
                        found = found.meet(new)
                        if enough(found.widened(error)):
                            return found.widened(error)
                        if new.upper - new.lower <= 1e-10 or not (isinstance(piece, Rod) or isinstance(other, Rod)):
                            break
            continue
        ask = _bore_rod if kind == "bore and cylinder" else _bore_hull
        for first, second, swapped in ((a, b, False), (b, a, True)):
            place = back if swapped else T
            for bore in first.bores:
                for piece in second.outers:
                    if isinstance(piece, Rod) is not (ask is _bore_rod) or second.surface is not None:
                        continue
                    new = _with_witnesses(ask(bore, piece, place), first, second, place)
                    found = found.meet(new.moved(T).swapped() if swapped else new)
                    if enough(found.widened(error)):
                        return found.widened(error)
    return found.widened(error)


def _convex(piece: Convex, other: Convex, a: ClosedForm, b: ClosedForm, here: Array, T: Array, rims: bool) -> Distance:
    raw = convex_distance(piece, here, other, T, rims=rims)
    new = _with_witnesses(raw, a, b, T)
    expensive = a.surface is not None or b.surface is not None
    if new.upper - raw.lower > 1e-10 and raw.normal is not None and (raw.lower > -0.01 or not expensive):
        return new.meet(face_to_face(raw, piece, other, a, b, T))
    return new


def kernel_distance(answer: SignedDistance, error: float = 0.0) -> Distance:
    """The kernel's answer as a `Distance` in the groove's frame, with ``error`` mm more uncertainty."""
    d, e = answer.distance, answer.error_bound + error
    p, q = answer.point_on_groove, answer.point_on_cylinder
    return Distance(d - e, d + e, p, q, answer.normal, None, "features", "groove kernel")


def bore_rod(bore: Bore, rod: Rod, T: Array) -> Distance:
    """The kernel's answer for a bore of the first body and a rod of the second, placed by ``T``.

    In an overlap the capsule that holds the rod gives a lower bound, and the rod's own answer is how deep a point lies.
    """
    covers = [(groove, place, inverse(place) @ T @ rod.T) for groove, place in bore.covers()]
    tilt = norm(cross(bore.T[:3, 2], T[:3, :3] @ rod.T[:3, 2]))
    flat = [(signed_distance(groove, Cylinder(rod.radius, rod.length), P), place) for groove, place, P in covers]
    answer, place = min(flat, key=lambda found: found[0].distance)
    found = replace(kernel_distance(answer).moved(place), unique=False if tilt < 1e-12 else None)
    if answer.distance > answer.error_bound:
        return found
    answers = [signed_distance(groove, Capsule(rod.radius, rod.length), P) for groove, _, P in covers]
    if len(answers) > 1 and any(answer.distance <= answer.error_bound - rod.radius for answer in answers):
        return Distance()  # in the material the two halves' depths end where they meet, that of the whole does not
    return replace(found, lower=min(answer.distance - answer.error_bound for answer in answers))


def _bore_rod(bore: Bore, piece: Convex, T: Array) -> Distance:
    assert isinstance(piece, Rod)
    return bore_rod(bore, piece, T)


def _bore_hull(bore: Bore, piece: Convex, T: Array) -> Distance:
    """A groove or hole and a polyhedron that lie apart.

    The hollow side of the arc bends away from every flat face, so a nearest point lies on an edge of the polyhedron
    (a thin capsule for the kernel), or on a lip or an end edge of the groove. That these lines all lie apart proves
    that the bodies do: where a face alone cut the material, the cut would have a corner on one of them, or no end.
    """
    assert isinstance(piece, Hull)
    found = Distance(np.inf, np.inf)
    corners, edges, triangles = (to_target(T, x) for x in piece.near(None))
    if len(corners) > 64:
        return Distance()
    for groove, place in bore.covers():
        R, t = place[:3, :3], place[:3, 3]
        E, V = (edges - t) @ R, (corners - t) @ R
        for start, end in E:
            P = np.eye(4)
            length = norm(end - start)
            z = (end - start) / length
            x = cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
            P[:3, 2], P[:3, 0] = z, x / norm(x)
            P[:3, 1], P[:3, 3] = cross(z, P[:3, 0]), 0.5 * (start + end)
            answer = signed_distance(groove, Capsule(_THIN, length), P)
            if answer.distance < found.upper:
                found = kernel_distance(answer).moved(place)
        s, h = groove.radius * math.sin(groove.half_angle), -groove.radius * math.cos(groove.half_angle)
        H, far = 0.5 * groove.length, s + float(np.abs(V).max()) + groove.length
        lines = [[(x, h, -H), (x, h, H)] for x in (-s, s)]
        lines += [[(x, h, z), (math.copysign(far, x), h, z)] for x in (-s, s) for z in (-H, H)]
        L = np.array(lines)
        M = inverse(T) @ place
        if any(piece.crossed_by(to_target(M, line)) for line in L):
            return Distance()
        for d, p, q in (segment_pairs(L, E), to_faces(L.reshape(-1, 3), (triangles - t) @ R)):
            if 0.0 < d < found.upper:
                e = 8.0 * 2.0**-52 * float(np.abs(V).max() + groove.radius + H)
                n = (q - p) / d
                found = Distance(d - e, d + e, p, q, n, None, "features", "groove kernel").moved(place)
    return found if found.lower > 0.0 else Distance()


def _with_witnesses(known: Distance, a: ClosedForm, b: ClosedForm, T: Array) -> Distance:
    """``known`` with its upper side kept only if points that both bodies have attest it; ``T`` places b, points in a.

    Apart, the two witnesses must lie on the bodies. Overlapping, a point that lies in both attests the depth it has
    in either; tried at the witnesses and between them.
    """
    p, q = known.point_a, known.point_b
    if p is None or q is None:
        return replace(known, upper=math.inf, point_a=None, point_b=None)
    # The two may be slid along a cylinder together: of a line of contact the named point may not be on the body.
    lines = [_along(piece, None) for piece in a.outers] + [_along(piece, T) for piece in b.outers]
    none = np.zeros((1, 3))
    if known.upper >= 0.0:
        first = _attested(known, a, b, T, p[None], q[None])
        if first.upper < math.inf or not any(len(line) for line in lines):
            return first
        shifts = np.vstack(lines)
        return _attested(known, a, b, T, p + shifts, q + shifts)
    shifts = none if a.surface is not None or b.surface is not None else np.vstack([none, *lines])
    trials = np.vstack([x + shifts for x in (p, q, 0.5 * (p + q))])
    found = _deepest_common(known, a, b, T, trials)
    kept = found.point_a is not None and np.array_equal(found.point_a, p)
    if not kept or known.normal is None or found.upper > known.upper + MEMBER:
        return found
    # The piece's point q may be where a groove or a hole has taken the body away.
    on_b = b.depth(to_source(T, q[None]))[0] >= -MEMBER * (1.0 + float(np.abs(q).max()))
    return replace(found, point_a=p, point_b=q) if on_b else found


def _deepest_common(known: Distance, a: ClosedForm, b: ClosedForm, T: Array, trials: Array) -> Distance:
    """``known`` with the deepest of ``trials`` (k, 3) that lie in both bodies as its witness, or without points."""
    slack = MEMBER * (1.0 + float(np.abs(trials).max()))
    in_a, in_b = a.depth(trials), b.depth(to_source(T, trials))
    both = np.where(np.minimum(in_a, in_b) >= -slack, np.maximum(in_a, in_b), -np.inf)
    k = int(np.argmax(both))
    if both[k] == -np.inf:
        return replace(known, upper=math.inf, point_a=None, point_b=None)
    outside = max(0.0, -float(min(in_a[k], in_b[k])))
    upper = max(known.lower, min(0.0, 4.0 * outside - float(both[k])))
    return replace(known, upper=upper, point_a=trials[k], point_b=trials[k])


def _attested(known: Distance, a: ClosedForm, b: ClosedForm, T: Array, p: Array, q: Array) -> Distance:
    """``known`` with the first of the pairs ``p``, ``q`` (k, 3) that lie on the bodies, or without points.

    What they are measured to lie outside is added; the cheap body is asked first.
    """
    slack = MEMBER * (1.0 + float(max(np.abs(p).max(), np.abs(q).max())))
    index, outside = np.arange(len(p)), np.zeros(len(p))
    tests = [(a, p), (b, to_source(T, q))]
    for body, points in sorted(tests, key=lambda test: test[0].surface is not None):
        depth = body.depth(points[index])
        on = depth >= -slack
        index, depth = index[on], depth[on]
        outside[index] += slack if body.surface is not None else np.maximum(0.0, -4.0 * depth)
        if not len(index):
            return replace(known, upper=math.inf, point_a=None, point_b=None)
    k = int(index[0])
    return replace(known, upper=known.upper + float(outside[k]), point_a=p[k], point_b=q[k])


def face_to_face(known: Distance, piece: Convex, other: Convex, a: ClosedForm, b: ClosedForm, T: Array) -> Distance:
    """``known`` with points of the two faces that look at each other across its planes, where both bodies have them.

    A hole or the mouth of a groove may take the solver's own points away.
    """
    n, R, t = known.normal, T[:3, :3], T[:3, 3]
    assert n is not None
    p, q = piece.face(n), other.face(-n @ R) @ R.T + t
    gap = known.lower
    p, q = np.vstack([p, q - gap * n]), np.vstack([p + gap * n, q])
    if gap >= 0.0:
        return _attested(replace(known, upper=gap, method="convex"), a, b, T, p, q)
    found = _deepest_common(known, a, b, T, np.vstack([p, q, 0.5 * (p + q)]))
    return replace(found, method="convex")


def _along(piece: Convex, T: Array | None) -> Array:
    """Shifts (k, 3) along a rod's axis in equal steps; none for other pieces."""
    if not isinstance(piece, Rod):
        return np.empty((0, 3))
    axis = piece.T[:3, 2] if T is None else T[:3, :3] @ piece.T[:3, 2]
    return np.outer(np.linspace(-1.0, 1.0, 2 * _SHIFTS - 1) * piece.length, axis)
