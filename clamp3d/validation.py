"""Validates values from files and from Python against dataclasses, by msgspec; errors are one line."""

from __future__ import annotations

import functools
import math
import re
import typing
from dataclasses import dataclass, fields, is_dataclass

import msgspec
import numpy as np

from clamp3d import checks
from clamp3d.errors import InputError

T = typing.TypeVar("T")

_WORDS = {">": "greater than", ">=": "at least", "<": "less than", "<=": "at most"}
_KINDS = {
    "float": "a valid number",
    "int": "a whole number",
    "str": "a text",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}


@typing.dataclass_transform(kw_only_default=True, frozen_default=True)
def checked(kind: type[T]) -> type[T]:
    """A frozen dataclass with keyword arguments only, which raises InputError for invalid values."""

    cls: typing.Any = dataclass(frozen=True, slots=True, kw_only=True)(kind)

    @functools.wraps(cls.__init__)
    def init(self: T, **values: typing.Any) -> None:
        plain = {key: value.item() if isinstance(value, np.generic) else value for key, value in values.items()}
        converted = validate(cls, plain, cls.__name__)
        for field in fields(cls):
            object.__setattr__(self, field.name, getattr(converted, field.name))

    cls.__init__ = init
    checked_class: type[T] = cls
    return checked_class


def validate(kind: typing.Any, data: typing.Any, origin: str, key: str = "", *, strict: bool = True) -> typing.Any:
    """Convert ``data`` to ``kind`` (a dataclass or a msgspec.Struct); ``key`` is its place in ``origin``.

    Unless ``strict``, a number may also be a string.
    Raises InputError: one line with origin, key, value and rule.
    """
    if isinstance(data, dict) and isinstance(kind, type) and is_dataclass(kind):
        hints, data = _hints(kind), dict(data)
        for name, value in data.items():
            if name not in hints:  # which msgspec ignores
                raise InputError(f"{origin}: {_unknown(_joined(key, name), name, list(hints))}")
            if isinstance(value, dict):
                data[name] = validate(_bare(hints[name]), value, origin, _joined(key, name))
    try:
        return msgspec.convert(data, kind, strict=strict)
    except msgspec.ValidationError as failure:
        raise InputError(f"{origin}: {_message(failure, kind, data, key)}") from None


@functools.cache
def _hints(kind: typing.Any) -> dict[str, typing.Any]:
    return typing.get_type_hints(kind, include_extras=True)


def _message(failure: msgspec.ValidationError, kind: typing.Any, data: typing.Any, key: str) -> str:
    """Key, value and rule for an error of msgspec."""
    message, _, path = str(failure).partition(" - at `")
    for name, number in re.findall(r"\.(\w+)|\[(\d+|\.\.\.)\]", path):
        key, kind, data = _below(key, kind, data, name or number)
    if failure.__cause__ is not None:  # one of our own rules; it begins with the key
        return _joined(checks.short(key, 100), str(failure.__cause__))
    kind = _bare(kind)
    if path.startswith("key` in `"):
        kind = typing.get_args(kind)[0]
        data = next(name for name in data if not _is(name, kind))
        key = _joined(key, data)
    named = re.search(r"(missing required|unknown) field `(.*)`", message)
    if named is not None:
        where = _joined(key, named[2])
        return f"{where} is missing" if named[1] != "unknown" else _unknown(where, named[2], kind.__struct_fields__)
    return f"{checks.short(key, 100)}: must be {_rule(message, kind, data)}, got {checks.shown(data)}"


def _rule(message: str, kind: typing.Any, data: typing.Any) -> str:
    """The rule of ``kind`` that ``data`` breaks, from msgspec's ``message``."""
    if typing.get_origin(kind) is typing.Literal:
        *most, last = map(repr, typing.get_args(kind))
        return f"{', '.join(most)} or {last}" if most else last
    if length := re.fullmatch(r"Expected `array` (of length \d+), got \d+", message):
        return length[1]
    bound = re.fullmatch(r"Expected `(\w+)` (?:of length )?([<>]=?) (.*)", message)
    is_float = bound is not None and bound[1] == "float" and isinstance(data, (float, str))
    if bound is not None and not (is_float and not math.isfinite(float(data))):
        return f"{'of length ' * (bound[1] == 'array')}{_WORDS[bound[2]]} {float(bound[3]):g}"
    expected = re.match(r"Expected `(.*?)`, got", message)
    words = [_KINDS[word] for word in expected[1].split(" | ") if word in _KINDS] if expected else []
    return " or ".join(words) or "a finite number"


def _below(key: str, kind: typing.Any, data: typing.Any, step: str) -> tuple[str, typing.Any, typing.Any]:
    """Key, kind and value of one entry of a table or list; ``step`` `...` is the first invalid value."""
    kind = _bare(kind)
    inner = typing.get_args(kind)
    if step == "...":
        step = next(name for name, value in data.items() if not _is(value, inner[1]))
        return _joined(key, step), inner[1], data[step]
    if isinstance(data, (list, tuple)):
        number = int(step)
        return _joined(key, step), inner[min(number, len(inner) - 1)], data[number]
    value = data[step] if isinstance(data, dict) else getattr(data, step)
    return _joined(key, step), _hints(kind)[step], value


def _bare(kind: typing.Any) -> typing.Any:
    """A type without its bounds and without None."""
    while typing.get_origin(kind) is typing.Annotated or type(None) in typing.get_args(kind):
        kind = typing.get_args(kind)[0]
    return kind


def _is(value: typing.Any, kind: typing.Any) -> bool:
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError:
        return False
    return True


def _joined(key: str, name: str) -> str:
    return f"{key}.{name}" if key and name else f"{key}{name}"


def _unknown(where: str, name: str, known: typing.Sequence[str]) -> str:
    import difflib

    near = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"choices: {', '.join(known)}"
    return f"{checks.short(where, 100)} is not a known key; {hint}"
