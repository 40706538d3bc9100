"""Bad and nearly good values as strategies, and ways to spoil a document, a file's bytes or a pose."""

from __future__ import annotations

import copy
import fractions
import json
import math
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import clamp3d
from clamp3d.core import pose as poses

Draw = Callable[..., Any]
"""What `hypothesis.strategies.data` gives: a strategy in, a value out."""

NUMBERS = st.floats() | st.sampled_from([0.0, 1.0, -1.0, 1e-12, 1e5, 99999.99999, 1e12, 1e154, math.pi, 90.0, 180.0])
_TEXT = "nan|1e400|0x10|mm|P1|P9|-1|--|*|[|1,2|a:b|%s%n{}{0}|[bold]x[/bold]|C:\\x|../../etc/passwd||"
_TEXT += " |ref\nerence|\x00|\x1b[31mred|\u202eright|\U0001f529|١٢|<script>alert(1)</script>|" + "a" * 5000
TEXTS = st.sampled_from(_TEXT.split("|")) | st.text(max_size=8)
_SIMPLE = NUMBERS | TEXTS | st.booleans() | st.sampled_from([0, 1, -1, 7, 2**31, 2**63 - 1, -(2**63)])
_KEYS = st.sampled_from(["x", "radius", "P1", "", "a.b", "Ü", "shape"])
TOML = st.recursive(
    _SIMPLE, lambda x: st.lists(x, max_size=4) | st.dictionaries(_KEYS, x, max_size=1), max_leaves=8
) | st.integers(1, 60).map(lambda n: _deep(n))
"""Any value that TOML can hold, most of them wrong where they go."""


def _deep(n: int) -> Any:
    value: Any = 1.0
    for k in range(n):
        value = [value] if k % 3 else {"x": value}
    return value


def pick(draw: Draw, *options: Any) -> Any:
    """One of ``options``."""
    return draw(st.sampled_from(options))


def chance(draw: Draw, n: int) -> bool:
    """True once in ``n`` times."""
    return bool(draw(st.integers(0, n - 1)) == n - 1)  # the simplest input has nothing special


def power(draw: Draw, low: float, high: float) -> float:
    """Ten to a power from ``low`` to ``high``."""
    return float(10.0 ** draw(st.floats(low, high)))


def near(draw: Draw, value: float) -> float:
    """A number near ``value``, from a rounding error to a factor."""
    return float(
        pick(
            draw,
            lambda: math.nextafter(value, pick(draw, -math.inf, math.inf)),
            lambda: value * (1.0 + pick(draw, -1.0, 1.0) * power(draw, -15, -3)),
            lambda: value * draw(st.floats(0.9, 1.1)),
            lambda: value * power(draw, -6, 6),
            lambda: -value,
            lambda: round(value) if math.isfinite(value) else 0.0,
        )()
    )


# --- TOML -------------------------------------------------------------------------------------------------------------


def to_toml(data: dict[str, Any]) -> bytes:
    """``data`` as a TOML document, every table inline below the first level (short, and any nesting goes)."""
    return "".join(f"{_text(k)} = {_value(v)}\n" for k, v in data.items()).encode("utf-8", "surrogatepass")


def _text(text: str) -> str:
    # JSON's escapes of astral characters are pairs of surrogates, which TOML does not know.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_text(k)} = {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    return _text(value) if isinstance(value, str) else repr(value).lower()


def changed(data: Any, change: Callable[[float], float], but: tuple[str, ...] = (), key: str = "") -> Any:
    """The same data with all its decimal numbers changed, except those under keys that end with one of ``but``."""
    if isinstance(data, dict):
        return {k: changed(v, change, but, k) for k, v in data.items()}
    if isinstance(data, list):
        return [changed(v, change, but, key) for v in data]
    return change(data) if isinstance(data, float) and not (but and key.endswith(but)) else data


