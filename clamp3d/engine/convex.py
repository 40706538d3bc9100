"""Convex pieces, and the signed distance of two of them between proven bounds.

FCL names the nearest points. It is not taken at its word: they must lie in the pieces, which bounds the distance from
above, and the width of the slab between the pieces along a normal (support functions, closed form) bounds it from
below. So a wrong answer costs sharpness, not truth. In an overlap a point in both pieces attests a depth, and a slab
bounds it; `convex_depth` sharpens that where it matters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.hull import FLAT, MEMBER, Hull
from clamp3d.geometry.pose import Array, cross, norm, to_source, to_target

_LEVEL = 1e-6
"""Below this sine it is not claimed that the nearest points are the only ones: rounding decides."""
_TOUCHING = 1e-3
"""Distances and depths (mm) below which FCL's normal may be mostly rounding, so that it is searched for."""
_ENLARGED = 2.0**27
"""FCL measures pieces this much larger: its solver stops at an absolute 1e-6, and a power of two costs no rounding.
Of random boxes and cylinders the bounds are then 1e-13 mm apart, in place of up to 4e-4."""
_LOOSE = 1e-9
"""Width (mm) of bounds at which FCL is asked in the other order too, in which its solver may end nearer."""
_EPS = 2.0**-52


@dataclass(frozen=True, slots=True, eq=False)
class Rod:
    """A cylinder with flat ends, axis on z of its pose ``T`` (4, 4) in the part's frame; mm."""

    radius: float
    length: float
    T: Array

    def support(self, n: Array) -> Array:
        """The points (k, 3) that lie furthest along ``n`` (k, 3)."""
        m = n @ self.T[:3, :3]
        across = np.hypot(m[:, 0], m[:, 1])
        local = m * np.where(across > 1e-12, self.radius / np.maximum(across, 1e-12), 0.0)[:, None]
        local[:, 2] = np.copysign(0.5 * self.length, m[:, 2])
        return np.asarray(to_target(self.T, local))

    def face(self, n: Array, within: float = FLAT) -> Array:
        """Points (k, 3) of what lies furthest along ``n`` (3,): a line on the side, the rim of an end, a point."""
        m = n @ self.T[:3, :3]
        across = float(np.hypot(m[0], m[1]))
        if across < within:
            turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
            rim = self.radius * np.column_stack([np.cos(turn), np.sin(turn)])
            flat = np.vstack([rim, 0.5 * rim, np.zeros((1, 2))])
            local = np.column_stack([flat, np.full(len(flat), np.copysign(0.5 * self.length, m[2]))])
        elif abs(m[2]) < within:
            z = np.linspace(-0.5, 0.5, 65) * self.length
            local = np.column_stack([np.outer(np.ones(65), self.radius / across * m[:2]), z])
        else:
            return self.support(n[None])
        return np.asarray(to_target(self.T, local))

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside, and then no further out than they are."""
        local = to_source(self.T, points)
        return np.asarray(
            np.minimum(self.radius - np.hypot(local[:, 0], local[:, 1]), 0.5 * self.length - np.abs(local[:, 2]))
        )

    @property
    def flat_normals(self) -> Array:
        """Unit normals (2, 3) of the flat faces."""
        return np.array([self.T[:3, 2], -self.T[:3, 2]])

    def normals(self, n: Array) -> Array:
        """Directions near ``n`` (k, 3) in which the surface is flat or round (m, 3): the axis, and across it."""
        axis = self.T[:3, 2]
        along = (n @ axis)[:, None]
        across = n - along * axis
        size = np.linalg.norm(across, axis=1)
        aside = size > 1e-9
        return np.vstack([np.copysign(1.0, along) * axis, across[aside] / size[aside, None]])

    @property
    def ends(self) -> Array:
        """Both ends (2, 3) of the axis."""
        return np.asarray(self.T[:3, 3] + np.outer([-0.5 * self.length, 0.5 * self.length], self.T[:3, 2]))


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """A ball about the origin of its pose ``T`` (4, 4) in the part's frame; mm."""

    radius: float
    T: Array

    def support(self, n: Array) -> Array:
        """The points (k, 3) that lie furthest along ``n`` (k, 3)."""
        return np.asarray(self.T[:3, 3] + self.radius * n / np.linalg.norm(n, axis=1)[:, None])

    def face(self, n: Array, within: float = FLAT) -> Array:
        """The point (1, 3) that lies furthest along ``n`` (3,)."""
        return self.support(n[None])

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside."""
        return np.asarray(self.radius - np.linalg.norm(points - self.T[:3, 3], axis=1))

    @property
    def flat_normals(self) -> Array:
        """None (0, 3): it is flat nowhere."""
        return np.empty((0, 3))

    def normals(self, n: Array) -> Array:
        """None (0, 3) besides the directions ``n`` (k, 3) themselves."""
        return np.empty((0, 3))

    @property
    def ends(self) -> Array:
        """The centre (2, 3), twice: it is a cylinder with round ends whose axis has no length."""
        return np.tile(self.T[:3, 3], (2, 1))


Convex: TypeAlias = Rod | Ball | Hull


def convex_distance(a: Convex, Ta: Array, b: Convex, Tb: Array, *, sharp: bool = True) -> Distance:
    """Signed distance of two convex pieces placed by ``Ta``, ``Tb`` (4, 4); points and normal in that frame.

    Not ``sharp``: pieces that all but touch are not searched for the direction that proves it.
    """
    pair = _enlarged(a, Ta), _enlarged(b, Tb)
    points = _nearest(*pair)
    if points is None:
        distance = _overlapping(a, Ta, b, Tb, pair)
    else:
        distance = _apart(a, Ta, b, Tb, *points)
        if distance.upper - distance.lower > _LOOSE and (points := _nearest(*pair[::-1])) is not None:
            distance = distance.meet(_apart(a, Ta, b, Tb, *points[::-1]))
    if sharp and distance.upper - distance.lower > 1e-9 and abs(distance.upper) < _TOUCHING:
        from clamp3d.engine.convex_depth import convex_depth  # which needs the pieces of this module

        proof = convex_depth(a, Ta, b, Tb)
        distance = distance.meet(replace(distance, lower=proof.lower, normal=proof.normal))
    return replace(distance, unique=_unique(a, Ta, b, Tb, distance))


def nearest_points(a: Convex, Ta: Array, b: Convex, Tb: Array) -> tuple[Array, Array] | None:
    """FCL's nearest points (3,) of two pieces; None where they touch or overlap."""
    return _nearest(_enlarged(a, Ta), _enlarged(b, Tb))


