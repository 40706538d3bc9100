"""Features of solids from CAD, read off their exact faces: nothing is fitted, and what is no cylinder is not one."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from clamp3d.brep.bodies import Body, Reading
from clamp3d.brep.open_cascade import CYLINDER, KINDS, PLANE
from clamp3d.brep.solid import CHORD, BrepSolid
from clamp3d.core.linear import to_source, to_target
from clamp3d.core.mesh import Array, IntArray, Mesh, is_closed
from clamp3d.fit.surface import covered

_SAME = 1e-6
"""Cylinders (mm, rad) nearer than this are one."""
_NEAR_END = 0.8


def cad_features(
    reading: Reading, name: str, chord: float = CHORD
) -> tuple[Mesh, list[tuple[float, dict[str, Any]]], list[str]]:
    """The mesh of all bodies; for each cylindrical feature its sense (1: convex) and values; notes on other faces."""
    vertices, faces, features, others = [], [], [], Counter[str]()
    n = m = 0
    for body in reading.bodies:
        solid = body.shape
        assert isinstance(solid, BrepSolid)
        mesh = solid.tessellated(chord)
        vertices.append(to_target(body.T, mesh.vertices))
        faces.append(mesh.faces + n)
        others.update(KINDS[k] for k in solid.surfaces.kind if k not in (PLANE, CYLINDER))
        for group in _groups(solid, chord):
            sense, values = _measured(body, solid, group, chord)
            features.append((sense, values | {"faces": values["faces"] + m}))
        n, m = n + len(mesh.vertices), m + len(mesh.faces)
    V, F = np.concatenate(vertices), np.concatenate(faces)
    joined = Mesh(name, V, F, is_closed(F), float(np.abs(V).max()) * 2.0**-50)
    words = [f"{count} {'free-form' if kind == 'other' else kind}" for kind, count in sorted(others.items())]
    notes = [*reading.notes, *([f"faces that are no cylinders: {', '.join(words)}"] if words else [])]
    return joined, features, notes


def _groups(solid: BrepSolid, chord: float) -> list[IntArray]:
    """Cylindrical faces that continue one another on one surface."""
    mesh = solid.tessellated(chord)
    groups: list[list[int]] = []
    corners: list[set[int]] = []
    for i in np.flatnonzero(solid.surfaces.kind == CYLINDER):
        own, group = set(mesh.faces[mesh.face == i].ravel().tolist()), [int(i)]
        for k in reversed(range(len(groups))):
            if _on_one_cylinder(solid, groups[k][0], int(i)) and corners[k] & own:
                group, own = groups.pop(k) + group, corners.pop(k) | own
        groups.append(group)
        corners.append(own)
    return [np.array(group) for group, own in zip(groups, corners, strict=True) if own]


def _on_one_cylinder(solid: BrepSolid, i: int, j: int) -> bool:
    """Whether two cylindrical faces lie on one cylinder."""
    faces = solid.surfaces
    (o, *_, z), (p, *_, w) = faces.frame[i], faces.frame[j]
    apart, turned = np.linalg.norm(np.cross(p - o, z)), np.linalg.norm(np.cross(z, w))
    off = max(abs(float(faces.size[i, 0] - faces.size[j, 0])), float(apart), float(turned))
    return bool(faces.sense[i] == faces.sense[j]) and off < _SAME


def _measured(body: Body, solid: BrepSolid, group: IntArray, chord: float) -> tuple[float, dict[str, Any]]:
    """Sense and values of the cylinder that a group of faces is on."""
    mesh = solid.tessellated(chord)
    rows = np.flatnonzero(np.isin(mesh.face, group))
    frame, radius = solid.surfaces.frame[group[0]], float(solid.surfaces.size[group[0], 0])
    z = body.T[:3, :3] @ frame[3]
    if z[int(np.argmax(np.abs(z)))] < 0.0:  # the sense of an axis is nobody's: as that of a fit
        frame = frame * np.array([[1.0], [1.0], [-1.0], [-1.0]])
    local = (mesh.vertices[mesh.faces[rows]] - frame[0]) @ frame[1:].T
    angle = np.arctan2(local[..., 1], local[..., 0])
    angle = angle[:, :1] + np.remainder(angle - angle[:, :1] + math.pi, 2.0 * math.pi) - math.pi
    middle, half = covered(angle, _SAME)
    low, high = float(local[..., 2].min()), float(local[..., 2].max())
    T = np.eye(4)
    T[:3, 1] = -(math.cos(middle) * frame[1] + math.sin(middle) * frame[2])
    T[:3, 2] = frame[3]
    T[:3, 0] = np.cross(T[:3, 1], T[:3, 2])
    T[:3, 3] = frame[0] + 0.5 * (low + high) * frame[3]
    unrolled = np.stack([angle, local[..., 2]], axis=2)
    (a, b), (c, d) = ((unrolled[:, k] - unrolled[:, 0]).T for k in (1, 2))
    area = 0.5 * radius * float(np.abs(a * d - b * c).sum())
    arc_error, length_error = _strays(mesh.faces[rows], mesh.vertices, T, half, high - low)
    return float(solid.surfaces.sense[group[0]]), {
        "radius": radius,
        "half_angle": half,
        "length": high - low,
        "T_part_feature": body.T @ T,
        "residual_rms": 0.0,
        "residual_max": 0.0,
        "points": len(np.unique(mesh.faces[rows])),
        "covered_area": area,
        "coverage": min(1.0, area / (2.0 * half * radius * (high - low))),
        "covariance": np.zeros((5, 5)),
        "covariance_error": 0.0,
        "form_error": 0.0,
        "chord_error": float(mesh.errors[rows].max()),
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
    z, angle = np.abs(ends[:, :, 2]), np.abs(np.arctan2(ends[:, :, 0], -ends[:, :, 1]))
    rounds = z[~along & (z.min(axis=1) > 0.5 * _NEAR_END * length)]
    lips = angle[along & (angle.min(axis=1) > _NEAR_END * half)] if half < math.pi else np.zeros(0)
    return float((half - lips).max(initial=0.0)), float((0.5 * length - rounds).max(initial=0.0))
