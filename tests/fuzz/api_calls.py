"""Calls of everything public, most with one or two bad arguments; what answers is held to being finite and right."""

from __future__ import annotations

import dataclasses
import fractions
import functools
import math
import warnings
from collections.abc import Callable, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

import clamp3d
from clamp3d.assembly.run import assemble
from clamp3d.clamp.dimensions import Wire
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.loader import load_clamp
from clamp3d.contact.cas import Cas
from clamp3d.contact.chords import Chords
from clamp3d.contact.wedges import Wedges
from clamp3d.errors import Clamp3dError
from clamp3d.geometry import pose as poses
from clamp3d.scene import shapes
from clamp3d.scene.motion import Motion
from clamp3d.scene.scene import Allowed
from tests.fuzz import garbage
from tests.fuzz.runner import FindingError

Rng = np.random.Generator
Make = Callable[[Rng, Path], tuple[Callable[..., Any], dict[str, Any]]]

RESULTS = {
    "ArcContact",
    "Cas",
    "Equilibrium",
    "ArcRelation",
    "CheckResult",
    "Clearance",
    "CylinderFit",
    "Feature",
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
    "MotionContact",
    "PairResult",
    "PoseSweep",
    "Relation3D",
    "SignedDistance",
    "SignedDistances",
    "Verdict",
}
"""Public names that a user reads and does not call."""

_INFINITE = {"curvature", "gap_left", "gap_right", "gap", "high", "opening"}
"""Fields whose documented value is infinite where there is none."""


class _Odd:
    """No number, no array, no shape."""


def anything(rng: Rng, depth: int = 0) -> Any:
    """Any Python value."""
    way = rng.integers(10)
    if way <= 2:
        return garbage.pick(rng, garbage.NUMBERS)
    if way == 3:
        return garbage.pick(rng, garbage.TEXTS)
    if way == 4:
        return odd_array(rng)
    if way == 5 and depth < 2:
        return [anything(rng, depth + 1) for _ in range(rng.integers(5))]
    if way == 6 and depth < 2:
        return {garbage.pick(rng, ("P1", 1, None, "x")): anything(rng, depth + 1)}
    return garbage.pick(rng, _ODD)


_ODD: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    1,
    -1,
    7,
    2**31,
    2**63,
    10**400,
    -(10**400),
    1j,
    complex(7, 0),
    b"7",
    bytearray(b"x"),
    (),
    [],
    {},
    set(),
    frozenset({1}),
    range(3),
    object(),
    _Odd(),
    _Odd,
    len,
    Ellipsis,
    NotImplemented,
    slice(3),
    Decimal("7.5"),
    Decimal("NaN"),
    fractions.Fraction(7, 3),
    np.float32(7.0),
    np.float16(7.0),
    np.int8(7),
    np.uint64(2**63),
    np.bool_(True),
    np.complex128(7 + 1j),
    np.longdouble(7),
    np.datetime64("2020-01-01"),
    np.timedelta64(7, "s"),
    np.array(7.0),
    np.array([7.0]),
    np.array([]),
    np.array("7"),
    np.array(None),
    np.array([1, "x"], dtype=object),
    np.str_("7"),
    np.ma.masked,
    memoryview(b"abc"),
    Path("x"),
    ValueError("x"),
    clamp3d,
)


def odd_array(rng: Rng) -> Any:
    """An array or nested list of some shape and type."""
    shape = garbage.pick(
        rng,
        (
            (),
            (0,),
            (3,),
            (4,),
            (16,),
            (2, 3),
            (3, 3),
            (3, 4),
            (4, 4),
            (5, 5),
            (1, 4, 4),
            (0, 4, 4),
            (2, 4, 4),
            (4, 4, 2),
            (1, 1, 4, 4),
            (0, 3),
            (4, 0),
        ),
    )
    a = rng.normal(size=shape)
    way = rng.integers(12)
    if way == 0:
        return a.astype(np.float32)
    if way == 1:
        return a.astype(np.int64)
    if way == 2:
        return a.astype(object)
    if way == 3:
        return a + 1j
    if way == 4:
        return a.astype(str)
    if way == 5:
        return a.tolist()
    if way == 6:
        return np.where(a > 0, np.nan, a)
    if way == 7:
        return np.where(a > 0, np.inf, a)
    if way == 8:
        return np.full(shape, None)
    if way == 9:
        with np.errstate(all="ignore"):
            return a * garbage.pick(rng, garbage.NUMBERS)
    if way == 10:
        return a > 0
    return a


