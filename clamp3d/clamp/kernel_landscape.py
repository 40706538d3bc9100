"""Compiled search for the way downhill in a sampled landscape. Import this module only when it is asked."""

from __future__ import annotations

import math

from clamp3d.core.jit import entry


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


downhill = entry(_downhill, "void(f8[:,::1],f8[::1],i8[:,::1])")
