"""python-fcl 0.7: convex pieces under its dynamic AABB tree in millimetres, as its README does; or those of a sector.

Its GJK stops at an absolute 1e-6; ``fcl-scaled`` gives it lengths in units of 2^-14 mm, which makes that finer. Signed
distances are asked of a sector alone: the tree's callback ends at the first overlap.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from clamp3d.bench.compare.methods import SECTOR_ANGLES_DEG, Prepared, Series, ready
from clamp3d.bench.compare.peers.pieces import TRIANGLES, boxes, prisms, sectors
from clamp3d.bench.compare.scene import WIRE
from clamp3d.core.pose import Array

_FLAT = np.insert(TRIANGLES, 0, 3, axis=1).ravel()


def _prisms(unit_angle: float, unit: float) -> list[Any]:
    import fcl

    return [
        fcl.CollisionObject(fcl.Convex(unit * V, len(TRIANGLES), _FLAT), fcl.Transform()) for V in prisms(unit_angle)
    ]


def _tree(unit_angle: float, unit: float) -> Prepared:
    import fcl

    keep = _prisms(unit_angle, unit)
    keep += [fcl.CollisionObject(fcl.Box(*(unit * size)), fcl.Transform(unit * centre)) for size, centre in boxes()]
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(keep)
    manager.setup()
    wire = fcl.CollisionObject(fcl.Cylinder(unit * WIRE.radius, unit * WIRE.length), fcl.Transform())

    def one(T: Array) -> float:
        wire.setTransform(fcl.Transform(T[:3, :3], unit * T[:3, 3]))
        told = fcl.DistanceData()
        manager.distance(wire, told, fcl.defaultDistanceCallback)
        return float(told.result.min_distance) / unit

    one.keep = keep  # type: ignore[attr-defined]
    return ready(one, len(keep), depth=False)


def _sector(unit_angle: float) -> Prepared:
    import fcl

    keep = _prisms(unit_angle, 1.0)
    wire = fcl.CollisionObject(fcl.Capsule(WIRE.radius, WIRE.length), fcl.Transform())
    find, request = sectors(len(keep)), fcl.DistanceRequest(enable_signed_distance=True)

    def one(T: Array) -> float:
        wire.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
        i, j = find(T)
        d = fcl.distance(keep[i], wire, request, fcl.DistanceResult())
        return float(d if i == j else min(d, fcl.distance(keep[j], wire, request, fcl.DistanceResult())))

    return ready(one, len(keep), depth=True)


SERIES = {
    "fcl": Series(lambda angle: _tree(angle, 1.0), "python-fcl", ("fcl",)),
    "fcl-scaled": Series(lambda angle: _tree(angle, 16384.0), "python-fcl", ("fcl",)),
    "fcl-sector": Series(_sector, "python-fcl", ("fcl",), SECTOR_ANGLES_DEG),
}
