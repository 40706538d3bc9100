"""Convex pieces, and the signed distance of two of them between proven bounds.

FCL's answer is never taken at its word: its two points must lie in the pieces, which bounds the distance from above,
and the width of the slab between the pieces along any normal (support functions, closed form) bounds it from below.
So a wrong answer of the solver costs sharpness, not truth. Depth likewise: a translation that parts the pieces bounds
it from above, a point inside both from below.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.core.pose import Array

MEMBER = 1e-9
"""Relative to the size of the parts: a point this far outside still counts as on the surface."""

_FLAT = 1e-8
"""Sine of the angle below which a face or line counts as square to a direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Rod:
    """A cylinder with flat ends, axis on z of its pose ``T`` (4, 4) in the part's frame; mm."""

    radius: float
    length: float
    T: Array

    def support(self, n: Array) -> Array:
        """The point (3,) that lies furthest along ``n`` (3,)."""
        R, t = self.T[:3, :3], self.T[:3, 3]
        m = n @ R
        across = float(np.hypot(m[0], m[1]))
        scale = self.radius / across if across > 1e-12 else 0.0
        return np.asarray(t + R @ np.array([scale * m[0], scale * m[1], np.copysign(0.5 * self.length, m[2])]))

    def face(self, n: Array) -> Array:
        """Points (k, 3) of what lies furthest along ``n`` (3,): a line on the side, the rim of an end, a point."""
        m = n @ self.T[:3, :3]
        across = float(np.hypot(m[0], m[1]))
        if across < _FLAT:
            turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
            rim = self.radius * np.column_stack([np.cos(turn), np.sin(turn)])
            flat = np.vstack([rim, 0.5 * rim, np.zeros((1, 2))])
            local = np.column_stack([flat, np.full(len(flat), np.copysign(0.5 * self.length, m[2]))])
        elif abs(m[2]) < _FLAT:
            z = np.linspace(-0.5, 0.5, 65) * self.length
            local = np.column_stack([np.outer(np.ones(65), self.radius / across * m[:2]), z])
        else:
            return self.support(n)[None]
        return np.asarray(local @ self.T[:3, :3].T + self.T[:3, 3])

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside, and then no further out than they are."""
        local = (points - self.T[:3, 3]) @ self.T[:3, :3]
        return np.asarray(
            np.minimum(self.radius - np.hypot(local[:, 0], local[:, 1]), 0.5 * self.length - np.abs(local[:, 2]))
        )

    def normals(self, n: Array) -> list[Array]:
        """Directions near ``n`` (3,) in which the surface is flat or round: the axis, and across it."""
        axis = self.T[:3, 2]
        along = float(n @ axis)
        across = n - along * axis
        size = float(np.linalg.norm(across))
        found = [np.copysign(1.0, along) * axis]
        return [*found, across / size] if size > 1e-9 else found


@dataclass(frozen=True, slots=True, eq=False)
class Hull:
    """A convex polyhedron: ``vertices`` (n, 3), ``planes`` (m, 4) with outward unit normals, normal . x + d <= 0."""

    vertices: Array
    planes: Array
    faces: Any = field(repr=False)

    def support(self, n: Array) -> Array:
        """The vertex (3,) that lies furthest along ``n`` (3,)."""
        return np.asarray(self.vertices[int(np.argmax(self.vertices @ n))])

    def face(self, n: Array) -> Array:
        """Points (k, 3) of what lies furthest along ``n`` (3,): corners, and the middles between each two of them."""
        height = self.vertices @ n
        corners = self.vertices[height >= height.max() - _FLAT * (1.0 + float(np.ptp(height)))][:24]
        i, j = np.triu_indices(len(corners))
        return np.asarray(0.5 * (corners[i] + corners[j]))

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside, and then no further out than they are."""
        return np.asarray(-(points @ self.planes[:, :3].T + self.planes[:, 3]).max(axis=1))

    def normals(self, n: Array) -> list[Array]:
        """The face normal nearest to ``n`` (3,)."""
        return [np.asarray(self.planes[int(np.argmax(self.planes[:, :3] @ n)), :3])]


Convex: TypeAlias = Rod | Hull


