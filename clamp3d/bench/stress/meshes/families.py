"""Families of meshes: broken ones, and good ones that are hard to read. `MESHES` maps name -> `MeshFamily`."""

from __future__ import annotations

import numpy as np

from clamp3d.bench.stress.meshes import faults
from clamp3d.bench.stress.meshes.family import MeshFamily


def _any_unit(rng: np.random.Generator) -> float:
    return float(rng.choice([1e-3, 1.0, 1000.0 / 25.4, 1e3]))


_ALL = (
    MeshFamily("mesh: open", "faces removed from a block with a groove, or a corner torn off", faults.opened),
    MeshFamily("mesh: inside out", "windings turned: of all faces, of some, of one body of two", faults.inside_out),
    MeshFamily("mesh: doubled", "faces, vertices or the whole body twice", faults.doubled),
    MeshFamily("mesh: empty", "no faces, no vertices, or none with an area or a volume", faults.empty),
    MeshFamily(
        "mesh: bad numbers", "coordinates nan or infinite, face indices negative or out of range", faults.bad_numbers
    ),
    MeshFamily("mesh: soup", "vertices not merged, as in an STL: a good mesh that must be answered", faults.soup),
    MeshFamily("mesh: turned", "random order of vertices and faces, random rotation: must be answered", faults.turned),
    MeshFamily(
        "mesh: scaled", "metres, inches, microns, up to 1e6 sizes from the origin: good meshes", faults.far, _any_unit
    ),
)

MESHES: dict[str, MeshFamily] = {family.name: family for family in _ALL}
