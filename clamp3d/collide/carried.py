"""Faces that a motion carries along themselves: their distance from each other is that of curves, whatever the time.

A turn leaves a point its height along the axis and its distance from it, a translation its place across the way, a
screw the distance from the axis. In these coordinates a face of revolution about the axis, or one along the way, is a
curve, a line or a circle, and no triangles stand for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.surfaces import CONE, CYLINDER, PLANE, SPHERE, TORUS, Faces
from clamp3d.collide.invariants import boxes_of, rounding_of, unchanged
from clamp3d.collide.slopes import CANONICAL, Mask
from clamp3d.core.linear import atan2, cross, crosses, dot, norm, to_target
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array

if TYPE_CHECKING:
    from shapely import LineString

_BESIDE = 1e-6
"""A face that leaves itself by less (mm) is carried along itself."""
_SAGITTA = 4e-5
"""Arcs are polylines with this error, mm."""
_MOST = 1_000_000
"""Pairs of curves beyond which there are too many to measure."""


class Curves(NamedTuple):
    """Curves (k,) in the coordinates that stay, each the ``face`` (k,) that it is of, and its ``error`` (k,) mm.

    ``along`` (k, 2): from where to where the face reaches along the motion's axis, mm, at t = 0.
    """

    lines: NDArray[np.object_]
    face: NDArray[np.int64]
    error: Array
    along: Array

    def of(self, faces: Mask) -> Curves:
        """Those of some faces (n,)."""
        rows = faces[self.face]
        return Curves(self.lines[rows], self.face[rows], self.error[rows], self.along[rows])


class Carried(NamedTuple):
    """Pairs of curves that come near: distance (k,), where each is along the axis at t = 0, and how far it goes."""

    apart: Array
    moving: Array
    still: Array
    travel: float

    def gap(self, stretch: tuple[float, float], most: float) -> float:
        """Distance (mm) that all keep from each other from the first to the last time, up to ``most``."""
        ways = sorted(self.travel * t for t in stretch)
        ahead = self.still[:, 0] - (self.moving[:, 1] + ways[1])
        behind = self.moving[:, 0] + ways[0] - self.still[:, 1]
        found = np.hypot(self.apart, np.maximum(np.maximum(ahead, behind), 0.0))
        return float(found.min(initial=most))


def _leaves(faces: Faces, T: Array, motion: Motion) -> Array:
    """How far (n,) mm each face of a solid at ``T`` (4, 4) leaves itself in the motion; infinity: it does not stay."""
    u, z = axis_of(motion), dot(faces.frame[:, 3], T[:3, :3].T)
    origin = dot(faces.frame[:, 0], T[:3, :3].T) + T[:3, 3]
    far = np.zeros(len(z))
    reach = np.linalg.norm(faces.corners - faces.frame[faces.face, 0][:, None], axis=2).max(axis=1)
    np.maximum.at(far, faces.face, reach + faces.error)
    far += norm(motion.travel)
    lean = np.linalg.norm(crosses(z, np.broadcast_to(u, z.shape)), axis=1)
    kinds: tuple[int, ...] = (CYLINDER,)
    if not motion.angle:
        kinds = (PLANE, CYLINDER)
        lean = np.where(faces.kind == PLANE, np.abs(dot(z, u)), lean)
    elif not motion.travel.any():
        kinds = (PLANE, CYLINDER, CONE, SPHERE, TORUS)
        lean = np.where(faces.kind == SPHERE, 0.0, lean)
    beside = motion.from_axis(origin) if motion.angle else np.zeros(len(z))
    off = lean * far + np.where(faces.kind == PLANE, 0.0, beside)
    stays = (off <= _BESIDE) & np.isin(faces.kind, kinds) & (faces.deviation <= CANONICAL)
    return np.where(stays, off, np.inf)


def axis_of(motion: Motion) -> Array:
    """The direction (3,) of a turn's axis, or of a straight way."""
    return motion.axis if motion.angle else motion.travel / norm(motion.travel)


def curves(faces: Faces, T: Array, motion: Motion) -> Curves:
    """The faces of a solid at ``T`` (4, 4) that the motion carries along themselves, as curves.

    Their triangles, and how far these are from the surface and its border, tell from where to where.
    """
    off = _leaves(faces, T, motion)
    rows = np.flatnonzero(np.isfinite(off)[faces.face])
    triangles = to_target(T, faces.corners[rows].reshape(-1, 3)).reshape(-1, 3, 3)
    reach = faces.error[rows] + faces.sag[rows].max(axis=1) + _BESIDE
    if not len(rows):
        return Curves(np.empty(0, dtype=object), np.empty(0, dtype=np.int64), np.empty(0), np.empty((0, 2)))
    ranges = list(unchanged(motion, triangles))
    if motion.travel.any():
        height = dot(triangles, axis_of(motion))
        ranges += [height.min(axis=1, keepdims=True), height.max(axis=1, keepdims=True)]
    else:  # the height along the axis is one of the coordinates that stay
        ranges += [np.zeros((len(rows), 1)), np.zeros((len(rows), 1))]
    low, high = np.hstack(ranges[::2]) - reach[:, None], np.hstack(ranges[1::2]) + reach[:, None]
    table = np.unique(
        np.column_stack([faces.face[rows], low.round(9), high.round(9)])[:, [0, 3, 6, 1, 2, 4, 5]], axis=0
    )
    pieces, first = np.unique(table[:, :3], axis=0, return_index=True)
    of, lines, piece = pieces[:, 0].astype(np.int64), [], []
    for k, boxes in enumerate(np.split(table[:, 3:], first[1:])):
        found = _lines(*_curve(faces, int(of[k]), T, motion), boxes[:, :2], boxes[:, 2:])
        lines += found
        piece += [k] * len(found)
    error = off[of] + faces.deviation[of] + _SAGITTA + rounding_of(motion, triangles)
    return Curves(np.array(lines, dtype=object), of[piece], error[piece], pieces[piece, 1:])


