"""Clamp and scene files: good ones spoilt, and what is no such file; through every command that reads them."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from clamp3d.clamp import loader
from tests.fuzz.cli_calls import Called, FindingError, call, check_outputs, some_old
from tests.fuzz.values import SAME, Draw, chance, changed, jitter, pick, power, spoil, spoil_bytes, spoil_text, to_toml

CLAMP = (Path(loader.__file__).parent / "data" / "reference.toml").read_text(encoding="utf-8")
DISTANCE = 31.5298
"""Distance between the splints of the reference clamp, to its printed digits."""
PARTS = """
contact = 0.01
clearance = 0.5

[parts.block]
shape = "groove-block"
radius = 7.0
half_angle_deg = 60
length = 50.0
width = 60.0
height = 20.0
grooves = [{ x = 18.0, radius = 5.0, half_angle_deg = 50.0 }]
holes = [{ diameter = 4.0, at = [-15.0, 3.0], axis = "y" }]

[parts.wire]
shape = "cylinder"
diameter = 13.87
length = 80.0
bore_diameter = 4.0
pose = { translation = [0.0, 0.3, 0.0], rpy_deg = [0.0, 0.0, 90.0] }
"""

_MOVING = """
unit = "mm"

[parts.plate]
shape = "box"
size = [40.0, 30.0, 8.0]
holes = [{ radius = 3.0, at = [10.0, 0.0] }]
pose = { translation = [1.0, 2.0, 3.0], axis = [0.0, 0.0, 1.0], angle_deg = 30.0 }

[parts.pin]
shape = "cylinder"
conductor = "LJ-120"
length = 40.0
pose = { matrix = [[1.0, 0.0, 0.0, 60.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 20.0]] }

[[allowed]]
parts = ["p*", "plate"]
overlap = 0.05

[[motions]]
parts = ["pin"]
translate = [0.0, -20.0, 0.0]

[[motions]]
name = "turn"
parts = ["pin"]
screw = { axis = [0.0, 0.0, 1.0], point = [60.0, 0.0, 0.0], angle_deg = 90.0, pitch = 2.0 }
"""

_MESHES = """
[parts.tetra]
shape = "mesh"
file = "tetra.stl"
unit = "mm"
fit = "round"

[parts.pin]
shape = "cylinder"
radius = 2.0
length = 30.0
pose = { quaternion = [0.0, 0.0, 0.0, 1.0], translation = [20.0, 0.0, 0.0] }
"""

_CLAMPED = """
[clamp]
name = "reference"
line = "LJ-500"

[parts.extra]
shape = "clamp-part"
clamp = "reference"
part = "P1"
pose = { translation = [500.0, 0.0, 0.0] }
"""

_SIDES = ("0 0 0 0 9 0 9 0 0", "0 0 0 9 0 0 0 0 9", "9 0 0 0 9 0 0 0 9", "0 9 0 0 0 0 0 0 9")
TETRA = b"".join(
    b"facet normal 0 0 0\nouter loop\n%sendloop\nendfacet\n"
    % b"".join(b"vertex %s %s %s\n" % tuple(side.encode().split()[k : k + 3]) for k in (0, 3, 6))
    for side in _SIDES
)
TETRA = b"solid t\n" + TETRA + b"endsolid t\n"

_NO_FILES: dict[str, Callable[[Path], Any]] = {
    "a folder": Path.mkdir,
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a link to nowhere": lambda path: path.symlink_to("nowhere"),
    "no permission": lambda path: (path.write_text(CLAMP, encoding="utf-8"), path.chmod(0)),
    "no file": lambda path: None,
}


def _spoilt(draw: Draw, text: str, more: dict[str, Callable[[], tuple[str, Any]]]) -> tuple[str, bytes, bool]:
    """What was done to a file, its new content, and whether it says the same in other words."""
    data = tomllib.loads(text)
    way = pick(draw, "rewritten", *["text"] * 3, *["jitter"] * 3, *["spoil"] * 8, *more)
    if way == "text":
        what, content = spoil_text(draw, text)
        return what, content, what in SAME
    ways = {"rewritten": lambda: (way, data), "jitter": lambda: jitter(draw, data), "spoil": lambda: spoil(draw, data)}
    what, data = (ways | more)[way]()
    return what, to_toml(data), way == "rewritten"


# --- Clamps -----------------------------------------------------------------------------------------------------------


def make_clamp(draw: Draw, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A clamp file in ``folder`` and the command that reads it."""
    path, same = folder / "clamp.toml", False
    if chance(draw, 20):
        what = pick(draw, *_NO_FILES)
        _NO_FILES[what](path)
    else:
        what, content, same = _spoilt(draw, CLAMP, {"scaled": lambda: _scaled_clamp(draw)})
        path.write_bytes(content)
    args, written = _clamp_command(draw, folder)
    old = some_old(draw, written)

    def ask() -> bool:
        called = call(args)
        check_outputs(called, folder, old, written)
        if not called.refused and args[0] == "run":
            run = json.loads(Path(folder, "r.json").read_text(encoding="utf-8"))
            if same and not abs(run["distance_mm"] - DISTANCE) < 1e-4:
                raise FindingError(f"the same clamp in other words has distance {run['distance_mm']}")
            if run["status"] == "clamped" and not math.isfinite(run["distance_mm"]):
                raise FindingError(f"clamped at distance {run['distance_mm']}")
        if same and called.code != 0:
            raise FindingError(f"the same clamp in other words: exit code {called.code}: {called.stderr[:200]}")
        return not called.refused

    return f"{what} | {' '.join(args)}", ask


