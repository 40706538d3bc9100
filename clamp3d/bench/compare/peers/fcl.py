"""python-fcl 0.7: boxes under its dynamic AABB tree, as in its README; the surface as ``BVHModel``, or two of a sector.

In millimetres. The tree asks GJK, which stops at an absolute 1e-6 and now and then a whole millimetre off; its callback
ends at the first overlap, so it has no depth. ``fcl-axis`` and ``fcl-sector`` ask two meshes, triangles beside
triangles, which have no tolerance.
"""

from __future__ import annotations

from typing import Any

from clamp3d.bench.compare.methods import AXIS_ANGLES_DEG, SECTOR_ANGLES_DEG, Prepared, Series, ready
from clamp3d.bench.compare.peers.pieces import AXIS, boxes, sectors, surface
from clamp3d.bench.compare.scene import WIRE
from clamp3d.engine.surface import fcl_tree
from clamp3d.geometry.pose import Array


def _tree(unit_angle: float) -> Prepared:
    import fcl

    keep = [fcl.CollisionObject(fcl.Box(*size), fcl.Transform(T[:3, :3], T[:3, 3])) for size, T in boxes(unit_angle)]
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(keep)
    manager.setup()
    wire = fcl.CollisionObject(fcl.Cylinder(WIRE.radius, WIRE.length), fcl.Transform())

    def one(T: Array) -> float:
        wire.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
        data = fcl.DistanceData()
        manager.distance(wire, data, fcl.defaultDistanceCallback)
        return float(data.result.min_distance)

    return ready(one, len(keep), depth=False, keep=keep)


def _mesh(V: Array, F: Any) -> Any:
    import fcl

    return fcl.CollisionObject(fcl_tree(V, F), fcl.Transform())


def _axis(unit_angle: float) -> Prepared:
    import fcl

    V, F = surface(unit_angle)
    part, axis, request = _mesh(V, F), _mesh(*AXIS), fcl.DistanceRequest()

    def one(T: Array) -> float:
        axis.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
        return float(fcl.distance(part, axis, request, fcl.DistanceResult())) - WIRE.radius

    return ready(one, len(F), depth=True)


def _sector(unit_angle: float) -> Prepared:
    import fcl

    V, F = surface(unit_angle)
    chords = [_mesh(V[k : k + 4], F[:2]) for k in range(2, len(V) - 4, 2)]
    axis, find, request = _mesh(*AXIS), sectors(len(chords)), fcl.DistanceRequest()

    def one(T: Array) -> float:
        axis.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
        i, j = find(T)
        d = fcl.distance(chords[i], axis, request, fcl.DistanceResult())
        if j != i:
            d = min(d, fcl.distance(chords[j], axis, request, fcl.DistanceResult()))
        return float(d) - WIRE.radius

    return ready(one, len(chords), depth=True)


SERIES = {
    "fcl": Series(_tree, "python-fcl", ("fcl",)),
    "fcl-axis": Series(_axis, "python-fcl", ("fcl",), AXIS_ANGLES_DEG),
    "fcl-sector": Series(_sector, "python-fcl", ("fcl",), SECTOR_ANGLES_DEG),
}