def hull(points: Array) -> Hull:
    """Convex hull of points (n, 3) that do not lie in one plane."""
    from scipy.spatial import ConvexHull

    found = ConvexHull(points)
    planes = np.asarray(found.equations, dtype=np.float64)
    faces = found.simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), planes[:, :3]) < 0.0
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    used, index = np.unique(faces, return_inverse=True)
    return Hull(points[used], np.unique(planes.round(14), axis=0), index.reshape(faces.shape))


def box(low: Array, high: Array) -> Hull:
    """Box between two corners (3,)."""
    i = np.indices((2, 2, 2)).reshape(3, -1).T
    return hull(np.where(i == 0, low, high).astype(np.float64))


@lru_cache(maxsize=4096)
def _geometry(piece: Convex) -> tuple[Any, Array]:
    """FCL's shape and the pose it has in the part's frame."""
    import fcl

    if isinstance(piece, Rod):
        return fcl.Cylinder(piece.radius, piece.length), piece.T
    flat = np.column_stack([np.full(len(piece.faces), 3), piece.faces]).ravel()
    return fcl.Convex(piece.vertices, len(piece.faces), flat), np.eye(4)


def _object(piece: Convex, T: Array) -> Any:
    import fcl

    shape, own = _geometry(piece)
    P = T @ own
    return fcl.CollisionObject(shape, fcl.Transform(P[:3, :3], P[:3, 3]))


def closest_on_axes(a: Rod, Ta: Array, b: Rod, Tb: Array) -> tuple[Array, Array, bool]:
    """Nearest points (3,) of two rods' axis segments, and whether both lie within the segments, square to them."""
    A, B = Ta @ a.T, Tb @ b.T
    p, u, q, v = A[:3, 3], A[:3, 2], B[:3, 3], B[:3, 2]
    ha, hb = 0.5 * a.length, 0.5 * b.length
    w = q - p
    cosine = float(u @ v)
    square = float(np.cross(u, v) @ np.cross(u, v))
    wu, wv = float(w @ u), float(w @ v)
    if square > 1e-24:
        s = min(max((wu - cosine * wv) / square, -ha), ha)
    else:  # parallel: the middle of the stretch they share, if they do
        low, high = sorted((wu - hb, wu + hb))
        s = min(max(0.5 * (max(low, -ha) + min(high, ha)), -ha), ha)
    t = min(max(s * cosine - wv, -hb), hb)
    s = min(max(t * cosine + wu, -ha), ha)
    x, y = p + s * u, q + t * v
    d = y - x
    slack = 1e-12 * (1.0 + float(np.abs(d).max()))
    return x, y, abs(float(d @ u)) <= slack and abs(float(d @ v)) <= slack


