"""Bad and nearly good values as strategies, and ways to spoil a document, a file's bytes or a pose."""

import copy
import fractions
import json
import math
from decimal import Decimal
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

import clamp3d
from tests.kinds import poses

NUMBERS = st.floats() | st.sampled_from([0.0, 1.0, -1.0, 1e-12, 99999.99999, 1e12, 1e154, math.pi, 90.0, 180.0])
_TEXT = "nan|1e400|0x10|mm|P1|P9|-1|--|*|[|1,2|a:b|%s%n{}{0}|[bold]x[/bold]|C:\\x|../../etc/passwd|| "
_TEXT += "|ref\nerence|\x00|\x1b[31mred|\u202eright|\U0001f529|١٢|<script>alert(1)</script>|" + "a" * 5000
TEXTS = st.sampled_from(_TEXT.split("|")) | st.text(max_size=8)
_SIMPLE = NUMBERS | TEXTS | st.booleans() | st.sampled_from([0, 1, -1, 7, 2**31, 2**63 - 1, -(2**63)])
_KEYS = st.sampled_from(["x", "radius", "P1", "", "a.b", "Ü", "shape"])
TOML = st.recursive(_SIMPLE, lambda x: st.lists(x, max_size=4) | st.dictionaries(_KEYS, x, max_size=1), max_leaves=8)
"""Any value that TOML can hold, most of them wrong where they go."""

_ODD = [None, 10**400, 1j, b"7", (), [], {}, set(), range(3), object(), len, Ellipsis, slice(3), Decimal("NaN")]
_ODD += [fractions.Fraction(7, 3), np.float32(7.0), np.uint64(2**63), np.complex128(7 + 1j), np.longdouble(7)]
_ODD += [np.datetime64("2020-01-01"), np.str_("7"), np.ma.masked, Path("x"), ValueError("x"), clamp3d]
_ODD += [np.array(x) for x in (7.0, [7.0], [], "7", None)] + [np.array([1, "x"], dtype=object)]
ANYTHING = st.recursive(
    _SIMPLE | st.sampled_from(_ODD),
    lambda x: st.lists(x, max_size=4) | st.dictionaries(st.sampled_from(["P1", 1, None, "x"]), x, max_size=1),
    max_leaves=4,
)
"""Any Python value."""


def pick(draw, *options):
    """One of ``options``."""
    return draw(st.sampled_from(options))


def power(draw, low, high):
    """Ten to a power from ``low`` to ``high``."""
    return float(10.0 ** draw(st.floats(low, high)))


def near(draw, value):
    """A number near ``value``, from a rounding error to a factor."""
    ways = (
        lambda: math.nextafter(value, pick(draw, -math.inf, math.inf)),
        lambda: value * (1.0 + pick(draw, -1.0, 1.0) * power(draw, -15, -1)),
        lambda: value * power(draw, -6, 6),
        lambda: -value,
    )
    return float(pick(draw, *ways)())


def to_toml(value, top=True):
    """A TOML document, every table inline below the first level."""
    if isinstance(value, dict):
        lines = [f"{to_toml(str(k), False)} = {to_toml(v, False)}" for k, v in value.items()]
        return "\n".join(lines) if top else "{" + ", ".join(lines) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(to_toml(v, False) for v in value) + "]"
    if isinstance(value, str):  # JSON's escapes of astral characters are pairs of surrogates, which TOML does not know
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value).lower()


def _leaves(data, path=()):
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path] * bool(path) + [leaf for key, value in items for leaf in _leaves(value, (*path, key))]


def spoil(draw, data):
    """A copy of a document's data with one to three changes: a number nearly right, any value, nothing, a wrong key."""
    data = copy.deepcopy(data)
    for _ in range(pick(draw, 1, 1, 1, 2, 3)):
        *way, key = pick(draw, *(_leaves(data) or [("x",)]))
        holder = data
        for step in way:
            holder = holder[step]
        change = pick(draw, "near", "near", "other", "other", "gone", "misspelt", "more")
        if change == "near" and key in holder and type(holder[key]) in (int, float):
            holder[key] = near(draw, float(holder[key]))
        elif change == "gone" and way:
            del holder[key]
        elif change == "misspelt" and isinstance(key, str):
            holder[f"{key}x"] = holder.pop(key, 1.0)
        elif change == "more" and isinstance(holder, dict):
            holder[pick(draw, "radius", "", "T", "a b", "Ünit")] = draw(TOML)
        else:
            holder[key] = draw(TOML)
    return data


def spoil_bytes(draw, content):
    """One change of a file's bytes."""
    i, j = sorted(draw(st.tuples(*[st.integers(0, len(content))] * 2)))
    more = draw(st.binary(max_size=30)) + b"9" * pick(draw, 0, 0, 0, 6000)
    flipped = bytes(byte ^ 1 << draw(st.integers(0, 7)) for byte in content[i : i + 4])
    changed = content[:i] + flipped + content[i + 4 :]
    return pick(draw, changed, changed, content[:i], content[:i] + content[j:], content[:i] + more + content[i:], more)


@st.composite
def any_pose(draw):
    """A pose in some type and layout, one in three no pose any more, or just not quite."""
    T = draw(poses(20.0))
    if pick(draw, True, True, False):
        return pick(draw, lambda T: T, np.asfortranarray, np.ndarray.tolist, lambda T: T.astype(">f8"))(T)
    T[draw(st.integers(0, 3)), draw(st.integers(0, 3))] += pick(draw, 0.0, draw(NUMBERS))
    factor = pick(draw, 2.0, -1.0, 1.001, 1.0 + 1e-7, 0.0, 1e-300, 1e200)
    return pick(draw, T * [[factor, 1, 1, 1]], T * factor, T + 1e-3j, T.astype(str), T[:3], T[None], T.astype(object))
