"""coal 3 (once hpp-fcl): convex pieces under its dynamic AABB tree, or cached `ComputeDistance` functors for a sector.

Its README prefers convex shapes to ``BVHModel``. The tree's callback ends at the first overlap, so it has no depth; a
functor has one. Requests and results are kept from call to call. ``CachedGuess`` as the start of GJK takes a fifth
longer here, on a slow motion too (1.37 against 1.18 us a call), so the default guess stays.
"""

from __future__ import annotations

import importlib
from typing import Any

from clamp3d.bench.compare.methods import SECTOR_ANGLES_DEG, Prepared, Series, ready
from clamp3d.bench.compare.peers.pieces import TRIANGLES, boxes, prisms, sectors
from clamp3d.bench.compare.scene import WIRE
from clamp3d.core.pose import Array


def _convex(coal: Any, corners: Array) -> Any:
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in corners:
        points.append(corner)
    for a, b, c in TRIANGLES.tolist():
        triangles.append(coal.Triangle(a, b, c))
    return coal.Convex(points, triangles)


def _tree(unit_angle: float, shape: str) -> Prepared:
    coal: Any = importlib.import_module("coal")
    manager = coal.DynamicAABBTreeCollisionManager()
    keep = [coal.CollisionObject(_convex(coal, corners)) for corners in prisms(unit_angle)]
    for size, centre in boxes():
        at = coal.Transform3s()
        at.setTranslation(centre)
        keep.append(coal.CollisionObject(coal.Box(*size), at))
    for piece in keep:
        manager.registerObject(piece)
    manager.setup()
    wire = coal.CollisionObject(getattr(coal, shape)(WIRE.radius, WIRE.length))
    callback = coal.DistanceCallBackDefault()

    def one(T: Array) -> float:
        wire.setRotation(T[:3, :3])
        wire.setTranslation(T[:3, 3])
        wire.computeAABB()
        callback.init()
        manager.distance(wire, callback)
        return float(callback.data.result.min_distance)

    one.keep = keep  # type: ignore[attr-defined]  # coal's bindings hold bare pointers
    return ready(one, len(keep), depth=False)


def _sector(unit_angle: float) -> Prepared:
    coal: Any = importlib.import_module("coal")
    shapes = [_convex(coal, corners) for corners in prisms(unit_angle)]
    wire = coal.Capsule(WIRE.radius, WIRE.length)
    functors, find = [coal.ComputeDistance(shape, wire) for shape in shapes], sectors(len(shapes))
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    here, place = coal.Transform3s(), coal.Transform3s()

    def one(T: Array) -> float:
        place.setRotation(T[:3, :3])
        place.setTranslation(T[:3, 3])
        i, j = find(T)
        result.clear()
        d = functors[i](here, place, request, result)
        if j != i:
            result.clear()
            d = min(d, functors[j](here, place, request, result))
        return float(d)

    one.keep = shapes, wire  # type: ignore[attr-defined]
    return ready(one, len(shapes), depth=True)


SERIES = {
    "coal-cylinder": Series(lambda angle: _tree(angle, "Cylinder"), "coal", ("coal",)),
    "coal-capsule": Series(lambda angle: _tree(angle, "Capsule"), "coal", ("coal",)),
    "coal-sector": Series(_sector, "coal", ("coal",), SECTOR_ANGLES_DEG),
}
