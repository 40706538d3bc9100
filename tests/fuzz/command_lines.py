"""Command lines: real commands and options with good and bad values in any combination."""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from hypothesis import strategies as st

from tests.fuzz import files
from tests.fuzz.cli_calls import OLD, Called, call, check_outputs, held_to_rules
from tests.fuzz.values import Draw, chance, pick

_FLOATS = ("1", "0.5", "0", "-1", "nan", "inf", "-inf", "1e308", "1e400", "5e-324", "", "x", "1,5", "0x1", "١", " 2 ")
_INTS = ("1", "2", "0", "-1", "1.5", "99999999999999999999", "", "x", "0x1", "1e3", "nan")
_WORDS = (
    "",
    "x",
    "CAS",
    "cas ",
    "ünï",
    "-",
    "--",
    "a\nb",
    "\x1b[31m",
    "a" * 3000,
    "*",
    "LJ-500",
    "20",
    "-4",
    "nan",
    "1e5",
)
_BARE = ("--help", "--version", "-h", "run", "nonsense", "", "--", "-", "--nonsense", "ünï", "-1")
_BAD = (["--nonsense"], ["--json", "no/where.json"], ["--json", "a folder"], ["surplus"], ["--quiet=1"], ["--json"])
_NO_INPUT = (
    "nowhere",
    "nowhere.toml",
    "a folder",
    "loop",
    "empty",
    "",
    ".",
    "x" * 300,
    "tetra.stl",
    "scene.toml",
    "a\nb",
)

# Values of options by name, where their kind does not say what to try.
_VALUES: dict[str, tuple[str, ...]] = {
    "--points": ("5,5 50,30", "1,1 40,2", "0,0 0,0", "1,1", "a,b c,d", "nan,1 2,3", "1e9,1 2,3", "-1,-1 5,5", ""),
    "--pairs": ("block:wire", "block:block", "a:b", "", ":", "block", "block:wire,block:wire"),
    "--state": ("open", "final", "1", "0", "99", "-1", "P7", "", "x", "1.5", "١"),
    "--overlay": (
        "wedges",
        "wedges=20",
        "wedges=0",
        "wedges=x",
        "x",
        "",
        "hulls=nan",
        "wedges=nan",
        "wedges=1e-9",
        "=",
    ),
    "--host": ("127.0.0.1", "", "300.1.1.1", "a b"),
    "--output": ("out", "a folder", "empty", "empty/out", "new/deep", "loop", "", "x" * 300),
    "--method": ("cas", "x", ""),
}
_VALUES["--reference"] = _VALUES["--points"]
_SUFFIXES = {"--json": ".json", "--html": ".html", "--markdown": ".md"}

# Good values that take a second at most; without an entry the option's kind says what to try.
_QUICK: dict[str, dict[str, tuple[str, ...]]] = {
    "run": {"--method": ("cas", "chords"), "--step": ("1", "4", "0", "-1", "x", "nan", "1e-300", "1e300")},
    "view": {
        "--timeout": ("0", "0.0"),
        "--port": ("0", "x", "-1", "65536"),
        "--url": ("x", "tcp://", "http://127.0.0.1:1"),
    },
    "tolerance": {
        "--n": ("1", "3", "0", "-1", "x"),
        "--processes": ("1", "0", "x"),
        "--scheduler": ("x", "", "tcp://127.0.0.1:1"),
    },
    "sweep": {"--steps": ("3", "4", "2", "1002", "x"), "--random": ("1", "9", "0", "x", "10000001")},
    "stress": {
        "--n": ("1", "2", "0", "x"),
        "--method": ("cas", "x", ""),
        "--check": ("0", "1", "-1"),
        "--workers": ("1", "0", "x"),
        "--family": ("equal radii", "x", "", "tangency"),
        "--time-limit": ("1", "0", "x", "nan"),
        "--case": ("0", "1", "99", "x"),
    },
    "export": {"--mesh-error": ("0.5", "1", "0", "-1", "nan", "inf", "x", "1e-9", "1e300")},
    "report": {"--method": ("cas", "chords")},
}
for _name in ("view", "report"):
    _QUICK[_name] = {**_QUICK["run"], **_QUICK[_name]}
_QUICK["run"] = {**_QUICK["view"], **_QUICK["run"]}

_ALWAYS: dict[str, list[str]] = {
    "view": ["--timeout", "0"],
    "run": ["--timeout", "0"],
    "tolerance": ["--n", "2"],
    "sweep": ["--steps", "3"],
    "stress": ["--n", "1", "--method", "cas", "--check", "0", "--time-limit", "1", "--family", "equal radii"],
}
_LONG = ("compare", "reproduce")
"""Commands that run long when all is well: they get something bad every time."""