def _scaled_clamp(draw: Draw) -> tuple[str, dict[str, Any]]:
    """The clamp in another size: metres in place of mm, or 1e-9 to 1e6 times as large."""
    factor = pick(draw, 1e-3, 25.4, power(draw, -9, 6))
    data = changed(tomllib.loads(CLAMP), lambda x: x * factor, ("_deg",))
    if chance(draw, 2):
        data["line"], data["jumper"] = {"diameter": 32.67 * factor}, {"diameter": 14.25 * factor}
    return f"scaled by {factor:g}", data


def _clamp_command(draw: Draw, folder: Path) -> tuple[list[str], list[Path]]:
    """A command that reads the file, quick on a good clamp, and the files that it writes."""
    name, way = "clamp.toml", draw(st.integers(0, 59))
    if way < 50:
        return ["run", name, "--quiet", "--json", "r.json"], [folder / "r.json"]
    if way < 55:
        form, layout = pick(draw, "stl", "obj", "ply", "glb", "3mf"), pick(draw, "parts", "assembly")
        return ["export", name, "-f", form, "-o", "out", "--layout", layout, "--mesh-error", "0.5", "-q"], []
    (folder / "scene.toml").write_text(f'[clamp]\nname = "{name}"\n', encoding="utf-8")
    return ["check", "scene.toml", "--quiet", "--json", "c.json"], [folder / "c.json"]


# --- Scenes -----------------------------------------------------------------------------------------------------------


def make_scene(draw: Draw, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A scene file in ``folder`` and the command that checks it."""
    text = pick(draw, PARTS, PARTS, _MOVING, _MOVING, _MESHES, _CLAMPED)
    what, content, same = _spoilt(draw, text, {"scaled": lambda: _scaled_scene(draw, tomllib.loads(text))})
    name = "scene.toml"
    if chance(draw, 16):
        name, same = pick(draw, "nowhere.toml", ".", "x" * 300 + ".toml", "no/where.toml"), False
    else:
        (folder / name).write_bytes(content)
    mesh = pick(draw, TETRA, TETRA, TETRA, b"", spoil_bytes(draw, TETRA)[1])
    if mesh:
        (folder / "tetra.stl").write_bytes(mesh)
    args, written = ["check", name], []
    if not chance(draw, 4):
        args, written = [*args, "--json", "c.json"], [folder / "c.json"]
    if chance(draw, 8):
        args, written = [*args, "--html", "c.html"], [*written, folder / "c.html"]
    if chance(draw, 8):
        args += ["--clearance", str(pick(draw, 0, 1, "0.5", "nan", -1, "inf", 1e308, 1e-300))]
    if chance(draw, 8):
        args += ["--pairs", pick(draw, "block:wire", "pin:plate", "pin:pin", "a:b", ":", "P1:P2,P1:P3", "tetra:pin,")]
    same &= mesh is TETRA and not {"--clearance", "--pairs"} & {*args}
    old = some_old(draw, written)

    def ask() -> bool:
        called = call(args)
        check_outputs(called, folder, old, written)
        if same and called.refused:
            raise FindingError(f"the same scene in other words is refused: {called.stderr[-200:]}")
        if not called.refused and "c.json" in args:
            _plausible(called, json.loads(Path(folder, "c.json").read_text(encoding="utf-8")))
        return not called.refused

    return f"{what} | {' '.join(args)[:300]}", ask


def _plausible(called: Called, data: dict[str, Any]) -> None:
    """The exit code says what the verdicts say."""
    rows = [*data.get("pairs", []), *data.get("motions", [])]
    verdicts = {row["verdict"] for row in rows}
    codes = ((verdicts & {"clash", "contained"}, 1), ("failed" in verdicts, 4), ("uncertain" in verdicts, 3))
    code = next((code for true, code in codes if true), 0 if data["work"]["pairs"] else 2)
    if called.code != code:
        raise FindingError(f"verdicts {sorted(verdicts)} with exit code {called.code}")
    for row in rows:
        low, high = row["at_least_mm"], row["at_most_mm"]
        if low is not None and high is not None and not low <= high + 1e-9 * max(1.0, abs(low)):
            raise FindingError(f"bounds {low!r} to {high!r}")


def _scaled_scene(draw: Draw, data: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """The scene in another size, or with all its parts far from the origin."""
    factor = power(draw, -8, 5)
    if chance(draw, 2):
        for part in data.get("parts", {}).values():
            pose = part.setdefault("pose", {})
            if "matrix" not in pose:
                pose["translation"] = [factor * math.e, 0.0, factor]
        return f"moved by {factor:.1e}", data
    same = ("_deg", "matrix", "quaternion", "axis")
    return f"scaled by {factor:.1e}", changed(data, lambda x: x * factor, same)
