"""Compiled entry point of `nonnegative`: loops in one order, so the same bits whatever BLAS, cores or process.

All arrays are the caller's and are written into; nothing is allocated. Import this module only when it is needed.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula

_EPS = 2.0**-52


@formula
def _reduced(A, b, order, count, Q, y):  # type: ignore[no-untyped-def]
    """Least squares with the first ``count`` columns of A in ``order``, by Householder: solution into y (n,).

    False if the last of them is a sum of the others.
    """
    m = A.shape[0]
    for k in range(count):
        for i in range(m):
            Q[i, k] = A[i, int(order[k])]
    for i in range(m):
        Q[i, count] = b[i]
    for k in range(count):
        whole = 0.0
        for i in range(k):
            whole += Q[i, k] * Q[i, k]
        square = 0.0
        for i in range(k, m):
            square += Q[i, k] * Q[i, k]
        if not square > 1e4 * _EPS * _EPS * (whole + square):
            return False
        r = -math.copysign(math.sqrt(square), Q[k, k])
        head = Q[k, k] - r
        for j in range(k + 1, count + 1):
            along = head * Q[k, j]
            for i in range(k + 1, m):
                along += Q[i, k] * Q[i, j]
            along /= r * head
            Q[k, j] += along * head
            for i in range(k + 1, m):
                Q[i, j] += along * Q[i, k]
        Q[k, k] = r
    for k in range(count - 1, -1, -1):
        rest = Q[k, count]
        for j in range(k + 1, count):
            rest -= Q[k, j] * y[j]
        y[k] = rest / Q[k, k]
    return True


@formula
def nonnegative(A, n, b, x, w, order, y, Q):  # type: ignore[no-untyped-def]
    """Lawson & Hanson, Solving Least Squares Problems (1974), algorithm NNLS; rounds, or -1 where it does not end.

    Of ``A`` only the first n columns count. ``order`` (n,): the columns of the set that is not 0, then the others;
    ``w`` (n,), ``y`` (n,) and ``Q`` (m, n + 1) are the workspace.
    """
    m = A.shape[0]
    scale = 0.0
    for j in range(n):
        order[j] = j
        x[j] = 0.0
        total = 0.0
        for i in range(m):
            total += abs(A[i, j])
        scale = max(scale, total)
    tolerance = 10.0 * max(m, n) * _EPS * scale
    count, fresh = 0, True
    for rounds in range(30 * n + 30):
        if fresh:
            for i in range(m):
                Q[i, n] = b[i]
                for j in range(n):
                    Q[i, n] -= A[i, j] * x[j]
            for j in range(n):
                w[j] = 0.0
                for i in range(m):
                    w[j] += A[i, j] * Q[i, n]
        best = -1
        for k in range(count, n):
            if w[int(order[k])] > tolerance and (best < 0 or w[int(order[k])] > w[int(order[best])]):
                best = k
        if best < 0 or count >= m:
            return rounds
        order[count], order[best] = order[best], order[count]
        new = int(order[count])
        fresh = _reduced(A, b, order, count + 1, Q, y) and y[count] > 0.0
        if not fresh:
            w[new] = 0.0  # rounding alone says that it would help
            continue
        count += 1
        while True:
            share, least = 1.0, 1.0
            for k in range(count):
                least = min(least, y[k])
                at = x[int(order[k])]
                if y[k] <= 0.0:
                    share = min(share, at / (at - y[k]))
            if least > 0.0:
                break
            kept = 0
            for k in range(count):
                j = int(order[k])
                gone = y[k] <= 0.0 and x[j] / (x[j] - y[k]) <= share
                x[j] = 0.0 if gone else x[j] + share * (y[k] - x[j])
                if x[j] > 0.0:
                    order[k], order[kept] = order[kept], order[k]
                    kept += 1
                else:
                    x[j] = 0.0
            count = kept
            _reduced(A, b, order, count, Q, y)
        for k in range(count):
            x[int(order[k])] = y[k]
    return -1


def _nnls(A, b, x, w, order, y, Q):  # type: ignore[no-untyped-def]
    """`nonnegative` with all columns."""
    return nonnegative(A, A.shape[1], b, x, w, order, y, Q)


solve = entry(_nnls, "i8(f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[:,::1])")
