"""Public functions and command lines with bad arguments: an answer without NaN, or a refusal in one line."""

import dataclasses
import inspect
import re
import warnings
from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import clamp3d
from clamp3d import cli, kernel, shapes
from clamp3d.errors import Clamp3dError
from tests.fuzz.rules import OLD, assert_outputs, call, examples, new_folder
from tests.fuzz.samples import SCENE, TETRA
from tests.fuzz.spoil import ANYTHING, any_pose, near, pick
from tests.kinds import poses

_INFINITE = {"curvature", "gap_left", "gap_right", "gap", "high", "least", "lower", "opening", "upper", "uncertainty"}
"""Fields whose documented value is infinite where there is none."""

SIZES = st.floats(1.0, 20.0) | st.floats(-6.0, 6.0).map(lambda x: 10.0**x)
THREE = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3)
GROOVES = st.builds(kernel.SweptArc, SIZES, st.floats(0.05, 3.1), SIZES)
WIRES = st.builds(kernel.Cylinder, SIZES, SIZES) | st.builds(kernel.Capsule, SIZES, SIZES)
MOTIONS = THREE.filter(lambda x: np.linalg.norm(x) > 1e-3).map(lambda x: clamp3d.Motion.translate(40.0 * np.array(x)))
FLAT = [[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]]
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]

BOX, BLOCK = shapes.box((1, 2, 3)), shapes.groove_block(kernel.SweptArc(7.0, 1.0, 50.0), 40.0, 20.0)
BLOCK_AND_WIRE = clamp3d.Scene(clearance=0.5).add("block", BLOCK).add("wire", shapes.cylinder(6.5, 80.0))
WAY = {"a": GROOVES, "b": WIRES, "motion": MOTIONS, "T_a_b": kernel.translation(0.0, 40.0, 0.0)}
POSES = st.lists(poses(20.0), max_size=5).map(lambda some: np.array(some).reshape(-1, 4, 4)) | any_pose()
TARGETS = [
    (kernel.signed_distance, {"groove": GROOVES, "cylinder": WIRES, "pose": any_pose()}),
    (kernel.signed_distances, {"groove": GROOVES, "cylinder": WIRES, "poses": POSES}),
    (kernel.relative_pose, {"T_world_a": any_pose(), "T_world_b": any_pose()}),
    (clamp3d.first_contact, WAY),
    (clamp3d.min_clearance, WAY),
    (shapes.make_mesh, {"vertices": SIZES.map(lambda s: (s * np.array(FLAT)).tolist()), "faces": FACES}),
    (shapes.groove_block, {"groove": GROOVES, "width": SIZES.map(lambda s: 9 * s), "height": SIZES}),
    (BLOCK_AND_WIRE.add, {"part": "a", "shape": BOX, "T_world": any_pose()}),
    (clamp3d.Motion.screw, {"parts": "wire", "axis": THREE, "angle": st.floats(-4.0, 4.0), "point": THREE}),
    (clamp3d.check, {"scene": poses(20.0).map(lambda T: BLOCK_AND_WIRE.moved({"wire": T}))}),
    (clamp3d.check_poses, {"scene": BLOCK_AND_WIRE, "part": "wire", "poses": POSES}),
    (clamp3d.distance, {"a": BLOCK, "b": BOX, "T_a_b": poses(20.0)}),
]
"""What is called, and its arguments or strategies for them; what has a default and is not named gets that."""


