"""Bad and nearly good values, and ways to spoil a TOML file."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

import numpy as np

Rng = np.random.Generator

NUMBERS: tuple[float, ...] = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    math.nan,
    math.inf,
    -math.inf,
    1e308,
    -1e308,
    1.7976931348623157e308,
    5e-324,
    1e-300,
    1e-160,
    1e-12,
    1e12,
    1e100,
    1.0000001e100,
    1e154,
    99999.99999,
    1e5,
    -99999.99999,
    math.pi,
    math.pi / 2,
    90.0,
    180.0,
    360.0,
    2.0**-52,
    1.0 - 2.0**-53,
    1.0 + 2.0**-52,
)

TEXTS: tuple[str, ...] = (
    "",
    " ",
    "nan",
    "1e400",
    "0x10",
    "mm",
    "P1",
    "P9",
    "ref\nerence",
    "tab\there",
    "\u0000",
    "\u001b[31mred",
    "\u202eright to left",
    "Ünïcödé",
    "\U0001f529",
    "𝟙𝟚",
    "١٢",
    "a" * 5000,
    "../../etc/passwd",
    "%s%n{}{0}",
    "[bold]x[/bold]",
    "<script>alert(1)</script>",
    "C:\\x",
    "*",
    "[",
    "-1",
    "--",
    "1,2",
    "a:b",
)


def pick(rng: Rng, options: Any) -> Any:
    """One of ``options``."""
    return options[int(rng.integers(len(options)))]


def near(rng: Rng, value: float) -> float:
    """A number near ``value``, from a rounding error to a factor."""
    way = rng.integers(6)
    if way == 0:
        return math.nextafter(value, float(rng.choice([-np.inf, np.inf])))
    if way == 1:
        return value * (1.0 + float(rng.choice([-1, 1])) * 10.0 ** float(rng.uniform(-15, -3)))
    if way == 2:
        return value * float(rng.uniform(0.9, 1.1))
    if way == 3:
        return value * 10.0 ** float(rng.uniform(-6, 6))
    if way == 4:
        return -value
    return float(round(value)) if math.isfinite(value) else 0.0


def toml_value(rng: Rng, depth: int = 0) -> Any:
    """Any value that TOML can hold, most of them wrong where they go."""
    way = rng.integers(9 if depth < 3 else 6)
    if way <= 2:
        return pick(rng, NUMBERS)
    if way == 3:
        return pick(rng, TEXTS)
    if way == 4:
        return bool(rng.integers(2))
    if way == 5:
        return int(pick(rng, (0, 1, -1, 2, 7, 2**31, 2**63 - 1, -(2**63), 10**18)))
    if way == 6:
        return [toml_value(rng, depth + 1) for _ in range(rng.integers(5))]
    if way == 7:
        return {pick(rng, ("x", "radius", "P1", "", "a.b", "Ü", "shape")): toml_value(rng, depth + 1)}
    deep: Any = 1.0
    for _ in range(int(rng.integers(1, 60))):
        deep = [deep] if rng.integers(2) else {"x": deep}
    return deep


def to_toml(data: Any) -> str:
    """``data`` as a TOML document, every table inline below the first level (short, and any nesting goes)."""
    return "".join(f"{_key(k)} = {_value(v)}\n" for k, v in data.items())


def _key(key: str) -> str:
    return json.dumps(key, ensure_ascii=True).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else {math.inf: "inf", -math.inf: "-inf"}.get(value, "nan")
    if isinstance(value, str):
        # JSON writes astral characters as surrogate pairs, which TOML does not know.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def leaves(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values, tables and arrays included."""
    found = [path] if path else []
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        found += leaves(value, (*path, key))
    return found


def at(data: Any, path: tuple[Any, ...]) -> Any:
    """The value at a path."""
    for key in path:
        data = data[key]
    return data