_SKIPPED = {"--open", "--processes", "--workers", "--peers", "--url", "--scheduler"}
"""Options that open a browser, start processes or wait for a network; tried with what is refused at once."""


@functools.cache
def _commands() -> dict[str, click.Command]:
    from clamp3d import cli

    context = click.Context(cli.group)
    return {name: cli.group.get_command(context, name) for name in cli.COMMANDS}  # type: ignore[misc]


def make(draw: Draw, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A command line, and the files that it is about."""
    from PIL import Image

    click.launch = lambda *a, **k: 0
    Path(folder, "clamp.toml").write_text(files.CLAMP, encoding="utf-8")
    Path(folder, "scene.toml").write_text(files.PARTS, encoding="utf-8")
    Path(folder, "tetra.stl").write_bytes(files.TETRA)
    Path(folder, "empty").write_bytes(b"")
    Path(folder, "a folder").mkdir()
    Path(folder, "loop").symlink_to("loop")
    Image.fromarray(np.full((40, 60), 200, np.uint8)).save(folder / "image.png")
    old: list[Path] = []
    if chance(draw, 30):
        args = draw(st.lists(st.sampled_from(_BARE), max_size=4))
    else:
        args, old = _line(draw, folder, pick(draw, *_commands()))
    for path in old:
        path.write_bytes(OLD)
    child = chance(draw, 100)

    def ask() -> bool:
        called = _in_a_process(args) if child else call(args)
        check_outputs(called, folder, old, [])
        return not called.refused

    return " ".join(map(repr, args))[:500], ask


def _in_a_process(args: list[str]) -> Called:
    """The same through a real process."""
    command = [sys.executable, "-m", "clamp3d", *args]
    done = subprocess.run(command, capture_output=True, timeout=120, stdin=subprocess.DEVNULL, check=False)
    return held_to_rules(Called(done.returncode, done.stdout.decode(), done.stderr.decode("utf-8", "replace")))


def _line(draw: Draw, folder: Path, name: str) -> tuple[list[str], list[Path]]:
    params, args, old = _commands()[name].params, [name], []
    good = {"scene": "scene.toml", "mesh": "tetra.stl", "image": "image.png", "clamp": "clamp.toml"}
    for argument in (p for p in params if isinstance(p, click.Argument)):
        args += pick(draw, *[[good.get(str(argument.name), "reference")]] * 3, [], [pick(draw, *_NO_INPUT)])
    args += _ALWAYS.get(name, [])
    options = [p for p in params if isinstance(p, click.Option)]
    required = [o for o in options if o.required and not chance(draw, 8)]
    others = draw(st.permutations([o for o in options if o not in required]))[: draw(st.integers(0, 4))]
    for option in (*required, *others):
        flag = str(max(option.opts, key=len))
        if flag in _SKIPPED and flag not in _QUICK.get(name, {}):
            continue
        if option.is_flag:
            args += [flag] * (name not in _LONG)
            continue
        value, there = _value(draw, folder, _QUICK.get(name, {}).get(flag) or _VALUES.get(flag), flag, option)
        old += there
        args += [f"{flag}={value}"] if chance(draw, 4) else [flag, value]
    if name in _LONG:
        args += ["--nonsense", *pick(draw, *_BAD)]  # in this order: an option without its value would take the other's
    elif chance(draw, 20):
        args.insert(draw(st.integers(1, len(args))), pick(draw, "--nonsense", "--", "surplus", "", "-x", "--json"))
    return args, old


def _value(
    draw: Draw, folder: Path, known: tuple[str, ...] | None, flag: str, option: click.Option
) -> tuple[str, list[Path]]:
    """A value for an option, and the files that are there before."""
    kind: Any = option.type
    if known is not None:
        return pick(draw, *known), []
    if isinstance(kind, click.Choice):
        return str(pick(draw, *[*kind.choices] * 3, *_WORDS)), []
    if isinstance(kind, click.Path):
        suffix = _SUFFIXES.get(flag, pick(draw, ".png", ".svg", ".pdf"))
        value = pick(draw, "new", "new", "old", "old", "no/where", "empty/x", "x" * 300, "a\nb") + suffix
        value = pick(draw, *[value] * 6, "a folder", "loop", "", ".", "bad.suffix")
        return value, [folder / value] * (value.startswith("old") and flag != "--resume")
    if isinstance(kind, (click.types.IntParamType, click.IntRange)):
        return pick(draw, *_INTS), []
    if isinstance(kind, (click.types.FloatParamType, click.FloatRange)):
        return pick(draw, *_FLOATS), []
    return pick(draw, *_WORDS), []
