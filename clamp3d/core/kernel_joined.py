"""Compiled entry point of `shells.joined`. Import this module only when it is needed."""

from __future__ import annotations

from clamp3d.core.jit import entry, formula


@formula
def _least(label, k):  # type: ignore[no-untyped-def]
    """The number that ``k`` is joined to so far; the way there is halved."""
    while label[k] != k:
        label[k] = label[label[k]]
        k = label[k]
    return k


def _join(groups, label):  # type: ignore[no-untyped-def]
    """Join each row of ``groups`` (m, k): ``label`` (n,), at first 0 to n - 1, becomes the least number joined to."""
    for i in range(groups.shape[0]):
        a = _least(label, groups[i, 0])
        for j in range(1, groups.shape[1]):
            b = _least(label, groups[i, j])
            label[max(a, b)] = min(a, b)
            a = min(a, b)
    for k in range(label.shape[0]):
        label[k] = label[label[k]]


join = entry(_join, "void(i8[:,::1],i8[::1])")