def _curve(faces: Faces, k: int, T: Array, motion: Motion) -> tuple[Array, Array, float]:
    """A face in the coordinates that stay: a point (2,), and the direction (2,) of a line or the radius of a circle."""
    u, z = axis_of(motion), dot(T[:3, :3], faces.frame[k, 3])
    origin = dot(T[:3, :3], faces.frame[k, 0]) + T[:3, 3]
    kind, (size, second) = faces.kind[k], faces.size[k].tolist()
    nothing = np.zeros(2)
    if not motion.angle:
        at = unchanged(motion, origin[None, None])[0][0]
        if kind == CYLINDER:
            return at, nothing, size
        across = unchanged(motion, (origin + cross(z, u))[None, None])[0][0] - at
        return at, across / norm(across), 0.0
    if motion.travel.any():
        return np.array([0.0, size]), np.array([1.0, 0.0]), 0.0
    h, same = float(dot(origin - motion.point, u)), 1.0 if dot(z, u) > 0.0 else -1.0
    if kind == PLANE:
        return np.array([h, 0.0]), np.array([0.0, 1.0]), 0.0
    if kind == CYLINDER:
        return np.array([h, size]), np.array([1.0, 0.0]), 0.0
    if kind == CONE:
        return np.array([h, size]), np.array([same * np.cos(second), np.sin(second)]), 0.0
    return (np.array([h, 0.0]), nothing, size) if kind == SPHERE else (np.array([h, size]), nothing, second)


def _lines(at: Array, direction: Array, radius: float, low: Array, high: Array) -> list[LineString]:
    """What of a line or circle may be in some boxes (k, 2), and perhaps a little more, as polylines."""
    from shapely import LineString

    corners = np.stack([np.column_stack([x, y]) for x in (low[:, 0], high[:, 0]) for y in (low[:, 1], high[:, 1])])
    corners -= at
    if not radius:
        reach = dot(corners, direction)
        ends = np.stack([reach.min(axis=0), reach.max(axis=0)], axis=1)
        return [LineString(at + np.outer(end, direction)) for end in _merged(ends)]
    # Seen from the centre a box that does not hold it is less than half a turn wide.
    middle = corners.mean(axis=0)
    side = atan2(middle[:, 0] * corners[..., 1] - middle[:, 1] * corners[..., 0], (middle * corners).sum(axis=2))
    first = atan2(middle[:, 1], middle[:, 0])
    holds = ((low <= at) & (high >= at)).all(axis=1)
    ends = np.stack([first + side.min(axis=0), first + side.max(axis=0)], axis=1)
    ends[holds] = -np.pi, np.pi
    found = []
    for start, stop in _merged(ends):
        count = int(np.ceil((stop - start) / np.sqrt(min(8.0 * _SAGITTA / radius, 1.0)))) + 1
        angle = np.linspace(start, stop, count + 1)
        found.append(LineString(at + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)))
    return found


def _merged(ends: Array) -> Array:
    """Intervals (k, 2) that overlap as one."""
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    reach = np.maximum.accumulate(ends[:, 1])
    begins = np.append(True, ends[1:, 0] > reach[:-1])
    return np.stack([ends[begins, 0], reach[np.append(begins[1:], True)]], axis=1)


def pairs_of(moving: Curves, still: Curves, kept: Mask, motion: Motion, limit: float) -> Carried | None:
    """The pairs of faces ``kept`` (n, k) that come within ``limit`` mm; None where there are too many to measure."""
    from shapely import distance

    if len(moving.lines) * len(still.lines) > _MOST:
        return None
    i, j = np.nonzero(kept[np.ix_(moving.face, still.face)])
    apart = distance(moving.lines[i], still.lines[j]) - moving.error[i] - still.error[j]
    near = apart < limit
    i, j = i[near], j[near]
    travel = norm(motion.travel) if not motion.angle else float(dot(motion.travel, motion.axis))
    return Carried(np.maximum(apart[near], 0.0), moving.along[i], still.along[j], travel)


def least(
    motion: Motion, moving: tuple[Curves, Array, Array], still: tuple[Curves, Array, Array], limit: float
) -> float:
    """Distance (mm) that curves and triangles keep in all the motion, up to ``limit``; not that of curves from curves.

    Triangles (m, 3, 3) in the world at t = 0, each with how far the true surface may be from it (m,) mm.
    """
    from shapely import STRtree, distance

    found = limit
    (lines, boxes), (other_lines, other_boxes) = ((x[0], boxes_of(motion, *x[1:])) for x in (moving, still))
    for curved, flat in ((lines, other_boxes), (other_lines, boxes)):
        for line, error in zip(curved.lines, curved.error, strict=True):
            if len(flat):
                found = min(found, float(distance(line, flat).min()) - error)
    if len(boxes) and len(other_boxes) and found > 0.0:
        _, apart = STRtree(boxes).query_nearest(
            other_boxes, max_distance=found, return_distance=True, all_matches=False
        )
        found = min(found, float(apart.min(initial=np.inf)))
    return max(found, 0.0)
