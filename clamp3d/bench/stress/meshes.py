"""Families of meshes that nearly touch: gaps and overlaps of 1e-6 to 1e-2 mm that are known by construction.

One body lies face up; the lowest corner of the other is a known gap above that face, or below it, and wherever else the
two come near the gap is larger. So the distance is that gap. An overlap is as deep as it: the way up separates the
bodies, and no shorter one separates the two convex pieces that meet, the face being wide all around.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import trimesh
from numpy.typing import NDArray

from clamp3d.baselines.fcl_shapes import tree
from clamp3d.bench.stress.family import Family, Makers, Methods
from clamp3d.bench.stress.outcome import REFERENCE
from clamp3d.bench.stress.worker import Measured, Measures, Rows
from clamp3d.collide.distance import distance
from clamp3d.collide.motions import first_contact
from clamp3d.core.mesh import make_mesh
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array, inverse, rotation, translation
from clamp3d.core.shapes import MeshShape

_ROUNDING = 1e-9
"""Two numbers (mm) about bodies of up to 100 mm that agree to this are one."""
_EARLY = 2e-4
"""mm that bodies may be apart at the time that `first_contact` says."""
_OFF = 1e-6
"""A body that slides is further than this (mm) from the floor."""
_UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class Answer:
    """Distance and its bound in mm, NaN where there is none; ``why`` it does not hold."""

    distance: float
    bound: float = math.nan
    why: str = ""


@dataclass(frozen=True, slots=True)
class OneByOne:
    """A method that answers one pair of meshes at a time."""

    answer: Callable[[Contact], Answer]
    measures: Measures = "clearance"

    def measure(self, cases: Contacts) -> Measured:
        """See `Method`."""
        answers = [self.answer(cases[i]) for i in range(len(cases))]
        distance, bound = np.array([(answer.distance, answer.bound) for answer in answers]).T
        why = next((answer.why for answer in answers if answer.why), "")
        return Measured(distance, bound, np.array([bool(answer.why) for answer in answers]), why)


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Meshes ``a`` and ``b``, ``b`` at ``T`` (4, 4) in a's frame, and their distance ``truth`` (mm).

    With a ``way`` (3,) b moves by it, and ``truth`` is how far it has gone at the first contact. ``near`` is a pose
    (4, 4) of b at which their distance is ``off`` mm, more than 0.
    """

    a: trimesh.Trimesh
    b: trimesh.Trimesh
    T: Array
    truth: float
    near: Array
    off: float
    way: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Contacts(Rows):
    """n cases, each with meshes of its own."""

    pairs: NDArray[Any]
    shape: NDArray[np.intp]

    def __getitem__(self, i: int) -> Contact:
        return self.pairs[i]  # type: ignore[no-any-return]

    def scene(self) -> Array:
        """Largest length of each case (n,), mm."""
        return np.array([max(np.ptp(x.vertices, axis=0).max() for x in (pair.a, pair.b)) for pair in self.pairs])


def _contact(
    rng: np.random.Generator, a: trimesh.Trimesh, b: trimesh.Trimesh, T: Array, truth: float, way: Array | None = None
) -> Contact:
    """The case of ``b`` above or in ``a``, each in a frame of its own: no face is square to the axes any more."""
    off, step = abs(truth), np.array([0.0, 0.0, abs(truth) - truth])
    if way is not None:
        off = _OFF
        step = way * (truth - off) / np.linalg.norm(way)
    A, B = (rotation(rng.normal(size=3), rng.uniform(0.0, math.pi)) for _ in range(2))
    A[:3, 3], B[:3, 3] = rng.uniform(-20.0, 20.0, (2, 3))
    near = A @ translation(*step) @ T @ inverse(B)
    way = None if way is None else A[:3, :3] @ way
    return Contact(a.copy().apply_transform(A), b.copy().apply_transform(B), A @ T @ inverse(B), truth, near, off, way)


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> trimesh.Trimesh:
    solid: trimesh.Trimesh = trimesh.creation.box(bounds=[low, high])
    return solid


def _prism(depth: float, *corners: tuple[float, float]) -> trimesh.Trimesh:
    """An outline in x and z, from y = -depth / 2 to depth / 2."""
    from shapely import Polygon

    solid: trimesh.Trimesh = trimesh.creation.extrude_polygon(Polygon(corners), depth)
    solid.apply_translation((0.0, 0.0, -0.5 * depth)).apply_transform(_UPRIGHT)
    return solid


