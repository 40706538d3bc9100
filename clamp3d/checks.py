"""Each function validates and converts one argument from outside, or raises InputError.

A number is a real number: an int, a float, a NumPy scalar or a zero-dimensional array. Strings, bools and complex
numbers are refused, not converted.
"""

from __future__ import annotations

import math
import numbers
import os
import stat
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.errors import InputError


def shown(value: object) -> str:
    """``repr`` of a value on one short line, for messages.

    >>> shown("a" * 200)[-12:]
    'aaaaaaaa ...'
    """
    if isinstance(value, (np.ndarray, np.generic)):
        if value.size > 6:
            return f"array of shape {value.shape}"
        value = value.tolist()
    try:
        text = repr(value[:80] if isinstance(value, (str, bytes)) else value)
    except Exception:  # an int with more digits than Python prints; an object without a repr
        return type(value).__name__
    text = " ".join(text.split())
    return text if len(text) <= 80 and not (isinstance(value, str) and len(value) > 80) else text[:76] + " ..."


_READ: list[set[str]] = []
"""Of each block of `files_read` that has begun: the files that were read in it."""


@contextmanager
def files_read() -> Iterator[set[str]]:
    """The real paths of the files that are read in the block: a set that grows."""
    files: set[str] = set()
    _READ.append(files)
    try:
        yield files
    finally:
        _READ.pop()


def note_read(files: Iterable[str | Path]) -> None:
    """Note files as read, for the blocks of `files_read` that this is called in."""
    for read in _READ:
        read.update(map(os.path.realpath, files))


def is_read(path: Path) -> bool:
    """Whether a file was read in a block of `files_read` that this is called in."""
    return any(os.path.realpath(path) in read for read in _READ)


