"""Many poses at once, where grooves or holes of one body and a cylinder of the other decide: the kernel's batch."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distances
from clamp3d.engine.closed_form import Bore, ClosedForm
from clamp3d.engine.convex import Ball, Convex, Rod
from clamp3d.engine.hull import MEMBER
from clamp3d.engine.model import Model
from clamp3d.geometry.pose import Array, inverse, to_target
from clamp3d.geometry.primitives import Cylinder
from clamp3d.kernel.distance import signed_distances

_SHARES = (0.6, 0.98)
"""How far out points of a piece are tried besides those in its middle."""
_IN_A_ROD = (np.linspace(-0.49, 0.49, 7), np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False), np.array(_SHARES))
"""Where along a cylinder, in lengths, at which angles, and how far out points are tried."""
_BLOCK = 2000
"""Poses whose points are measured at a time: with hundreds of points each they fill some 10 MB."""
_CORNERS = 32
"""Corners of a polyhedron that points are tried towards, about."""


def bounds_at_poses(a: Model, b: Model, T: Array) -> Distances:
    """What grooves and holes against cylinders say of the distances of ``b`` at ``T`` (n, 4, 4) in a's frame.

    A bore's material holds the body and a cylinder holds the other, so the kernel's distance is a lower bound; where
    its nearest points lie on the bodies it is the distance. Other bounds are infinite, and so are
    lower ones in an overlap.
    """
    nan = np.full((len(T), 3), np.nan)
    unknown = Distances(np.full(len(T), -np.inf), np.full(len(T), np.inf), nan, nan, nan, ("groove kernel",) * len(T))
    if a.bodies is None or b.bodies is None or len(a.bodies) != 1 or len(b.bodies) != 1:
        return unknown
    (first,), (second,) = a.bodies, b.bodies
    if any(form.error or form.surface is not None for form in (first, second)):
        return unknown
    answers = [unknown, *(_bore_rod(bore, rod, first, second, T) for bore, rod in _pairs(first, second))]
    if turned := _pairs(second, first):
        back = inverse(T)
        answers += [_seen_from_first(_bore_rod(bore, rod, second, first, back), T) for bore, rod in turned]
    return replace(_nearest(answers), lower=np.max([answer.lower for answer in answers], axis=0))


def overlaps_at_poses(a: Model, b: Model, T: Array) -> Array:
    """Upper bounds (n,) of the signed distances of ``b`` at ``T`` (n, 4, 4) in a's frame, from points in both bodies.

    Points in either body are tried; infinite is the bound where none of them lies in the other too, and of bodies that
    are only enclosed by a closed form.
    """
    upper = np.full(len(T), np.inf)
    for first, second, places in ((a, b, T), (b, a, inverse(T))):
        for form, other in itertools.product(second.bodies or (), first.bodies or ()):
            if form.surface is None and other.surface is None:
                upper = np.minimum(upper, -_attested(form, other, places))
    return upper


def _attested(form: ClosedForm, other: ClosedForm, T: Array) -> Array:
    """The greatest depth (n,) of the tried points of a body, at ``T`` (n, 4, 4) in the other's frame, in either body.

    Minus infinity where none of them is in both.
    """
    points = np.vstack([_points_in(piece) for piece in form.outers])
    own = form.depth(points) - form.error
    points, own = points[own > 0.0], own[own > 0.0]
    best = np.full(len(T), -np.inf)
    for rows in np.array_split(np.arange(len(T)), 1 + len(T) // _BLOCK):
        moved = np.einsum("nij,kj->nki", T[rows, :3, :3], points) + T[rows, None, :3, 3]
        depth = other.depth(moved.reshape(-1, 3)).reshape(moved.shape[:2]) - other.error
        best[rows] = np.where(depth > 0.0, np.maximum(depth, own), -np.inf).max(axis=1, initial=-np.inf)
    return best


def _points_in(piece: Convex) -> Array:
    """Points (k, 3) in a piece: in the middle, and just under the surface, the ends or the corners."""
    if isinstance(piece, Rod):
        z, angle, share = (x.ravel() for x in np.meshgrid(*_IN_A_ROD))
        around = np.column_stack([share * np.cos(angle), share * np.sin(angle), z])
        axis = np.column_stack([np.zeros((len(_IN_A_ROD[0]), 2)), _IN_A_ROD[0]])
        return to_target(piece.T, np.vstack([axis, around]) * (piece.radius, piece.radius, piece.length))
    if isinstance(piece, Ball):
        axes = piece.radius * np.vstack([np.eye(3), -np.eye(3)])
        return piece.T[:3, 3] + np.vstack([np.zeros(3), *(share * axes for share in _SHARES)])
    corners = piece.vertices[:: 1 + len(piece.vertices) // _CORNERS]
    middle = piece.vertices.mean(axis=0)
    return np.vstack([middle, *(middle + share * (corners - middle) for share in _SHARES)])


def _pairs(a: ClosedForm, b: ClosedForm) -> list[tuple[Bore, Rod]]:
    """Bores of ``a`` against cylinders among the pieces of ``b``."""
    return [(bore, rod) for bore in a.bores for rod in b.outers if isinstance(rod, Rod)]


def _bore_rod(bore: Bore, rod: Rod, a: ClosedForm, b: ClosedForm, T: Array) -> Distances:
    """The nearest of a bore's grooves at each pose, its upper bound kept where its points lie on both bodies."""
    covers = []
    for groove, place in bore.covers():
        P = inverse(place) @ T @ rod.T
        answer = signed_distances(groove, Cylinder(rod.radius, rod.length), P, full=True)
        p, q = to_target(place, answer.point_on_groove), to_target(place, answer.point_on_cylinder)
        low, high = answer.distance - answer.error_bound, answer.distance + answer.error_bound
        covers.append(Distances(low, high, p, q, answer.normal @ place[:3, :3].T, ("groove kernel",) * len(T)))
    nearest = _nearest(covers)
    local = np.einsum("nji,nj->ni", T[:, :3, :3], nearest.point_b - T[:, :3, 3])
    slack = MEMBER * (1.0 + np.abs(nearest.point_a).max(axis=1, initial=0.0))
    on_a, on_b = a.depth(nearest.point_a) >= -slack, b.depth(local) >= -slack
    apart = nearest.lower >= 0.0
    # In an overlap the cylinder's point must lie in the body too, and is no deeper than the body's other faces allow.
    depth = a.depth(nearest.point_b) - 4.0 * slack
    upper = np.where(apart & on_a & on_b, nearest.upper, np.inf)
    upper = np.where((nearest.upper < 0.0) & on_b & (depth > 0.0), np.maximum(nearest.upper, -depth), upper)
    return replace(nearest, lower=np.where(apart, nearest.lower, -np.inf), upper=upper)


def _nearest(answers: list[Distances]) -> Distances:
    """At each pose the answer with the smallest upper bound."""
    chosen, rows = np.argmin([answer.upper for answer in answers], axis=0), np.arange(len(answers[0]))
    names = ("lower", "upper", "point_a", "point_b", "normal")
    fields = {name: np.array([getattr(answer, name) for answer in answers])[chosen, rows] for name in names}
    return Distances(**fields, method=answers[0].method)


def _seen_from_first(d: Distances, T: Array) -> Distances:
    """Distances whose points are in the second body's frame, from it to the first, the other way about."""
    q, p, n = (np.einsum("nij,nj->ni", T[:, :3, :3], x) for x in (d.point_a, d.point_b, d.normal))
    return replace(d, point_a=p + T[:, :3, 3], point_b=q + T[:, :3, 3], normal=-n)
