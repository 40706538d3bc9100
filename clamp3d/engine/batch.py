"""Many poses at once, where grooves or holes of one body and a cylinder of the other decide: the kernel's batch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.answer import Distances
from clamp3d.engine.closed_form import Bore, ClosedForm
from clamp3d.engine.convex import Rod
from clamp3d.engine.hull import MEMBER
from clamp3d.engine.model import Model
from clamp3d.geometry.pose import Array, inverse
from clamp3d.geometry.primitives import Cylinder
from clamp3d.kernel.distance import signed_distances


def bounds_at_poses(a: Model, b: Model, T: Array) -> Distances:
    """What grooves and holes against cylinders say of the distances of ``b`` at ``T`` (n, 4, 4) in a's frame.

    A bore's material holds the body and a cylinder holds the other, so the kernel's distance is a lower bound; where
    its nearest points lie on the bodies it is the distance. Other bounds are infinite, and so are
    lower ones in an overlap.
    """
    n = len(T)
    p, q, normal = np.full((3, n, 3), np.nan)
    answer = Distances(np.full(n, -np.inf), np.full(n, np.inf), p, q, normal, ("groove kernel",) * n)
    if a.bodies is None or b.bodies is None or len(a.bodies) != 1 or len(b.bodies) != 1:
        return answer
    (first,), (second,) = a.bodies, b.bodies
    if any(form.error or form.surface is not None for form in (first, second)):
        return answer
    for bore, rod in _pairs(first, second):
        answer = _nearer(answer, _bore_rod(bore, rod, first, second, T))
    back = np.array([inverse(pose) for pose in T]) if _pairs(second, first) else T
    for bore, rod in _pairs(second, first):
        answer = _nearer(answer, _seen_from_first(_bore_rod(bore, rod, second, first, back), T))
    return answer


def _pairs(a: ClosedForm, b: ClosedForm) -> list[tuple[Bore, Rod]]:
    """Bores of ``a`` against cylinders among the pieces of ``b``."""
    return [(bore, rod) for bore in a.bores for rod in b.outers if isinstance(rod, Rod)]


def _bore_rod(bore: Bore, rod: Rod, a: ClosedForm, b: ClosedForm, T: Array) -> Distances:
    """The nearest of a bore's grooves at each pose, its upper bound kept where its points lie on both bodies."""
    cylinder, best = Cylinder(rod.radius, rod.length), None
    for groove, place in bore.covers():
        R, t = place[:3, :3], place[:3, 3]
        answer = signed_distances(groove, cylinder, inverse(place) @ T @ rod.T, full=True)
        p, q = answer.point_on_groove @ R.T + t, answer.point_on_cylinder @ R.T + t
        error = answer.error_bound
        one = Distances(answer.distance - error, answer.distance + error, p, q, answer.normal @ R.T, ("",) * len(T))
        best = one if best is None else _least(best, one)
    assert best is not None
    local = np.einsum("nji,nj->ni", T[:, :3, :3], best.point_b - T[:, :3, 3])
    slack = MEMBER * (1.0 + np.abs(best.point_a).max(axis=1, initial=0.0))
    on_a, on_b = a.depth(best.point_a) >= -slack, b.depth(local) >= -slack
    apart = best.lower >= 0.0
    lower = np.where(apart, best.lower, -np.inf)
    # In an overlap the cylinder's point must lie in the body too, and is no deeper than the body's other faces allow.
    deep = a.depth(best.point_b) - 4.0 * slack
    upper = np.where(apart & on_a & on_b, best.upper, np.inf)
    upper = np.where((best.upper < 0.0) & on_b & (deep > 0.0), np.maximum(best.upper, -deep), upper)
    return Distances(lower, upper, best.point_a, best.point_b, best.normal, best.method)


def _least(x: Distances, y: Distances) -> Distances:
    """At each pose the smaller of two distances: a body is held by the union of the two materials."""
    return _chosen(x, y, y.upper < x.upper)


def _nearer(x: Distances, y: Distances) -> Distances:
    """Both bounds at once, with the points of the smaller upper one."""
    met = _chosen(x, y, y.upper < x.upper)
    return Distances(np.maximum(x.lower, y.lower), met.upper, met.point_a, met.point_b, met.normal, x.method)


def _chosen(x: Distances, y: Distances, second: NDArray[np.bool_]) -> Distances:
    row = second[:, None]
    return Distances(
        np.where(second, y.lower, x.lower),
        np.where(second, y.upper, x.upper),
        np.where(row, y.point_a, x.point_a),
        np.where(row, y.point_b, x.point_b),
        np.where(row, y.normal, x.normal),
        x.method,
    )


def _seen_from_first(d: Distances, T: Array) -> Distances:
    """Distances whose points are in the second body's frame, from it to the first, the other way about."""
    R, t = T[:, :3, :3], T[:, :3, 3]
    q, p, n = (np.einsum("nij,nj->ni", R, x) for x in (d.point_a, d.point_b, d.normal))
    return Distances(d.lower, d.upper, p + t, q + t, -n, d.method)
