"""Clamp files: the built-in one spoilt, and what is no clamp file at all; through every command that reads one."""

from __future__ import annotations

import copy
import json
import math
import os
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d.clamp import loader
from tests.fuzz import garbage
from tests.fuzz.cli_calls import call, check_outputs, some_old
from tests.fuzz.runner import FindingError

TEXT = (Path(loader.__file__).parent / "data" / "reference.toml").read_text(encoding="utf-8")
DISTANCE = 31.5298
"""Distance between the splints of the reference clamp, to its printed digits."""


def make(rng: np.random.Generator, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A clamp file in ``folder`` and the command that reads it."""
    name = "clamp.toml"
    same = False  # the file says the same in other words
    way = rng.integers(20)
    if way == 0:
        what = _no_file(rng, folder, name)
    elif way <= 3:
        what, content = garbage.spoil_text(rng, TEXT)
        same = what in ("CRLF", "UTF-8 with a mark")
        Path(folder, name).write_bytes(content)
    elif way == 4:
        what, data = "rewritten", tomllib.loads(TEXT)
        same = True
        Path(folder, name).write_text(garbage.to_toml(data), encoding="utf-8")
    elif way <= 7:
        share = 10.0 ** float(rng.uniform(-12, -1))
        what = f"all numbers changed by {share:.1e}"
        data = garbage.jitter(rng, tomllib.loads(TEXT), share)
        Path(folder, name).write_text(garbage.to_toml(data), encoding="utf-8")
    elif way == 8:
        what, data = _scaled(rng)
        Path(folder, name).write_text(garbage.to_toml(data), encoding="utf-8")
    elif way <= 10:
        what, data = _at_a_limit(rng)
        Path(folder, name).write_text(garbage.to_toml(data), encoding="utf-8")
    else:
        what, data = garbage.spoil(rng, tomllib.loads(TEXT))
        Path(folder, name).write_text(garbage.to_toml(data), encoding="utf-8", errors="surrogatepass")
    args, written = _command(rng, folder, name)
    old = some_old(rng, written)

    def ask() -> bool:
        called = call(args)
        check_outputs(called, folder, old, written)
        if not called.refused and "result.json" in args and args[0] == "run":
            exact = same and not {"--method", "--solver"} & {*args}
            _plausible(json.loads(Path(folder, "result.json").read_text(encoding="utf-8")), exact)
        if same and called.code != 0:
            raise FindingError(f"the same clamp in other words: exit code {called.code}: {called.stderr[:200]}")
        return not called.refused

    return f"{what} | {' '.join(args)}", ask


def _plausible(run: dict[str, Any], same: bool) -> None:
    distance = run["distance_mm"]
    if same and not abs(distance - DISTANCE) < 1e-4:
        raise FindingError(f"the same clamp in other words has distance {distance}")
    if run["status"] == "clamped" and not (math.isfinite(distance)):
        raise FindingError(f"clamped at distance {distance}")


def _no_file(rng: np.random.Generator, folder: Path, name: str) -> str:
    path = Path(folder, name)
    way = rng.integers(5)
    if way == 0:
        path.mkdir()
        return "a folder"
    if way == 1:
        path.symlink_to(name)
        return "a link to itself"
    if way == 2:
        path.symlink_to("nowhere")
        return "a link to nowhere"
    if way == 3:
        path.write_text(TEXT, encoding="utf-8")
        path.chmod(0)
        return "unreadable" if os.geteuid() else "no permission bits"
    return "no file"


def _scaled(rng: np.random.Generator) -> tuple[str, dict[str, Any]]:
    """The clamp in another size: metres in place of mm, or 1e-6 to 1e6 times as large."""
    factor = float(rng.choice([1e-3, 25.4, 10.0 ** float(rng.uniform(-9, 6))]))

    def scale(data: Any, key: str = "") -> Any:
        if isinstance(data, dict):
            return {k: scale(v, k) for k, v in data.items()}
        return data * factor if isinstance(data, float) and not key.endswith("_deg") else data

    data = scale(tomllib.loads(TEXT))
    if rng.integers(2):
        data["line"], data["jumper"] = {"diameter": 32.67 * factor}, {"diameter": 14.25 * factor}
    return f"scaled by {factor:g}", data


def _at_a_limit(rng: np.random.Generator) -> tuple[str, dict[str, Any]]:
    """A dimension at the limit that its own rule states, or a rounding error beside it."""
    data = copy.deepcopy(tomllib.loads(TEXT))
    up, down, saddle, bolt = data["up_splint"], data["down_splint"], data["saddle"], data["bolt"]
    groove = up["line_groove"]
    depth = groove["centre_depth"] - up["thickness"]
    limits: tuple[tuple[str, dict[str, Any], str, float], ...] = (
        ("arc just reaches the face", groove, "radius", abs(depth)),
        ("arc up to the top face", groove, "radius", groove["centre_depth"]),
        ("centre on the face", groove, "centre_depth", up["thickness"]),
        ("mouth at the edge", groove, "offset", up["width"] / 2 - math.sqrt(groove["radius"] ** 2 - depth**2)),
        ("hole as wide as the bolt", up, "hole_diameter", bolt["diameter"]),
        ("bolt as wide as the hole", bolt, "diameter", up["hole_diameter"]),
        ("bolt as wide as the slot is long", down, "slot_length", bolt["diameter"]),
        ("saddle as round as the back", saddle, "radius", down["back_radius"]),
        ("saddle a half circle", saddle, "width", 2 * saddle["radius"]),
        ("back a half circle", down, "back_half_angle_deg", 90.0),
        ("no tilt", down, "max_tilt_deg", 1e-12),
        ("tilt of 45 deg", down, "max_tilt_deg", 45.0),
        ("face at the underside", down, "face_depth", down["back_radius"] * math.cos(math.radians(40.0))),
        ("largest length", up, "length", 1e5),
        ("smallest length", up, "length", 5e-324),
        ("largest shank", bolt, "shank_length", 1e5),
        ("smallest pitch", bolt, "pitch", 5e-324),
        ("nut of no height", data["nut"], "height", 1e-300),
        ("groove of no radius", groove, "radius", 1e-300),
        ("wire as thick as the groove", data, "line", 2 * groove["radius"]),
        ("thin wire", data, "jumper", 1e-9),
        ("thinnest wire", data, "jumper", 5e-324),
        ("thickest wire", data, "line", 99999.0),
    )
    what, table, key, limit = garbage.pick(rng, limits)
    steps = int(rng.integers(-2, 3))
    value = limit
    for _ in range(abs(steps)):
        value = math.nextafter(value, math.inf if steps > 0 else 0.0)
    if rng.integers(3) == 0:
        value = limit * (1.0 + float(rng.normal(0.0, 1e-6)))
    table[key] = {"diameter": value} if key in ("line", "jumper") else value
    return f"{what}: {key} = {value!r}", data


def _command(rng: np.random.Generator, folder: Path, name: str) -> tuple[list[str], list[Path]]:
    """A command that reads the file, quick on a good clamp, and the files that it writes."""
    way = rng.integers(60)
    if way < 50:
        method = ["--method", "chords"] if way == 0 else ["--solver", "stepped", "--step", "2"] if way == 1 else []
        return ["run", name, "--quiet", "--json", "result.json", *method], [folder / "result.json"]
    if way < 52:
        return ["tolerance", name, "--n", "2", "--quiet", "--json", "t.json"], [folder / "t.json"]
    if way < 56:
        layout = str(rng.choice(["parts", "assembly"]))
        form = str(rng.choice(["stl", "obj", "ply", "glb", "3mf"]))
        return ["export", name, "-f", form, "-o", "out", "--layout", layout, "--mesh-error", "0.5", "-q"], []
    if way == 56:
        return ["report", name, "-o", "rep", "--quiet"], []
    if way == 57:
        return ["view", name, "--html", "v.html", "--quiet", "--draw-error", "0.5"], [folder / "v.html"]
    if way == 58:
        return ["sweep", name, "--steps", "3", "--json", "s.json"], [folder / "s.json"]
    Path(folder, "scene.toml").write_text(f'[clamp]\nname = "{name}"\n', encoding="utf-8")
    return ["check", "scene.toml", "--quiet", "--json", "c.json"], [folder / "c.json"]
