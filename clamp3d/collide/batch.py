"""Many poses at once, where grooves or holes of one body and a cylinder of the other decide."""

from __future__ import annotations

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.body import ClosedForm
from clamp3d.collide.convex import MEMBER, Rod
from clamp3d.collide.model import Model
from clamp3d.core.distance import signed_distances
from clamp3d.core.pose import Array, inverse
from clamp3d.core.primitives import Cylinder

_KNOWN = 1e-9


def by_kernel(a: Model, b: Model, T: Array) -> list[Distance | None]:
    """Distances of ``b`` at ``T`` (n, 4, 4) in a's frame; None where other faces than grooves and holes may decide."""
    none: list[Distance | None] = [None] * len(T)
    if a.bodies is None or b.bodies is None or not len(a.bodies) == len(b.bodies) == 1 or not len(T):
        return none
    if any(form.error or form.surface is not None for form in (*a.bodies, *b.bodies)):
        return none
    (first,), (second,) = a.bodies, b.bodies
    if any(isinstance(piece, Rod) for piece in second.outers) and first.bores:
        return _by_kernel(first, second, T)
    if any(isinstance(piece, Rod) for piece in first.outers) and second.bores:
        swapped = _by_kernel(second, first, inverse(T))
        return [d if d is None else d.moved(T[k]).swapped() for k, d in enumerate(swapped)]
    return none


def _by_kernel(a: ClosedForm, b: ClosedForm, T: Array) -> list[Distance | None]:
    n = len(T)
    lower = np.full(n, -np.inf)
    best: list[Distance | None] = [None] * n
    upper = np.full(n, np.inf)
    for bore in a.bores:
        for rod in b.outers:
            if not isinstance(rod, Rod):
                continue
            covers = bore.covers()
            rows = [np.ascontiguousarray(inverse(P) @ T @ rod.T) for _, P in covers]
            wire = Cylinder(rod.radius, rod.length)
            answers = [
                signed_distances(groove, wire, P, full=True) for (groove, _), P in zip(covers, rows, strict=True)
            ]
            d = np.array([answer.distance for answer in answers])
            k = d.argmin(axis=0)
            row = np.arange(n)
            d, e = d[k, row], np.array([answer.error_bound for answer in answers])[k, row]
            apart = d >= -e  # of an overlap it is no bound of the depth
            lower = np.where(apart, np.maximum(lower, np.where(d > e, d - e, -0.5 * _KNOWN)), lower)
            R = np.array([P[:3, :3] for _, P in covers])[k]
            t = np.array([P[:3, 3] for _, P in covers])[k]
            fields = ("point_on_groove", "point_on_cylinder", "normal")
            p, q, m = (
                np.einsum("nij,nj->ni", R, np.array([getattr(answer, name) for answer in answers])[k, row])
                for name in fields
            )
            p, q = p + t, q + t
            slack = MEMBER * (1.0 + float(max(np.abs(p).max(), np.abs(q).max())))
            outside = np.minimum(a.depth(p), b.depth(np.einsum("nji,nj->ni", T[:, :3, :3], q - T[:, :3, 3])))
            high = d + e + np.maximum(0.0, -4.0 * outside)
            for i in np.flatnonzero(apart & (outside >= -slack) & (high < upper)):
                upper[i] = high[i]
                best[i] = Distance(-np.inf, float(high[i]), p[i], q[i], m[i], None, "features", "groove kernel")
    return [
        Distance(float(lower[i]), x.upper, x.point_a, x.point_b, x.normal, None, x.level, x.method)
        if (x := best[i]) is not None and upper[i] - lower[i] <= _KNOWN and lower[i] >= -_KNOWN  # else how deep?
        else None
        for i in range(n)
    ]
