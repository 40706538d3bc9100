"""Distance of two parts in the section by their outlines: for pairs that no groove, hole, seat or thread joins.

Every part is as wide along the wires as its section is on the plane Y = 0 or narrower, so two parts whose sections are
apart are as far apart as these. Arcs are equal chords with their ends on the arc, so the distance is off by the two
chord errors at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clamp3d.clamp.parts import Extrusion, Part
from clamp3d.geometry.pose import Array, SectionPose


@dataclass(frozen=True, slots=True)
class OutlineGap:
    """``distance`` >= 0 mm between ``point_a`` and ``point_b`` (2,) in the section; ``error_bound`` mm.

    ``overlap`` says that the outlines meet (then the distance is 0), ``contained`` that one lies inside the other.
    """

    distance: float
    point_a: Array
    point_b: Array
    error_bound: float
    overlap: bool
    contained: bool


def outline_gap(a: Part, pose_a: SectionPose, b: Part, pose_b: SectionPose, mesh_error: float) -> OutlineGap:
    """How far apart the outlines of two parts are in the section, holes filled.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> from clamp3d.clamp.parts import parts
    >>> wires = parts(load_clamp(line="20", jumper="10"))
    >>> gap = outline_gap(wires["P6"], SectionPose(0, 0), wires["P7"], SectionPose(30, 0), 1e-4)
    >>> abs(gap.distance - 15.0) <= gap.error_bound <= 2e-4
    True
    """
    error = sum(_chord_error(part, mesh_error) for part in (a, b))
    best = OutlineGap(np.inf, np.zeros(2), np.zeros(2), error, False, False)
    for p in _outlines(a, pose_a, mesh_error):
        for q in _outlines(b, pose_b, mesh_error):
            found = _polygon_gap(p, q, error)
            if (found.distance, not found.contained) < (best.distance, not best.contained):
                best = found
    return best


def _outlines(part: Part, pose: SectionPose, mesh_error: float) -> list[Array]:
    """Each body's outline (n, 2) in the section's x, y."""
    c, s = np.cos(pose.angle), np.sin(pose.angle)
    turn = np.array([[c, -s], [s, c]])
    return [_silhouette(body, mesh_error) @ turn + (pose.x, pose.y) for body in part.bodies]


def _silhouette(body: Extrusion, mesh_error: float) -> Array:
    if body.axis == "Y":
        return body.profile.polygon(mesh_error)
    (left, _), (right, _) = body.profile.bounds
    return np.array([(left, -body.end), (right, -body.end), (right, -body.start), (left, -body.start)])


def _chord_error(part: Part, mesh_error: float) -> float:
    return max((body.profile.chord_error(mesh_error) for body in part.bodies if body.axis == "Y"), default=0.0)


def _polygon_gap(p: Array, q: Array, error: float) -> OutlineGap:
    crossing = _edges_cross(p, q)
    for inner, outer in ((q, p), (p, q)):
        if crossing or _contains(outer, inner[0]):
            return OutlineGap(0.0, inner[0], inner[0], error, True, not crossing)
    # Apart: the nearest points are a corner of one and a point of an edge of the other.
    on_q, d_pq = _nearest(p, q)
    on_p, d_qp = _nearest(q, p)
    i, j = int(np.argmin(d_pq)), int(np.argmin(d_qp))
    if d_pq[i] <= d_qp[j]:
        return OutlineGap(float(d_pq[i]), p[i], on_q[i], error, d_pq[i] == 0.0, False)
    return OutlineGap(float(d_qp[j]), on_p[j], q[j], error, d_qp[j] == 0.0, False)


def _edges_cross(p: Array, q: Array) -> bool:
    """Whether an edge of one polygon runs through an edge of the other; a touch is no crossing."""
    a, b = p[:, None], np.roll(p, -1, axis=0)[:, None]
    c, d = q[None], np.roll(q, -1, axis=0)[None]
    apart = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
    return bool(apart.any())


def _side(a: Array, b: Array, x: Array) -> Array:
    """On which side of the line from a to b points lie: 1, 0, -1."""
    ab, ax = b - a, x - a
    return np.sign(ab[..., 0] * ax[..., 1] - ab[..., 1] * ax[..., 0])


def _contains(polygon: Array, point: Array) -> bool:
    """Whether a ray from the point to the right crosses the edges an odd number of times."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    a, b = np.where(a[:, 1:] <= b[:, 1:], a, b), np.where(a[:, 1:] <= b[:, 1:], b, a)  # upwards
    level = (a[:, 1] <= point[1]) & (point[1] < b[:, 1])
    return bool((_side(a, b, point)[level] > 0.0).sum() % 2)


def _nearest(points: Array, polygon: Array) -> tuple[Array, Array]:
    """Nearest point (n, 2) of the polygon's edges to each of ``points`` (n, 2), and how far it is (n,)."""
    start = polygon[None]
    along = np.roll(polygon, -1, axis=0)[None] - start
    t = ((points[:, None] - start) * along).sum(-1) / (along**2).sum(-1)
    foot = start + np.clip(t, 0.0, 1.0)[..., None] * along
    distance = np.linalg.norm(points[:, None] - foot, axis=-1)
    k = np.argmin(distance, axis=1)
    rows = np.arange(len(points))
    return foot[rows, k], distance[rows, k]