def _lowered(rng: np.random.Generator, body: trimesh.Trimesh) -> trimesh.Trimesh:
    """The body turned, a third of them square to the floor, with its lowest corner at the origin."""
    R = rotation(rng.normal(size=3), rng.uniform(0.0, math.pi))
    if rng.random() < 1 / 3:
        R = rotation((0.0, 0.0, 1.0), rng.uniform(0.0, math.pi))
        R = R @ rotation((1.0, 0.0, 0.0), 0.5 * math.pi * int(rng.integers(4)))
    turned: trimesh.Trimesh = body.copy().apply_transform(R)
    turned.apply_translation(-turned.vertices[turned.vertices[:, 2].argmin()])
    return turned


def _block(rng: np.random.Generator) -> trimesh.Trimesh:
    return _lowered(rng, trimesh.creation.box(rng.uniform(5.0, 15.0, 3)))


def _bracket(rng: np.random.Generator) -> trimesh.Trimesh:
    """Two legs, square to each other."""
    (w, h, d), t = rng.uniform(8.0, 15.0, 3).tolist(), float(rng.uniform(2.0, 4.0))
    return _lowered(rng, _prism(d, (0.0, 0.0), (w, 0.0), (w, t), (t, t), (t, h), (0.0, h)))


def _gap(rng: np.random.Generator) -> float:
    return float(10.0 ** rng.uniform(-6.0, -2.0) * rng.choice([-1.0, 1.0]))


def _all(make: Callable[[np.random.Generator], Contact]) -> Callable[[np.random.Generator, int], Contacts]:
    def cases(rng: np.random.Generator, n: int) -> Contacts:
        pairs = np.empty(n, object)
        pairs[:] = [make(rng) for _ in range(n)]
        return Contacts(pairs, np.arange(n, dtype=np.intp))

    return cases


MAKERS = Makers("mesh: ")
"""Name -> what is hard in it, and what makes the cases."""


@MAKERS.family("contact", _all)
def _plain(rng: np.random.Generator) -> Contact:
    """Blocks 1e-6 ... 1e-2 mm off or in each other, by a face, an edge or a corner."""
    floor, gap = _box((-30.0, -30.0, -rng.uniform(5.0, 10.0)), (30.0, 30.0, 0.0)), _gap(rng)
    x, y = rng.uniform(-10.0, 10.0, 2).tolist()
    return _contact(rng, floor, _block(rng), translation(x, y, gap), gap)


@MAKERS.family("seam", _all)
def _seam(rng: np.random.Generator) -> Contact:
    """The same at the line where two united blocks meet, which is no surface."""
    thick, beyond = rng.uniform(5.0, 10.0), float(rng.choice([0.0, rng.uniform(0.0, 5.0)]))
    halves = [_box((-30.0, -30.0, -thick), (beyond, 30.0, 0.0)), _box((0.0, -30.0, -thick), (30.0, 30.0, 0.0))]
    beside, gap = rng.choice([0.0, 1e-6, 1e-3]) * rng.uniform(-1.0, 1.0), _gap(rng)
    floor = trimesh.boolean.union(halves, engine="manifold")
    return _contact(rng, floor, _block(rng), translation(beside, rng.uniform(-10.0, 10.0), gap), gap)


@MAKERS.family("concave", _all)
def _concave(rng: np.random.Generator) -> Contact:
    """A bracket 1e-6 ... 1e-2 mm off or in the floor of a channel, and little further from its wall."""
    b, gap, thick = _bracket(rng), _gap(rng), rng.uniform(2.0, 5.0)
    left = float(b.bounds[0, 0]) - abs(gap) * 10.0 ** rng.uniform(0.2, 3.0)
    right, high = float(b.bounds[1, 0]) + rng.uniform(1.0, 10.0), rng.uniform(10.0, 30.0)
    inside = ((right, high), (right, 0.0), (left, 0.0), (left, high))
    outside = ((left - thick, high), (left - thick, -thick), (right + thick, -thick), (right + thick, high))
    channel = _prism(80.0, *inside, *outside)
    return _contact(rng, channel, b, translation(0.0, rng.uniform(-5.0, 5.0), gap), gap)


