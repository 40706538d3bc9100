"""manifold3d 3.5: `Manifold.min_gap` of the closed block and the wire's axis, searched up to 2 mm beyond the wire.

Every pair of triangles that is not farther is looked at, so the wire is the body with the fewest: a tetrahedron about
its axis, thinner than any error here. On one core, as it is at its best: on meshes of this size its other threads only
wait, which takes as much CPU again.
"""

from __future__ import annotations

import os

import numpy as np

from clamp3d.bench.compare.methods import Prepared, Series, ready
from clamp3d.bench.compare.scene import BLOCK, PAIR, WIRE, chord_error
from clamp3d.geometry.manifolds import as_manifold
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.pose import Array

_FARTHEST = WIRE.radius + 2.0  # mm
_THIN = 1e-8  # mm


def _make(unit_angle: float) -> Prepared:
    if hasattr(os, "sched_setaffinity"):  # before its threads start
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    block_mesh, half = mesh(BLOCK, chord_error(unit_angle) * (1.0 + 1e-9)), 0.5 * WIRE.length
    part = as_manifold(block_mesh.vertices @ PAIR.T_a_groove[:3, :3], block_mesh.faces)
    wire = as_manifold(
        np.array([(0.0, 0.0, -half), (_THIN, 0.0, -half), (0.0, _THIN, -half), (0.0, 0.0, half)]),
        np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]),
    )

    def one(T: Array) -> float:
        return float(part.min_gap(wire.transform(T[:3]), _FARTHEST)) - WIRE.radius

    return ready(one, len(block_mesh.faces), depth=True)


_NEEDS = ("manifold3d", "trimesh", "scipy.spatial")  # what makes the mesh, too
SERIES = {"manifold3d": Series(_make, "manifold3d", _NEEDS)}