def rigid(rng: Rng, reach: float = 20.0) -> np.ndarray:
    """A rigid pose; a quarter turn in one of three."""
    T = poses.rotation(rng.normal(size=3), float(rng.uniform(-math.pi, math.pi)))
    if rng.integers(3) == 0:
        T = poses.rotation([[1, 0, 0], [0, 1, 0], [0, 0, 1]][int(rng.integers(3))], math.pi / 2).round()
    T[:3, 3] = rng.uniform(-reach, reach, 3)
    return T


def pose(rng: Rng) -> Any:
    """A pose, good in two of three, in some type and layout."""
    T = rigid(rng, 10.0 ** float(rng.uniform(-6, 9)) if rng.integers(4) == 0 else 20.0)
    return _layout(rng, T) if rng.integers(3) else _broken(rng, T)


def pose_batch(rng: Rng) -> Any:
    """Poses (n, 4, 4), good in two of three."""
    n = int(rng.choice([0, 1, 2, 7, 100], p=[0.1, 0.3, 0.3, 0.2, 0.1]))
    if rng.integers(300) == 0:
        n = 100_000
    T = np.array([rigid(rng) for _ in range(min(n, 7))]).reshape(-1, 4, 4)
    T = T[np.arange(n) % 7] if n else T
    if rng.integers(3):
        return _layout(rng, T)
    if n and rng.integers(2):
        k = int(rng.integers(n))
        bad = np.asarray(_broken(rng, T[k].copy(), shape=False))
        T = T.astype(bad.dtype) if bad.dtype.kind == "O" else T
        T[k] = bad
        return T
    return _broken(rng, T)


def _layout(rng: Rng, T: np.ndarray) -> Any:
    """The same numbers in another layout."""
    way = rng.integers(9)
    if way == 0:
        return np.asfortranarray(T)
    if way == 1:
        wide = np.zeros((*T.shape[:-1], 8))
        wide[..., ::2] = T
        return wide[..., ::2]
    if way == 2:
        T = T.copy()
        T.flags.writeable = False
        return T
    if way == 3:
        return T.tolist()
    if way == 4:
        return T.astype(object)
    if way == 5:
        return T.astype(">f8")
    if way == 6 and T.ndim == 2:
        return tuple(map(tuple, T))
    return T


def _broken(rng: Rng, T: np.ndarray, *, shape: bool = True) -> Any:
    way = rng.integers(14 if shape else 8)
    T = T.copy()
    if way == 0:
        T[..., :3, :3] *= float(rng.choice([2.0, 1.001, 1.0 + 1e-7, 0.0, -1.0, 1e-300, 1e200]))
    elif way == 1:
        T[..., :3, 0] *= -1.0
    elif way == 2:
        T[..., 0, 1] += float(rng.choice([1e-6, 0.1, 1e300]))
    elif way == 3:
        T[..., int(rng.integers(4)), int(rng.integers(4))] = garbage.pick(rng, garbage.NUMBERS)
    elif way == 4:
        T[..., 3, :] = rng.normal(size=4)
    elif way == 5:
        T[..., :3, 3] = float(rng.choice([1e99, 1e101, 1e155, 1e300]))
    elif way == 6:
        T[...] = np.nan
    elif way == 7:
        T[...] = 0.0
    elif way == 8:
        return T.astype(complex) + 1e-3j
    elif way == 9:
        return T.astype(str)
    elif way == 10:
        return T[..., :3]
    elif way == 11:
        return T.astype(np.float32)
    elif way == 12:
        return T[None]
    else:
        return odd_array(rng)
    return T


@functools.cache
def _clamp() -> Any:
    return load_clamp()