def spoil(rng: Rng, data: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """One to three changes of a document's data."""
    data = copy.deepcopy(data)
    done = []
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        paths = leaves(data)
        if not paths:
            break
        path = pick(rng, paths)
        holder, key, name = at(data, path[:-1]), path[-1], ".".join(str(p) for p in path)
        way = rng.integers(8)
        numeric = isinstance(holder[key], (int, float)) and not isinstance(holder[key], bool)
        if way <= 2 and numeric:
            holder[key] = near(rng, float(holder[key]))
            done.append(f"{name} = {holder[key]!r}")
        elif way <= 4:
            holder[key] = toml_value(rng)
            done.append(f"{name} = {str(holder[key])[:60]!r}")
        elif way == 5:
            del holder[key]
            done.append(f"no {name}")
        elif way == 6 and isinstance(holder, dict) and len(key) > 1:
            i = int(rng.integers(len(key)))
            new = key[:i] + key[i + 1 :] if rng.integers(2) else key[:i] + "x" + key[i:]
            holder[new] = holder.pop(key)
            done.append(f"{name} misspelt {new}")
        else:
            target = holder if isinstance(holder, dict) else data
            extra = str(pick(rng, ("radius", "colour", "", "T", "P1", "a b", "shape", "Ünit")))
            target[extra] = toml_value(rng)
            done.append(f"{extra!r} beside {name}")
    return "; ".join(done), data


def jitter(rng: Rng, data: Any, share: float) -> Any:
    """The same data with all its decimal numbers changed a little."""
    if isinstance(data, dict):
        return {k: jitter(rng, v, share) for k, v in data.items()}
    if isinstance(data, list):
        return [jitter(rng, v, share) for v in data]
    return data * (1.0 + float(rng.normal(0.0, share))) if isinstance(data, float) else data


def spoil_bytes(rng: Rng, content: bytes) -> tuple[str, bytes]:
    """One change of a file's bytes."""
    n = len(content)
    ways = ("cut", "flip", "insert", "noise", "empty", "zeros", "double", "swap", "drop", "long line")
    way = pick(rng, ways)
    if way == "cut":
        return "cut", content[: int(rng.integers(n + 1))]
    if way == "flip":
        out = bytearray(content)
        for _ in range(int(rng.integers(1, 20)) if n else 0):
            out[int(rng.integers(n))] ^= 1 << int(rng.integers(8))
        return "bits flipped", bytes(out)
    if way == "insert":
        i = int(rng.integers(n + 1))
        return "bytes put in", content[:i] + rng.bytes(int(rng.integers(1, 30))) + content[i:]
    if way == "noise":
        return "noise", rng.bytes(int(rng.integers(2000)))
    if way == "empty":
        return "empty", b""
    if way == "zeros":
        return "zeros", bytes(int(rng.integers(1, 500)))
    if way == "double":
        return "twice", content + content
    i, j = sorted(int(v) for v in rng.integers(n + 1, size=2))
    if way == "swap":
        return "pieces swapped", content[j:] + content[i:j] + content[:i]
    if way == "drop":
        return "a piece left out", content[:i] + content[j:]
    return "a long line", content[:i] + b"9" * 6000 + content[i:]


def spoil_text(rng: Rng, text: str) -> tuple[str, bytes]:
    """A text file in another encoding, with other line ends, or with its bytes changed."""
    way = rng.integers(10)
    if way == 0:
        return "UTF-8 with a mark", b"\xef\xbb\xbf" + text.encode()
    if way == 1:
        return "CRLF", text.replace("\n", "\r\n").encode()
    if way == 2:
        return "UTF-16", text.encode("utf-16")
    if way == 3:
        return "CR", text.replace("\n", "\r").encode()
    if way == 4:
        lines = text.splitlines()
        i = int(rng.integers(len(lines))) if lines else 0
        return "a line twice", "\n".join(lines[:i] + lines[i : i + 1] * 2 + lines[i + 1 :]).encode()
    if way == 5:
        return "latin-1", (text + "\n# é\n").encode("latin-1")
    return spoil_bytes(rng, text.encode())
