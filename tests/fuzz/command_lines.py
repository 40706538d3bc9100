"""Command lines: real commands and options with good and bad values in any combination."""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from hypothesis import strategies as st

from tests.fuzz import files
from tests.fuzz.cli_calls import OLD, Called, call, check_outputs, held_to_rules
from tests.fuzz.values import Draw, chance, pick

_FLOATS = ("1", "0.5", "0", "-1", "nan", "inf", "1e308", "5e-324", "", "x", "1,5", "0x1", "١", " 2 ")
_INTS = ("1", "2", "0", "-1", "1.5", "99999999999999999999", "", "x", "0x1", "nan")
_WORDS = ("", "x", "cas", "ünï", "-", "--", "a\nb", "\x1b[31m", "a" * 3000, "*", "LJ-500", "20", "-4", "nan", "1e5")
_BARE = ("--help", "--version", "-h", "run", "nonsense", "", "--", "-", "--nonsense", "ünï", "-1")
_BAD = (["--nonsense"], ["--json", "no/where.json"], ["--json", "a folder"], ["surplus"], ["--quiet=1"], ["--json"])
_NO_INPUT = ("nowhere", "nowhere.toml", "a folder", "loop", "empty", "", ".", "x" * 300, "tetra.stl", "scene.toml")
_VALUES: dict[str, tuple[str, ...]] = {
    "--pairs": ("block:wire", "block:block", "a:b", "", ":", "block", "block:wire,block:wire"),
    "--output": ("out", "a folder", "empty", "empty/out", "new/deep", "loop", "", "x" * 300),
    "--method": ("cas", "x", ""),
    "--mesh-error": ("0.5", "1", "0", "-1", "nan", "inf", "x", "1e-9", "1e300"),
    "--timeout": ("0", "0.0"),
    "--step": ("4", "0", "-1", "x", "nan", "1e-300", "1e300"),
}
"""Values of options by name, where their kind does not say what to try; good ones take a second at most."""
_SUFFIXES = {"--json": ".json", "--html": ".html", "--markdown": ".md"}
_QUICK = ("run", "check", "export", "fit", "conductors")
"""Commands that are quick when all is well; the others get something bad every time."""
_SKIPPED = ("--open", "--url", "--port", "--host")
"""Options that open a browser, or wait for a network."""


@functools.cache
def _commands() -> dict[str, click.Command]:
    from clamp3d import cli

    context = click.Context(cli.group)
    return {name: cli.group.get_command(context, name) for name in cli.COMMANDS}  # type: ignore[misc]


def make(draw: Draw, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A command line, and the files that it is about."""
    click.launch = lambda *a, **k: 0
    Path(folder, "clamp.toml").write_text(files.CLAMP, encoding="utf-8")
    Path(folder, "scene.toml").write_text(files.PARTS, encoding="utf-8")
    Path(folder, "tetra.stl").write_bytes(files.TETRA)
    Path(folder, "empty").write_bytes(b"")
    Path(folder, "a folder").mkdir()
    Path(folder, "loop").symlink_to("loop")
    old: list[Path] = []
    if chance(draw, 30):
        args = draw(st.lists(st.sampled_from(_BARE), max_size=4))
    else:
        args, old = _line(draw, folder, pick(draw, *_commands(), *_QUICK, *_QUICK))
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
    good = {"run": "clamp.toml", "check": "scene.toml", "fit": "tetra.stl", "export": "clamp.toml"}
    for _ in (p for p in params if isinstance(p, click.Argument)):
        args += pick(draw, *[[good.get(name, "reference")]] * 3, [], [pick(draw, *_NO_INPUT)])
    options = [p for p in params if isinstance(p, click.Option) and max(p.opts, key=len) not in _SKIPPED]
    for option in draw(st.permutations(options))[: draw(st.integers(0, 4))]:
        flag = str(max(option.opts, key=len))
        if option.is_flag:
            args.append(flag)
            continue
        value, there = _value(draw, folder, flag, option)
        old += there
        args += [f"{flag}={value}"] if chance(draw, 4) else [flag, value]
    if name not in _QUICK:
        args += ["--nonsense", *pick(draw, *_BAD)]  # in this order: an option without its value would take the other's
    elif chance(draw, 20):
        args.insert(draw(st.integers(1, len(args))), pick(draw, "--nonsense", "--", "surplus", "", "-x", "--json"))
    return args, old


def _value(draw: Draw, folder: Path, flag: str, option: click.Option) -> tuple[str, list[Path]]:
    """A value for an option, and the files that are there before."""
    kind: Any = option.type
    if flag in _VALUES:
        return pick(draw, *_VALUES[flag]), []
    if isinstance(kind, click.Choice):
        return str(pick(draw, *[*kind.choices] * 3, *_WORDS)), []
    if isinstance(kind, click.Path):
        suffix = _SUFFIXES.get(flag, pick(draw, ".png", ".svg", ".pdf"))
        value = pick(draw, "new", "new", "old", "old", "no/where", "empty/x", "x" * 300, "a\nb") + suffix
        value = pick(draw, *[value] * 6, "a folder", "loop", "", ".", "bad.suffix")
        return value, [folder / value] * value.startswith("old")
    if isinstance(kind, (click.types.IntParamType, click.IntRange)):
        return pick(draw, *_INTS), []
    if isinstance(kind, (click.types.FloatParamType, click.FloatRange)):
        return pick(draw, *_FLOATS), []
    return pick(draw, *_WORDS), []
