"""Many poses at once, where grooves or holes of one body and a cylinder of the other decide."""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distances
from clamp3d.collide.body import Bore, ClosedForm
from clamp3d.collide.convex import Rod
from clamp3d.collide.hull import MEMBER
from clamp3d.collide.model import Model
from clamp3d.core.pose import Array

_KNOWN = 1e-9

Pairs = tuple[Array, NDArray[np.int64], Array, NDArray[np.int64]]
"""Poses (i, 4, 4) of a first body and which of them (m,) is meant, then those of a second."""


def in_frame_of_first(T: Array) -> Pairs:
    """The pairs of a second body at poses (n, 4, 4) in the first one's frame."""
    return np.eye(4)[None], np.zeros(len(T), dtype=np.int64), T, np.arange(len(T))


def relative(pairs: Pairs) -> Array:
    """The second body's poses (m, 4, 4) in the first one's frame."""
    from clamp3d.collide.poses_kernel import between

    T = np.empty((len(pairs[1]), 4, 4))
    between(*pairs, T)
    return T


def by_kernel(a: Model, b: Model, T: Array) -> Distances:
    """What grooves and holes against cylinders say of the distances of ``b`` at ``T`` (n, 4, 4) in a's frame.

    Where other faces may decide both bounds are infinite; of an overlap they are those of the interference. `exact`
    tells the rows whose distance is known.
    """
    found = _by_kernel(a, b, in_frame_of_first(T), points=True)
    return Distances(found[0], found[1], found[2:5].T, found[5:8].T, found[8:11].T, ("groove kernel",) * len(T))


def bounds_by_kernel(a: Model, b: Model, pairs: Pairs, clash: float = -np.inf) -> tuple[Array, Array]:
    """The bounds (m,) of `by_kernel` alone, for the poses of both bodies in the world.

    What overlaps by more than ``-clash`` mm need have no lower bound.
    """
    found = _by_kernel(a, b, pairs, points=False, clash=clash)
    return found[0], found[1]


def exact(found: Distances) -> NDArray[np.bool_]:
    """Rows (n,) whose distance is known; how deep an overlap is takes a search."""
    with np.errstate(invalid="ignore"):
        return np.asarray((found.upper - found.lower <= _KNOWN) & (found.lower >= -_KNOWN))


def _by_kernel(a: Model, b: Model, pairs: Pairs, points: bool, clash: float = -np.inf) -> Array:
    """Bounds, and with ``points`` points and normals in a's frame, NaN where unknown: (2 or 11, m)."""
    known = []
    if a.bodies is not None and b.bodies is not None and len(a.bodies) == len(b.bodies) == 1:
        (first,), (second,) = a.bodies, b.bodies
        if not any(form.error or form.surface is not None for form in (first, second)):
            known = [_bore_rod(bore, rod, first, second, pairs, points, clash) for bore, rod in _asked(first, second)]
            for bore, rod in _asked(second, first):
                known.append(_bore_rod(bore, rod, second, first, (*pairs[2:], *pairs[:2]), points, clash))
                if points:
                    _seen_from_first(known[-1], pairs)
    if known:
        return reduce(_better, known)
    nothing = np.full((11 if points else 2, len(pairs[1])), np.nan)
    nothing[0], nothing[1] = -np.inf, np.inf
    return nothing


def _asked(a: ClosedForm, b: ClosedForm) -> list[tuple[Bore, Rod]]:
    """Bores of ``a`` against cylinders among the pieces of ``b``."""
    return [(bore, rod) for bore in a.bores for rod in b.outers if isinstance(rod, Rod)]


def _seen_from_first(found: Array, pairs: Pairs) -> None:
    """Points and normals (11, m) in the second body's frame, from it to the first, in place the other way about."""
    T = relative(pairs)
    R, t = T[:, :3, :3], T[:, :3, 3].T
    q, p, n = (np.einsum("nij,jn->in", R, found[k : k + 3]) for k in (2, 5, 8))
    found[2:5], found[5:8], found[8:11] = p + t, q + t, -n


def _better(x: Array, y: Array) -> Array:
    """The bounds that either knows, with the points of the smaller upper one."""
    found = np.where(x[1] <= y[1], x, y)
    found[0] = np.maximum(x[0], y[0])
    return found


def _bore_rod(
    bore: Bore, rod: Rod, a: ClosedForm, b: ClosedForm, pairs: Pairs, points: bool, clash: float = -np.inf
) -> Array:
    from clamp3d.collide.bore_kernel import WORK, bore_rod

    covers = bore.covers()
    grooves = np.array([(groove.radius, groove.half_angle, 0.5 * groove.length, 0.0, 0.0) for groove, _ in covers])
    P, found = np.array([place for _, place in covers]), np.empty((11 if points else 2, len(pairs[1])))
    wire = rod.radius, 0.5 * rod.length, np.array([rod.T])
    work = np.empty(WORK), np.empty((128, 5))
    bore_rod(grooves, P, *wire, *pairs, *members(a), *members(b), MEMBER, _KNOWN, clash, *work, found)
    return found


def members(form: ClosedForm) -> tuple[Array, Array, Array]:
    """What `ClosedForm.depth` asks, as the kernel takes it: planes (k, 4), radii and half lengths (m, 2), poses."""
    planes = [piece.planes for piece in form.outers if not isinstance(piece, Rod)]
    rods = [piece for piece in form.outers if isinstance(piece, Rod)]
    rounds = [(rod.radius, 0.5 * rod.length) for rod in rods] + [(bore.radius, -1.0) for bore in form.bores]
    places = [rod.T for rod in rods] + [bore.T for bore in form.bores]
    return np.vstack([np.empty((0, 4)), *planes]), np.array(rounds).reshape(-1, 2), np.array(places).reshape(-1, 4, 4)