def jitter(draw: Draw, data: Any) -> tuple[str, Any]:
    """The same data with all its decimal numbers changed a little."""
    share, rng = power(draw, -12, -1), np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return f"changed by {share:.1e}", changed(data, lambda x: x * (1.0 + float(rng.normal(0.0, share))))


def _leaves(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path] * bool(path) + [leaf for key, value in items for leaf in _leaves(value, (*path, key))]


def spoil(draw: Draw, data: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """One to three changes of a document's data: a number nearly right, any value, nothing, a key misspelt or more."""
    data, done = copy.deepcopy(data), []
    for _ in range(pick(draw, 1, 1, 1, 2, 3)):
        if not (paths := _leaves(data)):
            break
        *way, key = pick(draw, *paths)
        holder: Any = data
        for step in way:
            holder = holder[step]
        old, name, change = holder[key], ".".join(map(str, [*way, key])), draw(st.integers(0, 7))
        if change <= 2 and type(old) in (int, float):
            holder[key] = near(draw, float(old))
        elif change <= 4:
            holder[key] = draw(TOML)
        elif change == 5:
            del holder[key]
        elif change == 6 and isinstance(key, str) and key:
            holder[key[:-1] if chance(draw, 2) else f"{key}x"] = holder.pop(key)
        else:
            (holder if isinstance(holder, dict) else data)[pick(draw, "radius", "", "T", "a b", "Ünit")] = draw(TOML)
        done.append(f"{['=', '~', '~', '*', '*', '-', 'misspelt', '+'][change]} {name}")
    return "; ".join(done), data


# --- Bytes ------------------------------------------------------------------------------------------------------------


def spoil_bytes(draw: Draw, content: bytes) -> tuple[str, bytes]:
    """One change of a file's bytes."""
    i, j = sorted(draw(st.tuples(*[st.integers(0, len(content))] * 2)))
    way = pick(draw, "cut", "bits", "put in", "noise", "empty", "zeros", "twice", "swapped", "left out", "long line")
    if way == "bits":
        out = bytearray(content)
        for at in draw(st.lists(st.integers(0, len(content) - 1), max_size=20)) if content else ():
            out[at] ^= 1 << draw(st.integers(0, 7))
        return way, bytes(out)
    made = {
        "cut": lambda: content[:i],
        "put in": lambda: content[:i] + draw(st.binary(min_size=1, max_size=30)) + content[i:],
        "noise": lambda: draw(st.binary(max_size=2000)),
        "empty": lambda: b"",
        "zeros": lambda: bytes(i % 500 + 1),
        "twice": lambda: content + content,
        "swapped": lambda: content[j:] + content[i:j] + content[:i],
        "left out": lambda: content[:i] + content[j:],
        "long line": lambda: content[:i] + b"9" * 6000 + content[i:],
    }
    return way, made[way]()


SAME = ("CRLF", "UTF-8 with a mark")
"""Ways to write a text that leave its meaning alone."""


def spoil_text(draw: Draw, text: str) -> tuple[str, bytes]:
    """A text file in another encoding, with other line ends, or with its bytes changed."""
    lines = text.splitlines()
    i = draw(st.integers(0, len(lines) - 1))
    ways = {
        "UTF-8 with a mark": b"\xef\xbb\xbf" + text.encode(),
        "CRLF": text.replace("\n", "\r\n").encode(),
        "UTF-16": text.encode("utf-16"),
        "CR": text.replace("\n", "\r").encode(),
        "a line twice": "\n".join([*lines[:i], lines[i], *lines[i:]]).encode(),
        "latin-1": (text + "\n# é\n").encode("latin-1"),
    }
    way = pick(draw, *ways, *["bytes"] * 4)
    return (way, ways[way]) if way in ways else spoil_bytes(draw, text.encode())


# --- Python values and poses ------------------------------------------------------------------------------------------


class _Odd:
    """No number, no array, no shape."""


_ODD = [None, 10**400, 1j, 7 + 0j, b"7", bytearray(b"x"), (), [], {}, set(), frozenset({1}), range(3), object(), _Odd()]
_ODD += [_Odd, len, Ellipsis, NotImplemented, slice(3), Decimal("7.5"), Decimal("NaN"), fractions.Fraction(7, 3)]
_ODD += [np.float32(7.0), np.float16(7.0), np.int8(7), np.uint64(2**63), np.bool_(True), np.complex128(7 + 1j)]
_ODD += [np.longdouble(7), np.datetime64("2020-01-01"), np.timedelta64(7, "s"), np.str_("7"), np.ma.masked]
_ODD += [np.array(x) for x in (7.0, [7.0], [], "7", None)] + [np.array([1, "x"], dtype=object)]
_ODD += [memoryview(b"abc"), Path("x"), ValueError("x"), clamp3d]
ANYTHING = st.recursive(
    _SIMPLE | st.sampled_from(_ODD),
    lambda x: st.lists(x, max_size=4) | st.dictionaries(st.sampled_from(["P1", 1, None, "x"]), x, max_size=1),
    max_leaves=4,
)
"""Any Python value."""


@st.composite
def rigid(draw: Draw, reach: float = 20.0) -> np.ndarray:
    """A rigid pose; a quarter turn in one of three."""
    axis = draw(st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda x: np.linalg.norm(x) > 1e-3))
    T = poses.rotation(axis, draw(st.floats(-math.pi, math.pi)))
    if chance(draw, 3):
        T = poses.rotation(pick(draw, [1, 0, 0], [0, 1, 0], [0, 0, 1]), math.pi / 2).round()
    T[:3, 3] = draw(st.tuples(*[st.floats(-reach, reach)] * 3))
    return T


