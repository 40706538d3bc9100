"""Features of solids from CAD, read off their exact faces: nothing is fitted, and what is no cylinder is not one."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from clamp3d.files.bodies import Body, Reading
from clamp3d.files.faces import CYLINDER, KINDS, PLANE
from clamp3d.files.solid import BrepSolid
from clamp3d.fit.axis import Axis, covered, frame, upward
from clamp3d.fit.features import FitResult, result_of
from clamp3d.geometry.mesh import Mesh, appended, edges_of
from clamp3d.geometry.pose import Array, to_source, to_target

_SAME = 1e-6
"""Cylinders (mm, rad) nearer than this are one: ten times what CAD counts as one point, 1e-7 mm."""
_NEAR_END = 0.8  # part of half an extent beyond which a border edge belongs to that end; chosen


def fit_solid(solid: BrepSolid) -> FitResult:
    """The cylindrical faces of a solid from CAD, with its own mesh."""
    return result_of(*cad_features(Reading([Body(solid.name, solid, np.eye(4))]), solid.name))


def cad_features(reading: Reading, name: str) -> tuple[Mesh, list[tuple[float, dict[str, Any]]], list[str]]:
    """The mesh of all bodies; for each cylindrical feature its sense (1: convex) and values; notes on other faces."""
    vertices, faces, features, others = [], [], [], Counter[str]()
    count = 0
    for body in reading.bodies:
        solid = body.shape
        assert isinstance(solid, BrepSolid)
        placed = to_target(body.T, solid.mesh.vertices)
        others.update(KINDS[kind] for kind in solid.surfaces.kind if kind not in (PLANE, CYLINDER))
        for group in _groups(solid):
            rows = np.flatnonzero(np.isin(solid.face, group))
            values = _values(body, solid, group[0], placed[solid.mesh.faces[rows]])
            features.append((float(solid.surfaces.sense[group[0]]), values | {"faces": rows + count}))
        vertices.append(placed)
        faces.append(solid.mesh.faces)
        count += len(solid.mesh.faces)
    closed = all(body.mesh.watertight for body in reading.bodies)
    rounding = max(body.mesh.rounding for body in reading.bodies)
    mesh = Mesh(name, *appended(vertices, faces), closed, rounding)
    words = [f"{count} {'free-form' if kind == 'other' else kind}" for kind, count in sorted(others.items())]
    return mesh, features, [*reading.notes, *([f"faces that are no cylinders: {', '.join(words)}"] if words else [])]


def _groups(solid: BrepSolid) -> list[list[int]]:
    """Cylindrical faces that continue one another on one surface."""
    groups: list[list[int]] = []
    corners: list[set[int]] = []
    for i in np.flatnonzero(solid.surfaces.kind == CYLINDER):
        own, group = set(solid.mesh.faces[solid.face == i].ravel().tolist()), [int(i)]
        for k in reversed(range(len(groups))):
            if _continues(solid, groups[k][0], int(i)) and corners[k] & own:
                group, own = groups.pop(k) + group, corners.pop(k) | own
        groups.append(group)
        corners.append(own)
    return groups


def _continues(solid: BrepSolid, i: int, j: int) -> bool:
    """Whether two cylindrical faces lie on one cylinder."""
    faces = solid.surfaces
    (o, *_, z), (p, *_, w) = faces.frame[i], faces.frame[j]
    off = abs(faces.size[i, 0] - faces.size[j, 0]), np.linalg.norm(np.cross(p - o, z)), np.linalg.norm(np.cross(z, w))
    return bool(faces.sense[i] == faces.sense[j] and max(off) < _SAME)


def _values(body: Body, solid: BrepSolid, face: int, corners: Array) -> dict[str, Any]:
    """The values of a `FittedSurface` but its ``faces``, from the triangles (m, 3, 3) on the cylinder of a face."""
    point, *_, direction = solid.surfaces.frame[face]
    radius = float(solid.surfaces.size[face, 0])
    axis = Axis(to_target(body.T, point), upward(body.T[:3, :3] @ direction), radius)
    x, y, z = np.moveaxis(to_source(frame(axis, 0.0, 0.0), corners), -1, 0)
    angle = np.unwrap(np.arctan2(x, -y), axis=1)
    middle, half = covered(angle, _SAME)
    low, high = float(z.min()), float(z.max())
    T = frame(axis, middle, 0.5 * (low + high))
    across, along = angle[:, 1:] - angle[:, :1], z[:, 1:] - z[:, :1]
    area = 0.5 * radius * float(np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0]).sum())
    off = float(np.abs(np.hypot(x, y) - radius).max())
    arc_error, length_error = _strays(to_source(T, corners), half, high - low)
    return {
        "radius": radius,
        "half_angle": half,
        "length": high - low,
        "T_part_feature": T,
        "residual_rms": off,
        "residual_max": off,
        "points": len(np.unique(corners.reshape(-1, 3), axis=0)),
        "covered_area": area,
        "form_error": off,
        "arc_error": arc_error,
        "length_error": length_error,
    }


def _strays(corners: Array, half: float, length: float) -> tuple[float, float]:
    """How far the border strays from the ends of the arc (rad) and of the length (mm), beside these ends."""
    points, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    ends = points[edges_of(number.reshape(-1, 3), 1)[0]]
    along = np.abs(np.diff(ends[:, :, 2], axis=1)[:, 0]) > 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    z, angle = np.abs(ends[:, :, 2]), np.abs(np.arctan2(ends[:, :, 0], -ends[:, :, 1]))
    rounds = z[~along & (z.min(axis=1) > 0.5 * _NEAR_END * length)]
    lips = angle[along & (angle.min(axis=1) > _NEAR_END * half)] if half < math.pi else np.zeros(0)
    return float((half - lips).max(initial=0.0)), float((0.5 * length - rounds).max(initial=0.0))
