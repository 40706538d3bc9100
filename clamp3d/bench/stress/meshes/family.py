"""Families of meshes, broken ones and good ones that are hard to read, and the methods that read them.

The methods are this package's, and the bare libraries as one would call them without its guards.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import coacd
import fcl
import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines.fcl_shapes import encoded, tree
from clamp3d.bench.stress.family import Methods
from clamp3d.bench.stress.meshes import faults
from clamp3d.bench.stress.meshes.cases import Fault, MeshCase, MeshCases, make_cases
from clamp3d.bench.stress.outcome import TOUCHING, Outcome, judge
from clamp3d.bench.stress.poses.family import FCL_ERROR, MESH_ERROR, THRESHOLD, fcl_model
from clamp3d.bench.stress.poses.family import METHODS as POSE_METHODS
from clamp3d.bench.stress.poses.flat import MAX_BOXES, FlatFamily, interval
from clamp3d.bench.stress.worker import Answers, Measured, Measures
from clamp3d.collide.check import check
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Verdict
from clamp3d.core.distance import signed_distances
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.mesh import make_mesh
from clamp3d.core.pose import inverse
from clamp3d.core.shapes import MeshShape
from clamp3d.fit.fit import fit_mesh

_TIME = 15.0
"""Seconds for CoACD in method hulls: less than a child may be silent."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Distance and its bound in mm, NaN where there is none; ``why`` it does not hold."""

    distance: float
    bound: float = math.nan
    why: str = ""


@dataclass(frozen=True, slots=True)
class OneByOne:
    """A method that answers one mesh at a time."""

    ask: Callable[[Any], Answer]
    measures: Measures = "clearance"

    def measure(self, cases: Any) -> Measured:
        """See `Method`."""
        exact = [self.ask(cases[i]) for i in range(len(cases))]
        return Measured(
            np.array([answer.distance for answer in exact]),
            np.array([answer.bound for answer in exact]),
            np.array([bool(answer.why) for answer in exact]),
            next((answer.why for answer in exact if answer.why), ""),
        )


def _fcl_model(name: str, bound: float, case: MeshCase) -> Answer:
    """A contact model made of the mesh as it is; ``bound`` in parts of the groove's radius."""
    settings = {"threshold": THRESHOLD} if name == "hulls" else {}
    model = fcl_model(name, case.mesh, case.groove, settings, _TIME)
    pair = GroovePair("P1", "P6", case.groove, case.mesh.T_mesh_groove, case.wire, np.eye(4))
    distance = float(model.distances(pair, case.T_mesh_wire[None])[0])
    return Answer(distance, bound * case.groove.radius + FCL_ERROR + _rounding(case))


def _rounding(case: MeshCase) -> float:
    """What a float64 position may be off by where the mesh is, mm."""
    return 1e-15 * float(np.abs(case.T_mesh_wire[:3, 3]).max())


def _fit(case: MeshCase) -> Answer:
    """Groove fitted to the mesh, wire in it by the kernel; what the fit says of its own errors is the bound."""

    mesh = make_mesh(case.mesh.vertices, case.mesh.faces)
    if not mesh.watertight:
        return Answer(math.nan, why=f"fit: {next(note for note in mesh.notes if 'not closed' in note)}")
    result = fit_mesh(mesh)
    if not result.grooves:
        return Answer(math.nan, why=f"fit: {result.notes[-1]}")
    groove = result.grooves[0]
    T = np.ascontiguousarray(inverse(groove.T_part_feature) @ case.T_mesh_wire)
    exact = signed_distances(groove.shape, case.wire, T[None], full=True, workers=1)
    ends = groove.radius * groove.arc_error + groove.length_error
    bound = float(exact.error_bound[0]) + groove.fit_error + ends + mesh.rounding
    return Answer(float(exact.distance[0]), bound)


def _scene(case: MeshCase) -> Answer:
    """A scene of the mesh and the wire, checked: what the mesh is for a user who wants a verdict."""

    mesh = make_mesh(case.mesh.vertices, case.mesh.faces)
    if not mesh.watertight:  # the distance that it gets is that of the surfaces, not of what they should enclose
        return Answer(math.nan, why="scene: inside unknown")
    size = 10.0 * float(np.ptp(mesh.vertices, axis=0).max())  # so that every pair is measured
    scene = Scene.of(
        {"part": (MeshShape(mesh, "round"), np.eye(4)), "wire": (case.wire, case.T_mesh_wire)},
        contact=1e-3 * case.groove.radius,
        clearance=size,
    )
    (row,) = check(scene).pairs
    if row.verdict is Verdict.UNCERTAIN:
        return Answer(math.nan, why="scene: uncertain")
    if row.verdict in (Verdict.CLASH, Verdict.CONTAINED):
        return Answer(row.distance.upper)
    return Answer(row.distance.value, row.distance.uncertainty + _rounding(case))


def _fcl_alone(case: MeshCase) -> Answer:

    with _silence():
        model = tree(case.mesh.vertices, case.mesh.faces)
        return Answer(_fcl_distance([fcl.CollisionObject(model, fcl.Transform())], case))


