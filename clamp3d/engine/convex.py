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

    def face(self, n: Array) -> Array:
        """Points (k, 3) of what lies furthest along ``n`` (3,): a line on the side, the rim of an end, a point."""
        m = n @ self.T[:3, :3]
        across = float(np.hypot(m[0], m[1]))
        if across < FLAT:
            turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
            rim = self.radius * np.column_stack([np.cos(turn), np.sin(turn)])
            flat = np.vstack([rim, 0.5 * rim, np.zeros((1, 2))])
            local = np.column_stack([flat, np.full(len(flat), np.copysign(0.5 * self.length, m[2]))])
        elif abs(m[2]) < FLAT:
            z = np.linspace(-0.5, 0.5, 65) * self.length
            local = np.column_stack([np.outer(np.ones(65), self.radius / across * m[:2]), z])
        else:
            return self.support(n[None])
        return np.asarray(to_target(self.T, local))

    def flatness(self, n: Array, within: float = FLAT) -> tuple[int, Array | None]:
        """Dimension of what lies furthest along ``n`` (3,), and its direction if it is a line."""
        m = n @ self.T[:3, :3]
        if float(np.hypot(m[0], m[1])) < within:
            return 2, None
        return (1, self.T[:3, 2]) if abs(m[2]) < within else (0, None)

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


Convex: TypeAlias = Rod | Hull


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

        distance = distance.meet(Distance(convex_depth(a, Ta, b, Tb).lower))
    return replace(distance, unique=_unique(a, Ta, b, Tb, distance))


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
    low, normal = _slab(a, Ta, b, Tb, (q - p)[None] / size)
    outside = max(0.0, -_depth(a, Ta, p), -_depth(b, Tb, q))
    distance = Distance(low, size + 2.0 * outside, p, q, normal, None, "features", "convex")
    # The direction of a short distance is mostly rounding.
    return distance if size - low < 1e-5 else distance.meet(_slab_of_faces(a, Ta, b, Tb))


def _overlapping(a: Convex, Ta: Array, b: Convex, Tb: Array, pair: tuple[Any, Any]) -> Distance:
    """Bounds of the depth of two pieces from FCL's contact; of the distance where they touch within rounding."""
    import fcl

    contacts = fcl.CollisionResult()
    fcl.collide(*pair, fcl.CollisionRequest(enable_contact=True, gjk_solver_type=_libccd()), contacts)
    distance = Distance()
    for contact in contacts.contacts:
        n, place = np.asarray(contact.normal, dtype=np.float64), np.asarray(contact.pos) / _ENLARGED
        if not 0.0 < norm(n) < np.inf:
            continue
        n = n / norm(n)
        low, normal = _slab(a, Ta, b, Tb, np.array([n, -n]))
        half = 0.5 * abs(float(contact.penetration_depth)) / _ENLARGED
        distance = replace(_deepest(a, Ta, b, Tb, place + np.outer((0.0, -half, half), n), low), normal=normal)
    shallow = distance.upper > -_TOUCHING or distance.lower > -_TOUCHING
    return distance.meet(_slab_of_faces(a, Ta, b, Tb)) if shallow else distance


def _deepest(a: Convex, Ta: Array, b: Convex, Tb: Array, trials: Array, low: float) -> Distance:
    """Distance in an overlap: the deepest of ``trials`` (k, 3) that lie in both pieces, beside a proven ``low``."""
    in_a, in_b = a.depth(to_source(Ta, trials)), b.depth(to_source(Tb, trials))
    inside = np.minimum(in_a, in_b) >= -MEMBER * (1.0 + float(np.abs(trials).max()))
    depth = np.where(inside, np.maximum(in_a, in_b), -np.inf)
    k = int(np.argmax(depth))
    if depth[k] == -np.inf:
        return Distance(low, method="convex")
    outside = max(0.0, -float(min(in_a[k], in_b[k])))
    upper = 4.0 * outside - max(0.0, float(depth[k]))
    return Distance(low, max(low, upper), trials[k], trials[k], None, None, "features", "convex")


def _slab_of_faces(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Distance:
    """Lower bound from all faces of both pieces, and what of the other piece looks at each."""
    trials = []
    for piece, T, sign in ((a, Ta, 1.0), (b, Tb, -1.0)):
        trials.append((sign * piece.flat_normals) @ T[:3, :3].T)
    low, normal = _slab(a, Ta, b, Tb, np.vstack(trials))
    return Distance(low, normal=normal, method="convex")


def _slab(a: Convex, Ta: Array, b: Convex, Tb: Array, near: Array) -> tuple[float, Array]:
    """Largest signed gap between two planes that part the pieces, square to one of the normals ``near`` (k, 3) from a
    to b or to what either piece has beside one; and that normal (3,).
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
    flat, nearly = (_several(a, Ta, b, Tb, n, within) for within in (FLAT, _LEVEL))
    return not flat if flat == nearly else None


def _several(a: Convex, Ta: Array, b: Convex, Tb: Array, n: Array, within: float) -> bool:
    """Whether faces, or parallel lines, look at each other along ``n`` (3,); angles below ``within`` count as none."""
    (i, u), (j, v) = a.flatness(n @ Ta[:3, :3], within), b.flatness(-n @ Tb[:3, :3], within)
    if i == 0 or j == 0:
        return False
    if u is not None and v is not None:
        return bool(norm(cross(Ta[:3, :3] @ u, Tb[:3, :3] @ v)) <= within)
    return True
