"""Compiled loops over a sampled landscape. Import this module only when one is asked for."""

from __future__ import annotations

import math

from clamp3d.core.jit import entry


def _under(u, v, tilts, bolt, x, turned, depth):  # type: ignore[no-untyped-def]
    """Depth of a curve (u, v), n points by rising u, at places x (m,), turned by each tilt about ``bolt``, into (t, m).

    Linear between the points; of what the turned curve has over itself the first counts, and its ends beyond them.
    ``turned`` (2, n) is workspace.
    """
    n = u.shape[0]
    for k in range(tilts.shape[0]):
        c, s = math.cos(tilts[k]), math.sin(tilts[k])
        furthest = -math.inf
        for i in range(n):
            furthest = max(furthest, bolt + u[i] * c + v[i] * s)
            turned[0, i] = furthest
            turned[1, i] = v[i] * c - u[i] * s
        j = 0
        for i in range(x.shape[0]):
            while j < n - 1 and turned[0, j + 1] <= x[i]:
                j += 1
            depth[k, i] = turned[1, j]
            if j < n - 1 and x[i] > turned[0, j]:
                rise = (turned[1, j + 1] - turned[1, j]) / (turned[0, j + 1] - turned[0, j])
                depth[k, i] += rise * (x[i] - turned[0, j])


def _downhill(height, beyond, step):  # type: ignore[no-untyped-def]
    """Whether each sample of ``height`` (v, n) slides left (-1), right (1) or nowhere (0), into ``step`` (v, n).

    What counts is the next other height on either side, the lower one first, and none beyond the ends: a slight slope
    is a stair. Of a level stretch between higher ones the first sample stands for all. ``beyond`` (n,) is workspace.
    """
    n = height.shape[1]
    for k in range(height.shape[0]):
        row = height[k]
        other = math.inf
        for i in range(n - 1, -1, -1):
            if i < n - 1 and row[i + 1] != row[i]:
                other = row[i + 1]
            beyond[i] = other
        other = math.inf
        for i in range(n):
            level = i > 0 and row[i - 1] == row[i]
            if i > 0 and not level:
                other = row[i - 1]
            if beyond[i] < row[i] and beyond[i] <= other:
                step[k, i] = 1
            elif other < row[i] or level:
                step[k, i] = -1
            else:
                step[k, i] = 0


under = entry(_under, "void(f8[::1],f8[::1],f8[::1],f8,f8[::1],f8[:,::1],f8[:,::1])")
downhill = entry(_downhill, "void(f8[:,::1],f8[::1],i8[:,::1])")