def readable_file(path: Path, most: float = math.inf) -> int:
    """Size in bytes of a regular file (no folder, pipe or device) of at most ``most`` bytes."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise InputError(f"{short(path)}: no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{short(path)}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{short(path)}: not a regular file")
    if status.st_size > most:
        raise InputError(f"{short(path)}: {status.st_size} bytes, at most {most:.0f} are read")
    note_read([path])
    return status.st_size


def short(value: object, most: int = 200) -> str:
    """``str`` of a value, for messages; a long one without its middle."""
    text = str(value)
    return text if len(text) <= most else f"{text[: most // 2]} ... {text[-most // 2 :]}"


def number(name: str, value: object, *, rule: str = "be a finite number") -> float:
    """A finite real number as a float.

    >>> number("angle", np.float32(0.5))
    0.5
    """
    x = value if type(value) is float else real(value)  # solvers ask thousands of times
    if x is None or not math.isfinite(x):
        raise InputError(f"{name} must {rule}, got {shown(value)}")
    return x


def real(value: object) -> float | None:
    """A real number as a float, also NaN and infinities; None for anything else."""
    if isinstance(value, np.ndarray):
        if value.ndim or value.dtype.kind not in "iuf" or isinstance(value, np.ma.MaskedArray):
            return None
        value = value.item()
    if not isinstance(value, numbers.Real) or isinstance(value, (bool, np.timedelta64)):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def positive(name: str, value: object) -> float:
    """A finite length > 0 mm as a float.

    >>> positive("radius", -1)
    Traceback (most recent call last):
    clamp3d.errors.InputError: radius must be a finite length > 0 mm, got -1
    """
    x = number(name, value, rule="be a finite length > 0 mm")
    if not x > 0.0:
        raise InputError(f"{name} must be a finite length > 0 mm, got {shown(value)}")
    return x


def whole(name: str, value: object, *, least: int, most: int | None = None) -> int:
    """An integer from ``least`` to ``most``."""
    if isinstance(value, numbers.Integral) and not isinstance(value, (bool, np.timedelta64)):
        n = int(value)
        if n >= least and (most is None or n <= most):
            return n
    rule = f">= {least}" if most is None else f"from {least} to {most}"
    raise InputError(f"{name} must be a whole number {rule}, got {shown(value)}")


def array(name: str, value: object, shape: tuple[int | None, ...], *, finite: bool = True) -> NDArray[np.float64]:
    """Real numbers as a float64 array of ``shape``, with None for any length; a float64 array is not copied.

    >>> array("axis", (0, 0, 1), (3,)).tolist()
    [0.0, 0.0, 1.0]
    >>> array("axis", "xyz", (3,))
    Traceback (most recent call last):
    clamp3d.errors.InputError: axis must be an array of numbers with shape (3,), got 'xyz'
    """
    words = ", ".join("n" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "")
    rule = f"{name} must be an array of numbers with shape ({words})"
    out = _as_floats(value)
    if out is None:
        raise InputError(f"{rule}, got {shown(value)}")
    if out.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, out.shape, strict=True)):
        raise InputError(f"{name} must have shape ({words}), got {out.shape}")
    if finite and not np.isfinite(out).all():
        row = np.argwhere(~np.isfinite(out))[0]
        raise InputError(f"{name} must be finite, got {out[tuple(row)]} at {row.tolist()}")
    return out


def _as_floats(value: object) -> NDArray[np.float64] | None:
    """Real numbers of any type as float64; None for anything else."""
    if "numpy.ma" in sys.modules and isinstance(value, np.ma.MaskedArray):  # NumPy imports it on first use
        return None
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return value.view(np.ndarray)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a masked number in a list: NaN
            out = np.asarray(value)
        is_object = out.dtype.kind == "O"
        if out.dtype.kind not in "biufO" or (is_object and any(real(item) is None for item in out.flat)):
            return None
        with np.errstate(over="ignore"):
            return out.astype(np.float64)
    except (TypeError, ValueError, OverflowError, RecursionError):
        return None


def instance(name: str, value: object, *kinds: type) -> None:
    """Raise InputError unless ``value`` is of one of ``kinds``.

    >>> instance("clamp", "reference", dict)
    Traceback (most recent call last):
    clamp3d.errors.InputError: clamp must be a dict, got str
    """
    if not isinstance(value, kinds):
        words = " or ".join(kind.__name__ for kind in kinds)
        article = "an" if words[0] in "AEIOUaeiou" else "a"
        raise InputError(f"{name} must be {article} {words}, got {type(value).__name__}")


def flag(name: str, value: object) -> bool:
    """True or False."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise InputError(f"{name} must be True or False, got {shown(value)}")


def choice(name: str, value: object, choices: Iterable[str]) -> None:
    """Raise InputError unless ``value`` is one of ``choices``, which the message lists."""
    choices = tuple(choices)
    if not (isinstance(value, str) and value in choices):
        raise InputError(f"{name} must be one of {', '.join(choices)}, got {shown(value)}")


def items(name: str, value: object, what: str) -> tuple[Any, ...]:
    """The items of a list, tuple or other sequence, not of a string; ``what`` names them in the message."""
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview)):
        return tuple(value)
    if isinstance(value, (set, frozenset, np.ndarray)) and getattr(value, "ndim", 1) > 0:
        return tuple(value)
    raise InputError(f"{name} must be a list of {what}, got {shown(value)}")


def text(name: str, value: object) -> str:
    """A text."""
    if not isinstance(value, str):
        raise InputError(f"{name} must be a text, got {shown(value)}")
    return value


def function(name: str, value: object) -> None:
    """Raise InputError unless ``value`` is None or can be called."""
    if value is not None and not callable(value):
        raise InputError(f"{name} must be a function, got {shown(value)}")


def path(name: str, value: object) -> Path:
    """A file's or a folder's path, from a text or a path."""
    if isinstance(value, (str, os.PathLike)):
        plain = os.fspath(value)
        if isinstance(plain, str) and "\0" not in plain:
            return Path(plain)
    raise InputError(f"{name} must be a path, got {shown(value)}")
