"""trimesh 5: `CollisionManager` takes meshes only, so the wire is one, as finely divided as the groove. No depth."""

from __future__ import annotations

import importlib
import math
from typing import Any

import numpy as np

from clamp3d.bench.compare.methods import Prepared, Series, ready
from clamp3d.bench.compare.scene import WIRE, block, chord_error, pair
from clamp3d.core.pose import Array
from clamp3d.core.profile import chord_count

NEEDS = ("trimesh.collision", "fcl", "manifold3d", "scipy.spatial")  # what makes the meshes, too


def block_mesh(unit_angle: float) -> tuple[Array, Any]:
    """Vertices and triangles of the block's mesh in the groove's frame."""
    from clamp3d.core.meshing import mesh

    made = mesh(block(), chord_error(unit_angle) * (1.0 + 1e-9))
    return np.asarray(made.vertices) @ pair().T_a_groove[:3, :3], np.asarray(made.faces)


def sections(unit_angle: float) -> int:
    """Sides of a wire as finely divided as the groove."""
    return max(3, chord_count(2.0 * math.pi, unit_angle))


def _make(unit_angle: float) -> Prepared:
    trimesh: Any = importlib.import_module("trimesh")
    collision: Any = importlib.import_module("trimesh.collision")
    V, F = block_mesh(unit_angle)
    part, wire = collision.CollisionManager(), collision.CollisionManager()
    part.add_object("part", trimesh.Trimesh(V, F, process=False))
    wire.add_object("wire", trimesh.creation.cylinder(WIRE.radius, WIRE.length, sections=sections(unit_angle)))

    def one(T: Array) -> float:
        wire.set_transform("wire", T)
        return float(part.min_distance_other(wire))

    return ready(one, len(F), depth=False)


SERIES = {"trimesh": Series(_make, "trimesh", ("trimesh", *NEEDS))}
