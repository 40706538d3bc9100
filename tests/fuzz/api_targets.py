"""Everything public that a user calls, with good arguments for it."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import clamp3d
from clamp3d import figures, kernel, shapes
from clamp3d.baselines.cas import Cas
from clamp3d.baselines.chords import Chords
from clamp3d.baselines.wedges import Wedges
from clamp3d.bench.image import image_study, measure_image
from clamp3d.bench.legends import table2_figure, table3_figure
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import Wire
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.clamp.placement import Placement
from clamp3d.clamp.section import Section
from clamp3d.collide.poses import check_poses
from clamp3d.collide.scene import Allowed
from clamp3d.core import pose as poses
from clamp3d.core.motion import Motion
from clamp3d.core.shapes import FITS
from clamp3d.output.viewer import Viewer
from clamp3d.scenefile.file import load_scene
from tests.fuzz import garbage
from tests.fuzz.api_values import Rng, pose, pose_batch, rigid

Make = Callable[[Rng, Path], tuple[Callable[..., Any], dict[str, Any]]]

RESULTS = {
    "ArcContact",
    "Assembly",
    "Cas",
    "Clamp",
    "Distance",
    "Mesh",
    "baselines",
    "bench",
    "figures",
    "kernel",
    "shapes",
    "testing",
    "Equilibrium",
    "ArcRelation",
    "CheckResult",
    "CylinderFit",
    "Distances",
    "Feature",
    "GeneralisedGradient",
    "FitResult",
    "GrooveFit",
    "GroovePieces",
    "GrooveRelation",
    "HoleContact",
    "HoleFit",
    "HoleRelation",
    "ImageMeasurement",
    "ImageStudy",
    "InputError",
    "MotionDistance",
    "PairResult",
    "PoseVerdicts",
    "Relation3D",
    "SignedDistance",
    "SignedDistances",
    "Verdict",
}
"""Public names that a user reads and does not call."""


@functools.cache
def _clamp() -> Any:
    return load_clamp()


@functools.cache
def _run() -> Any:
    return assemble(_clamp(), Cas())


@functools.cache
def _models() -> tuple[Any, ...]:
    from clamp3d.baselines.meshes import Meshes
    from clamp3d.core.meshing import mesh

    solids = parts(_clamp())
    return (
        Cas(),
        Chords(0.2),
        Wedges(solids, 0.2),
        Meshes({name: mesh(solids[name], 0.5) for name in ("P1", "P2", "P3")}),
    )


@functools.cache
def _scene() -> Any:
    block = shapes.groove_block(kernel.SweptArc(7.0, 1.0, 50.0), 40.0, 20.0)
    return clamp3d.Scene(clearance=0.5).add("block", block).add("wire", shapes.cylinder(6.5, 80.0))


_TETRAHEDRON = ([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@functools.cache
def _mesh() -> Any:
    return shapes.make_mesh(*_TETRAHEDRON)


def size(rng: Rng) -> float:
    """A length that is good, mostly an ordinary one."""
    return float(rng.uniform(1.0, 20.0)) if rng.integers(4) else 10.0 ** float(rng.uniform(-6, 6))


def _groove(rng: Rng) -> Any:
    return kernel.SweptArc(size(rng), float(rng.uniform(0.05, 3.1)), size(rng))


def _wire(rng: Rng) -> Any:
    return (kernel.Cylinder if rng.random() < 0.5 else kernel.Capsule)(size(rng), size(rng))


def _motion(rng: Rng) -> Any:
    way = rng.integers(3)
    if way == 0:
        return Motion.translate(rng.normal(size=3) * 40.0)
    travel = 30.0 * float(way - 1)
    return Motion.screw(rng.normal(size=3), float(rng.uniform(-7, 7)), point=rng.normal(size=3), travel=travel)


def _above(rng: Rng) -> Any:
    return poses.translation(0.0, 40.0, 0.0) @ rigid(rng, 5.0)


def _marks(rng: Rng) -> Any:
    return rng.uniform(0.0, 500.0, (2, 2))


def _three(rng: Rng) -> Any:
    return rng.normal(size=3).tolist()


def _stl(folder: Path) -> Path:
    import trimesh

    trimesh.creation.box((10.0, 8.0, 6.0)).export(folder / "box.stl")
    return folder / "box.stl"


def _model_call(name: str) -> Make:
    def make(rng: Rng, folder: Path) -> Any:
        model = garbage.pick(rng, _models())
        pair = garbage.pick(rng, list(groove_pairs(_clamp()).values())[:4])
        first = _run().T_world(pair.a)
        T = np.linalg.inv(first) @ _run().T_world(pair.b)
        T[:3, :3], T[:3, 3] = np.round(T[:3, :3], 15), T[:3, 3] + rng.normal(size=3)
        many = name == "distances"
        value = pose_batch(rng) if many else pose(rng)
        if rng.integers(2):
            value = np.array([T] * 3) if many else T
        if many and np.size(value) > 200:
            value = value[:10]
        return getattr(model, name), {"pair": pair, "T_a_b": value}

    return make


def _simple(function: Callable[..., Any], **makers: Callable[[Rng], Any]) -> Make:
    return lambda rng, folder: (function, {name: maker(rng) for name, maker in makers.items()})


def _angle(rng: Rng) -> float:
    return float(rng.uniform(-4.0, 4.0))


def _tolerance(rng: Rng) -> float:
    return float(rng.choice([0.0, 1e-9, 1e-6, 1e-3]))


def _fixed(value: Any) -> Callable[[Rng], Any]:
    return lambda rng: value


def _choice(*values: Any) -> Callable[[Rng], Any]:
    return lambda rng: garbage.pick(rng, values)


def _rectangle(rng: Rng) -> Any:
    return kernel.Rectangle(*rng.normal(size=2), size(rng), size(rng), float(rng.normal(0, 0.3)))


def targets() -> dict[str, tuple[float, Make]]:
    """Everything callable with how often it is called, by name."""
    vertices, faces = _TETRAHEDRON
    return {
        "SweptArc": (
            5,
            _simple(kernel.SweptArc, radius=size, half_angle=lambda r: float(r.uniform(0, 3.2)), length=size),
        ),
        "Capsule": (1, _simple(kernel.Capsule, radius=size, length=size)),
        "Cylinder": (3, _simple(kernel.Cylinder, radius=size, length=size)),
        "generalised_gradient": (
            5,
            _simple(kernel.generalised_gradient, groove=_groove, cylinder=_wire, pose=pose),
        ),
        "signed_distance": (20, _simple(kernel.signed_distance, groove=_groove, cylinder=_wire, pose=pose)),
        "signed_distances": (
            20,
            _simple(
                kernel.signed_distances,
                groove=_groove,
                cylinder=_wire,
                poses=pose_batch,
                full=_choice(True, False),
                workers=_choice(None, 1, 2),
            ),
        ),
        "groove_pieces": (10, _simple(kernel.groove_pieces, groove=_groove, cylinder=_wire, pose=pose)),
        "groove_relation": (
            10,
            _simple(kernel.groove_relation, groove=_groove, cylinder=_wire, pose=pose, tolerance=_tolerance),
        ),
        "relative_pose": (8, _simple(kernel.relative_pose, T_world_a=pose, T_world_b=pose)),
        "Motion.at": (3, lambda r, f: (_motion(r).at, {"t": float(r.random())})),
        "first_contact": (
            3,
            _simple(
                clamp3d.first_contact,
                a=_groove,
                b=_wire,
                motion=_motion,
                T_a_b=_above,
                margin=_choice(0.0, 0.1, -0.1),
                resolution=_choice(None, 1e-3),
            ),
        ),
        "min_clearance": (2, _simple(clamp3d.min_clearance, a=_groove, b=_wire, motion=_motion, T_a_b=_above)),
        "arc_circle": (
            8,
            _simple(
                kernel.arc_circle,
                arc_radius=size,
                half_angle=lambda r: float(r.uniform(0, 3.2)),
                circle_radius=size,
                x=_angle,
                y=_angle,
                tolerance=_tolerance,
            ),
        ),
        "classify_arc_circle": (
            4,
            _simple(
                kernel.classify_arc_circle,
                gap=_angle,
                arc_radius=size,
                half_angle=_fixed(1.0),
                circle_radius=size,
                x=_angle,
                y=_angle,
                tolerance=_tolerance,
            ),
        ),
        "Rectangle": (
            4,
            _simple(kernel.Rectangle, x=_angle, y=_angle, half_width=size, half_height=size, angle=_angle),
        ),
        "hole_bolt": (5, _simple(kernel.hole_bolt, hole=_rectangle, bolt=_rectangle, tolerance=_tolerance)),
        "check_pose": (5, _simple(poses.check_pose, pose=pose)),
        "rotation": (4, _simple(poses.rotation, axis=_three, angle=_angle)),
        "translation": (3, _simple(poses.translation, x=_angle, y=_angle, z=_angle)),
        "SectionPose": (3, _simple(poses.SectionPose, x=_angle, y=_angle, angle=_angle)),
        "pieces": (8, _model_call("pieces")),
        "distances": (8, _model_call("distances")),
        "Chords": (1, _simple(Chords, unit_angle=lambda r: float(r.uniform(0, 3.2)))),
        "Wedges": (
            1,
            _simple(Wedges, parts=_fixed(parts(_clamp())), unit_angle=lambda r: float(r.uniform(0.1, 3.2))),
        ),
        "make_mesh": (
            8,
            _simple(
                shapes.make_mesh,
                vertices=lambda r: (np.array(vertices) * size(r)).tolist(),
                faces=_fixed(faces),
                name=_fixed("m"),
                scale=_choice(1.0, 1000.0),
                float32=_choice(True, False),
            ),
        ),
        "load_mesh": (
            1,
            lambda r, f: (shapes.load_mesh, {"path": _stl(f), "unit": garbage.pick(r, (None, "mm", "in"))}),
        ),
        "fit_file": (1, lambda r, f: (clamp3d.fit_file, {"path": _stl(f), "unit": None, "progress": None})),
        "fit_mesh": (2, _simple(clamp3d.fit_mesh, mesh=_fixed(_mesh()), progress=_fixed(None))),
        "MeshShape": (
            3,
            _simple(shapes.MeshShape, mesh=_fixed(_mesh()), fit=_choice(*FITS), name=_fixed("m")),
        ),
        "Solid": (
            2,
            _simple(shapes.Solid, name=_fixed("s"), bodies=_fixed(shapes.box((1, 2, 3)).bodies), holes=_fixed(())),
        ),
        "shapes.Hole": (
            2,
            lambda r, f: (shapes.Hole, {"radius": 3.0, "at": (1.0, 2.0), "axis": garbage.pick(r, ("y", "z"))}),
        ),
        "shapes.cylinder": (3, _simple(shapes.cylinder, radius=size, length=size, bore=_fixed(0.0), name=_fixed("c"))),
        "shapes.box": (
            3,
            _simple(shapes.box, size=lambda r: [size(r) for _ in range(3)], holes=_fixed(()), name=_fixed("b")),
        ),
        "shapes.groove_block": (
            3,
            _simple(
                shapes.groove_block,
                groove=_groove,
                width=lambda r: 100.0 * size(r),
                height=lambda r: 100.0 * size(r),
                others=_fixed(()),
                holes=_fixed(()),
            ),
        ),
        "Scene": (
            4,
            _simple(
                clamp3d.Scene,
                parts=_fixed(_scene().parts),
                contact=_tolerance,
                clearance=_choice(0.0, 0.5),
                allowed=_fixed(()),
                motions=_fixed(()),
                name=_fixed("s"),
            ),
        ),
        "Scene.of": (
            2,
            lambda r, f: (
                clamp3d.Scene.of,
                {"parts": {"a": (shapes.box((1, 2, 3)), pose(r))}, "clearance": 0.0, "contact": 0.01},
            ),
        ),
        "Scene.add": (
            3,
            lambda r, f: (_scene().add, {"part": "a", "shape": shapes.box((1, 2, 3)), "T_world": pose(r)}),
        ),
        "Allowed": (2, _simple(Allowed, a=_fixed("block"), b=_fixed("w*"), overlap=_choice(0.0, 0.1))),
        "Scene.moved": (2, lambda r, f: (_scene().moved, {"poses": {"wire": pose(r)}})),
        "load_scene": (1, lambda r, f: (load_scene, {"path": "no.toml"})),
        "Motion.translate": (2, _simple(Motion.translate, parts=_fixed("wire"), by=_three, name=_fixed("m"))),
        "Motion.screw": (
            2,
            _simple(
                Motion.screw,
                parts=_fixed("wire"),
                axis=_three,
                angle=_angle,
                point=_three,
                travel=_angle,
                name=_fixed("m"),
            ),
        ),
        "Motion.to_pose": (2, _simple(Motion.to_pose, parts=_fixed("wire"), to=pose, name=_fixed("m"))),
        "check": (
            2,
            lambda r, f: (
                clamp3d.check,
                {
                    "scene": _scene().moved({"wire": rigid(r)}),
                    "pairs": garbage.pick(r, (None, [("wire", "block")])),
                    "full": False,
                    "distances": False,
                    "progress": None,
                    "cache": None,
                },
            ),
        ),
        "Part": (3, lambda r, f: (clamp3d.Part, {"name": "a", "shape": shapes.box((1, 2, 3)), "T_world": pose(r)})),
        "distance": (
            2,
            lambda r, f: (
                clamp3d.distance,
                {"a": _scene().parts[0].shape, "b": shapes.cylinder(6.5, 80.0), "T_a_b": rigid(r), "accuracy": 1e-3},
            ),
        ),
        "measure": (
            1,
            lambda r, f: (
                clamp3d.measure,
                {"scene": _scene(), "pairs": garbage.pick(r, (None, [("wire", "block")])), "accuracy": 1e-3},
            ),
        ),
        "check_poses": (
            2,
            lambda r, f: (
                check_poses,
                {"scene": _scene(), "part": "wire", "others": None, "poses": _few(pose_batch(r)), "cache": None},
            ),
        ),
        "load_clamp": (
            3,
            lambda r, f: (
                load_clamp,
                {
                    "source": "reference",
                    "line": garbage.pick(r, (None, "LJ-500", "20")),
                    "jumper": garbage.pick(r, (None, "16")),
                },
            ),
        ),
        "assemble": (
            1,
            _simple(
                assemble,
                clamp=_fixed(_clamp()),
                model=_choice(*_models()[:2]),
                solver=_fixed("exact"),
                step=_fixed(2.0),
                tilt_step=_fixed(0.1),
                open_by=_choice(0.0, 3.0),
                open_tilt=_choice(0.0, 0.05),
            ),
        ),
        "load": (
            2,
            lambda r, f: (
                clamp3d.load,
                {
                    "source": garbage.pick(r, ("reference", _stl(f))),
                    "line": garbage.pick(r, (None, "LJ-500")),
                    "jumper": None,
                    "unit": garbage.pick(r, (None, "in")),
                },
            ),
        ),
        "sensitivity": (0.2, _simple(clamp3d.sensitivity, clamp=_fixed(_clamp()))),
        "monte_carlo": (
            0.2,
            _simple(
                clamp3d.monte_carlo,
                clamp=_fixed(_clamp()),
                n=_choice(1, 2),
                seed=_fixed(0),
                tolerance=_choice(None, 0.1),
                wire_tolerance_percent=_fixed(1.0),
                distribution=_choice("uniform", "normal"),
                processes=_fixed(1),
            ),
        ),
        "Wire": (1, lambda r, f: (Wire, {"diameter": float(r.uniform(5.0, 50.0))})),
        "replace": (3, _changed_clamp),
        "Section": (2, _simple(Section, clamp=_fixed(_clamp()), model=_choice(*_models()))),
        "equilibria": (0.1, _simple(equilibria, section=_fixed(Section(_clamp(), Cas())))),
        "parts": (2, _simple(parts, clamp=_fixed(_clamp()))),
        "mesh": (
            2,
            _simple(shapes.mesh, part=_choice(*parts(_clamp()).values()), mesh_error=_choice(0.5, 0.1)),
        ),
        "export": (
            2,
            lambda r, f: (
                clamp3d.export,
                {
                    "source": garbage.pick(r, (_clamp(), _run(), _scene())),
                    "path": f / "out",
                    "format": garbage.pick(r, ("stl", "obj", "ply", "glb", "3mf")),
                    "layout": None,
                    "state": None,
                    "mesh_error": 0.5,
                    "unit": None,
                    "names": garbage.pick(r, (None, ["P1"])),
                },
            ),
        ),
        "Placement": (
            1,
            _simple(Placement, clamp=_fixed(_clamp()), wire=_choice("P6", "P7"), seat_tolerance=size),
        ),
        "Placement.close": (1, lambda r, f: (_closing().close, {"misplacement": 0.1 * r.normal(size=(3, 4))})),
        "Placement.cloud": (1, lambda r, f: (_closing().cloud, {"ranges": {"offset": 1.0}, "count": 5, "seed": 0})),
        "Placement.limits": (0.3, lambda r, f: (_closing().limits, {"freedom": "offset", "reach": 5.0})),
        "placement": (
            0.3,
            _simple(
                clamp3d.placement,
                clamp=_fixed(_clamp()),
                ranges=_choice({"offset": 1.0}, {"yaw": 0.01}),
                wire=_choice("P6", "P7"),
                seat_tolerance=_fixed(0.5),
                samples=_fixed(5),
                seed=_fixed(0),
            ),
        ),
        "report": (
            0.1,
            lambda r, f: (clamp3d.report, {"source": _scene(), "folder": f / "out", "clearance": None}),
        ),
        "view": (0.2, _simple(clamp3d.view, shown=_fixed(_scene()), serve=_fixed(False), mesh_error=_fixed(1.0))),
        "measure_image": (
            4,
            _simple(
                measure_image,
                points=_marks,
                reference=_marks,
                reference_mm=size,
                kind=_choice("height", "straight"),
                marking_error=_choice(4.5, 0.0),
                calliper_error=_fixed(0.02),
            ),
        ),
        "image_study": (
            0.3,
            _simple(
                image_study,
                run=_fixed(_run()),
                count=_fixed(5),
                px_per_mm=_fixed(4.0),
                seed=_fixed(1),
                kind=_choice("height", "straight"),
            ),
        ),
        "Viewer": (
            0.2,
            _simple(
                Viewer,
                clamp=_fixed(_clamp()),
                model=_fixed(Cas()),
                mesh_error=_fixed(1.0),
                clearance=_fixed(5.0),
                overlays=_fixed(None),
                serve=_fixed(False),
                url=_fixed(None),
            ),
        ),
        "save_figure": (
            0.2,
            lambda r, f: (figures.save_figure, {"figure": _figure(), "path": f / "x.svg", "dpi": 50}),
        ),
        "section_figure": (
            0.2,
            _simple(figures.section_figure, run=_fixed(_run()), waypoint=_choice(None, _run().path[1])),
        ),
        "states_figure": (0.1, _simple(figures.states_figure, run=_fixed(_run()))),
        "contacts_figure": (0.1, _simple(figures.contacts_figure, run=_fixed(_run()))),
        "contact_figure": (
            0.1,
            _simple(figures.contact_figure, run=_fixed(_run()), contact=_fixed(_run().contacts[0])),
        ),
        "exploded_figure": (0.1, _simple(figures.exploded_figure, clamp=_fixed(_clamp()))),
        "steps_figure": (0.1, _simple(figures.steps_figure, run=_fixed(_run()))),
        "table2_figure": (0.05, _simple(table2_figure)),
        "table3_figure": (0.05, _simple(table3_figure)),
    }


def _changed_clamp(rng: Rng, folder: Path) -> tuple[Callable[..., Any], dict[str, Any]]:
    """One part of the clamp with its own dimensions, to be given again."""
    name = garbage.pick(rng, ("line", "up_splint", "down_splint", "saddle", "bolt", "nut"))
    part = getattr(_clamp(), name)
    values = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}

    def change(**values: Any) -> Any:
        return dataclasses.replace(_clamp(), **{name: dataclasses.replace(part, **values)})

    return change, values


def _few(value: Any) -> Any:
    return value[:5] if isinstance(value, np.ndarray) and value.ndim and len(value) > 5 else value


@functools.cache
def _closing() -> Any:
    return Placement(_clamp())


@functools.cache
def _figure() -> Any:
    return table2_figure()
