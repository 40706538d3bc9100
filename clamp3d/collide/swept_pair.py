"""Bounds over a stretch of a motion from the triangles of two parts, and from those faces of CAD that need none."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.solid import BrepSolid
from clamp3d.collide.carried import Carried, Curves, axis_of, curves, least, pairs_of
from clamp3d.collide.invariants import can_meet
from clamp3d.collide.meshes import any_inside
from clamp3d.collide.model import FINEST_CAD, Model
from clamp3d.collide.slopes import Mask, facing
from clamp3d.collide.swept_mesh import Standing, swept_gap
from clamp3d.core.linear import dot, to_target
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array, inverse
from clamp3d.core.shells import joined
from clamp3d.core.triangles import distinct

_ERRORS = (0.064, 0.016, 0.004)
"""Chord errors (mm) of the meshes: the first that is at most an eighth of the distance that is wanted, so that most is
left of it. Where none is, the parts touch or nearly do, and the finest one says as little as the first."""
_GROUPS = 8
"""Sets of faces that are measured apart from each other at most."""
_BORDERS = 1e-6
"""Faces that share an edge may end this far (mm) from each other there."""


class _Side(NamedTuple):
    """Triangles (m, 3, 3) in the world at t = 0, their errors (m,) mm, and numbers (m, 3) of their corners."""

    triangles: Array
    errors: Array
    corners: NDArray[np.int64]

    def of(self, rows: Mask) -> _Side:
        return _Side(self.triangles[rows], self.errors[rows], self.corners[rows])


class _Group(NamedTuple):
    """Triangles of the moving part (m, 3, 3), in the world at t = 0, with their errors (m,) mm, and what they may meet.

    In the coordinates that the motion leaves as they are they stay at ``least`` mm from that.
    """

    moving: Array
    errors: Array
    still: Standing
    least: float


class _Near(NamedTuple):
    """All that may come within ``limit`` mm on the way, by meshes of chord error ``error``."""

    limit: float
    error: float
    groups: list[_Group]
    carried: Carried | None


class SweptPair:
    """A part that moves against one that stands, both as closed meshes."""

    def __init__(self, moving: Model, still: Model, motion: Motion, start: Array, T_still: Array) -> None:
        self.a, self.b, self.motion = moving, still, motion
        self.start, self.T_still = start, T_still
        self._near: dict[bool, _Near] = {}

    @property
    def asked(self) -> bool:
        """Whether a stretch has been bounded."""
        return bool(self._near)

    @cached_property
    def by_faces(self) -> bool:
        """Whether faces can be left out, and others be measured exactly, while the parts are apart."""
        moves = bool(self.motion.angle) or bool(self.motion.travel.any())
        return len(self._solids) == 2 and self.motion.is_screw and moves

    @cached_property
    def _solids(self) -> list[tuple[BrepSolid, Array]]:
        """Those of the two that are closed solids from CAD, with their poses (4, 4) at t = 0."""
        placed = ((self.a.shape, self.start), (self.b.shape, self.T_still))
        return [(shape, T) for shape, T in placed if isinstance(shape, BrepSolid) and shape.mesh.watertight]

    def lower(self, t: float, half: float, wanted: float, apart: bool) -> float:
        """Distance (mm) that is kept from t - half to t + half, up to ``wanted``; minus infinity where they may meet.

        ``apart``: whether they certainly are at ``t``.
        """
        self.a.counters.queries["swept meshes"] += 1
        limit = max(wanted, 0.0)
        stretch = (t - half, t + half)
        if apart and self.by_faces:
            near = self._kept(True, limit)
            low = near.limit if near.carried is None else near.carried.gap(stretch, near.limit)
            low = self._gap(near.groups, stretch, low) - _BORDERS
            # Apart at the middle, and the places that could meet first never do: so nothing does.
            return low if low > 0.0 else -np.inf
        near = self._kept(False, limit)
        low = self._gap(near.groups, stretch, near.limit)
        mine, other = self.a.outer(near.error), self.b.outer(near.error)
        T = dot(inverse(self.motion.at(t, self.start)), self.T_still)
        if low == -np.inf or any_inside(other, mine, inverse(T)) or any_inside(mine, other, T):
            return -np.inf
        return low - 1e-11 * (mine.scale + other.scale + float(np.abs(T[:3, 3]).max()))

    def _gap(self, groups: list[_Group], stretch: tuple[float, float], most: float) -> float:
        for group in groups:
            if most == -np.inf:
                break
            low = swept_gap(group.still, group.moving, group.errors, self.motion, stretch, most, group.least)
            most = min(most, low)
        return most

    def _kept(self, by_faces: bool, limit: float) -> _Near:
        known = self._near.get(by_faces)
        if limit <= 2.0 * _ERRORS[-1]:
            error = _ERRORS[0]
        else:
            error = next((error for error in _ERRORS if error <= 0.125 * limit), _ERRORS[-1])
        if known is None or known.error != error or not limit <= known.limit <= 2.0 * limit:
            known = (self._faces if by_faces else self._meshes)(error, limit)
            self._near[by_faces] = known
        return known

    def _meshes(self, error: float, limit: float) -> _Near:
        """All triangles of the two meshes that may come within ``limit`` mm of the other one on the way."""
        found = []
        for model, T in ((self.a, self.start), (self.b, self.T_still)):
            mesh = model.outer(error)
            errors = np.zeros(len(mesh.faces)) if mesh.face_error is None else mesh.face_error
            found.append(_Side(to_target(T, mesh.vertices)[mesh.faces], errors, mesh.faces))
        return _Near(limit, error, self._group(found[0], found[1], limit), None)

    def _faces(self, error: float, limit: float) -> _Near:
        """The same of those pairs of faces that can hold the nearest points; faces that are carried along as curves."""
        exact, pairs = self._carried(limit)
        kept = self._facing & ~pairs
        sides = []
        for (solid, T), lines in zip(self._solids, self._curves, strict=True):
            faces = solid.tessellated(max(error, FINEST_CAD)).surfaces
            points = faces.corners.reshape(-1, 3)
            _, corner = np.unique(points, axis=0, return_inverse=True)
            # A flat face has no error of its own, but a border that its triangles cut short.
            errors = faces.error + faces.sag.max(axis=1)
            side = _Side(to_target(T, points).reshape(-1, 3, 3), errors, corner.reshape(-1, 3))
            sides.append((faces.face, ~np.isin(faces.face, lines.face), side, lines))
        groups = []
        for rows in _alike(kept):
            chosen, images = [], []
            for (face, leaves, side, lines), mask in zip(
                sides, (rows, np.asarray(kept[rows].any(axis=0))), strict=True
            ):
                flat = mask[face] & leaves
                images.append((lines.of(mask), side.triangles[flat], side.errors[flat]))
                chosen.append(side.of(mask[face]))
            known = least(self.motion, images[0], images[1], limit) if exact is not None else -np.inf
            groups += self._group(chosen[0], chosen[1], limit, known)
        return _Near(limit, error, groups, exact)

    def _group(self, moving: _Side, still: _Side, limit: float, least: float = -np.inf) -> list[_Group]:
        """What of two sets of triangles may come within ``limit`` mm, as the one group that it is, or none."""
        if not len(moving.errors) or not len(still.errors) or least >= limit > 0.0:
            return []
        ours, theirs = can_meet(self.motion, moving[:2], still[:2], limit)
        if not ours.any() or not theirs.any():
            return []
        other = still.of(theirs)
        piece = joined(other.corners, int(other.corners.max()) + 1)[other.corners[:, 0]]
        return [
            _Group(moving.triangles[ours], moving.errors[ours], Standing(other.triangles, other.errors, piece), least)
        ]

    @cached_property
    def _facing(self) -> Mask:
        """Pairs of faces that can hold the nearest points."""
        u, ((moving, start), (still, T_still)) = axis_of(self.motion), self._solids
        return facing(moving, still, dot(u, start[:3, :3]), dot(u, T_still[:3, :3]))

    @cached_property
    def _curves(self) -> list[Curves]:
        """The faces of each part that the motion carries along themselves."""
        return [curves(solid.surfaces, T, self.motion) for solid, T in self._solids]

    def _carried(self, limit: float) -> tuple[Carried | None, Mask]:
        """The pairs of them that come within ``limit`` mm, and which pairs of faces those are of."""
        facing, (moving, still) = self._facing, self._curves
        found = pairs_of(moving, still, facing, self.motion, limit)
        pairs = np.zeros_like(facing)
        if found is not None:
            pairs[np.ix_(distinct(moving.face), distinct(still.face))] = True
        return found, pairs


def _alike(kept: Mask) -> list[Mask]:
    """Rows of ``kept`` (n, k) that are the same, as masks (n,); all that have one true entry if there are too many."""
    patterns, number = np.unique(kept, axis=0, return_inverse=True)
    if len(patterns) > _GROUPS:
        return [np.asarray(kept.any(axis=1))]
    return [np.asarray(number == k) for k in range(len(patterns)) if patterns[k].any()]