@functools.cache
def _run() -> Any:
    return assemble(_clamp(), Cas())


@functools.cache
def _models() -> tuple[Any, ...]:
    from clamp3d.clamp.meshes import mesh
    from clamp3d.contact.mesh import Mesh

    solids = clamp3d.parts(_clamp())
    return (
        Cas(),
        Chords(0.2),
        Wedges(solids, 0.2),
        Mesh({name: mesh(solids[name], 0.5) for name in ("P1", "P2", "P3")}),
    )


@functools.cache
def _scene() -> Any:
    block = shapes.groove_block(clamp3d.SweptArc(7.0, 1.0, 50.0), 40.0, 20.0)
    return clamp3d.Scene(clearance=0.5).add("block", block).add("wire", shapes.cylinder(6.5, 80.0))


_TETRAHEDRON = ([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@functools.cache
def _mesh() -> Any:
    return clamp3d.make_mesh(*_TETRAHEDRON)


def size(rng: Rng) -> float:
    """A length that is good, mostly an ordinary one."""
    return float(rng.uniform(1.0, 20.0)) if rng.integers(4) else 10.0 ** float(rng.uniform(-6, 6))


def _groove(rng: Rng) -> Any:
    return clamp3d.SweptArc(size(rng), float(rng.uniform(0.05, 3.1)), size(rng))


def _wire(rng: Rng) -> Any:
    return clamp3d.Cylinder(size(rng), size(rng))


def _motion(rng: Rng) -> Any:
    T = poses.translation(0.0, 40.0, 0.0) @ rigid(rng, 5.0)
    way = rng.integers(3)
    if way == 0:
        return clamp3d.Translation(T, rng.normal(size=3) * 40.0)
    if way == 1:
        return clamp3d.Rotation(T, rng.normal(size=3), rng.normal(size=3), float(rng.uniform(-7, 7)))
    return clamp3d.Screw(T, rng.normal(size=3), rng.normal(size=3), float(rng.uniform(-7, 7)), 30.0)


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
    return clamp3d.Rectangle(*rng.normal(size=2), size(rng), size(rng), float(rng.normal(0, 0.3)))


def targets() -> dict[str, tuple[float, Make]]:
    """Everything callable with how often it is called, by name."""
    c = clamp3d
    vertices, faces = _TETRAHEDRON
    return {
        "SweptArc": (5, _simple(c.SweptArc, radius=size, half_angle=lambda r: float(r.uniform(0, 3.2)), length=size)),
        "Cylinder": (3, _simple(c.Cylinder, radius=size, length=size)),
        "signed_distance": (20, _simple(c.signed_distance, groove=_groove, cylinder=_wire, pose=pose)),
        "signed_distances": (
            20,
            _simple(
                c.signed_distances,
                groove=_groove,
                cylinder=_wire,
                poses=pose_batch,
                full=_choice(True, False),
                workers=_choice(None, 1, 2),
            ),
        ),
        "groove_pieces": (10, _simple(c.groove_pieces, groove=_groove, cylinder=_wire, pose=pose)),
        "groove_relation": (
            10,
            _simple(c.groove_relation, groove=_groove, cylinder=_wire, pose=pose, tolerance=_tolerance),
        ),
        "relative_pose": (8, _simple(c.relative_pose, T_world_a=pose, T_world_b=pose)),
        "Translation": (5, _simple(c.Translation, start=pose, vector=_three)),
        "Rotation": (5, _simple(c.Rotation, start=pose, point=_three, axis=_three, angle=_angle)),
        "Screw": (5, _simple(c.Screw, start=pose, point=_three, axis=_three, angle=_angle, travel=_angle)),
        "Screw.pose": (3, lambda r, f: (_motion(r).pose, {"instant": float(r.random())})),
        "first_contact": (
            3,
            _simple(
                c.first_contact,
                groove=_groove,
                cylinder=_wire,
                motion=_motion,
                margin=_choice(0.0, 0.1, -0.1),
                resolution=_choice(None, 1e-3),
            ),
        ),
        "sweep": (2, _simple(c.sweep, groove=_groove, cylinder=_wire, motion=_motion, resolution=_choice(None, 1e-3))),
        "arc_circle": (
            8,
            _simple(
                c.arc_circle,
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
                c.classify_arc_circle,
                gap=_angle,
                arc_radius=size,
                half_angle=_fixed(1.0),
                circle_radius=size,
                x=_angle,
                y=_angle,
                tolerance=_tolerance,
            ),
        ),
        "Rectangle": (4, _simple(c.Rectangle, x=_angle, y=_angle, half_width=size, half_height=size, angle=_angle)),
        "hole_bolt": (5, _simple(c.hole_bolt, hole=_rectangle, bolt=_rectangle, tolerance=_tolerance)),
        "check_pose": (5, _simple(poses.check_pose, pose=pose)),
        "rotation": (4, _simple(poses.rotation, axis=_three, angle=_angle)),
        "translation": (3, _simple(poses.translation, x=_angle, y=_angle, z=_angle)),
        "SectionPose": (3, _simple(poses.SectionPose, x=_angle, y=_angle, angle=_angle)),
        "pieces": (8, _model_call("pieces")),
        "distances": (8, _model_call("distances")),
        "Chords": (1, _simple(Chords, unit_angle=lambda r: float(r.uniform(0, 3.2)))),
        "Wedges": (
            1,
            _simple(Wedges, parts=_fixed(c.parts(_clamp())), unit_angle=lambda r: float(r.uniform(0.1, 3.2))),
        ),
        "make_mesh": (
            8,
            _simple(
                c.make_mesh,
                vertices=lambda r: (np.array(vertices) * size(r)).tolist(),
                faces=_fixed(faces),
                name=_fixed("m"),
                scale=_choice(1.0, 1000.0),
                float32=_choice(True, False),
            ),
        ),
        "load_mesh": (1, lambda r, f: (c.load_mesh, {"path": _stl(f), "unit": garbage.pick(r, (None, "mm", "in"))})),
        "fit_file": (1, lambda r, f: (c.fit_file, {"path": _stl(f), "unit": None, "progress": None})),
        "fit_mesh": (2, _simple(c.fit_mesh, mesh=_fixed(_mesh()), progress=_fixed(None))),
        "MeshShape": (3, _simple(c.MeshShape, mesh=_fixed(_mesh()), fit=_choice(*shapes.FITS), name=_fixed("m"))),
        "Solid": (2, _simple(c.Solid, name=_fixed("s"), bodies=_fixed(shapes.box((1, 2, 3)).bodies), holes=_fixed(()))),
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
                c.Scene,
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
                c.Scene.of,
                {"parts": {"a": (shapes.box((1, 2, 3)), pose(r))}, "clearance": 0.0, "contact": 0.01},
            ),
        ),
        "Scene.add": (
            3,
            lambda r, f: (_scene().add, {"name": "a", "shape": shapes.box((1, 2, 3)), "T_world": pose(r)}),
        ),
        "Allowed": (2, _simple(Allowed, a=_fixed("block"), b=_fixed("w*"), overlap=_choice(0.0, 0.1))),
        "Scene.moved": (2, lambda r, f: (_scene().moved, {"poses": {"wire": pose(r)}})),
        "Scene.load": (1, lambda r, f: (c.Scene.load, {"path": "no.toml"})),
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
                c.check,
                {
                    "scene": _scene().moved({"wire": rigid(r)}),
                    "pairs": garbage.pick(r, (None, [("wire", "block")])),
                    "full": False,
                    "progress": None,
                    "workshop": None,
                },
            ),
        ),
        "sweep_poses": (
            2,
            lambda r, f: (
                c.sweep_poses,
                {"scene": _scene(), "part": "wire", "others": None, "poses": _few(pose_batch(r)), "workshop": None},
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
        "Wire": (1, lambda r, f: (Wire, {"diameter": float(r.uniform(5.0, 50.0))})),
        "replace": (3, _changed_clamp),
        "Section": (2, _simple(c.Section, clamp=_fixed(_clamp()), model=_choice(*_models()))),
        "equilibria": (0.1, _simple(c.equilibria, section=_fixed(c.Section(_clamp(), Cas())))),
        "parts": (2, _simple(c.parts, clamp=_fixed(_clamp()))),
        "mesh": (2, _simple(c.mesh, part=_choice(*c.parts(_clamp()).values()), mesh_error=_choice(0.5, 0.1))),
        "export": (
            2,
            lambda r, f: (
                c.export,
                {
                    "clamp": _clamp(),
                    "format": garbage.pick(r, ("stl", "obj", "ply", "glb", "3mf")),
                    "output": f / "out",
                    "poses": {n: _run().T_world(n) for n in _run().poses},
                    "state": "final",
                    "status": "clamped",
                    "layout": None,
                    "mesh_error": 0.5,
                    "unit": None,
                    "names": garbage.pick(r, (None, ["P1"])),
                },
            ),
        ),
        "WireClosing": (
            1,
            _simple(c.WireClosing, clamp=_fixed(_clamp()), wire=_choice("P6", "P7"), seat_tolerance=size),
        ),
        "WireClosing.close": (1, lambda r, f: (_closing().close, {"misplacement": 0.1 * r.normal(size=(3, 4))})),
        "WireClosing.cloud": (1, lambda r, f: (_closing().cloud, {"ranges": {"offset": 1.0}, "count": 5, "seed": 0})),
        "WireClosing.limits": (0.3, lambda r, f: (_closing().limits, {"freedom": "offset", "reach": 5.0})),
        "measure_image": (
            4,
            _simple(
                c.measure_image,
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
                c.image_study,
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
                c.Viewer,
                clamp=_fixed(_clamp()),
                model=_fixed(Cas()),
                mesh_error=_fixed(1.0),
                clearance=_fixed(5.0),
                overlays=_fixed(None),
                serve=_fixed(False),
                url=_fixed(None),
            ),
        ),
        "save_figure": (0.2, lambda r, f: (c.save_figure, {"figure": _figure(), "path": f / "x.svg", "dpi": 50})),
        "section_figure": (0.2, _simple(c.section_figure, run=_fixed(_run()), waypoint=_choice(None, _run().path[1]))),
        "states_figure": (0.1, _simple(c.states_figure, run=_fixed(_run()))),
        "contacts_figure": (0.1, _simple(c.contacts_figure, run=_fixed(_run()))),
        "contact_figure": (0.1, _simple(c.contact_figure, run=_fixed(_run()), contact=_fixed(_run().contacts[0]))),
        "exploded_figure": (0.1, _simple(c.exploded_figure, clamp=_fixed(_clamp()))),
        "steps_figure": (0.1, _simple(c.steps_figure, run=_fixed(_run()))),
        "table2_figure": (0.05, _simple(c.table2_figure)),
        "table3_figure": (0.05, _simple(c.table3_figure)),
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
    return clamp3d.WireClosing(_clamp())


@functools.cache
def _figure() -> Any:
    return clamp3d.table2_figure()


_TARGETS: dict[str, tuple[float, Make]] = {}


def make(rng: Rng, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A call, with none to three of its arguments spoilt."""
    if not _TARGETS:
        _TARGETS.update(targets())
    names = list(_TARGETS)
    weights = np.array([_TARGETS[name][0] for name in names])
    name = names[int(rng.choice(len(names), p=weights / weights.sum()))]
    function, arguments = _TARGETS[name][1](rng, folder)
    spoilt = []
    for _ in range(int(rng.choice([0, 1, 1, 1, 2, 3]))):
        key = garbage.pick(rng, list(arguments)) if arguments else "extra"
        way = rng.integers(30)
        if way == 0:
            arguments.pop(key, None)
            spoilt.append(f"no {key}")
            continue
        old = arguments.get(key)
        if isinstance(old, float) and way < 10:
            arguments[key] = garbage.near(rng, old)
        else:
            arguments[key] = anything(rng)
        if key == "progress" and callable(arguments[key]):  # what a user's own function raises is theirs
            arguments[key] = None
        spoilt.append(key)
    text = f"{name}({', '.join(f'{k}={v!r}'[:300] for k, v in arguments.items())})"

    def ask() -> bool:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            try:
                result = function(**arguments)
            except Clamp3dError as error:
                _clear(error)
                return False
            except TypeError as error:
                if error.__traceback__ is not None and error.__traceback__.tb_next is None:
                    return False  # a missing or an unknown argument: raised by the call itself
                raise
            finite(result, name)
            _right(name, arguments, result)
        return True

    return text, ask


def _clear(error: Clamp3dError) -> None:
    message = str(error)
    if not message.strip() or "\n" in message or len(message) > 1000:
        raise FindingError(f"message is not one clear line: {message[:300]!r}")


def finite(value: Any, where: str, depth: int = 0) -> None:
    """Raise FindingError for a NaN anywhere in an answer, and an infinity where none is documented."""
    if depth > 6 or isinstance(value, (str, bytes, type)) or value is None:
        return
    if (isinstance(value, np.ndarray) and value.dtype.kind == "f") or isinstance(value, (float, np.floating)):
        allowed = where.rsplit(".", 1)[-1] in _INFINITE
        bad = np.isnan(value) if allowed else ~np.isfinite(value)
        if np.any(bad):
            raise FindingError(f"{where} is not finite: {np.asarray(value).tolist() if np.size(value) < 20 else '...'}")
    elif isinstance(value, Mapping):
        for key, item in value.items():
            finite(item, f"{where}[{key!r}]", depth + 1)
    elif isinstance(value, (list, tuple)):
        for item in value:
            finite(item, where, depth + 1)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            finite(getattr(value, field.name), f"{where}.{field.name}", depth + 1)


def _right(name: str, arguments: dict[str, Any], result: Any) -> None:
    """Checks of answers where one is at hand: plain float64 inputs must give the same."""
    if name in ("signed_distance", "groove_pieces") and "pose" in arguments:
        plain = np.array(arguments["pose"], dtype=np.float64)
        if _off(plain) > 1e-8:
            raise FindingError(f"answered for a pose that is not rigid by {_off(plain):.3g}")
        groove, wire = arguments["groove"], arguments["cylinder"]
        again = clamp3d.signed_distance(groove, wire, plain)
        if name == "signed_distance" and again.distance != result.distance:
            raise FindingError(f"distance {result.distance!r}, for the same numbers in float64 {again.distance!r}")
        if name == "signed_distance":
            gap = result.point_on_groove + result.distance * result.normal - result.point_on_cylinder
            scale = max(1.0, float(np.abs(plain[:3, 3]).max()), wire.length, groove.length, groove.radius, wire.radius)
            if not np.abs(gap).max() <= 1e-9 * scale or not abs(np.linalg.norm(result.normal) - 1.0) < 1e-9:
                raise FindingError(f"witness points do not fit the distance: {gap.tolist()}")
    elif name == "signed_distances" and "poses" in arguments:
        plain = np.array(arguments["poses"], dtype=np.float64)
        found = result.distance if arguments.get("full") else result
        if len(found) != len(plain):
            raise FindingError(f"{len(found)} answers for {len(plain)} poses")
        for k in range(0, len(plain), max(1, len(plain) // 3)):
            if _off(plain[k]) > 1e-8:
                raise FindingError(f"answered for a pose that is not rigid by {_off(plain[k]):.3g}")
            one = clamp3d.signed_distance(arguments["groove"], arguments["cylinder"], plain[k])
            if one.distance != found[k]:
                raise FindingError(f"poses[{k}]: {found[k]!r} in the batch, {one.distance!r} alone")
    elif name in ("check_pose", "relative_pose") and _off(result) > 1e-8:
        raise FindingError(f"the result is not rigid by {_off(result):.3g}")
    elif name in ("SweptArc", "Cylinder"):
        for field in dataclasses.fields(result):
            if type(getattr(result, field.name)) is not float:
                raise FindingError(f"{field.name} is kept as {type(getattr(result, field.name)).__name__}")


def _off(T: np.ndarray) -> float:
    R = T[:3, :3]
    off = float(np.abs(R @ R.T - np.eye(3)).max())
    return off if np.linalg.det(R) > 0.0 else math.inf