_LAYOUTS = [lambda T: T, np.asfortranarray, np.ndarray.tolist, lambda T: T.astype(object), lambda T: T.astype(">f8")]


def _broken(draw: Draw, T: np.ndarray) -> Any:
    """A pose or a batch of them that is none any more, or just not quite."""
    T, way = T.copy(), draw(st.integers(0, 10))
    if way == 0:
        T[..., :3, :3] *= pick(draw, 2.0, 1.001, 1.0 + 1e-7, 0.0, -1.0, 1e-300, 1e200)
    elif way == 1:
        T[..., :3, 0] *= -1.0
    elif way == 2:
        T[..., 0, 1] += pick(draw, 1e-6, 0.1, 1e300)
    elif way == 3:
        T[..., draw(st.integers(0, 3)), draw(st.integers(0, 3))] = draw(NUMBERS)
    elif way == 4:
        T[..., :3, 3] = pick(draw, 1e99, 1e101, 1e155, 1e300)
    elif way == 5:
        T[...] = pick(draw, np.nan, 0.0)
    else:
        return pick(draw, T.astype(complex) + 1e-3j, T.astype(str), T[..., :3], T.astype(np.float32), T[None])
    return T


@st.composite
def any_pose(draw: Draw) -> Any:
    """A pose, good in two of three, in some type and layout."""
    T = draw(rigid(power(draw, -6, 9) if chance(draw, 4) else 20.0))
    return _broken(draw, T) if chance(draw, 3) else pick(draw, *_LAYOUTS)(T)


@st.composite
def pose_batch(draw: Draw) -> Any:
    """Poses (n, 4, 4), good in two of three."""
    n = 100_000 if chance(draw, 300) else pick(draw, 0, 1, 1, 2, 2, 7, 100)
    few = np.array(draw(st.lists(rigid(), min_size=min(n, 3), max_size=min(n, 3)))).reshape(-1, 4, 4)
    T = few[np.arange(n) % max(1, len(few))]
    if not chance(draw, 3):
        return pick(draw, *_LAYOUTS)(T)
    if n and chance(draw, 2) and np.shape(bad := _broken(draw, T[0])) == (4, 4) and bad.dtype == float:
        T[draw(st.integers(0, n - 1))] = bad
        return T
    return _broken(draw, T)
