"""Faces bounded by lines of their parameters, meshed in rows: fewer triangles than a mesher's, and better shaped."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from clamp3d.brep.surfaces import SPHERE, TORUS, Size
from clamp3d.core.mesh import Array, IntArray

_NEAR = 1e-9


def divisions(kind: int, size: Size, span: float, chord: float) -> int:
    """Triangles that a row of a ball or torus takes over a ``span`` (rad) of its angle, for a ``chord`` error in mm."""
    radius = {SPHERE: size[0], TORUS: size[0] + size[1]}.get(kind, 0.0)
    return 1 if radius <= chord else math.ceil(span / (2.0 * math.acos(1.0 - chord / radius)))


def gridded(uv: Array, border: IntArray, least: Callable[[float], int]) -> tuple[IntArray, Array] | None:
    """Triangles (m, 3) in rows from one side of a rectangle of parameters to the other, and new nodes (k, 2) for them.

    They go round as the parameters do; the new nodes are numbered after the ``uv``.

    Parameters
    ----------
    uv : ndarray (n, 2)
        Parameters of the mesher's nodes.
    border : ndarray of int
        Nodes of the face's edges.
    least : callable
        How many triangles an inner row has at least over a span of the first parameter.

    Returns None where the border is no rectangle, or has other nodes on the left than on the right.
    """
    at = uv[border]
    low, high = at.min(axis=0), at.max(axis=0)
    near = _NEAR * (high - low)
    below, above = (_sorted(border[np.abs(at[:, 1] - x) <= near[1]], uv[:, 0]) for x in (low[1], high[1]))
    left, right = (_sorted(border[np.abs(at[:, 0] - x) <= near[0]], uv[:, 1]) for x in (low[0], high[0]))
    if len(left) < 2 or len(left) != len(right) or np.abs(uv[left, 1] - uv[right, 1]).max() > 1e-6 * (high - low)[1]:
        return None
    ends = [below[[0, -1]], above[[0, -1]]]
    if len(below) + len(above) + 2 * len(left) - 4 != len(border) or not np.array_equal(
        ends, np.column_stack([left, right])[[0, -1]]
    ):
        return None
    m = max(len(below) - 1, len(above) - 1, least(float(high[0] - low[0])))
    across = np.linspace(low[0], high[0], m + 1)[1:-1]
    inner = [np.column_stack([across, np.full(m - 1, v)]) for v in uv[left[1:-1], 1]]
    new = np.concatenate([np.zeros((0, 2)), *inner])
    numbers = len(uv) + np.arange(len(new)).reshape(-1, m - 1) if m > 1 else np.zeros((len(inner), 0), dtype=np.int64)
    sides = zip(left[1:-1], numbers, right[1:-1], strict=True)
    rows = [below, *(np.concatenate([[a], k, [b]]) for a, k, b in sides), above]
    u = np.concatenate([uv[:, 0], new[:, 0]])
    made = np.concatenate([_strip(one, other, u) for one, other in itertools.pairwise(rows)])
    return made, new


def _sorted(nodes: IntArray, by: Array) -> IntArray:
    return nodes[np.argsort(by[nodes], kind="stable")]


def _strip(low: IntArray, high: IntArray, u: Array) -> IntArray:
    """Triangles between two rows of nodes with parameters ``u``."""
    # Steps are taken in the order of where they end: each with the node that the other row has come to by then.
    i, j = np.arange(len(low) - 1), np.arange(len(high) - 1)
    first = np.searchsorted(u[high[1:-1]], u[low[1:]], side="left")
    second = np.append(np.searchsorted(u[low[1:-1]], u[high[1:-1]], side="right"), len(low) - 1)
    return np.concatenate(
        [
            np.column_stack([low[i], low[i + 1], high[first]]),
            np.column_stack([low[second], high[j + 1], high[j]]),
        ]
    )
