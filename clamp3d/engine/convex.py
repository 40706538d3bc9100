"""Convex pieces, and the signed distance of two of them between proven bounds.

Nearest points are found among corners, edges, faces, axes and rims in closed form, for large hulls near the place that
FCL names. No answer is taken at its word: its two points must lie in the pieces, which bounds the distance from above,
and the width of the slab between the pieces along a normal (support functions, closed form) bounds it from below. So a
wrong answer costs sharpness, not truth. Depth likewise: a translation that parts the pieces bounds it from above, a
point inside both from below.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.hull import FLAT, MEMBER, SMALL, Hull
from clamp3d.engine.nearest import rim_minimum, segment_pairs, to_faces
from clamp3d.geometry.pose import Array, cross, inverse, norm, to_source, to_target

_LEVEL = 1e-6
"""Below this sine it is not claimed that the nearest points are the only ones: rounding decides."""
_TOUCHING = 1e-3
"""Distances and depths (mm) below which FCL's normal may be mostly rounding, so that it is searched for."""
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

    def normals(self, n: Array) -> Array:
        """Directions near ``n`` (k, 3) in which the surface is flat or round (m, 3): the axis, and across it."""
        axis = self.T[:3, 2]
        along = (n @ axis)[:, None]
        across = n - along * axis
        size = np.linalg.norm(across, axis=1)
        aside = size > 1e-9
        return np.vstack([np.copysign(1.0, along) * axis, across[aside] / size[aside, None]])

    def closest(self, points: Array) -> Array:
        """The points of the rod (k, 3) that are nearest to ``points`` (k, 3)."""
        local = to_source(self.T, points)
        out = np.hypot(local[:, 0], local[:, 1])
        local[:, :2] *= np.minimum(1.0, self.radius / np.maximum(out, 1e-300))[:, None]
        local[:, 2] = np.clip(local[:, 2], -0.5 * self.length, 0.5 * self.length)
        return np.asarray(to_target(self.T, local))

    @property
    def ends(self) -> Array:
        """Both ends (2, 3) of the axis."""
        return np.asarray(self.T[:3, 3] + np.outer([-0.5 * self.length, 0.5 * self.length], self.T[:3, 2]))


Convex: TypeAlias = Rod | Hull


def convex_distance(a: Convex, Ta: Array, b: Convex, Tb: Array, *, rims: bool = True) -> Distance:
    """Signed distance of two convex pieces placed by ``Ta``, ``Tb`` (4, 4); points and normal in that frame.

    Closed forms first; what they leave open goes to FCL, whose answer is polished. Without ``rims`` the rims of a
    cylinder, which take long, are left to FCL.
    """
    found = _closed_form(a, Ta, b, Tb, None, rims)
    if found.upper - found.lower > 1e-10:
        found = found.meet(_by_gjk(a, Ta, b, Tb))
    if rims and found.upper - found.lower > 1e-9 and abs(found.upper) < _TOUCHING:
        from clamp3d.engine.convex_depth import convex_depth  # which needs the pieces of this module

        found = found.meet(Distance(convex_depth(a, Ta, b, Tb).lower))
    return replace(found, unique=_unique(a, Ta, b, Tb, found))


def _closed_form(a: Convex, Ta: Array, b: Convex, Tb: Array, n: Array | None, rims: bool) -> Distance:
    """What corners, edges, faces, axes and rims say; of large hulls only those that face along ``n``."""
    if isinstance(a, Rod):
        if isinstance(b, Rod):
            return _rods(a, Ta, b, Tb, rims)
        return _rod_hull(a, Ta, b, Tb, n, rims)
    if isinstance(b, Rod):
        return _rod_hull(b, Tb, a, Ta, None if n is None else -n, rims).swapped()
    return _hulls(a, Ta, b, Tb, n)


def _unique(a: Convex, Ta: Array, b: Convex, Tb: Array, found: Distance) -> bool | None:
    """Whether the nearest points are the only ones, from what of either piece lies furthest along the normal."""
    n = found.normal
    if n is None or found.lower < -1e-9:
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


def _placed(points: Array, T: Array) -> Array:
    return np.asarray(to_target(T, points))


