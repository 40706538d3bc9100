"""Clamp files: TOML in, validated dimensions out; every fault is one line with file, key, value and rule."""

from __future__ import annotations

import difflib
import os
import sys
import typing
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from clamp3d import checks
from clamp3d.clamp.conductors import conductor
from clamp3d.clamp.dimensions import SMALLEST, Clamp, Wire
from clamp3d.errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


_UNKNOWN_KEY = {"unexpected_keyword_argument", "extra_forbidden"}


def builtin_clamps() -> list[str]:
    """Names of the clamp files inside the package.

    >>> builtin_clamps()
    ['reference']
    """
    folder = resources.files("clamp3d.clamp").joinpath("data")
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_clamp(source: str | Path = "reference", *, line: str | None = None, jumper: str | None = None) -> Clamp:
    """Load a clamp by built-in name or file path; ``line`` and ``jumper`` replace its wires.

    A wire is a catalogue designation or a diameter in mm ("21.6"). Raises InputError for anything that is not a
    clamp, naming file, key, value and rule.

    >>> load_clamp(jumper="21.6").jumper.radius
    10.8
    """
    text, origin = _read(checks.path("clamp", source))
    clamp: Clamp = validate(Clamp, parse_toml(text, origin), origin)
    wires = {key: wire(given, key) for key, given in (("line", line), ("jumper", jumper)) if given is not None}
    try:
        return replace(clamp, **wires) if wires else clamp  # type: ignore[arg-type]
    except ValidationError as failure:
        raise _one_line(failure, Clamp, origin, {}) from None


def wire(text: str, name: str = "wire") -> Wire:
    """A wire from what a user types: a designation, or a diameter in mm. Raises InputError."""
    checks.text(name, text)
    try:
        diameter = float(text)
    except ValueError:
        return Wire(conductor=conductor(text).designation)
    try:
        return Wire(diameter=diameter)
    except ValidationError:
        raise InputError(
            f"{name} diameter must be > 0 (at least {SMALLEST:g}) and < 100000 mm, got {checks.short(text, 40)}"
        ) from None


def _read(path: Path) -> tuple[str, str]:
    source = str(path)
    if source in builtin_clamps():
        return resources.files("clamp3d.clamp").joinpath(f"data/{source}.toml").read_text(encoding="utf-8"), source
    if path.suffix != ".toml" and not os.path.exists(path):
        built_in = ", ".join(builtin_clamps())
        raise InputError(f"unknown clamp {checks.shown(source)}; built in: {built_in}; or give a .toml file")
    return read_text(path), source


def read_text(path: Path) -> str:
    """Text of a UTF-8 file, a byte order mark left out. Raises InputError if it cannot be read or is no text."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8") from None
    except OSError as error:
        raise InputError(f"{checks.short(path)}: cannot be read: {error.strerror}") from None


def parse_toml(text: str, origin: str) -> dict[str, typing.Any]:
    """Tables of a TOML text. Raises InputError naming ``origin`` and the line."""
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError) as error:  # an integer of thousands of digits is a ValueError
        raise InputError(f"{origin}: not valid TOML: {error}") from None
    except RecursionError:
        raise InputError(f"{origin}: not valid TOML: tables or arrays nested too deeply") from None


def validate(kind: typing.Any, data: typing.Any, origin: str, tags: Mapping[str, type] | None = None) -> typing.Any:
    """``data`` as ``kind`` (a pydantic model or dataclass), else InputError: one line with origin, key, value and rule.

    ``tags`` maps the tags of a discriminated union, which are no keys of the file, to its members.
    """
    try:
        return TypeAdapter(kind).validate_python(data)
    except ValidationError as failure:
        raise _one_line(failure, kind, origin, tags or {}) from None


def _one_line(failure: ValidationError, kind: typing.Any, origin: str, tags: Mapping[str, type]) -> InputError:
    """The error that says what pydantic found."""
    # A misspelt key is both unknown and missing; the first says what to mend.
    error = min(failure.errors(include_url=False), key=lambda e: e["type"] not in _UNKNOWN_KEY)
    others = failure.error_count() - 1
    key = checks.short(".".join(str(part) for part in error["loc"] if part != "[key]" and part not in tags), 100)
    rule = error["msg"].replace("Input should", "must").removeprefix("Value error, ")
    if error["type"] == "value_error":  # from our own validators, which begin with the key
        line = f"{origin}: {key}.{rule}" if key else f"{origin}: {rule}"
    elif error["type"] == "missing":
        line = f"{origin}: {key} is missing"
    elif error["type"] in _UNKNOWN_KEY:
        near = difflib.get_close_matches(str(error["loc"][-1]), _keys_at(kind, error["loc"][:-1], tags), n=1)
        line = f"{origin}: {key} is not a known key" + (f"; did you mean {near[0]}?" if near else "")
    elif isinstance(error["input"], (str, int, float, bool)):
        line = f"{origin}: {key}: {rule}, got {checks.shown(error['input'])}"
    else:
        line = f"{origin}: {key}: {rule}"
    return InputError(line + (f" (and {others} more)" if others else ""))


def _keys_at(kind: typing.Any, loc: tuple[int | str, ...], tags: Mapping[str, type]) -> list[str]:
    """Names of the fields that a table of the file may hold."""
    for part in loc:
        if part in tags:
            kind = tags[str(part)]
        elif dict in (kind, typing.get_origin(kind)) or isinstance(part, int):
            kind = next(iter(reversed(typing.get_args(kind))), None)
        else:
            kind = typing.get_type_hints(kind).get(str(part)) if hasattr(kind, "__annotations__") else None
        options = [a for a in typing.get_args(kind) if a is not type(None)]
        if type(None) in typing.get_args(kind) and len(options) == 1:
            kind = options[0]
    return list(getattr(kind, "__dataclass_fields__", {}))