def _coacd_alone(case: MeshCase) -> Answer:

    coacd.set_log_level("off")
    with _silence():
        parts = coacd.run_coacd(coacd.Mesh(case.mesh.vertices, case.mesh.faces))
    objects = []
    for V, F in parts:
        shape = fcl.Convex(np.asarray(V, np.float64), len(F), encoded(F))
        objects.append(fcl.CollisionObject(shape, fcl.Transform()))
    return Answer(_fcl_distance(objects, case))


@contextmanager
def _silence() -> Iterator[None]:
    """Libraries write what they think of a mesh past Python's stdout and stderr."""
    kept = [os.dup(k) for k in (1, 2)]
    with open(os.devnull, "wb") as nowhere:
        for k in (1, 2):
            os.dup2(nowhere.fileno(), k)
    try:
        yield
    finally:
        for k, old in enumerate(kept, 1):
            os.dup2(old, k)
            os.close(old)


def _fcl_distance(objects: list[Any], case: MeshCase) -> float:

    T = case.T_mesh_wire
    shape = fcl.Cylinder(case.wire.radius, case.wire.length)
    wire = fcl.CollisionObject(shape, fcl.Transform(T[:3, :3], T[:3, 3]))
    return float(min(fcl.distance(each, wire, fcl.DistanceRequest(), fcl.DistanceResult()) for each in objects))


METHODS: Methods = {
    "mesh": (POSE_METHODS["mesh"][0], partial(OneByOne, partial(_fcl_model, "mesh", MESH_ERROR))),
    "hulls": (POSE_METHODS["hulls"][0], partial(OneByOne, partial(_fcl_model, "hulls", math.nan))),
    "fit": (
        "groove fitted to the mesh (clamp3d.fit), the wire in it by closed forms; its bound is that of the fit",
        partial(OneByOne, _fit, "depth"),
    ),
    "scene": (
        "the mesh in a scene (clamp3d.check), its round surfaces fitted; its bound is that of the scene's answer",
        partial(OneByOne, _scene),
    ),
    "FCL alone": (
        "python-fcl's triangle mesh made of the arrays as they are, in millimetres, without the project's guards",
        partial(OneByOne, _fcl_alone),
    ),
    "CoACD alone": (
        "CoACD's hulls of the arrays as they are at its default threshold, each convex in python-fcl, without guards",
        partial(OneByOne, _coacd_alone),
    ),
}


def _millimetre(rng: np.random.Generator) -> float:
    return 1.0


def _any_unit(rng: np.random.Generator) -> float:
    return float(rng.choice([1e-3, 1.0, 1000.0 / 25.4, 1e3]))


class MeshFamily(FlatFamily):
    """A kind of fault: ``make`` spoils the mesh of a case, ``unit`` draws the size of its millimetre.

    Every method works in a child process: the libraries under them end it.
    """

    methods = METHODS
    part = 0.01

    def __init__(self, name: str, about: str, make: Fault, unit: Callable[[np.random.Generator], float]) -> None:
        super().__init__(name, about, lambda rng, n: None)
        self._fault, self._unit = make, unit

    def cases(self, n: int, seed: int) -> MeshCases:
        """See `Family`."""
        return make_cases(self.name, seed, n, self._fault, self._unit)

    def interval(self, cases: MeshCases, i: int, most: int = MAX_BOXES) -> tuple[float, float]:  # type: ignore[override]
        """See `FlatFamily`."""
        return interval(cases.poses, i, most)

    def judge(  # type: ignore[override]
        self, name: str, cases: MeshCases, truths: NDArray[Any], answers: Answers
    ) -> Outcome:
        """See `Family`; a verdict within the method's own bound of touching is not wrong."""
        band = np.maximum(TOUCHING * cases.scene(), np.nan_to_num(answers.bound, nan=0.0))
        measures = self.methods[name][1]().measures
        exact = np.clip(np.nan_to_num(answers.distance), truths[:, 0], truths[:, 1])  # the nearest that may be true
        return judge(self.name, name, cases.scene(), exact, answers, measures, band=band)

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        lines = [
            "import numpy as np",
            "import clamp3d",
            "from clamp3d.bench.stress.run import FAMILIES",
            f"case = FAMILIES[{self.name!r}].cases({n}, {seed})[{i}]",
            f"# {cases[i].mesh.what}",
            "try:",
            "    mesh = clamp3d.shapes.make_mesh(case.mesh.vertices, case.mesh.faces)",
            '    part = (clamp3d.shapes.MeshShape(mesh, "round"), np.eye(4))',
            '    scene = clamp3d.Scene.of({"part": part, "wire": (case.wire, case.T_mesh_wire)}, clearance=1e4)',
            "    print(clamp3d.check(scene).table())",
            "except clamp3d.InputError as error:",
            '    print("refused:", error)',
        ]
        low, high = self.interval(cases, i)
        return "\n".join([*lines, f"# truth: from {low!r} to {high!r} mm"])


_UNITS = {"mesh: scaled": _any_unit}

MESHES = {name: MeshFamily(name, *made, _UNITS.get(name, _millimetre)) for name, made in faults.MAKERS.items()}
