"""The methods that read meshes: the project's own, and the bare libraries as one would call them without its guards."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines import ContactModel, contact_model
from clamp3d.bench.stress.meshes.cases import MESH_ERROR, MeshCase, MeshCases
from clamp3d.bench.stress.poses.methods import METHODS as POSE_METHODS
from clamp3d.bench.stress.worker import Measured, Measures, Method
from clamp3d.core.distance import signed_distances
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import inverse
from clamp3d.errors import InputError

_FCL = 2e-6
"""Error of FCL's own distance in mm (see `contact.fcl_shapes`), rounded up."""

_THRESHOLD = 1.0 / 12.0
"""CoACD's threshold in parts of the groove's radius."""

_TIME = 15.0
"""Seconds for CoACD in method hulls: less than a child may be silent."""


@dataclass(frozen=True, slots=True)
class Arrays:
    """A mesh as two arrays, with nothing checked."""

    vertices: NDArray[Any]
    faces: NDArray[Any]


@dataclass(frozen=True, slots=True)
class OneByOne:
    """A method that answers one mesh at a time: ``ask`` gives the distance, its bound, and why it does not hold."""

    ask: Callable[[MeshCase], tuple[float, float, str]]
    measures: Measures

    def measure(self, cases: MeshCases) -> Measured:
        """See `Method`."""
        found = [self.ask(cases[i]) for i in range(len(cases))]
        unfit = np.array([bool(why) for *_, why in found])
        return Measured(
            np.array([d for d, *_ in found]),
            np.array([b for _, b, _ in found]),
            unfit,
            next((why for *_, why in found if why), ""),
        )


def _model(build: Callable[[Arrays, float], ContactModel], bound: float) -> Callable[[MeshCase], Any]:
    def ask(case: MeshCase) -> tuple[float, float, str]:
        model = build(Arrays(case.mesh.vertices, case.mesh.faces), case.groove.radius)
        pair = GroovePair("P1", "P6", case.groove, case.mesh.T_mesh_groove, case.wire, np.eye(4))
        d = float(model.distances(pair, case.T_mesh_wire[None])[0])
        return d, bound * case.groove.radius + _FCL + _rounding(case), ""

    return ask


def _rounding(case: MeshCase) -> float:
    """What a float64 position may be off by where the mesh is, mm."""
    return 1e-15 * float(np.abs(case.T_mesh_wire[:3, 3]).max())


def _mesh(mesh: Arrays, radius: float) -> ContactModel:
    return contact_model("mesh", {"P1": mesh})


def _hulls(mesh: Arrays, radius: float) -> ContactModel:
    return contact_model("hulls", {"P1": mesh}, threshold=_THRESHOLD * radius, time_limit=_TIME, progress=False)


def _fit(case: MeshCase) -> tuple[float, float, str]:
    """Groove fitted to the mesh, wire in it by the kernel; what the fit says of its own errors is the bound."""
    from clamp3d.core.mesh import make_mesh
    from clamp3d.fit.fit import fit_mesh

    mesh = make_mesh(case.mesh.vertices, case.mesh.faces)
    if not mesh.watertight:
        return math.nan, math.nan, f"fit: {next(note for note in mesh.notes if 'open' in note)}"
    result = fit_mesh(mesh)
    if not result.grooves:
        return math.nan, math.nan, f"fit: {result.notes[-1]}"
    groove = result.grooves[0]
    T = np.ascontiguousarray(inverse(groove.T_part_feature) @ case.T_mesh_wire)
    found = signed_distances(groove.shape, case.wire, T[None], full=True, workers=1)
    ends = groove.radius * groove.arc_error + groove.length_error
    bound = float(found.error_bound[0]) + groove.fit_error + ends + mesh.rounding
    return float(found.distance[0]), bound, ""


def _scene(case: MeshCase) -> tuple[float, float, str]:
    """A scene of the mesh and the wire, checked: what the mesh is for a user who wants a verdict."""
    from clamp3d.collide.check import check
    from clamp3d.collide.scene import Scene
    from clamp3d.collide.verdict import Verdict
    from clamp3d.core.mesh import make_mesh
    from clamp3d.core.shapes import MeshShape

    mesh = make_mesh(case.mesh.vertices, case.mesh.faces)
    size = 10.0 * float(np.ptp(mesh.vertices, axis=0).max())  # so that every pair is measured
    scene = Scene.of(
        {"part": (MeshShape(mesh, "round"), np.eye(4)), "wire": (case.wire, case.T_mesh_wire)},
        contact=1e-3 * case.groove.radius,
        clearance=size,
    )
    (row,) = check(scene).pairs
    if row.verdict is Verdict.UNCERTAIN:
        return math.nan, math.nan, "scene: uncertain"
    if row.verdict in (Verdict.CLASH, Verdict.CONTAINED):
        return row.distance.upper, math.nan, ""
    return row.distance.value, row.distance.uncertainty + _rounding(case), ""


def _fcl_alone(case: MeshCase) -> tuple[float, float, str]:
    import fcl

    V, F = case.mesh.vertices, case.mesh.faces
    with _silence():
        model = fcl.BVHModel()
        model.beginModel(len(V), len(F))
        model.addSubModel(V, F)
        model.endModel()
        return _fcl_distance([fcl.CollisionObject(model, fcl.Transform())], case), math.nan, ""


def _coacd_alone(case: MeshCase) -> tuple[float, float, str]:
    import coacd
    import fcl

    coacd.set_log_level("off")
    with _silence():
        parts = coacd.run_coacd(coacd.Mesh(case.mesh.vertices, case.mesh.faces))
    objects = []
    for V, F in parts:
        encoded = np.column_stack([np.full(len(F), 3), F]).ravel()
        objects.append(fcl.CollisionObject(fcl.Convex(np.asarray(V, np.float64), len(F), encoded), fcl.Transform()))
    return _fcl_distance(objects, case), math.nan, ""


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
    import fcl

    T = case.T_mesh_wire
    shape = fcl.Cylinder(case.wire.radius, case.wire.length)
    wire = fcl.CollisionObject(shape, fcl.Transform(T[:3, :3], T[:3, 3]))
    return float(min(fcl.distance(each, wire, fcl.DistanceRequest(), fcl.DistanceResult()) for each in objects))


METHODS: dict[str, tuple[str, Callable[[], Method]]] = {
    "mesh": (POSE_METHODS["mesh"][0], lambda: OneByOne(_model(_mesh, MESH_ERROR), "clearance")),
    "hulls": (POSE_METHODS["hulls"][0], lambda: OneByOne(_model(_hulls, math.nan), "clearance")),
    "fit": (
        "groove fitted to the mesh (clamp3d.fit), the wire in it by closed forms; its bound is that of the fit",
        lambda: OneByOne(_fit, "depth"),
    ),
    "scene": (
        "the mesh in a scene (clamp3d.check), its round surfaces fitted; its bound is that of the scene's answer",
        lambda: OneByOne(_scene, "clearance"),
    ),
    "FCL alone": (
        "python-fcl's triangle mesh made of the arrays as they are, in millimetres, without the project's guards",
        lambda: OneByOne(_fcl_alone, "clearance"),
    ),
    "CoACD alone": (
        "CoACD's hulls of the arrays as they are at its default threshold, each convex in python-fcl, without guards",
        lambda: OneByOne(_coacd_alone, "clearance"),
    ),
}
"""Name -> what it is, and how it is made."""


def method(name: str) -> Method:
    """The method of that name. Raises InputError naming the choices."""
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; available: {', '.join(METHODS)}")
    return METHODS[name][1]()