def _hulls(a: Hull, Ta: Array, b: Hull, Tb: Array, n: Array | None) -> Distance:
    """Two polyhedra: corners against faces and edges against edges; of large ones what looks along ``n``."""
    if n is None and max(len(a.vertices), len(b.vertices)) > SMALL:
        return Distance()
    Va, Ea, Fa = (_placed(x, Ta) for x in a.near(None if n is None else n @ Ta[:3, :3]))
    Vb, Eb, Fb = (_placed(x, Tb) for x in b.near(None if n is None else -n @ Tb[:3, :3]))
    trials = [segment_pairs(Ea, Eb), to_faces(Va, Fb)]
    d, q, p = to_faces(Vb, Fa)
    d, p, q = min([*trials, (d, p, q)], key=lambda found: found[0])
    return _proven(a, Ta, b, Tb, p, q, d)


def _proven(a: Convex, Ta: Array, b: Convex, Tb: Array, p: Array, q: Array, d: float) -> Distance:
    """Points ``p``, ``q`` of two pieces that are ``d`` mm apart, with what the slab between the pieces proves."""
    size = norm(q - p)
    if not 0.0 < d < np.inf or abs(size - d) > 1e-6 * d:  # so close that the points' difference is mostly rounding
        return Distance()
    low, normal = _slab(a, Ta, b, Tb, (q - p)[None] / size)
    if d - low > 1e-5 * (1.0 + d):  # they overlap, or another place is nearer
        return Distance(low, normal=normal)
    return Distance(low, d, p, q, normal, None, "features", "convex")


def _rod_hull(a: Rod, Ta: Array, b: Hull, Tb: Array, n: Array | None, rims: bool) -> Distance:
    """A cylinder and a polyhedron: its axis against edges and faces, less the radius; then its rims."""
    if n is None and len(b.vertices) > SMALL:
        return Distance()
    _V, E, F = (_placed(x, Tb) for x in b.near(None if n is None else -n @ Tb[:3, :3]))
    ends = _placed(a.ends, Ta)
    d, x, q = min([segment_pairs(ends[None], E), to_faces(ends, F)], key=lambda found: found[0])
    if not d > 1e-9 * a.radius or b.crossed_by(_placed(ends, inverse(Tb))):
        return Distance()
    m = (q - x) / d
    axis = Ta[:3, :3] @ a.T[:3, 2]
    found = Distance()
    if abs(float(m @ axis)) <= FLAT:  # square to the axis: on the side
        p = x + a.radius * m
        low, normal = _slab(a, Ta, b, Tb, m[None])
        if d >= a.radius:
            found = Distance(low, d - a.radius, p, q, normal, None, "features", "convex")
        else:
            found = _deepest(a, Ta, b, Tb, [q, p, 0.5 * (p + q)], low, 0.0)
            found = replace(found, normal=normal, point_a=p, point_b=q) if found.upper < np.inf else found
    if rims and found.upper - found.lower > 1e-10 and len(b.vertices) <= SMALL:
        found = found.meet(_rims(a, Ta, b, Tb))
    return found


def _rods(a: Rod, Ta: Array, b: Rod, Tb: Array, rims: bool) -> Distance:
    """Two cylinders: axis against axis, ends against ends, rims against the other cylinder."""
    found = Distance()
    ends_a, ends_b = _placed(a.ends, Ta), _placed(b.ends, Tb)
    d, x, y = segment_pairs(ends_a[None], ends_b[None])
    n = (y - x) / max(d, 1e-300)
    square = all(abs(float(n @ (T[:3, :3] @ rod.T[:3, 2]))) <= FLAT for rod, T in ((a, Ta), (b, Tb)))
    if square and d > 1e-9 * (a.radius + b.radius):  # else the feet are on ends, not on the sides
        p, q = x + a.radius * n, y - b.radius * n
        if d > a.radius + b.radius:
            found = _proven(a, Ta, b, Tb, p, q, norm(q - p))
        else:
            low, normal = _slab(a, Ta, b, Tb, n[None])
            deepest = _deepest(a, Ta, b, Tb, [p, q, 0.5 * (p + q)], low, 0.0)
            found = replace(deepest, normal=normal, point_a=p, point_b=q) if deepest.upper < np.inf else deepest
    if found.upper - found.lower > 1e-10:
        found = found.meet(_touching(a, Ta, b, Tb))
    if rims and found.upper - found.lower > 1e-10:
        found = found.meet(_rims(a, Ta, b, Tb)).meet(_rims(b, Tb, a, Ta).swapped())
    return found


