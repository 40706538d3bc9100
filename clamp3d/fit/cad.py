"""Features of solids from CAD, read off their exact faces: nothing is fitted, and what is no cylinder is not one."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from clamp3d.brep.bodies import Body, Reading
from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.surfaces import CYLINDER, KINDS, PLANE, parameters, unwrapped
from clamp3d.core.linear import atan2, cross, dot, norm, to_source, to_target
from clamp3d.core.mesh import Array, IntArray, Mesh
from clamp3d.core.triangles import distinct
from clamp3d.fit.surface import covered

_SAME = 1e-6
"""Cylinders (mm, rad) nearer than this are one."""
_NEAR_END = 0.8


def cad_features(reading: Reading, name: str) -> tuple[Mesh, list[tuple[float, dict[str, Any]]], list[str]]:
    """The mesh of all bodies; for each cylindrical feature its sense (1: convex) and values; notes on other faces."""
    vertices, faces, found, others = [], [], [], Counter[str]()
    n = m = 0
    for body in reading.bodies:
        shape = body.shape
        assert isinstance(shape, BrepSolid)
        vertices.append(to_target(body.T, shape.mesh.vertices))
        faces.append(shape.mesh.faces + n)
        others.update(KINDS[k] for k in shape.surfaces.kind if k not in (PLANE, CYLINDER))
        for group in _groups(shape):
            sense, values = _measured(body, shape, group)
            found.append((sense, values | {"faces": values["faces"] + m}))
        n, m = n + len(shape.mesh.vertices), m + len(shape.mesh.faces)
    closed = all(body.shape.mesh.watertight for body in reading.bodies)
    rounding = max(body.shape.mesh.rounding for body in reading.bodies)
    mesh = Mesh(name, np.concatenate(vertices), np.concatenate(faces), closed, rounding)
    words = [f"{count} {'free-form' if kind == 'other' else kind}" for kind, count in sorted(others.items())]
    notes = [*reading.notes, *([f"faces that are no cylinders: {', '.join(words)}"] if words else [])]
    return mesh, found, notes


def _groups(shape: BrepSolid) -> list[IntArray]:
    """Cylindrical faces that continue one another on one surface."""
    faces = shape.surfaces
    groups: list[list[int]] = []
    corners: list[set[int]] = []
    for i in np.flatnonzero(faces.kind == CYLINDER):
        own, group = set(shape.mesh.faces[shape.face == i].ravel().tolist()), [int(i)]
        for k in reversed(range(len(groups))):
            if _one(shape, groups[k][0], int(i)) and corners[k] & own:
                group, own = groups.pop(k) + group, corners.pop(k) | own
        groups.append(group)
        corners.append(own)
    return [np.array(group) for group in groups]


def _one(shape: BrepSolid, i: int, j: int) -> bool:
    """Whether two cylindrical faces lie on one cylinder."""
    faces = shape.surfaces
    (o, *_, z), (p, *_, w) = faces.frame[i], faces.frame[j]
    apart = norm(cross(p - o, z))
    turned = norm(cross(z, w))
    return (
        bool(faces.sense[i] == faces.sense[j]) and max(abs(faces.size[i, 0] - faces.size[j, 0]), apart, turned) < _SAME
    )


def _measured(body: Body, shape: BrepSolid, group: IntArray) -> tuple[float, dict[str, Any]]:
    faces, rows = shape.surfaces, np.flatnonzero(np.isin(shape.face, group))
    frame, radius = faces.frame[group[0]], float(faces.size[group[0], 0])
    z = dot(body.T[:3, :3], frame[3])
    if z[int(np.argmax(np.abs(z)))] < 0.0:  # the sense of an axis is nobody's: as that of a fit
        frame = frame * np.array([[1.0], [1.0], [-1.0], [-1.0]])
    pieces = faces.corners[np.isin(faces.face, group)]
    uv = unwrapped(CYLINDER, parameters(CYLINDER, frame, (radius, 0.0), pieces.reshape(-1, 3)).reshape(-1, 3, 2))
    middle, half = covered(uv[:, :, 0], _SAME)
    low, high = float(uv[:, :, 1].min()), float(uv[:, :, 1].max())
    T = np.eye(4)
    T[:3, 1] = -(math.cos(middle) * frame[1] + math.sin(middle) * frame[2])
    T[:3, 2] = frame[3]
    T[:3, 0] = cross(T[:3, 1], T[:3, 2])
    T[:3, 3] = frame[0] + 0.5 * (low + high) * frame[3]
    (a, b), (c, d) = ((uv[:, k] - uv[:, 0]).T for k in (1, 2))
    area = 0.5 * radius * float(np.abs(a * d - b * c).sum())
    arc_error, length_error = _strays(shape.mesh.faces[rows], shape.mesh.vertices, T, half, high - low)
    off = float(faces.deviation[group].max())
    points = distinct(shape.mesh.faces[rows])
    return float(faces.sense[group[0]]), {
        "radius": radius,
        "half_angle": half,
        "length": high - low,
        "T_part_feature": dot(body.T, T),
        "residual_rms": off,
        "residual_max": off,
        "points": len(points),
        "covered_area": area,
        "coverage": min(1.0, area / (2.0 * half * radius * (high - low))),
        "covariance": np.zeros((5, 5)),
        "covariance_error": 0.0,
        "form_error": off,
        "chord_error": 0.0,
        "arc_error": arc_error,
        "length_error": length_error,
        "faces": rows,
    }


def _strays(F: IntArray, V: Array, T: Array, half: float, length: float) -> tuple[float, float]:
    """How far the border strays from the ends of the arc (rad) and of the length (mm), beside these ends."""
    sides = np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    kept, count = np.unique(sides, axis=0, return_counts=True)
    ends = to_source(T, V[kept[count == 1]])
    along = np.abs(np.diff(ends[:, :, 2], axis=1)[:, 0]) > 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    z, angle = np.abs(ends[:, :, 2]), np.abs(atan2(ends[:, :, 0], -ends[:, :, 1]))
    rounds = z[~along & (z.min(axis=1) > 0.5 * _NEAR_END * length)]
    lips = angle[along & (angle.min(axis=1) > _NEAR_END * half)] if half < math.pi else np.zeros(0)
    return float((half - lips).max(initial=0.0)), float((0.5 * length - rounds).max(initial=0.0))
