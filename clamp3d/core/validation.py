"""What pydantic finds wrong, as one line: origin, key, value and rule."""

from __future__ import annotations

import functools
import typing
from collections.abc import Mapping

from pydantic import TypeAdapter, ValidationError

from clamp3d import checks
from clamp3d.errors import InputError

_UNKNOWN_KEY = {"unexpected_keyword_argument", "extra_forbidden"}

T = typing.TypeVar("T")


def one_line_errors(kind: type[T]) -> type[T]:
    """A pydantic dataclass that raises InputError with one line when it is made of wrong values."""
    make = kind.__init__

    @functools.wraps(make)
    def init(self: T, *args: typing.Any, **values: typing.Any) -> None:
        try:
            make(self, *args, **values)
        except ValidationError as failure:
            raise _one_line(failure, kind, kind.__name__, {}) from None

    kind.__init__ = init  # type: ignore[assignment, method-assign]
    return kind


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
        import difflib

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
    return list(getattr(kind, "__pydantic_fields__", {}))
