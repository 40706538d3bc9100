"""Scene files: good ones spoilt, with missing and broken meshes, put to ``clamp3d check``."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz import garbage
from tests.fuzz.cli_calls import Called, call, check_outputs, some_old
from tests.fuzz.runner import FindingError

_PARTS = """
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
fit = "bound"

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

_TETRA = b"""solid t
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 0 9 0
vertex 9 0 0
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 9 0 0
vertex 0 0 9
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 9 0 0
vertex 0 9 0
vertex 0 0 9
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 0 9 0
vertex 0 0 0
vertex 0 0 9
endloop
endfacet
endsolid t
"""


def make(rng: np.random.Generator, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A scene file in ``folder`` and the command that checks it."""
    text = garbage.pick(rng, (_PARTS, _PARTS, _MOVING, _MOVING, _MESHES, _CLAMPED))
    way = rng.integers(16)
    same = False
    name = "scene.toml"
    if way <= 2:
        what, content = garbage.spoil_text(rng, text)
        same = what in ("CRLF", "UTF-8 with a mark")
    elif way == 3:
        what, content, same = "rewritten", garbage.to_toml(tomllib.loads(text)).encode(), True
    elif way <= 5:
        share = 10.0 ** float(rng.uniform(-12, -1))
        what = f"all numbers changed by {share:.1e}"
        content = garbage.to_toml(garbage.jitter(rng, tomllib.loads(text), share)).encode()
    elif way == 6:
        what, data = _scaled(rng, tomllib.loads(text))
        content = garbage.to_toml(data).encode()
    else:
        what, data = garbage.spoil(rng, tomllib.loads(text))
        content = garbage.to_toml(data).encode("utf-8", "surrogatepass")
    if way == 15:
        what, content = f"{what}; no file", b""
        name = str(garbage.pick(rng, ("nowhere.toml", ".", "x" * 300 + ".toml", "no/where.toml")))
    else:
        Path(folder, name).write_bytes(content)
    mesh = rng.integers(6)
    if mesh > 0:
        Path(folder, "tetra.stl").write_bytes(_TETRA if mesh > 1 else garbage.spoil_bytes(rng, _TETRA)[1])
    same = same and mesh > 1
    args, written = _command(rng, folder, name)
    same = same and not {"--clearance", "--pairs"} & {*args}
    old = some_old(rng, written)

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


def _scaled(rng: np.random.Generator, data: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """The scene in another size, or with all its parts far from the origin."""
    factor = 10.0 ** float(rng.uniform(-8, 5))
    if rng.integers(2):
        for part in data.get("parts", {}).values():
            pose = part.setdefault("pose", {})
            if "matrix" not in pose:
                pose["translation"] = [factor * math.e, 0.0, factor]
        return f"moved by {factor:.1e}", data

    def scale(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {k: scale(v, k) for k, v in value.items()}
        if isinstance(value, list) and key not in ("matrix", "quaternion", "axis", "rpy_deg"):
            return [scale(v, key) for v in value]
        return value * factor if isinstance(value, float) and not key.endswith("_deg") else value

    return f"scaled by {factor:.1e}", scale(data)


def _command(rng: np.random.Generator, folder: Path, name: str) -> tuple[list[str], list[Path]]:
    args, written = ["check", name], []
    if rng.integers(4):
        args += ["--json", "c.json"]
        written.append(folder / "c.json")
    if rng.integers(8) == 0:
        args += ["--html", "c.html"]
        written.append(folder / "c.html")
    if rng.integers(8) == 0:
        args += ["--clearance", str(garbage.pick(rng, (0, 1, "0.5", "nan", -1, "inf", 1e308, 1e-300)))]
    if rng.integers(8) == 0:
        pairs = ("block:wire", "pin:plate", "pin:pin", "a:b", ":", "P1:P2,P1:P3", "tetra:pin,", "wire")
        args += ["--pairs", str(garbage.pick(rng, pairs))]
    if rng.integers(30) == 0:
        args.append("--full")
    return args, written