def convex_distance(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Distance:
    """Distance of the signed distance of two convex pieces placed by ``Ta``, ``Tb`` (4, 4); witnesses in that frame."""
    found = Distance()
    if isinstance(a, Rod) and isinstance(b, Rod):
        found = _rods(a, Ta, b, Tb).labelled("features", "cylinders")
        if found.upper - found.lower < 1e-9:
            return found
    return found.meet(_gjk(a, Ta, b, Tb).labelled("features", "convex (GJK)"))


def _rods(a: Rod, Ta: Array, b: Rod, Tb: Array) -> Distance:
    """Two cylinders side by side in closed form; with rounded ends in place of flat ones it is a lower bound."""
    x, y, square = closest_on_axes(a, Ta, b, Tb)
    d = y - x
    apart = float(np.linalg.norm(d))
    gap = apart - (a.radius + b.radius)
    slack = 8.0 * 2.0**-52 * (float(np.abs(x).max() + np.abs(y).max()) + a.radius + b.radius)
    if not square or apart <= 1e-9 * (a.radius + b.radius):
        return Distance(gap - slack)
    n = d / apart
    if gap >= 0.0:
        return Distance(gap - slack, gap + slack, x + a.radius * n, y - b.radius * n)
    return _deepest(a, Ta, b, Tb, [x + a.radius * n, y - b.radius * n, x, y], gap - slack, slack)


def _deepest(a: Convex, Ta: Array, b: Convex, Tb: Array, trials: list[Array], low: float, slack: float) -> Distance:
    """Distance of an overlap: the deepest of the ``trials`` (3,) that lie in both pieces, beside a known ``low``."""
    depths = [(_depth(a, Ta, x), _depth(b, Tb, x)) for x in trials]
    inside = [max(pair) if min(pair) >= -slack else -np.inf for pair in depths]
    k = int(np.argmax(inside))
    if inside[k] == -np.inf:
        return Distance(low)
    return Distance(low, slack - inside[k], trials[k], trials[k])


def _gjk(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Distance:
    import fcl

    oa, ob = _object(a, Ta), _object(b, Tb)
    answer = fcl.DistanceResult()
    libccd = fcl.GJKSolverType.GST_LIBCCD
    fcl.distance(oa, ob, fcl.DistanceRequest(enable_nearest_points=True, gjk_solver_type=libccd), answer)
    if answer.min_distance > 0.0:
        p, q = (np.asarray(x, dtype=np.float64) for x in answer.nearest_points)
        n = q - p
        size = float(np.linalg.norm(n))
        if 0.0 < size < np.inf:
            low, m = _slab(a, Ta, b, Tb, n / size)
            outside = max(0.0, -_depth(a, Ta, p), -_depth(b, Tb, q))
            found = Distance(low, size + 2.0 * outside, p, q, m)
            # The direction of a short distance is mostly rounding.
            return found if size - low < 1e-5 else found.meet(_touching(a, Ta, b, Tb))
    contacts = fcl.CollisionResult()
    request = fcl.CollisionRequest(num_max_contacts=4, enable_contact=True, gjk_solver_type=libccd)
    if not fcl.collide(oa, ob, request, contacts):
        return _touching(a, Ta, b, Tb)  # neither apart nor in each other: a hair's breadth either way
    found = Distance()
    for contact in contacts.contacts:
        n, at = np.asarray(contact.normal, dtype=np.float64), np.asarray(contact.pos, dtype=np.float64)
        size = float(np.linalg.norm(n))
        if not 0.0 < size < np.inf:
            continue
        low, m = max((_slab(a, Ta, b, Tb, s * n / size) for s in (1.0, -1.0)), key=lambda found: found[0])
        reach = abs(float(contact.penetration_depth))
        trials = [at + s * reach * n / size for s in (0.0, -0.5, 0.5, -0.25, 0.25)]
        new = _deepest(a, Ta, b, Tb, trials, low, MEMBER * (1.0 + float(np.abs(at).max())))
        found = found.meet(Distance(new.lower, new.upper, new.point_a, new.point_b, m))
    shallow = found.upper > -1e-3 or found.lower > -1e-3
    return found.meet(_touching(a, Ta, b, Tb)) if shallow else found


def _touching(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Distance:
    """Lower bound from all faces of both pieces."""
    best, normal = -np.inf, None
    for piece, T, sign in ((a, Ta, 1.0), (b, Tb, -1.0)):
        axes = piece.T[:3, 2] * np.array([[1.0], [-1.0]]) if isinstance(piece, Rod) else piece.planes[:200, :3]
        for n in sign * axes @ T[:3, :3].T:
            gap, m = _slab(a, Ta, b, Tb, n)
            if gap > best:
                best, normal = gap, m
    return Distance(best, normal=normal)


def _depth(piece: Convex, T: Array, x: Array) -> float:
    return float(piece.depth(((x - T[:3, 3]) @ T[:3, :3])[None])[0])


def _slab(a: Convex, Ta: Array, b: Convex, Tb: Array, n: Array) -> tuple[float, Array]:
    """Largest signed gap between two planes square to a normal near ``n`` (a to b) that part the pieces; and it."""
    Ra, Rb = Ta[:3, :3], Tb[:3, :3]
    offset = Tb[:3, 3] - Ta[:3, 3]
    best, normal = -np.inf, n
    trials = [n, *(Ra @ m for m in a.normals(n @ Ra)), *(-(Rb @ m) for m in b.normals(-n @ Rb))]
    for m in trials:
        if float(m @ n) > 0.5:
            ma, mb = m @ Ra, m @ Rb
            gap = float(m @ offset + mb @ b.support(-mb) - ma @ a.support(ma))
            gap -= 4.0 * 2.0**-52 * float(np.abs(offset).sum() + abs(gap))
            if gap > best:
                best, normal = gap, m
    return best, normal
