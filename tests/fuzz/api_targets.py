"""Everything public that a user calls, with good arguments for it."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st

import clamp3d
from clamp3d import figures, kernel, shapes
from clamp3d.baselines.cas import Cas
from clamp3d.baselines.chords import Chords
from clamp3d.baselines.polytopes import Meshes
from clamp3d.baselines.wedges import Wedges
from clamp3d.bench.image import image_study, measure_image
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import Wire
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.clamp.placement import Placement
from clamp3d.clamp.section import Section
from clamp3d.collide.allowed import Allowed
from clamp3d.collide.poses import check_poses
from clamp3d.core import pose as poses
from clamp3d.core.meshing import mesh
from clamp3d.core.motion import Motion
from clamp3d.core.shapes import FITS
from clamp3d.output.viewer import Viewer
from clamp3d.scenefile.file import load_scene
from tests.fuzz.values import any_pose, pose_batch, rigid

Target = tuple[Callable[..., Any], dict[str, Any]]
"""A function, and its arguments or strategies for them; what has a default and is not named gets that."""

_READ = (
    "ArcContact ArcRelation Assembly Cas CheckResult Clamp CylinderFit Distance Distances Equilibrium Feature "
    "FitResult GeneralisedGradient GrooveFit GroovePieces GrooveRelation HoleContact HoleFit HoleRelation "
    "ImageMeasurement ImageStudy InputError Mesh MotionDistance PairResult PoseVerdicts Relation3D "
    "SignedDistance SignedDistances Verdict baselines bench figures kernel shapes testing "
)
RESULTS = set(_READ.split())
"""Public names that a user reads and does not call."""

SIZES = st.floats(1.0, 20.0) | st.floats(1.0, 20.0) | st.floats(-6.0, 6.0).map(lambda x: 10.0**x)
ANGLES, TOLERANCES = st.floats(-4.0, 4.0), st.sampled_from([0.0, 1e-9, 1e-6, 1e-3])
THREE = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3)
GROOVES = st.builds(kernel.SweptArc, SIZES, st.floats(0.05, 3.1), SIZES)
WIRES = st.builds(kernel.Cylinder, SIZES, SIZES) | st.builds(kernel.Capsule, SIZES, SIZES)
AXES = THREE.filter(lambda x: np.linalg.norm(x) > 1e-3)
MOTIONS = st.builds(lambda x: Motion.translate(40.0 * np.array(x)), AXES) | st.builds(
    lambda axis, angle, point, travel: Motion.screw(axis, angle, point=point, travel=travel),
    AXES,
    ANGLES,
    THREE,
    ANGLES,
)
ABOVE = rigid(5.0).map(lambda T: poses.translation(0.0, 40.0, 0.0) @ T)
RECTANGLES = st.builds(kernel.Rectangle, ANGLES, ANGLES, SIZES, SIZES, st.floats(-0.5, 0.5))
MARKS = st.lists(st.lists(st.floats(0.0, 500.0), min_size=2, max_size=2), min_size=2, max_size=2)
BOX = shapes.box((1, 2, 3))
FLAT = [[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]]
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
one_of = st.sampled_from


@functools.cache
def targets() -> dict[str, Target]:
    """Everything callable by name."""
    return {name: target for _, some in groups() for name, target in some.items()}


@functools.cache
def groups() -> tuple[tuple[int, dict[str, Target]], ...]:
    """What is called, in groups: how often all of a group together, in a hundred calls."""
    clamp, run, tetrahedron = load_clamp(), assemble(load_clamp(), Cas()), shapes.make_mesh(FLAT, FACES)
    solids, closing, section = parts(clamp), Placement(clamp), Section(clamp, Cas())
    block = shapes.groove_block(kernel.SweptArc(7.0, 1.0, 50.0), 40.0, 20.0)
    scene = clamp3d.Scene(clearance=0.5).add("block", block).add("wire", shapes.cylinder(6.5, 80.0))
    coarse = {name: mesh(solids[name], 0.5) for name in ("P1", "P2", "P3")}
    models = one_of([Cas(), Chords(0.2), Wedges(solids, 0.2), Meshes(coarse)])
    pairs = one_of(list(groove_pairs(clamp).values())[:4])
    asked = one_of([None, [("wire", "block")]])
    pair_and_pose: dict[str, Any] = {"groove": GROOVES, "cylinder": WIRES, "pose": any_pose()}
    circle: dict[str, Any] = {"arc_radius": SIZES, "circle_radius": SIZES, "x": ANGLES, "y": ANGLES}
    way: dict[str, Any] = {"a": GROOVES, "b": WIRES, "motion": MOTIONS, "T_a_b": ABOVE}
    few = pose_batch().map(lambda T: T[:5] if isinstance(T, np.ndarray) and T.ndim else T)
    batch = {"groove": GROOVES, "cylinder": WIRES, "poses": pose_batch(), "full": st.booleans()}
    of_model: dict[str, Any] = {"self": models, "pair": pairs}
    numbers: dict[str, Target] = {
        "signed_distance": (kernel.signed_distance, pair_and_pose),
        "signed_distances": (kernel.signed_distances, {**batch, "workers": one_of([None, 1, 2])}),
        "groove_pieces": (kernel.groove_pieces, pair_and_pose),
        "groove_relation": (kernel.groove_relation, {**pair_and_pose, "tolerance": TOLERANCES}),
        "generalised_gradient": (kernel.generalised_gradient, pair_and_pose),
        "relative_pose": (kernel.relative_pose, {"T_world_a": any_pose(), "T_world_b": any_pose()}),
    }
    small: dict[str, Target] = {
        "SweptArc": (kernel.SweptArc, {"radius": SIZES, "half_angle": st.floats(0.0, 3.2), "length": SIZES}),
        "Capsule": (kernel.Capsule, {"radius": SIZES, "length": SIZES}),
        "Cylinder": (kernel.Cylinder, {"radius": SIZES, "length": SIZES}),
        "Motion.at": (Motion.at, {"self": MOTIONS, "t": st.floats(0.0, 1.0)}),
        "first_contact": (
            clamp3d.first_contact,
            {**way, "margin": one_of([0.0, 0.1, -0.1]), "resolution": one_of([None, 1e-3])},
        ),
        "min_clearance": (clamp3d.min_clearance, way),
        "arc_circle": (
            kernel.arc_circle,
            {**circle, "half_angle": st.floats(0.0, 3.2), "tolerance": TOLERANCES},
        ),
        "classify_arc_circle": (
            kernel.classify_arc_circle,
            {**circle, "gap": ANGLES, "half_angle": 1.0, "tolerance": TOLERANCES},
        ),
        "Rectangle": (
            kernel.Rectangle,
            {"x": ANGLES, "y": ANGLES, "half_width": SIZES, "half_height": SIZES, "angle": ANGLES},
        ),
        "hole_bolt": (kernel.hole_bolt, {"hole": RECTANGLES, "bolt": RECTANGLES, "tolerance": TOLERANCES}),
        "check_pose": (poses.check_pose, {"pose": any_pose()}),
        "rotation": (poses.rotation, {"axis": THREE, "angle": ANGLES}),
        "translation": (poses.translation, {"x": ANGLES, "y": ANGLES, "z": ANGLES}),
        "SectionPose": (poses.SectionPose, {"x": ANGLES, "y": ANGLES, "angle": ANGLES}),
        "pieces": (lambda self, pair, T_a_b: self.pieces(pair, T_a_b), {**of_model, "T_a_b": any_pose()}),
        "distances": (lambda self, pair, T_a_b: self.distances(pair, T_a_b), {**of_model, "T_a_b": few}),
        "Chords": (Chords, {"unit_angle": st.floats(0.0, 3.2)}),
        "make_mesh": (
            shapes.make_mesh,
            {"vertices": SIZES.map(lambda s: (s * np.array(FLAT)).tolist()), "faces": FACES, "float32": st.booleans()},
        ),
        "MeshShape": (shapes.MeshShape, {"mesh": tetrahedron, "fit": one_of(FITS)}),
        "Solid": (shapes.Solid, {"name": "s", "bodies": BOX.bodies}),
        "shapes.Hole": (shapes.Hole, {"radius": 3.0, "at": (1.0, 2.0), "axis": one_of(["y", "z"])}),
        "shapes.cylinder": (shapes.cylinder, {"radius": SIZES, "length": SIZES}),
        "shapes.box": (shapes.box, {"size": THREE.map(lambda x: (np.abs(x) + 0.1).tolist())}),
        "shapes.groove_block": (
            shapes.groove_block,
            {"groove": GROOVES, "width": SIZES.map(lambda s: 100.0 * s), "height": SIZES.map(lambda s: 100.0 * s)},
        ),
        "Scene": (clamp3d.Scene, {"parts": scene.parts, "contact": TOLERANCES, "clearance": one_of([0.0, 0.5])}),
        "Scene.of": (clamp3d.Scene.of, {"parts": any_pose().map(lambda T: {"a": (BOX, T)})}),
        "Scene.add": (scene.add, {"part": "a", "shape": BOX, "T_world": any_pose()}),
        "Scene.moved": (scene.moved, {"poses": any_pose().map(lambda T: {"wire": T})}),
        "Allowed": (Allowed, {"a": "block", "b": "w*", "overlap": one_of([0.0, 0.1])}),
        "load_scene": (load_scene, {"path": "no.toml"}),
        "Motion.translate": (Motion.translate, {"parts": "wire", "by": THREE}),
        "Motion.screw": (
            Motion.screw,
            {"parts": "wire", "axis": THREE, "angle": ANGLES, "point": THREE, "travel": ANGLES},
        ),
        "Motion.to_pose": (Motion.to_pose, {"parts": "wire", "to": any_pose()}),
        "check": (clamp3d.check, {"scene": rigid().map(lambda T: scene.moved({"wire": T})), "pairs": asked}),
        "Part": (clamp3d.Part, {"name": "a", "shape": BOX, "T_world": any_pose()}),
        "distance": (
            clamp3d.distance,
            {"a": block, "b": scene.parts[1].shape, "T_a_b": rigid()},
        ),
        "measure": (clamp3d.measure, {"scene": scene, "pairs": asked, "accuracy": 1e-3}),
        "check_poses": (check_poses, {"scene": scene, "part": "wire", "poses": few}),
        "load_clamp": (
            load_clamp,
            {"source": "reference", "line": one_of([None, "LJ-500", "20"]), "jumper": one_of([None, "16"])},
        ),
        "Wire": (Wire, {"diameter": st.floats(5.0, 50.0)}),
        **{f"replace {name}": _replacing(clamp, name) for name in ("line", "up_splint", "down_splint", "bolt", "nut")},
        "Section": (Section, {"clamp": clamp, "model": models}),
        "parts": (parts, {"clamp": clamp}),
        "measure_image": (
            measure_image,
            {"points": MARKS, "reference": MARKS, "reference_mm": SIZES, "kind": one_of(["height", "straight"])},
        ),
        "Placement": (Placement, {"clamp": clamp, "wire": one_of(["P6", "P7"]), "seat_tolerance": SIZES}),
    }
    slow: dict[str, Target] = {
        "Wedges": (Wedges, {"parts": solids, "unit_angle": st.floats(0.1, 3.2)}),
        "load_mesh": (shapes.load_mesh, {"path": "box.stl", "unit": one_of([None, "mm", "in"])}),
        "fit_file": (clamp3d.fit_file, {"path": "box.stl"}),
        "fit_mesh": (clamp3d.fit_mesh, {"mesh": tetrahedron}),
        "load": (clamp3d.load, {"source": one_of(["reference", "box.stl"]), "unit": one_of([None, "in"])}),
        "assemble": (assemble, {"clamp": clamp, "model": one_of([Cas(), Chords(0.2)]), "solver": "exact", "step": 2.0}),
        "mesh": (shapes.mesh, {"part": one_of(list(solids.values())), "mesh_error": one_of([0.5, 0.1])}),
        "export": (
            clamp3d.export,
            {
                "source": one_of([clamp, run, scene]),
                "path": "out",
                "format": one_of(["stl", "obj", "ply", "glb", "3mf"]),
                "mesh_error": 0.5,
                "names": one_of([None, ["P1"]]),
            },
        ),
        "Placement.close": (closing.close, {"misplacement": np.full((3, 4), 0.1)}),
        "Placement.cloud": (closing.cloud, {"ranges": {"offset": 1.0}, "count": 5, "seed": 0}),
    }
    slowest: dict[str, Target] = {
        "sensitivity": (clamp3d.sensitivity, {"clamp": clamp}),
        "monte_carlo": (clamp3d.monte_carlo, {"clamp": clamp, "n": one_of([1, 2]), "seed": 0, "processes": 1}),
        "equilibria": (equilibria, {"section": section}),
        "Placement.limits": (closing.limits, {"freedom": "offset", "reach": 5.0}),
        "placement": (clamp3d.placement, {"clamp": clamp, "ranges": {"offset": 1.0}, "wire": "P6", "samples": 5}),
        "report": (clamp3d.report, {"source": scene, "folder": "out"}),
        "view": (clamp3d.view, {"shown": scene, "serve": False, "mesh_error": 1.0}),
        "Viewer": (Viewer, {"clamp": clamp, "model": Cas(), "mesh_error": 1.0, "serve": False}),
        "image_study": (image_study, {"run": run, "count": 5, "seed": 0}),
        "save_figure": (figures.save_figure, {"figure": figures.section_figure(run), "path": "x.svg", "dpi": 50}),
        "section_figure": (figures.section_figure, {"run": run, "waypoint": one_of([None, run.path[1]])}),
        "states_figure": (figures.states_figure, {"run": run}),
        "contacts_figure": (figures.contacts_figure, {"run": run}),
        "contact_figure": (figures.contact_figure, {"run": run, "contact": run.contacts[0]}),
        "exploded_figure": (figures.exploded_figure, {"clamp": clamp}),
        "steps_figure": (figures.steps_figure, {"run": run}),
    }
    return (36, numbers), (55, small), (7, slow), (2, slowest)


def _replacing(clamp: Any, name: str) -> Target:
    """One part of the clamp with its own dimensions, to be given again."""
    part = getattr(clamp, name)

    def change(**values: Any) -> Any:
        return dataclasses.replace(clamp, **{name: dataclasses.replace(part, **values)})

    return change, {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