def _nearest(a: Any, b: Any) -> tuple[Array, Array] | None:
    """FCL's nearest points (3,) of two objects; None where they touch or overlap."""
    import fcl

    answer = fcl.DistanceResult()
    fcl.distance(a, b, fcl.DistanceRequest(enable_nearest_points=True, gjk_solver_type=_libccd()), answer)
    p, q = (np.asarray(x, dtype=np.float64) / _ENLARGED for x in answer.nearest_points)
    return (p, q) if answer.min_distance > 0.0 and 0.0 < norm(q - p) < np.inf else None


def _libccd() -> Any:
    """FCL's solver for convex shapes; the other one is wrong for crossed cylinders."""
    import fcl

    return fcl.GJKSolverType.GST_LIBCCD


def _apart(a: Convex, Ta: Array, b: Convex, Tb: Array, p: Array, q: Array) -> Distance:
    """Bounds of the distance of two pieces from their nearest points as FCL names them."""
    size = norm(q - p)
    near = (q - p)[None] / size
    low, normal = _slab(a, Ta, b, Tb, near)
    if size - low > 1e-5:  # the direction of a short distance is mostly rounding
        low, normal = _slab(a, Ta, b, Tb, np.vstack([near, face_normals(a, Ta, b, Tb)]))
    outside = max(0.0, -_depth(a, Ta, p), -_depth(b, Tb, q))
    return Distance(low, size + 2.0 * outside, p, q, normal, method="convex")


def _overlapping(a: Convex, Ta: Array, b: Convex, Tb: Array, pair: tuple[Any, Any]) -> Distance:
    """Bounds of the depth of two pieces from FCL's contacts; of the distance where they touch within rounding."""
    import fcl

    answer = fcl.CollisionResult()
    fcl.collide(*pair, fcl.CollisionRequest(enable_contact=True, gjk_solver_type=_libccd()), answer)
    contacts = [contact for contact in answer.contacts if 0.0 < norm(contact.normal) < np.inf]
    normals = np.array([contact.normal for contact in contacts]).reshape(-1, 3)
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    low, normal = _slab(a, Ta, b, Tb, np.vstack([normals, -normals, face_normals(a, Ta, b, Tb)]))
    half = np.array([0.5 * abs(contact.penetration_depth) / _ENLARGED for contact in contacts]).reshape(-1, 1)
    places = np.array([contact.pos for contact in contacts]).reshape(-1, 3) / _ENLARGED
    trials = np.vstack([places, places - half * normals, places + half * normals])
    in_a, in_b = a.depth(to_source(Ta, trials)), b.depth(to_source(Tb, trials))
    inside = np.minimum(in_a, in_b) >= -MEMBER * (1.0 + np.abs(trials).max(initial=0.0))
    if not inside.any():
        return Distance(low, normal=normal, method="convex")
    k = int(np.argmax(np.where(inside, np.maximum(in_a, in_b), -np.inf)))
    upper = 4.0 * max(0.0, -float(min(in_a[k], in_b[k]))) - max(0.0, float(max(in_a[k], in_b[k])))
    return Distance(low, max(low, upper), trials[k], trials[k], normal, method="convex")


