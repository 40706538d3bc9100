"""Clamp files: TOML in, validated dimensions out; every fault is one line with file, key, value and rule."""

from __future__ import annotations

import os
import re
import tomllib
import typing
from dataclasses import fields
from pathlib import Path
from typing import TypeAlias

from clamp3d import checks
from clamp3d.clamp.conductors import conductor
from clamp3d.clamp.dimensions import SMALLEST, Clamp, Wire
from clamp3d.errors import InputError
from clamp3d.validation import validate

_MOST_BYTES = 2**26  # 64 MiB: a scene of 100 000 parts has a fraction of it
_MOST_DOTS = 64  # no key of a clamp or a scene has as many
_DOTTED = re.compile(rf"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){{{_MOST_DOTS + 1}}}""")

WireSize: TypeAlias = str | float
"""A wire by catalogue name, or by diameter in mm."""


def builtin_clamps() -> list[str]:
    """Names of the clamp files inside the package.

    >>> builtin_clamps()
    ['reference']
    """
    return sorted(file.stem for file in Path(__file__).with_name("data").glob("*.toml"))


def load_clamp(
    source: Clamp | str | Path = "reference", *, line: WireSize | None = None, jumper: WireSize | None = None
) -> Clamp:
    """Load a clamp by built-in name or file path; ``line`` and ``jumper`` replace its wires.

    Parameters
    ----------
    source : str, Path or Clamp
        Name of a built-in clamp, a clamp file, or a clamp already loaded.
    line, jumper : str or float, optional
        A catalogue name, or a diameter in mm as a number or as text.

    Raises
    ------
    InputError
        For anything that is not a clamp or a wire, with file, key, value and rule.

    Examples
    --------
    >>> load_clamp(line=16, jumper="LJ-120").line.radius
    8.0
    """
    if isinstance(source, Clamp):
        clamp, origin = source, source.name
    else:
        text, origin = _read(checks.path("clamp", source))
        data = parse_toml(text, origin)
        if "parts" in data or "include" in data:
            raise InputError(f"{origin}: is a scene, not a clamp: give it to check, view, report or export")
        clamp = validate(Clamp, data, origin)
    wires = {key: wire(size, key) for key, size in (("line", line), ("jumper", jumper)) if size is not None}
    if wires:
        clamp = validate(Clamp, {f.name: getattr(clamp, f.name) for f in fields(clamp)} | wires, origin)
    return clamp


def wire(size: WireSize, name: str = "wire") -> Wire:
    """A wire by catalogue name, or by its diameter in mm as a number or as text. Raises InputError."""
    diameter = checks.real(size)
    if diameter is None:
        if not isinstance(size, str):
            raise InputError(f"{name} must be a conductor's name or a diameter in mm, got {checks.shown(size)}")
        try:
            diameter = float(size)
        except ValueError:
            return Wire(conductor=conductor(size).designation)
    try:
        return Wire(diameter=diameter)
    except InputError:
        raise InputError(
            f"{name} diameter must be > 0 (at least {SMALLEST:g}) and < 100000 mm, got {checks.short(str(size), 40)}"
        ) from None


def _read(path: Path) -> tuple[str, str]:
    source = str(path)
    if source in builtin_clamps():
        path = Path(__file__).with_name("data") / f"{source}.toml"
    elif path.suffix != ".toml" and not os.path.exists(path):
        built_in = ", ".join(builtin_clamps())
        raise InputError(f"unknown clamp {checks.shown(source)}; built in: {built_in}; or give a .toml file")
    return read_text(path), source


def read_text(path: Path) -> str:
    """Text of a UTF-8 file, a byte order mark left out. Raises InputError if it cannot be read or is no text."""
    checks.readable_file(path, _MOST_BYTES)
    return text_of(path)


def text_of(path: Path) -> str:
    """The same of a file that may be written over, as one that is kept up to date is. Raises InputError."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8") from None
    except OSError as error:
        raise InputError(f"{checks.short(path)}: cannot be read: {error.strerror}") from None


def parse_toml(text: str, origin: str) -> dict[str, typing.Any]:
    """Tables of a TOML text. Raises InputError naming ``origin`` and the line."""
    dotted = _DOTTED.search(text)  # tomllib takes memory that grows as the square of such a key
    if dotted is not None:
        raise InputError(
            f"{origin}: not valid TOML: a key of more than {_MOST_DOTS} dots: {checks.short(dotted[0], 40)}"
        )
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError) as error:  # an integer of thousands of digits is a ValueError
        raise InputError(f"{origin}: not valid TOML: {error}") from None
    except RecursionError:
        raise InputError(f"{origin}: not valid TOML: tables or arrays nested too deeply") from None
