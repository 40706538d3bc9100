"""Many poses at once, where grooves or holes of one body and a cylinder of the other decide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distances
from clamp3d.collide.body import Bore, ClosedForm
from clamp3d.collide.convex import MEMBER, Rod
from clamp3d.collide.model import Model
from clamp3d.core.distance import signed_distances
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array, inverse
from clamp3d.core.primitives import Capsule, Cylinder, SweptArc

_KNOWN = 1e-9


def by_kernel(a: Model, b: Model, T: Array) -> Distances:
    """What grooves and holes against cylinders say of the distances of ``b`` at ``T`` (n, 4, 4) in a's frame.

    Where other faces may decide both bounds are infinite; of an overlap they are those of the interference. `exact`
    tells the rows whose distance is known.
    """
    if a.bodies is None or b.bodies is None or not len(a.bodies) == len(b.bodies) == 1:
        return _nothing(len(T))
    if any(form.error or form.surface is not None for form in (*a.bodies, *b.bodies)):
        return _nothing(len(T))
    (first,), (second,) = a.bodies, b.bodies
    found = _by_kernel(first, second, T)
    swapped = _by_kernel(second, first, inverse(T)) if second.bores else None
    if swapped is None:
        return found or _nothing(len(T))
    R, t = T[:, :3, :3], T[:, :3, 3]
    q, p = (np.einsum("nij,nj->ni", R, x) + t for x in (swapped.point_a, swapped.point_b))
    swapped = replace(swapped, point_a=p, point_b=q, normal=-np.einsum("nij,nj->ni", R, swapped.normal))
    return swapped if found is None else _better(found, swapped)


def exact(found: Distances) -> NDArray[np.bool_]:
    """Rows (n,) whose distance is known; how deep an overlap is takes a search."""
    with np.errstate(invalid="ignore"):
        return np.asarray((found.upper - found.lower <= _KNOWN) & (found.lower >= -_KNOWN))


def _nothing(n: int) -> Distances:
    unknown = np.full((n, 3), np.nan)
    return Distances(np.full(n, -np.inf), np.full(n, np.inf), unknown, unknown, unknown, ("groove kernel",) * n)


def _better(x: Distances, y: Distances) -> Distances:
    """The bounds that either knows, with the points of the smaller upper one."""
    first = x.upper <= y.upper
    p, q, n = (
        np.where(first[:, None], u, v)
        for u, v in ((x.point_a, y.point_a), (x.point_b, y.point_b), (x.normal, y.normal))
    )
    return Distances(np.maximum(x.lower, y.lower), np.minimum(x.upper, y.upper), p, q, n, x.method)


def _by_kernel(a: ClosedForm, b: ClosedForm, T: Array) -> Distances | None:
    """Bores of ``a`` against cylinders among the pieces of ``b``; None if there are none."""
    found = None
    for bore in a.bores:
        for rod in b.outers:
            if isinstance(rod, Rod):
                new = _bore_rod(bore, rod, a, b, T)
                found = new if found is None else _better(found, new)
    return found


def _bore_rod(bore: Bore, rod: Rod, a: ClosedForm, b: ClosedForm, T: Array) -> Distances:
    wire, covers = Cylinder(rod.radius, rod.length), bore.covers()
    places = [np.ascontiguousarray(dot(dot(inverse(P), T), rod.T)) for _, P in covers]
    answers = [signed_distances(groove, wire, P, full=True) for (groove, _), P in zip(covers, places, strict=True)]
    k, row = np.array([answer.distance for answer in answers]).argmin(axis=0), np.arange(len(T))
    d, e, p, q, n = (
        np.array([getattr(answer, name) for answer in answers])[k, row]
        for name in ("distance", "error_bound", "point_on_groove", "point_on_cylinder", "normal")
    )
    R, t = np.array([P[:3, :3] for _, P in covers])[k], np.array([P[:3, 3] for _, P in covers])[k]
    p, q, n = (np.einsum("nij,nj->ni", R, x) for x in (p, q, n))
    p, q = p + t, q + t

    def depths(x: Array, rows: NDArray[np.int64]) -> tuple[Array, Array]:
        local = np.einsum("nji,nj->ni", T[rows, :3, :3], x[rows] - T[rows, :3, 3])
        return a.depth(x[rows]), b.depth(local)

    slack = MEMBER * (1.0 + float(max(np.abs(p).max(initial=0.0), np.abs(q).max(initial=0.0))))
    apart, upper = d >= -e, np.full(len(T), np.inf)
    rows = np.flatnonzero(apart)
    outside = np.minimum(depths(p, rows)[0], depths(q, rows)[1])
    upper[rows] = np.where(outside >= -slack, (d + e)[rows] + np.maximum(0.0, -4.0 * outside), np.inf)
    rows = np.flatnonzero(~apart)
    for x in (p, q, 0.5 * (p + q)):  # a point in both has the depth that it has in either
        own, other = depths(x, rows)
        out = np.minimum(own, other)
        deep = np.minimum(0.0, 4.0 * np.maximum(0.0, -out) - np.maximum(own, other))
        upper[rows] = np.where(out >= -slack, np.minimum(upper[rows], deep), upper[rows])
    lower = np.where(d > e, d - e, -0.5 * _KNOWN)
    lower[rows] = _least([(groove, P[rows]) for (groove, _), P in zip(covers, places, strict=True)], rod)
    return Distances(lower, upper, p, q, n, ("groove kernel",) * len(T))


def _least(covers: list[tuple[SweptArc, Array]], rod: Rod) -> Array:
    """Lower bounds (n,) of overlaps, as `body.bore_rod` has them: by the capsule that holds the rod."""
    wire = Capsule(rod.radius, rod.length)
    answers = [signed_distances(groove, wire, P, full=True) for groove, P in covers]
    d, e = (np.array([getattr(answer, name) for answer in answers]) for name in ("distance", "error_bound"))
    deep = (d <= e - rod.radius).any(axis=0) & (len(covers) > 1)
    return np.where(deep, -np.inf, (d - e).min(axis=0))