@MAKERS.family("late contact", _all)
def _late(rng: np.random.Generator) -> Contact:
    """A bracket slides 2e-6 ... 0.1 mm above a floor and meets a wall on it late: the way until then."""
    b, way = _bracket(rng), float(rng.uniform(5.0, 40.0))
    until = way * float(rng.uniform(0.02, 0.98))
    wall = float(b.bounds[1, 0]) + until
    step = ((wall + 1.0, 0.0), (wall + 1.0, 40.0), (wall, 40.0), (wall, 0.0))
    floor = _prism(80.0, (-60.0, 0.0), (-60.0, -5.0), (80.0, -5.0), (80.0, 0.0), *step)
    above = translation(0.0, 0.0, float(10.0 ** rng.uniform(math.log10(2.0 * _OFF), -1.0)))
    return _contact(rng, floor, b, above, until, np.array([way, 0.0, 0.0]))


def _shape(mesh: trimesh.Trimesh) -> MeshShape:
    return MeshShape(make_mesh(mesh.vertices, mesh.faces), "off")


def _engine(case: Contact) -> Answer:
    a, b = _shape(case.a), _shape(case.b)
    if case.way is None:
        measured = distance(a, b, case.T)
        return Answer(0.5 * (measured.lower + measured.upper), 0.5 * (measured.upper - measured.lower) + _ROUNDING)
    hit = first_contact(a, b, Motion.translate(case.way), case.T)
    length = float(np.linalg.norm(case.way))
    return Answer(hit.t * length + 0.5 * _EARLY, 0.5 * _EARLY + _ROUNDING)


def _fcl_alone(case: Contact) -> Answer:
    import fcl

    if case.way is not None:
        return Answer(math.nan, why="FCL alone: one pose at a time")
    bodies = [
        fcl.CollisionObject(tree(mesh.vertices, mesh.faces), fcl.Transform(T[:3, :3], T[:3, 3]))
        for mesh, T in ((case.a, np.eye(4)), (case.b, case.T))
    ]
    measured = float(fcl.distance(*bodies, fcl.DistanceRequest(), fcl.DistanceResult()))
    return Answer(measured if measured > 0.0 else -1.0)  # it says 0 where triangles cross


class ContactFamily(Family):
    """A kind of contact of two meshes."""

    methods: ClassVar[Methods] = {
        REFERENCE: ("the exact engine, with proven bounds", partial(OneByOne, _engine, "depth")),
        "FCL alone": ("python-fcl's triangle meshes as they are, in millimetres", partial(OneByOne, _fcl_alone)),
    }
    part = 0.1
    truth_error = 1e-10

    def truths(self, cases: Contacts) -> Array:
        """See `Family`."""
        return np.array([pair.truth for pair in cases.pairs])

    def difference(self, cases: Contacts, truths: Array, i: int) -> float:
        """See `Family`: by manifold3d, at the pose where they are apart."""
        import manifold3d

        case = cases[i]
        a, b = (
            manifold3d.Manifold(manifold3d.Mesh64(np.array(x.vertices), np.array(x.faces, np.uint64)))
            for x in (case.a, case.b)
        )
        gap = a.min_gap(b.transform(np.ascontiguousarray(case.near[:3])), 1.0)
        return abs(float(gap) - case.off) / float(cases.scene()[i])

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        case = self.cases(n, seed)[i]
        asked, gone = "distance(a, b, case.T)", ""
        if case.way is not None:
            asked = "first_contact(a, b, clamp3d.Motion.translate(case.way), case.T)"
            gone = f" of {float(np.linalg.norm(case.way))!r}"
        lines = [
            "import clamp3d",
            "from clamp3d.bench.stress.run import FAMILIES",
            "from clamp3d.shapes import MeshShape, make_mesh",
            f"case = FAMILIES[{self.name!r}].cases({n}, {seed})[{i}]",
            "a, b = (MeshShape(make_mesh(x.vertices, x.faces)) for x in (case.a, case.b))",
            f"print(clamp3d.{asked})",
            f"# truth: {case.truth!r} mm{gone}",
        ]
        return "\n".join(lines)


MESHES = {name: ContactFamily(name, *solid) for name, solid in MAKERS.items()}
