"""Calls of public functions with one to three bad arguments: a clear refusal, or an answer that is finite and right."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import clamp3d
from clamp3d import kernel, shapes
from clamp3d.errors import Clamp3dError
from clamp3d.kernel import translation
from tests.fuzz.cli_calls import FindingError
from tests.fuzz.values import ANYTHING, Draw, any_pose, near, pick, pose_batch, rigid

_INFINITE = {"curvature", "gap_left", "gap_right", "gap", "high", "least", "lower", "opening", "upper", "uncertainty"}
"""Fields whose documented value is infinite where there is none."""

Target = tuple[Callable[..., Any], dict[str, Any]]
"""A function, and its arguments or strategies for them; what has a default and is not named gets that."""

SIZES = st.floats(1.0, 20.0) | st.floats(-6.0, 6.0).map(lambda x: 10.0**x)
ANGLES = st.floats(-4.0, 4.0)
THREE = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3)
GROOVES = st.builds(kernel.SweptArc, SIZES, st.floats(0.05, 3.1), SIZES)
WIRES = st.builds(kernel.Cylinder, SIZES, SIZES) | st.builds(kernel.Capsule, SIZES, SIZES)
MOTIONS = THREE.filter(lambda x: np.linalg.norm(x) > 1e-3).map(lambda x: clamp3d.Motion.translate(40.0 * np.array(x)))
FLAT = [[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]]
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


@functools.cache
def targets() -> dict[str, Target]:
    """What is called by name, with good arguments."""
    box, block = shapes.box((1, 2, 3)), shapes.groove_block(kernel.SweptArc(7.0, 1.0, 50.0), 40.0, 20.0)
    scene = clamp3d.Scene(clearance=0.5).add("block", block).add("wire", shapes.cylinder(6.5, 80.0))
    tetrahedron = shapes.make_mesh(FLAT, FACES)
    pair: dict[str, Any] = {"groove": GROOVES, "cylinder": WIRES}
    above = rigid(5.0).map(lambda T: translation(0.0, 40.0, 0.0) @ T)
    way: dict[str, Any] = {"a": GROOVES, "b": WIRES, "motion": MOTIONS, "T_a_b": above}
    few = pose_batch().map(lambda T: T[:5] if isinstance(T, np.ndarray) and T.ndim else T)
    return {
        "signed_distance": (kernel.signed_distance, {**pair, "pose": any_pose()}),
        "signed_distances": (kernel.signed_distances, {**pair, "poses": pose_batch()}),
        "groove_pieces": (kernel.groove_pieces, {**pair, "pose": any_pose()}),
        "groove_relation": (kernel.groove_relation, {**pair, "pose": any_pose()}),
        "relative_pose": (kernel.relative_pose, {"T_world_a": any_pose(), "T_world_b": any_pose()}),
        "SweptArc": (kernel.SweptArc, {"radius": SIZES, "half_angle": st.floats(0.0, 3.2), "length": SIZES}),
        "Cylinder": (kernel.Cylinder, {"radius": SIZES, "length": SIZES}),
        "first_contact": (clamp3d.first_contact, way),
        "min_clearance": (clamp3d.min_clearance, way),
        "make_mesh": (
            shapes.make_mesh,
            {"vertices": SIZES.map(lambda s: (s * np.array(FLAT)).tolist()), "faces": FACES},
        ),
        "MeshShape": (shapes.MeshShape, {"mesh": tetrahedron}),
        "Hole": (shapes.Hole, {"radius": 3.0, "at": (1.0, 2.0), "axis": st.sampled_from(["y", "z"])}),
        "box": (shapes.box, {"size": THREE.map(lambda x: (np.abs(x) + 0.1).tolist())}),
        "groove_block": (
            shapes.groove_block,
            {"groove": GROOVES, "width": SIZES.map(lambda s: 9 * s), "height": SIZES},
        ),
        "Scene": (clamp3d.Scene, {"parts": scene.parts, "contact": SIZES, "clearance": SIZES}),
        "Scene.add": (scene.add, {"part": "a", "shape": box, "T_world": any_pose()}),
        "Scene.moved": (scene.moved, {"poses": any_pose().map(lambda T: {"wire": T})}),
        "Motion.screw": (clamp3d.Motion.screw, {"parts": "wire", "axis": THREE, "angle": ANGLES, "point": THREE}),
        "Motion.to_pose": (clamp3d.Motion.to_pose, {"parts": "wire", "to": any_pose()}),
        "check": (clamp3d.check, {"scene": rigid().map(lambda T: scene.moved({"wire": T}))}),
        "check_poses": (clamp3d.check_poses, {"scene": scene, "part": "wire", "poses": few}),
        "distance": (clamp3d.distance, {"a": block, "b": box, "T_a_b": rigid()}),
        "load": (clamp3d.load, {"source": st.sampled_from(["reference", "box.stl"]), "unit": None}),
        "load_mesh": (shapes.load_mesh, {"path": "box.stl", "unit": st.sampled_from([None, "mm", "in"])}),
        "load_clamp": (clamp3d.load_clamp, {"source": "reference", "line": st.sampled_from([None, "LJ-500", "20"])}),
    }


def make(draw: Draw, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A call, with none to three of its arguments spoilt."""
    name = pick(draw, *targets())
    function, good = targets()[name]
    defaults = {p.name: p.default for p in inspect.signature(function).parameters.values() if p.default is not p.empty}
    arguments = {**defaults, **good}
    for key, value in arguments.items():
        arguments[key] = draw(value) if isinstance(value, st.SearchStrategy) else value
    for key in draw(st.lists(st.sampled_from([*arguments, "extra"]), max_size=3)):
        value = arguments.get(key)
        close = isinstance(value, float) and draw(st.booleans())
        arguments[key] = near(draw, value) if close else draw(ANYTHING)
    if callable(arguments.get("progress")):  # what a user's own function raises is theirs
        arguments["progress"] = None
    if "box.stl" in map(str, arguments.values()):
        import trimesh

        trimesh.creation.box((10.0, 8.0, 6.0)).export(folder / "box.stl")
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
            if name == "signed_distance":
                _right(arguments, result)
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
        if np.any(np.isnan(value) if allowed else ~np.isfinite(value)):
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


def _right(arguments: dict[str, Any], result: Any) -> None:
    """The pose is rigid, plain float64 gives the same, and the points are that far apart."""
    T, groove, wire = np.array(arguments["pose"], dtype=np.float64), arguments["groove"], arguments["cylinder"]
    R = T[:3, :3]
    off = float(np.abs(R @ R.T - np.eye(3)).max()) if np.linalg.det(R) > 0.0 else math.inf
    if off > 2e-4:
        raise FindingError(f"answered for a pose that is not rigid by {off:.3g}")
    again = kernel.signed_distance(groove, wire, T)
    if again.distance != result.distance:
        raise FindingError(f"distance {result.distance!r}, for the same numbers in float64 {again.distance!r}")
    gap = result.point_on_groove + result.distance * result.normal - result.point_on_cylinder
    scale = max(1.0, float(np.abs(T[:3, 3]).max()), wire.length, groove.length, groove.radius, wire.radius)
    if not np.abs(gap).max() <= 1e-9 * scale or not abs(np.linalg.norm(result.normal) - 1.0) < 1e-9:
        raise FindingError(f"witness points do not fit the distance: {gap.tolist()}")
