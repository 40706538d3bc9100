"""Many poses at once, where grooves or holes of one body and a cylinder of the other decide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distances
from clamp3d.collide.body import Bore, ClosedForm
from clamp3d.collide.convex import MEMBER, Rod
from clamp3d.collide.model import Model
from clamp3d.core.pose import Array, inverse

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
    from clamp3d.collide.poses_kernel import bore_rod

    covers = bore.covers()
    grooves = np.array([(groove.radius, groove.half_angle, 0.5 * groove.length, 0.0, 0.0) for groove, _ in covers])
    P, found = np.array([place for _, place in covers]), np.empty((len(T), 11))
    wire = rod.radius, 0.5 * rod.length, np.array([rod.T])
    bore_rod(grooves, P, *wire, T, *members(a), *members(b), MEMBER, _KNOWN, np.empty((128, 5)), found)
    method = ("groove kernel",) * len(T)
    return Distances(found[:, 0], found[:, 1], found[:, 2:5], found[:, 5:8], found[:, 8:11], method)


def members(form: ClosedForm) -> tuple[Array, Array, Array]:
    """What `ClosedForm.depth` asks, as the kernel takes it: planes (k, 4), radii and half lengths (m, 2), poses."""
    planes = [piece.planes for piece in form.outers if not isinstance(piece, Rod)]
    rods = [piece for piece in form.outers if isinstance(piece, Rod)]
    rounds = [(rod.radius, 0.5 * rod.length) for rod in rods] + [(bore.radius, -1.0) for bore in form.bores]
    places = [rod.T for rod in rods] + [bore.T for bore in form.bores]
    return np.vstack([np.empty((0, 4)), *planes]), np.array(rounds).reshape(-1, 2), np.array(places).reshape(-1, 4, 4)
