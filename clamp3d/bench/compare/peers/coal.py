"""coal 3 (once hpp-fcl): boxes under its dynamic AABB tree, the surface as ``BVHModelOBBRSS``, functors for a sector.

The tree's callback ends at the first overlap, so it has no depth; the others have one. Requests and results are kept
from call to call. Of GJK's settings none is quicker here than its defaults: ``CachedGuess``, on a slow motion too,
Nesterov's and Polyak's acceleration, other criteria of convergence and a tolerance of 1e-4 take as long or longer.
``coal-axis`` asks two meshes with the cached `ComputeDistance`: triangles beside triangles need no GJK, and the axis
is far from most boxes of the hierarchy, which those about the wire are not.
"""

from __future__ import annotations

import importlib
from typing import Any

from clamp3d.bench.compare.methods import AXIS_ANGLES_DEG, SECTOR_ANGLES_DEG, Prepared, Series, ready
from clamp3d.bench.compare.peers.pieces import AXIS, boxes, sectors, surface
from clamp3d.bench.compare.scene import WIRE
from clamp3d.geometry.pose import Array


def _tree(unit_angle: float, shape: str) -> Prepared:
    coal: Any = importlib.import_module("coal")
    manager = coal.DynamicAABBTreeCollisionManager()
    keep = [
        coal.CollisionObject(coal.Box(*size), coal.Transform3s(T[:3, :3], T[:3, 3])) for size, T in boxes(unit_angle)
    ]
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

    return ready(one, len(keep), depth=False, keep=keep)


def _mesh(coal: Any, V: Array, F: Array) -> Any:
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in V:
        corners.append(corner)
    for a, b, c in F.tolist():
        triangles.append(coal.Triangle(a, b, c))
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(F), len(V))
    model.addSubModel(corners, triangles)
    model.endModel()
    return model


def _axis(unit_angle: float) -> Prepared:
    coal: Any = importlib.import_module("coal")
    V, F = surface(unit_angle)
    part, axis = _mesh(coal, V, F), _mesh(coal, *AXIS)
    ask, request, result = coal.ComputeDistance(part, axis), coal.DistanceRequest(), coal.DistanceResult()
    here, place = coal.Transform3s(), coal.Transform3s()

    def one(T: Array) -> float:
        place.setRotation(T[:3, :3])
        place.setTranslation(T[:3, 3])
        result.clear()
        return float(ask(here, place, request, result)) - WIRE.radius

    return ready(one, len(F), depth=True, keep=(part, axis))


def _sector(unit_angle: float) -> Prepared:
    coal: Any = importlib.import_module("coal")
    pieces = boxes(unit_angle)[:-2]
    shapes = [coal.Box(*size) for size, _ in pieces]
    places = [coal.Transform3s(T[:3, :3], T[:3, 3]) for _, T in pieces]
    wire = coal.Capsule(WIRE.radius, WIRE.length)
    functors, find = [coal.ComputeDistance(shape, wire) for shape in shapes], sectors(len(shapes))
    request, result, place = coal.DistanceRequest(), coal.DistanceResult(), coal.Transform3s()

    def one(T: Array) -> float:
        place.setRotation(T[:3, :3])
        place.setTranslation(T[:3, 3])
        i, j = find(T)
        result.clear()
        d = functors[i](places[i], place, request, result)
        if j != i:
            result.clear()
            d = min(d, functors[j](places[j], place, request, result))
        return float(d)

    return ready(one, len(shapes), depth=True, keep=(shapes, wire))


SERIES = {
    "coal-cylinder": Series(lambda angle: _tree(angle, "Cylinder"), "coal", ("coal",)),
    "coal-capsule": Series(lambda angle: _tree(angle, "Capsule"), "coal", ("coal",)),
    "coal-axis": Series(_axis, "coal", ("coal",), AXIS_ANGLES_DEG),
    "coal-sector": Series(_sector, "coal", ("coal",), SECTOR_ANGLES_DEG),
}
