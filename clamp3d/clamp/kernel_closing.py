"""Compiled loops of a step of the closing path. Import this module only when a clamp is closed."""

from __future__ import annotations

import math

from clamp3d.clamp.section import SIZE, B, D, S, U, V, W
from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_linear import rotated
from clamp3d.core.kernel_nonnegative import nonnegative

_NONE = 1e-12
"""What is left of a distance of 1 where there is no x."""


@formula
def _project(H, A, k, scale, x, back, M, Q, work):  # type: ignore[no-untyped-def]
    """Least y . H y / 2 + x . y with A y >= -value: y into x (n,), and the multipliers.

    A least-distance problem, solved by non-negative least squares [Lawson & Hanson, Solving Least Squares Problems,
    1974, chapter 23]. Returns 1, 0 where no y is so, and -1 where an iteration does not end. H (n, n) is symmetric and
    positive and is lost; of A (m, n) the first k rows count. Rows of ``work`` (7, n + m + 1): the values, the
    multipliers, then workspace, as are ``back`` (n, n), ``M`` (n + 1, m) and ``Q`` (n + 1, m + 1).
    """
    n = A.shape[1]
    value, u, z, b = work[0], work[1], work[2], work[3]
    for i in range(n):
        for j in range(n):
            back[i, j] = 1.0 if i == j else 0.0
    if rotated(H, back) < 0:  # its rows are the axes now, times the sizes
        return -1
    for i in range(n):
        size = 0.0
        for j in range(n):
            size += H[i, j] * H[i, j]
        size = math.sqrt(math.sqrt(size))
        z[i] = 0.0
        for j in range(n):
            back[i, j] /= size
            z[i] += back[i, j] * x[j]
        b[i] = 0.0
    b[n] = rest = 1.0
    for g in range(k):
        below = -value[g]
        for i in range(n):
            M[i, g] = 0.0
            for j in range(n):
                M[i, g] += A[g, j] * back[i, j]
            below += M[i, g] * z[i]
        M[n, g] = below / scale
    if k > 0 and nonnegative(M, k, b, u, work[4], work[5], work[6], Q) < 0:
        return -1
    for g in range(k):
        rest -= M[n, g] * u[g]
    if not rest > _NONE:
        return 0
    for g in range(k):
        u[g] *= scale / rest
        for i in range(n):
            z[i] -= M[i, g] * u[g]
    for j in range(n):
        x[j] = 0.0
        for i in range(n):
            x[j] -= z[i] * back[i, j]
    return 1


def _move(at, target, moving, bend, h, reach, value, gradient, apart, x, force, H, A, back, M, Q, work):  # type: ignore[no-untyped-def]
    """Move x (n,) of the coordinates ``moving`` from ``at`` to ``target`` (10,), as far as gaps let; their ``force``.

    Gaps that are ``apart`` (k,) do not count, nor those further than ``reach`` and what a step of h closes. ``bend``
    (n, n) is the curvature of the loaded gaps. What is returned and the arrays from H on (A: (k, n)) as of `_project`.
    """
    n = x.shape[0]
    for i in range(n):
        x[i] = at[moving[i]] - target[moving[i]]
        for j in range(n):
            H[i, j] = h * bend[i, j] + (1.0 if i == j else 0.0)
    m = 0
    for g in range(value.shape[0]):
        force[g] = -1.0
        if apart[g] == 0 and value[g] <= reach + abs(gradient[g, D]) * h:
            for i in range(n):
                A[m, i] = gradient[g, moving[i]]
            work[0, m] = value[g]
            force[g] = m
            m += 1
    found = _project(H, A, m, h, x, back, M, Q, work)
    for g in range(value.shape[0]):
        force[g] = work[1, int(force[g])] / h if force[g] >= 0.0 else 0.0
    return found


def _bends(gradient, force, groove, sizes, c, s, lever, along, bend):  # type: ignore[no-untyped-def]
    """Add to ``bend`` (10, 10) the curvature of the loaded arcs: what keeps a wire in the round of its groove.

    ``groove`` (k,) numbers the groove of a gap to its arc, 2 wire + splint, -1 for others; ``sizes`` (4, 3) has of each
    the difference of the radii and its centre in the splint's axes, mm. ``along`` (10,) is workspace.
    """
    for k in range(groove.shape[0]):
        which = groove[k]
        if which < 0 or force[k] == 0.0:
            continue
        i = 2 * (which // 2)
        slack, u, v = sizes[which, 0], sizes[which, 1], sizes[which, 2]
        tx, ty = -gradient[k, i + 1], gradient[k, i]
        along[:] = 0.0
        along[i] = tx
        along[i + 1] = ty
        if which % 2 == 1:
            along[D] = -ty
            along[U] = ty
            along[S] = (ty * (u * c + v * s) - tx * (v * c - u * s)) / lever
            along[B] = along[V] = along[W] = -tx
        for a in range(SIZE):
            for b in range(SIZE):
                bend[a, b] += force[k] / slack * along[a] * along[b]


move = entry(
    _move,
    "i8(f8[::1],f8[::1],i8[::1],f8[:,::1],f8,f8,f8[::1],f8[:,::1],i8[::1],f8[::1],f8[::1],"
    "f8[:,::1],f8[:,::1],f8[:,::1],f8[:,::1],f8[:,::1],f8[:,::1])",
)
bends = entry(_bends, "void(f8[:,::1],f8[::1],i8[::1],f8[:,::1],f8,f8,f8,f8[::1],f8[:,::1])")
