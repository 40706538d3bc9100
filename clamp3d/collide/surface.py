"""Pairs of closed triangle meshes: distance, containment and depth between bounds, by FCL and manifold3d.

FCL measures surfaces: its distance of meshes apart is exact, an overlap is a yes. A mesh inside another has no
surface in common with it, so containment is asked with winding numbers. The depth of an overlap comes from the
boolean intersection, whose corners and faces are measured against both surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distance
from clamp3d.core.pose import Array, inverse
from clamp3d.core.shells import corners_of, shells, winding_number

_PATCHES = 4000
"""Triangles of an overlap that are measured before its depth stays open."""
_INNER = 40
"""Points inside an overlap that are looked at."""


@dataclass(eq=False)
class Surface:
    """A closed mesh, ``vertices`` (n, 3) mm, ``faces`` (m, 3) outward; within ``error`` mm of the true surface."""

    vertices: Array
    faces: NDArray[np.int64]
    error: float

    @cached_property
    def scale(self) -> float:
        """Largest coordinate, mm: what rounding is relative to."""
        return float(np.abs(self.vertices).max())

    @cached_property
    def bvh(self) -> Any:
        """FCL's tree of oriented boxes."""
        import fcl

        tree = fcl.BVHModel()
        tree.beginModel(len(self.vertices), len(self.faces))
        tree.addSubModel(self.vertices, self.faces)
        tree.endModel()
        return tree

    @cached_property
    def manifold(self) -> Any:
        """The same mesh for booleans."""
        import manifold3d

        return manifold3d.Manifold(
            manifold3d.Mesh64(
                vert_properties=np.array(self.vertices, dtype=np.float64, order="C"),
                tri_verts=np.array(self.faces, dtype=np.uint64, order="C"),
            )
        )

    @cached_property
    def shell_points(self) -> Array:
        """One vertex (k, 3) of each connected shell."""
        return self.vertices[[self.faces[rows[0], 0] for rows in shells(self.faces, len(self.vertices))]]

    @cached_property
    def corners(self) -> tuple[Array, Array, Array]:
        """Corners of all triangles, three times (m, 3)."""
        return corners_of(self.vertices, self.faces)

    def contains(self, point: Array) -> bool:
        """Whether a point (3,) that is not on the surface lies inside."""
        return winding_number(self.corners, point) > 0.5

    def nearest(self, points: Array) -> tuple[Array, NDArray[np.int64]]:
        """Distance (k,) of points (k, 3) from the surface, never negative, and the triangle (k,) it is to.

        FCL finds the triangle with a ball of no size that matters; the distance to it is computed afresh.
        """
        import fcl
        from trimesh.triangles import closest_point

        surface, ball = fcl.CollisionObject(self.bvh, fcl.Transform()), fcl.CollisionObject(fcl.Sphere(1e-3))
        request = fcl.DistanceRequest()
        face = np.empty(len(points), dtype=np.int64)
        for k, x in enumerate(points):
            ball.setTranslation(x)
            answer = fcl.DistanceResult()
            fcl.distance(surface, ball, request, answer)
            face[k] = answer.b1
        foot = closest_point(self.vertices[self.faces[face]], points)  # type: ignore[no-untyped-call]
        return np.linalg.norm(foot - points, axis=1), face

    def distance(self, points: Array) -> Array:
        """Distance (k,) of points (k, 3) from the surface, never negative."""
        return self.nearest(points)[0]

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside."""
        d = self.distance(points)
        return np.where([self.contains(x) for x in points], d, -d)


def surface_distance(a: Surface, b: Surface, T: Array, *, contact: float) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame; ``contact`` mm is the depth that matters."""
    import fcl

    uncertainty = a.error + b.error
    oa = fcl.CollisionObject(a.bvh, fcl.Transform())
    ob = fcl.CollisionObject(b.bvh, fcl.Transform(T[:3, :3], T[:3, 3]))
    rounding = 1e-12 * (a.scale + b.scale + float(np.abs(T[:3, 3]).max()))
    if fcl.collide(oa, ob, fcl.CollisionRequest(), fcl.CollisionResult()):
        return _overlap(a, b, T, contact, rounding).widened(uncertainty + rounding)
    answer = fcl.DistanceResult()
    d = fcl.distance(oa, ob, fcl.DistanceRequest(enable_nearest_points=True), answer)
    if d <= rounding:
        return _overlap(a, b, T, contact, rounding).widened(uncertainty + rounding)
    p, q = (np.asarray(x, dtype=np.float64) for x in answer.nearest_points)
    R, t = T[:3, :3], T[:3, 3]
    for outer, shell_points, points in (
        (a, b.shell_points @ R.T + t, b.vertices @ R.T + t),
        (b, (a.shell_points - t) @ R, (a.vertices - t) @ R),
    ):
        if any(outer.contains(x) for x in shell_points):  # no surface in common: that shell lies inside as a whole
            deepest = float(outer.distance(points[:: max(1, len(points) // 50)]).max())
            return Distance(-np.inf, -max(d, deepest if len(shell_points) == 1 else d)).widened(uncertainty)
    return Distance(d, d, p, q).widened(uncertainty + rounding)


def clearance_of_shells(shells: tuple[tuple[Any, float], ...], still: Surface, T: Array, shell_points: Array) -> float:
    """Gap (mm) that is left of a moving mesh's distance after each shell's travel: (tree, travel mm) at ``T`` (4, 4).

    ``shell_points`` (k, 3), one vertex of each connected shell in the moving frame, tell a mesh inside the other.
    """
    import fcl

    fixed, place = fcl.CollisionObject(still.bvh, fcl.Transform()), fcl.Transform(T[:3, :3], T[:3, 3])
    low = np.inf
    for tree, travel in shells:
        d = float(fcl.distance(fixed, fcl.CollisionObject(tree, place), fcl.DistanceRequest(), fcl.DistanceResult()))
        if d <= 0.0:
            return -np.inf
        low = min(low, d - travel)
    inside_ = any(still.contains(x) for x in shell_points @ T[:3, :3].T + T[:3, 3])
    return -np.inf if inside_ else float(low)


def inside(inner: Surface, outer: Surface, T: Array, slack: float) -> bool:
    """Whether all of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer`` or within ``slack`` mm of it."""
    outside = inner.manifold.transform(np.ascontiguousarray(T[:3])) - outer.manifold
    if outside.is_empty():
        return True
    return bool(outer.distance(np.asarray(outside.to_mesh64().vert_properties)[:, :3]).max() <= slack)


def _overlap(a: Surface, b: Surface, T: Array, contact: float, rounding: float) -> Distance:
    """Depth of two meshes whose surfaces meet."""
    common = a.manifold ^ b.manifold.transform(np.ascontiguousarray(T[:3]))
    if common.is_empty():
        return Distance(0.0, 0.0)
    raw = common.to_mesh64()
    V = np.asarray(raw.vert_properties)[:, :3]
    F = np.asarray(raw.tri_verts, dtype=np.int64)
    back = inverse(T)
    low, high = 0.0, 0.0
    for model, place in ((a, np.eye(4)), (b, back)):
        points = V @ place[:3, :3].T + place[:3, 3]
        some = points[:: max(1, len(points) // 60)]
        high = min(high, -float(model.distance(some).max()))
        if high < -2.0 * contact - a.error - b.error:
            return Distance(-np.inf, high)
        deepest, limit = _deepest(model, points[F], contact, rounding)
        low, high = min(low, -limit), min(high, -deepest)
        if high < -2.0 * contact - a.error - b.error:
            return Distance(-np.inf, high)
    # What has nearly the same surface as both, as a part that is there twice has, is deep inside only.
    inner = _inner_points(V[F], 4.0 * (contact + a.error + b.error))
    overlap = Surface(V, F, 0.0)
    inner = inner[[overlap.contains(x) for x in inner]]
    if len(inner):
        deepest = max(a.distance(inner).max(), b.distance(inner @ back[:3, :3].T + back[:3, 3]).max())
        if deepest > -high:
            return Distance(-np.inf, -float(deepest))
    return Distance(low, high)


def _inner_points(triangles: Array, least: float) -> Array:
    """Points (k, 3) under the middles of the largest of a closed mesh's ``triangles`` (m, 3, 3).

    They lie ``least`` mm deep, and as deep as the mesh is thick on average: volume over area, which is the inner radius
    of a ball but for a factor of 3.
    """
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(cross, axis=1)
    rows = np.argsort(-size)[:_INNER]
    rows = rows[size[rows] > 0.0]
    origin = triangles.reshape(-1, 3).mean(axis=0)
    volume = float(np.einsum("ij,ij->", triangles[:, 0] - origin, cross)) / 6.0
    middle, normal = triangles[rows].mean(axis=1), cross[rows] / size[rows, None]
    return np.concatenate([middle - h * normal for h in (2.0 * volume / max(float(size.sum()), 1e-300), least)])


def _deepest(model: Surface, triangles: Array, contact: float, rounding: float) -> tuple[float, float]:
    """Deepest point of the ``triangles`` (k, 3, 3), which lie in the model: a depth that is reached, and a limit.

    The distance from one flat piece of the model's surface is a convex function, so over a triangle it is largest at
    a corner; where the corners share no piece the triangle is cut in four.
    """
    from trimesh.remesh import subdivide
    from trimesh.triangles import closest_point

    own = model.vertices[model.faces]
    deepest, limit = 0.0, 0.0
    todo, done = triangles, 0
    while len(todo):
        corners = todo.reshape(-1, 3)
        d, face = model.nearest(corners)
        deepest = max(deepest, float(d.max()))
        centre_face = model.nearest(todo.mean(axis=1))[1]
        face = np.column_stack([face.reshape(-1, 3), centre_face])
        best = np.full(len(todo), np.inf)
        for k in range(4):
            foot = closest_point(np.repeat(own[face[:, k]], 3, axis=0), corners)  # type: ignore[no-untyped-call]
            best = np.minimum(best, np.linalg.norm(foot - corners, axis=1).reshape(-1, 3).max(axis=1))
        open_ = best > max(deepest, 0.25 * contact) * 1.001 + rounding
        limit = max(limit, float(best[~open_].max(initial=0.0)))
        done += len(todo)
        if deepest > 2.0 * contact or done > _PATCHES:
            return deepest, max(limit, float(best.max()))
        if not open_.any():
            break
        corners = todo[open_].reshape(-1, 3)
        corners, faces = subdivide(corners, np.arange(len(corners)).reshape(-1, 3))  # type: ignore[no-untyped-call]
        todo = corners[faces]
    return deepest, max(deepest, limit)
