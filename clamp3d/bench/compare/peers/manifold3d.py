"""manifold3d 3.5: `Manifold.min_gap` of two meshes up to 2 mm, the wire as finely divided as the groove. No depth.

On one core, as it is at its best: on meshes of this size its other threads only wait, which takes as much CPU again.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

import numpy as np

from clamp3d.bench.compare.methods import Prepared, Series, ready
from clamp3d.bench.compare.peers.trimesh import NEEDS, block_mesh, sections
from clamp3d.bench.compare.scene import WIRE
from clamp3d.core.pose import Array

_FARTHEST = 2.0  # mm


def _make(unit_angle: float) -> Prepared:
    if hasattr(os, "sched_setaffinity"):  # before its threads start
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    manifold3d: Any = importlib.import_module("manifold3d")
    V, F = block_mesh(unit_angle)
    mesh = manifold3d.Mesh64(vert_properties=np.ascontiguousarray(V), tri_verts=np.ascontiguousarray(F, np.uint64))
    part = manifold3d.Manifold(mesh)
    wire = manifold3d.Manifold.cylinder(WIRE.length, WIRE.radius, WIRE.radius, sections(unit_angle), True)

    def one(T: Array) -> float:
        return float(part.min_gap(wire.transform(T[:3]), _FARTHEST))

    return ready(one, len(F), depth=False)


SERIES = {"manifold3d": Series(_make, "manifold3d", ("manifold3d", *NEEDS))}