def face_normals(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Array:
    """Unit normals (k, 3) of all faces of two pieces, from a to b."""
    return np.vstack([a.flat_normals @ Ta[:3, :3].T, -b.flat_normals @ Tb[:3, :3].T])


def _slab(a: Convex, Ta: Array, b: Convex, Tb: Array, near: Array) -> tuple[float, Array]:
    """Largest signed gap between two planes that part the pieces, and their normal (3,) from a to b.

    Tried are the normals ``near`` (k, 3), and what either piece has beside one of them.
    """
    Ra, Rb = Ta[:3, :3], Tb[:3, :3]
    offset = Tb[:3, 3] - Ta[:3, 3]
    n = np.vstack([near, a.normals(near @ Ra) @ Ra.T, -(b.normals(-(near @ Rb)) @ Rb.T)])
    na, nb = n @ Ra, -(n @ Rb)
    reach = np.einsum("ij,ij->i", na, a.support(na)) + np.einsum("ij,ij->i", nb, b.support(nb))
    gap = n @ offset - reach
    gap -= 4.0 * _EPS * (float(np.abs(offset).sum()) + np.abs(gap))
    k = int(np.argmax(gap))
    return float(gap[k]), n[k]


def _depth(piece: Convex, T: Array, x: Array) -> float:
    return float(piece.depth(to_source(T, x)[None])[0])


@lru_cache(maxsize=4096)
def _geometry(piece: Convex) -> tuple[Any, Array]:
    """FCL's shape, enlarged, and the pose it has in the part's frame."""
    import fcl

    if isinstance(piece, Rod):
        return fcl.Cylinder(_ENLARGED * piece.radius, _ENLARGED * piece.length), piece.T
    if isinstance(piece, Ball):
        return fcl.Sphere(_ENLARGED * piece.radius), piece.T
    flat = np.column_stack([np.full(len(piece.faces), 3), piece.faces]).ravel()
    return fcl.Convex(_ENLARGED * piece.vertices, len(piece.faces), flat), np.eye(4)


def _enlarged(piece: Convex, T: Array) -> Any:
    """The piece, placed by ``T`` (4, 4), as FCL's object."""
    import fcl

    shape, own = _geometry(piece)
    P = T @ own
    return fcl.CollisionObject(shape, fcl.Transform(P[:3, :3], _ENLARGED * P[:3, 3]))


def _unique(a: Convex, Ta: Array, b: Convex, Tb: Array, distance: Distance) -> bool | None:
    """Whether the nearest points are the only ones, from what of either piece lies furthest along the normal."""
    n = distance.normal
    if n is None or distance.lower < -1e-9:
        return None
    if not _several(a, Ta, b, Tb, n, _LEVEL):
        return True
    return False if _several(a, Ta, b, Tb, n, FLAT) else None


def _several(a: Convex, Ta: Array, b: Convex, Tb: Array, n: Array, within: float) -> bool:
    """Whether faces, or parallel lines, look at each other along ``n`` (3,); angles below ``within`` count as none."""
    i, u = _extent(a.face(n @ Ta[:3, :3], within))
    j, v = _extent(b.face(-n @ Tb[:3, :3], within)) if i else (0, u)
    if j == 0:
        return False
    return i + j > 2 or norm(cross(Ta[:3, :3] @ u, Tb[:3, :3] @ v)) <= within


def _extent(points: Array) -> tuple[int, Array]:
    """Dimension of a point, a line or a face given by points (k, 3), and the direction (3,) to the furthest of them."""
    away = points - points[0]
    if len(points) == 1:
        return 0, away[0]
    along = away[np.argmax((away**2).sum(axis=1))]
    size = norm(along)
    along = along / size
    aside = away - np.outer(away @ along, along)
    return 1 + bool((aside**2).sum(axis=1).max() > (_LEVEL * size) ** 2), along
