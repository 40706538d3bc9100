"""A binary heap of rows (n, k) in an array: the order of `heapq` and its tuples, without memory of its own.

What allocates memory is kept by numba alone, and to load that takes longer than most commands work (`jit`).
"""

from __future__ import annotations

from clamp3d.core.jit import formula


@formula
def before(rows, i, j):  # type: ignore[no-untyped-def]
    """Whether row i comes before row j: by the first number in which they differ."""
    for k in range(rows.shape[1]):
        if rows[i, k] != rows[j, k]:
            return rows[i, k] < rows[j, k]
    return False


@formula
def swap(rows, i, j):  # type: ignore[no-untyped-def]
    """Exchange rows i and j."""
    for k in range(rows.shape[1]):
        rows[i, k], rows[j, k] = rows[j, k], rows[i, k]


@formula
def push(rows, n):  # type: ignore[no-untyped-def]
    """Row n joins the heap of the n rows before it; returns n + 1."""
    i = n
    while i > 0 and before(rows, i, (i - 1) // 2):
        swap(rows, i, (i - 1) // 2)
        i = (i - 1) // 2
    return n + 1


@formula
def put(rows, n, a, b, c, d, e):  # type: ignore[no-untyped-def]
    """A row of five numbers joins the heap of n rows; returns n + 1."""
    rows[n, 0], rows[n, 1], rows[n, 2], rows[n, 3], rows[n, 4] = a, b, c, d, e
    return push(rows, n)


@formula
def pop(rows, n):  # type: ignore[no-untyped-def]
    """The first of n rows leaves the heap: it is row n - 1 then; returns n - 1."""
    n -= 1
    swap(rows, 0, n)
    i = 0
    while 2 * i + 1 < n:
        child = 2 * i + 1
        if child + 1 < n and before(rows, child + 1, child):
            child += 1
        if not before(rows, child, i):
            break
        swap(rows, i, child)
        i = child
    return n
