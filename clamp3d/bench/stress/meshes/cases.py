"""Cases of the mesh families: a block with a groove as a mesh with a fault, and a wire whose distance is known.

The truth is the distance of the flat-ended wire from the part that was meant, worked out from the groove itself; no
case is nearer to touching than the errors of tessellation, so a wrong verdict is never a matter of the chord error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.bench.stress.family import generator
from clamp3d.bench.stress.poses import draw
from clamp3d.bench.stress.poses.cases import Cases, Shapes
from clamp3d.bench.stress.poses.family import MESH_ERROR, block
from clamp3d.bench.stress.worker import Rows
from clamp3d.core.distance import signed_distances
from clamp3d.core.pose import Array
from clamp3d.core.primitives import Cylinder, SweptArc

LEAST = 0.02
"""No case is nearer to touching than this, in parts of the groove's radius."""

_CONTAINED = 0.15
"""Share of the candidates whose wire lies wholly in the material."""


@dataclass(frozen=True, slots=True)
class Faulty:
    """A mesh: ``vertices`` and ``faces`` as they are handed over, ``T_mesh_groove`` (4, 4) where the groove is in it.

    ``what`` says what was done to it. ``broken``: no solid is defined by it any more (else it must be answered).
    """

    vertices: NDArray[Any]
    faces: NDArray[Any]
    T_mesh_groove: Array
    what: str
    broken: bool


Fault = Callable[[np.random.Generator, Array, NDArray[np.int64], float], Faulty]
"""``(rng, vertices, faces, groove radius)`` of a good mesh in the groove's frame -> the mesh of the case."""


@dataclass(frozen=True, slots=True)
class MeshCase:
    """One case: the mesh that is given, the wire and its pose in the mesh's frame, and the groove that was meant."""

    mesh: Faulty
    groove: SweptArc
    wire: Cylinder
    T_mesh_wire: Array


@dataclass(frozen=True, slots=True)
class MeshCases(Rows):
    """n cases; every mesh is made when it is asked for, from the case's own random numbers.

    ``poses`` are the wires in their grooves' frames, ``shape`` (n,) the numbers of the cases, each with a mesh of its
    own, which is drawn with ``family``, ``seed`` and ``fault``.
    """

    family: str
    seed: int
    fault: Fault
    poses: Cases
    shape: NDArray[np.intp]

    def scene(self) -> Array:
        """Largest length of each case (n,), mm."""
        return self.poses.scene()

    def __getitem__(self, i: int) -> MeshCase:
        k = int(self.poses.shape[i])
        groove, wire, T = self.poses.shapes.groove(k), self.poses.shapes.cylinder(k), self.poses.T_world_wire[i]
        vertices, faces = good_mesh(groove, wire, T)
        rng = np.random.default_rng([*generator(self.family, self.seed).integers(2**32, size=2), self.shape[i]])
        mesh = self.fault(rng, vertices, faces, groove.radius)
        return MeshCase(mesh, groove, wire, mesh.T_mesh_groove @ T)


def good_mesh(groove: SweptArc, wire: Cylinder, T: Array) -> tuple[Array, NDArray[np.int64]]:
    """Closed mesh of a block with the groove, in the groove's frame, that reaches beyond the place of contact."""
    from clamp3d.core.meshing import mesh

    exact = signed_distances(groove, wire, T[None], full=True, workers=1)
    points = np.concatenate([exact.point_on_groove, exact.point_on_cylinder])
    # A part in metres is too small to be meshed: as if it were in larger units, by a power of two.
    unit = min(1.0, 2.0 ** np.floor(np.log2(groove.radius)))
    large = SweptArc(groove.radius / unit, groove.half_angle, groove.length / unit)
    candidates = mesh(block(large, points / unit), MESH_ERROR * large.radius)
    return np.array(candidates.vertices, dtype=np.float64) * unit, np.array(candidates.faces, dtype=np.int64)


def make_cases(family: str, seed: int, n: int, fault: Fault, unit: Callable[[np.random.Generator], float]) -> MeshCases:
    """The n cases of a seed. ``unit`` draws the size of a millimetre for each (1, or 1e-3 for parts in metres)."""
    rng = generator(family, seed)
    shapes: list[Array] = []
    poses: list[Array] = []
    while len(poses) < n:
        m = max(32, n)
        anywhere, contained = _anywhere(rng, m), _contained(rng, m)
        for k in range(m):
            candidates = contained if rng.random() < _CONTAINED else anywhere
            groove, wire, T = candidates.shapes.groove(k), candidates.shapes.cylinder(k), candidates.T_world_wire[k]
            exact = signed_distances(groove, wire, T[None], full=True, workers=1)
            distance, thick = float(exact.distance[0]), min(wire.radius, 0.5 * wire.length)
            # Of a disc that is deeper inside than it is thick only a bound of the signed distance is known.
            unknown = wire.length <= 2.0 * wire.radius and distance < -0.99 * thick
            if unknown or abs(distance) < LEAST * groove.radius:
                continue
            mm = unit(rng)
            lengths = mm * np.array([groove.radius, groove.length, wire.radius, wire.length])
            shapes.append(np.insert(lengths, 1, groove.half_angle))
            T_groove_wire = T.copy()
            T_groove_wire[:3, 3] *= mm
            poses.append(T_groove_wire)
    table = np.array(shapes[:n]).T
    T = np.array(poses[:n])
    rows = np.arange(n, dtype=np.intp)
    return MeshCases(family, seed, fault, Cases(Shapes(*table), rows, T, np.full(n, np.nan)), rows)


def _shapes(rng: np.random.Generator, m: int, **given: ArrayLike) -> Shapes:
    R = 10.0 ** rng.uniform(0.5, 2.0, m)
    half = np.where(rng.random(m) < 0.3, rng.uniform(1.6, 2.6, m), rng.uniform(0.4, 1.57, m))
    columns: dict[str, ArrayLike] = {"R": R, "half_angle": half, "L": R * rng.uniform(0.5, 5.0, m)}
    columns |= {"r": R * rng.uniform(0.3, 0.95, m), "length": R * rng.uniform(0.5, 4.0, m)}
    return draw.shapes(rng, m, **(columns | {name: R * np.asarray(value) for name, value in given.items()}))


def _anywhere(rng: np.random.Generator, m: int) -> Cases:
    """Wires near every feature of the groove, clear and clashing."""
    shapes = _shapes(rng, m)
    rows = np.arange(m, dtype=np.intp)
    gap = shapes.r * rng.choice([-1.0, 1.0], m) * rng.uniform(0.03, 0.6, m)
    return draw.place(rng, shapes, rows, draw.contact_on(rng, shapes, rows, rng.choice(draw.FEATURES, m)), gap)


def _contained(rng: np.random.Generator, m: int) -> Cases:
    """Thin wires along the groove, wholly in the material below it."""
    shapes = _shapes(rng, m, r=rng.uniform(0.04, 0.2, m), length=rng.uniform(0.1, 0.4, m), L=rng.uniform(3.0, 5.0, m))
    side = rng.uniform(-1.0, 1.0, m) * np.minimum(shapes.half_angle, 1.2)
    out = shapes.R + shapes.r * rng.uniform(1.5, 3.0, m)
    centre = np.stack([out * np.sin(side), -out * np.cos(side), shapes.L * rng.uniform(-0.1, 0.1, m)], 1)
    axis = np.tile([0.0, 0.0, 1.0], (m, 1))
    return draw.free(rng, shapes, np.arange(m, dtype=np.intp), centre, axis)
