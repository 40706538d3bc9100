"""Compiled entry points of `linear`: loops in one order. Import this module only when it is needed."""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula

_SWEEPS = 60
_EPS = 2.0**-52


def _product(a, b, out):  # type: ignore[no-untyped-def]
    """a (m, k) times b (k, n) into ``out``; k is at least 1."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = a[i, 0] * b[0, j]
        for k in range(1, a.shape[1]):
            for j in range(b.shape[1]):
                out[i, j] += a[i, k] * b[k, j]


@formula
def rotated(A, V):  # type: ignore[no-untyped-def]
    """Turn the columns of A, which are the *rows* of the array ``A``, until all are square to each other.

    One-sided Jacobi [M. R. Hestenes, Inversion of matrices by biorthogonalization, J. SIAM 6 (1958) 51-90]. The rows
    of V turn with them. A column of rounding errors beside the largest is left as it is. Sweeps taken, or -1 where
    they did not suffice.
    """
    n, m = A.shape
    total = 0.0
    for p in range(n):
        for i in range(m):
            total += A[p, i] * A[p, i]
    square = (m + 2.0) * _EPS
    nothing = 4.0 * _EPS * _EPS * total
    for sweep in range(_SWEEPS):
        done = True
        for p in range(n - 1):
            for q in range(p + 1, n):
                pp = 0.0
                qq = 0.0
                pq = 0.0
                for i in range(m):
                    pp += A[p, i] * A[p, i]
                    qq += A[q, i] * A[q, i]
                    pq += A[p, i] * A[q, i]
                if abs(pq) <= square * math.sqrt(pp) * math.sqrt(qq) or min(pp, qq) <= nothing:
                    continue
                done = False
                zeta = (qq - pp) / (2.0 * pq)
                t = math.copysign(1.0, zeta) / (abs(zeta) + math.hypot(1.0, zeta))
                c = 1.0 / math.sqrt(1.0 + t * t)
                s = c * t
                for i in range(m):
                    x = A[p, i]
                    A[p, i] = c * x - s * A[q, i]
                    A[q, i] = s * x + c * A[q, i]
                for i in range(V.shape[1]):
                    x = V[p, i]
                    V[p, i] = c * x - s * V[q, i]
                    V[q, i] = s * x + c * V[q, i]
        if done:
            return sweep
    return -1


def _columns(A, V):  # type: ignore[no-untyped-def]
    """`rotated`."""
    return rotated(A, V)


product = entry(_product, "void(f8[:,::1],f8[:,::1],f8[:,::1])")
columns = entry(_columns, "i8(f8[:,::1],f8[:,::1])")
