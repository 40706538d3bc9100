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

from tests.fuzz import garbage
from tests.fuzz.cli_calls import OLD, Called, call, check_outputs, held_to_rules

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


def make(rng: np.random.Generator, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A command line, and the files that it is about."""
    click.launch = lambda *a, **k: 0
    _files(folder)
    way = rng.integers(30)
    old: list[Path] = []
    if way == 0:
        words = (
            "--help",
            "--version",
            "-h",
            "run",
            "nonsense",
            "",
            "--",
            "-",
            "--nonsense",
            "\x00".strip("\x00"),
            "ünï",
            "-1",
        )
        args = [str(garbage.pick(rng, words)) for _ in range(rng.integers(4))]
    else:
        name = str(garbage.pick(rng, list(_commands())))
        args, old = _line(rng, folder, name)
    for path in old:
        path.write_bytes(OLD)
    child = rng.integers(100) == 0 and not any("\x00" in a for a in args)

    def ask() -> bool:
        called = _in_a_process(args) if child else call(args)
        check_outputs(called, folder, old, [])
        return not called.refused

    return " ".join(map(repr, args))[:500], ask


def _in_a_process(args: list[str]) -> Called:
    """The same through a real process."""
    done = subprocess.run(
        [sys.executable, "-m", "clamp3d", *args],
        capture_output=True,
        timeout=120,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    return held_to_rules(Called(done.returncode, done.stdout.decode(), done.stderr.decode("utf-8", "replace")))


def _files(folder: Path) -> None:
    from PIL import Image

    from tests.fuzz.clamp_files import TEXT
    from tests.fuzz.scene_files import _PARTS, _TETRA

    Path(folder, "clamp.toml").write_text(TEXT, encoding="utf-8")
    Path(folder, "scene.toml").write_text(_PARTS, encoding="utf-8")
    Path(folder, "tetra.stl").write_bytes(_TETRA)
    Path(folder, "empty").write_bytes(b"")
    Path(folder, "a folder").mkdir()
    Path(folder, "loop").symlink_to("loop")
    Image.fromarray(np.full((40, 60), 200, np.uint8)).save(folder / "image.png")


def _line(rng: np.random.Generator, folder: Path, name: str) -> tuple[list[str], list[Path]]:
    command = _commands()[name]
    args = [name]
    old: list[Path] = []
    arguments = [p for p in command.params if isinstance(p, click.Argument)]
    options = [p for p in command.params if isinstance(p, click.Option)]
    for _ in arguments:
        good = {"scene": "scene.toml", "mesh": "tetra.stl", "image": "image.png", "clamp": "clamp.toml"}
        value = good.get(str(arguments[0].name), "reference")
        way = rng.integers(5)
        if way == 0:
            value = str(
                garbage.pick(
                    rng,
                    (
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
                        "\x1b[0m",
                    ),
                )
            )
        if way != 1:
            args.append(value)
    args += _ALWAYS.get(name, [])
    required = [o for o in options if o.required and rng.integers(8)]
    others = [o for o in options if o not in required]
    chosen = [*required, *(others[int(i)] for i in rng.permutation(len(others))[: int(rng.integers(5))])]
    for option in chosen:
        flag = str(max(option.opts, key=len))
        if flag in _SKIPPED and flag not in _QUICK.get(name, {}):
            continue
        if option.is_flag:
            if name not in _LONG:
                args.append(flag)
            continue
        value, there = _value(rng, folder, name, flag, option)
        old += there
        args += [f"{flag}={value}"] if rng.integers(4) == 0 else [flag, value]
    if name in _LONG:
        args += garbage.pick(
            rng,
            (
                ["--nonsense"],
                ["--json", "no/where.json"],
                ["--json", "a folder"],
                ["surplus"],
                ["--quiet=1"],
                ["--json"],
            ),
        )
        if "--json" in args[:-2] and name == "reproduce":
            args.append("--nonsense")
    elif rng.integers(20) == 0:
        args.insert(
            int(rng.integers(1, len(args) + 1)),
            str(garbage.pick(rng, ("--nonsense", "--", "surplus", "", "-x", "--json"))),
        )
    return args, old


def _value(
    rng: np.random.Generator, folder: Path, name: str, flag: str, option: click.Option
) -> tuple[str, list[Path]]:
    """A value for an option, and the files that are there before."""
    quick = _QUICK.get(name, {}).get(flag)
    if quick is not None:
        return str(garbage.pick(rng, quick)), []
    kind: Any = option.type
    if isinstance(kind, click.Choice):
        return str(garbage.pick(rng, [*kind.choices] * 3 + [*_WORDS] if flag != "--method" else ["cas", "x", ""])), []
    if isinstance(kind, click.Path):
        way = rng.integers(7)
        suffix = {"--json": ".json", "--html": ".html", "--markdown": ".md"}.get(
            flag, str(garbage.pick(rng, (".png", ".svg", ".pdf")))
        )
        if flag in ("--output",):
            return str(
                garbage.pick(rng, ("out", "a folder", "empty", "empty/out", "new/deep", "loop", "", "x" * 300))
            ), []
        if way < 2:
            return f"new{suffix}", []
        if way < 4:
            return f"old{suffix}", [folder / f"old{suffix}"] if flag != "--resume" else []
        return str(
            garbage.pick(
                rng,
                (
                    "no/where" + suffix,
                    "a folder",
                    "empty/x" + suffix,
                    "loop",
                    "",
                    ".",
                    "x" * 300 + suffix,
                    "bad.suffix",
                    "a\nb" + suffix,
                ),
            )
        ), []
    if isinstance(kind, (click.types.IntParamType, click.IntRange)):
        return str(garbage.pick(rng, _INTS)), []
    if isinstance(kind, (click.types.FloatParamType, click.FloatRange)):
        return str(garbage.pick(rng, _FLOATS)), []
    if flag in ("--points", "--reference"):
        return str(
            garbage.pick(
                rng, ("5,5 50,30", "1,1 40,2", "0,0 0,0", "1,1", "a,b c,d", "nan,1 2,3", "1e9,1 2,3", "-1,-1 5,5", "")
            )
        ), []
    if flag == "--pairs":
        return str(
            garbage.pick(rng, ("block:wire", "block:block", "a:b", "", ":", "block", "block:wire,block:wire"))
        ), []
    if flag == "--state":
        return str(garbage.pick(rng, ("open", "final", "1", "0", "99", "-1", "P7", "", "x", "1.5", "١"))), []
    if flag == "--overlay":
        return str(
            garbage.pick(
                rng,
                ("wedges", "wedges=20", "wedges=0", "wedges=x", "x", "", "hulls=nan", "wedges=nan", "wedges=1e-9", "="),
            ),
        ), []
    if flag == "--host":
        return str(garbage.pick(rng, ("127.0.0.1", "", "300.1.1.1", "a b"))), []
    return str(garbage.pick(rng, _WORDS)), []
