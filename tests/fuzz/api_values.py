"""Values to give to the API: any Python value, odd arrays, poses that are rigid, laid out oddly, or broken."""

from __future__ import annotations

import fractions
import math
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

import clamp3d
from clamp3d.core import pose as poses
from tests.fuzz import garbage

Rng = np.random.Generator


class _Odd:
    """No number, no array, no shape."""


def anything(rng: Rng, depth: int = 0) -> Any:
    """Any Python value."""
    way = rng.integers(10)
    if way <= 2:
        return garbage.pick(rng, garbage.NUMBERS)
    if way == 3:
        return garbage.pick(rng, garbage.TEXTS)
    if way == 4:
        return odd_array(rng)
    if way == 5 and depth < 2:
        return [anything(rng, depth + 1) for _ in range(rng.integers(5))]
    if way == 6 and depth < 2:
        return {garbage.pick(rng, ("P1", 1, None, "x")): anything(rng, depth + 1)}
    return garbage.pick(rng, _ODD)


_ODD: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    1,
    -1,
    7,
    2**31,
    2**63,
    10**400,
    -(10**400),
    1j,
    complex(7, 0),
    b"7",
    bytearray(b"x"),
    (),
    [],
    {},
    set(),
    frozenset({1}),
    range(3),
    object(),
    _Odd(),
    _Odd,
    len,
    Ellipsis,
    NotImplemented,
    slice(3),
    Decimal("7.5"),
    Decimal("NaN"),
    fractions.Fraction(7, 3),
    np.float32(7.0),
    np.float16(7.0),
    np.int8(7),
    np.uint64(2**63),
    np.bool_(True),
    np.complex128(7 + 1j),
    np.longdouble(7),
    np.datetime64("2020-01-01"),
    np.timedelta64(7, "s"),
    np.array(7.0),
    np.array([7.0]),
    np.array([]),
    np.array("7"),
    np.array(None),
    np.array([1, "x"], dtype=object),
    np.str_("7"),
    np.ma.masked,
    memoryview(b"abc"),
    Path("x"),
    ValueError("x"),
    clamp3d,
)


def odd_array(rng: Rng) -> Any:
    """An array or nested list of some shape and type."""
    shape = garbage.pick(
        rng,
        (
            (),
            (0,),
            (3,),
            (4,),
            (16,),
            (2, 3),
            (3, 3),
            (3, 4),
            (4, 4),
            (5, 5),
            (1, 4, 4),
            (0, 4, 4),
            (2, 4, 4),
            (4, 4, 2),
            (1, 1, 4, 4),
            (0, 3),
            (4, 0),
        ),
    )
    a = rng.normal(size=shape)
    way = rng.integers(12)
    if way == 0:
        return a.astype(np.float32)
    if way == 1:
        return a.astype(np.int64)
    if way == 2:
        return a.astype(object)
    if way == 3:
        return a + 1j
    if way == 4:
        return a.astype(str)
    if way == 5:
        return a.tolist()
    if way == 6:
        return np.where(a > 0, np.nan, a)
    if way == 7:
        return np.where(a > 0, np.inf, a)
    if way == 8:
        return np.full(shape, None)
    if way == 9:
        with np.errstate(all="ignore"):
            return a * garbage.pick(rng, garbage.NUMBERS)
    if way == 10:
        return a > 0
    return a


def rigid(rng: Rng, reach: float = 20.0) -> np.ndarray:
    """A rigid pose; a quarter turn in one of three."""
    T = poses.rotation(rng.normal(size=3), float(rng.uniform(-math.pi, math.pi)))
    if rng.integers(3) == 0:
        T = poses.rotation([[1, 0, 0], [0, 1, 0], [0, 0, 1]][int(rng.integers(3))], math.pi / 2).round()
    T[:3, 3] = rng.uniform(-reach, reach, 3)
    return T


def pose(rng: Rng) -> Any:
    """A pose, good in two of three, in some type and layout."""
    T = rigid(rng, 10.0 ** float(rng.uniform(-6, 9)) if rng.integers(4) == 0 else 20.0)
    return _layout(rng, T) if rng.integers(3) else _broken(rng, T)


def pose_batch(rng: Rng) -> Any:
    """Poses (n, 4, 4), good in two of three."""
    n = int(rng.choice([0, 1, 2, 7, 100], p=[0.1, 0.3, 0.3, 0.2, 0.1]))
    if rng.integers(300) == 0:
        n = 100_000
    T = np.array([rigid(rng) for _ in range(min(n, 7))]).reshape(-1, 4, 4)
    T = T[np.arange(n) % 7] if n else T
    if rng.integers(3):
        return _layout(rng, T)
    if n and rng.integers(2):
        k = int(rng.integers(n))
        bad = np.asarray(_broken(rng, T[k].copy(), shape=False))
        T = T.astype(bad.dtype) if bad.dtype.kind == "O" else T
        T[k] = bad
        return T
    return _broken(rng, T)


def _layout(rng: Rng, T: np.ndarray) -> Any:
    """The same numbers in another layout."""
    way = rng.integers(9)
    if way == 0:
        return np.asfortranarray(T)
    if way == 1:
        wide = np.zeros((*T.shape[:-1], 8))
        wide[..., ::2] = T
        return wide[..., ::2]
    if way == 2:
        T = T.copy()
        T.flags.writeable = False
        return T
    if way == 3:
        return T.tolist()
    if way == 4:
        return T.astype(object)
    if way == 5:
        return T.astype(">f8")
    if way == 6 and T.ndim == 2:
        return tuple(map(tuple, T))
    return T


def _broken(rng: Rng, T: np.ndarray, *, shape: bool = True) -> Any:
    way = rng.integers(14 if shape else 8)
    T = T.copy()
    if way == 0:
        T[..., :3, :3] *= float(rng.choice([2.0, 1.001, 1.0 + 1e-7, 0.0, -1.0, 1e-300, 1e200]))
    elif way == 1:
        T[..., :3, 0] *= -1.0
    elif way == 2:
        T[..., 0, 1] += float(rng.choice([1e-6, 0.1, 1e300]))
    elif way == 3:
        T[..., int(rng.integers(4)), int(rng.integers(4))] = garbage.pick(rng, garbage.NUMBERS)
    elif way == 4:
        T[..., 3, :] = rng.normal(size=4)
    elif way == 5:
        T[..., :3, 3] = float(rng.choice([1e99, 1e101, 1e155, 1e300]))
    elif way == 6:
        T[...] = np.nan
    elif way == 7:
        T[...] = 0.0
    elif way == 8:
        return T.astype(complex) + 1e-3j
    elif way == 9:
        return T.astype(str)
    elif way == 10:
        return T[..., :3]
    elif way == 11:
        return T.astype(np.float32)
    elif way == 12:
        return T[None]
    else:
        return odd_array(rng)
    return T