@pytest.mark.parametrize(("function", "good"), TARGETS, ids=[function.__qualname__ for function, _ in TARGETS])
@examples(10)
@given(data=st.data())
def test_a_call_is_refused_or_its_answer_is_finite(function, good, data):
    arguments = {p.name: p.default for p in inspect.signature(function).parameters.values() if p.default is not p.empty}
    for key, value in good.items():
        arguments[key] = data.draw(value) if isinstance(value, st.SearchStrategy) else value
    for key in data.draw(st.lists(st.sampled_from([*arguments, "extra"]), max_size=3)):
        value = arguments.get(key)
        is_close = isinstance(value, float) and data.draw(st.booleans())
        arguments[key] = near(data.draw, value) if is_close else data.draw(ANYTHING)
    if callable(arguments.get("progress")):  # what a user's own function raises is theirs
        arguments["progress"] = None
    with warnings.catch_warnings():
        warnings.simplefilter("error", np.exceptions.ComplexWarning)
        try:
            result = function(**arguments)
        except Clamp3dError as error:
            assert re.fullmatch(r".{5,1000}", str(error))  # noqa: PT017
            return
        except TypeError as error:
            if error.__traceback__.tb_next is None:
                return  # a missing or an unknown argument: raised by the call itself
            raise
    assert_finite(result, function.__name__)


def assert_finite(value, where, depth=0):
    """No NaN anywhere in an answer, and no infinity where none is documented."""
    if depth > 6 or isinstance(value, (str, bytes, type)):
        return
    if (isinstance(value, np.ndarray) and value.dtype.kind == "f") or isinstance(value, (float, np.floating)):
        allowed = where.rsplit(".", 1)[-1] in _INFINITE
        assert not np.any(np.isnan(value) if allowed else ~np.isfinite(value)), where
    elif isinstance(value, Mapping):
        for key, item in value.items():
            assert_finite(item, f"{where}[{key!r}]", depth + 1)
    elif isinstance(value, (list, tuple)):
        for item in value:
            assert_finite(item, where, depth + 1)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            assert_finite(getattr(value, field.name), f"{where}.{field.name}", depth + 1)


WORDS = ("", "x", "cas", "ünï", "-", "--", "a\nb", "\x1b[31m", "a" * 3000, "*", "LJ-500", "20", "nan", "1e5", "1e308")
WORDS += ("1", "0.5", "0", "-1", "inf", "5e-324", "1,5", "0x1", "9" * 20, " 2 ", "nowhere", "loop", "empty", "a folder")
WORDS += (".", "x" * 300, "no/where.json", "new.json", "old.json", "old.html", "new.svg", "reference", "scene.toml")
INPUTS = ("reference", "scene.toml", "tetra.stl") * 8
QUICK = ("run", "check", "fit", "export", "conductors")
"""Commands that are quick when all is well; the others get a wrong option every time."""
GOOD = {
    "--timeout": ("0",),
    "--step": ("4", "0", "-1", "x"),
    "--mesh-error": ("0.5", "0", "x"),
    "--json": ("old.json",),
}
"""Values of options whose others take long, or are rarely hit."""
SKIPPED = {"--open", "--url", "--port", "--host"}
"""Options that open a browser, or wait for a network."""


@examples(40)
@given(data=st.data())
def test_a_command_line_ends_in_an_answer_or_one_line(data):
    name = pick(data.draw, *cli.COMMANDS, *QUICK, *QUICK)
    command = cli.group.get_command(click.Context(cli.group), name)
    arguments = [name, *(pick(data.draw, *WORDS, *INPUTS) for p in command.params if isinstance(p, click.Argument))]
    options = [p for p in command.params if isinstance(p, click.Option) and not SKIPPED & {*p.opts}]
    for option in data.draw(st.permutations(options))[: data.draw(st.integers(0, 4))]:
        flag = max(option.opts, key=len)
        choices = GOOD.get(flag, (*getattr(option.type, "choices", ()), *WORDS))
        arguments += [flag] if option.is_flag else [flag, str(pick(data.draw, *choices))]
    arguments += ["--nonsense"] * (name not in QUICK)
    with new_folder() as folder:
        Path("scene.toml").write_text(SCENE, encoding="utf-8")
        Path("tetra.stl").write_bytes(TETRA)
        Path("empty").touch()
        Path("a folder").mkdir()
        Path("loop").symlink_to("loop")
        old = [folder / word for word in {"old.json", "old.html"} & {*arguments}]
        for path in old:
            path.write_bytes(OLD)
        code, _ = call(arguments)
        assert_outputs(code, folder, old, [])