def _rims(a: Rod, Ta: Array, b: Convex, Tb: Array) -> Distance:
    """The rims of a cylinder against another piece."""
    back = inverse(Tb)
    found = Distance()
    for end in a.ends:
        T = Ta @ a.T
        T[:3, 3] = _placed(end, Ta)
        rim = rim_minimum(lambda x: _placed(b.closest(_placed(x, back)), Tb), T, a.radius)
        if rim is not None:
            p, q = rim
            found = found.meet(_proven(a, Ta, b, Tb, p, q, norm(q - p)))
    return found


def _deepest(a: Convex, Ta: Array, b: Convex, Tb: Array, trials: list[Array], low: float, slack: float) -> Distance:
    """Distance in an overlap: the deepest of the ``trials`` (3,) that lie in both pieces, beside a known ``low``."""
    depths = [(_depth(a, Ta, x), _depth(b, Tb, x)) for x in trials]
    allowed = slack + 16.0 * _EPS * (1.0 + max(float(np.abs(x).max()) for x in trials))
    inside = [max(pair) if min(pair) >= -allowed else -np.inf for pair in depths]
    k = int(np.argmax(inside))
    if inside[k] == -np.inf:
        return Distance(low)
    outside = max(0.0, -min(depths[k]))
    upper = 4.0 * outside - max(0.0, inside[k])
    return Distance(low, max(low, upper), trials[k], trials[k], None, None, "features", "convex")


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


def _by_gjk(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Distance:
    """FCL's answer, proven from both sides and polished near the points it names."""
    import fcl

    oa, ob = _object(a, Ta), _object(b, Tb)
    answer = fcl.DistanceResult()
    libccd = fcl.GJKSolverType.GST_LIBCCD
    fcl.distance(oa, ob, fcl.DistanceRequest(enable_nearest_points=True, gjk_solver_type=libccd), answer)
    if answer.min_distance > 0.0:
        p, q = (np.asarray(x, dtype=np.float64) for x in answer.nearest_points)
        size = norm(q - p)
        if 0.0 < size < np.inf:
            n = (q - p) / size
            low, m = _slab(a, Ta, b, Tb, n[None])
            outside = max(0.0, -_depth(a, Ta, p), -_depth(b, Tb, q))
            found = Distance(low, size + 2.0 * outside, p, q, m, None, "features", "convex (GJK)")
            if found.upper - found.lower > 1e-10 and (isinstance(a, Hull) or isinstance(b, Hull)):
                found = found.meet(_closed_form(a, Ta, b, Tb, n, False))
            # The direction of a short distance is mostly rounding.
            return found if size - low < 1e-5 else found.meet(_touching(a, Ta, b, Tb))
    contacts = fcl.CollisionResult()
    request = fcl.CollisionRequest(num_max_contacts=4, enable_contact=True, gjk_solver_type=libccd)
    if not fcl.collide(oa, ob, request, contacts):
        return _touching(a, Ta, b, Tb)  # touching within rounding
    found = Distance()
    for contact in contacts.contacts:
        n, at = np.asarray(contact.normal, dtype=np.float64), np.asarray(contact.pos, dtype=np.float64)
        size = norm(n)
        if not 0.0 < size < np.inf:
            continue
        low, m = _slab(a, Ta, b, Tb, np.array([n, -n]) / size)
        reach = abs(float(contact.penetration_depth))
        trials = [at + s * reach * n / size for s in (0.0, -0.5, 0.5, -0.25, 0.25)]
        new = _deepest(a, Ta, b, Tb, trials, low, MEMBER * (1.0 + float(np.abs(at).max())))
        found = found.meet(replace(new, normal=m, method="convex (GJK)"))
    shallow = found.upper > -1e-3 or found.lower > -1e-3
    return found.meet(_touching(a, Ta, b, Tb)) if shallow else found


def _touching(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Distance:
    """Lower bound from all faces of both pieces, and what of the other piece looks at each."""
    trials = []
    for piece, T, sign in ((a, Ta, 1.0), (b, Tb, -1.0)):
        axes = piece.T[:3, 2] * np.array([[1.0], [-1.0]]) if isinstance(piece, Rod) else piece.planes[:200, :3]
        trials.append((sign * axes) @ T[:3, :3].T)
    low, normal = _slab(a, Ta, b, Tb, np.vstack(trials))
    return Distance(low, normal=normal, method="convex")


def _depth(piece: Convex, T: Array, x: Array) -> float:
    return float(piece.depth(to_source(T, x)[None])[0])


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
