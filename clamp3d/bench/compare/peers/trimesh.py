"""trimesh 5: `CollisionManager` takes meshes only; the wire is its axis, which is one without facets of its own."""

from __future__ import annotations

import importlib
from typing import Any

from clamp3d.bench.compare.methods import Prepared, Series, ready
from clamp3d.bench.compare.peers.pieces import AXIS, surface
from clamp3d.bench.compare.scene import WIRE
from clamp3d.geometry.pose import Array


def _make(unit_angle: float) -> Prepared:
    trimesh: Any = importlib.import_module("trimesh")
    collision: Any = importlib.import_module("trimesh.collision")
    V, F = surface(unit_angle)
    part, wire = collision.CollisionManager(), collision.CollisionManager()
    part.add_object("part", trimesh.Trimesh(V, F, process=False))
    wire.add_object("wire", trimesh.Trimesh(*AXIS, process=False))

    def one(T: Array) -> float:
        wire.set_transform("wire", T)
        return float(part.min_distance_other(wire)) - WIRE.radius

    return ready(one, len(F), depth=True)


SERIES = {"trimesh": Series(_make, "trimesh", ("trimesh", "trimesh.collision", "fcl"))}
