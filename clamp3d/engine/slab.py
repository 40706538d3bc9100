"""Two solids from CAD of which one stands on a flat face of the other, or just over it, or just below.

Lemma: let no surface of a body be higher than h over a plane anywhere near another body, one point of this above h not
be inside the first, and all of the second at least at a height g. Then nothing of the first is above h near the second:
they are g - h apart. If that is negative, no point of one is deeper in the other: who moves so far along the plane's
normal leaves it.
"""

from __future__ import annotations

import numpy as np

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.model import CadModel
from clamp3d.files.faces import PLANE
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array, inverse, to_target

METHOD = f"extents along a face's normal, Open CASCADE, tolerance {TOLERANCE:g} mm"
_MARGIN = 0.1
"""How far (mm) around a body the other one is looked at: coarse meshes decide what is further apart."""
_HIGHEST = 8
"""Corners of a body that are looked at to see that they are outside of the other one."""


def slab_distance(a: CadModel, b: CadModel, T: Array, enough: Enough) -> Distance | None:
    """Lower bound of the distance of ``b`` at ``T`` (4, 4) in a's frame; None where none is found that is ``enough``.

    Of an overlap it is that of the interference: the greatest depth of a point of one body in the other.
    """
    for flat, other, pose in ((a, b, T), (b, a, inverse(T))):
        height = _height_over(flat, other, pose, enough)
        if height >= -_MARGIN:
            return Distance(min(height, _MARGIN) - TOLERANCE, method=METHOD)
    return None


def _height_over(flat: CadModel, other: CadModel, T: Array, enough: Enough) -> float:
    """How far (mm) ``other`` at ``T`` (4, 4) is at least over the flat face that it stands on; -inf if unknown."""
    mesh, others = (model.outer(model.chords[0]) for model in (flat, other))
    points = to_target(T, others.vertices)
    near = mesh.rows_near(np.array([points.min(axis=0), points.max(axis=0)]), others.error + _MARGIN)
    normal = _stood_on(flat, near, points, enough)
    if normal is None:
        return -np.inf
    height = _height_of(flat, normal, near)
    highest = points[np.argsort(-(points @ normal))[:_HIGHEST]]
    if not mesh.is_any_outside(highest[highest @ normal > height]):
        return -np.inf
    every = np.arange(len(others.faces))
    return float(normal @ T[:3, 3]) - _height_of(other, -normal @ T[:3, :3], every) - height


def _stood_on(flat: CadModel, near: IntArray, points: Array, enough: Enough) -> Array | None:
    """The normal (3,) of that flat face of triangles ``near`` (k,) which corners (n, 3) of a body are highest over.

    None if it cannot be ``enough`` how high that is.
    """
    form, faces = flat.shape.surfaces, np.unique(flat.face_meshes.face[near])
    faces = faces[form.kind[faces] == PLANE]
    if not len(faces):
        return None
    normals = form.sense[faces, None] * form.frame[faces, 3]
    heights = (points @ normals.T).min(axis=0) - np.einsum("ki,ki->k", normals, form.frame[faces, 0])
    best = float(heights.max())
    return np.asarray(normals[heights.argmax()]) if enough(Distance(best, max(0.0, best))) else None


def _height_of(model: CadModel, direction: Array, rows: IntArray) -> float:
    """How high (mm) what ``rows`` (k,) of a solid's coarse triangles stand for reaches along a unit vector (3,)."""
    mesh, face = model.face_meshes.surface, model.face_meshes.face[rows]
    corners = (mesh.vertices @ direction)[mesh.faces[rows]].max(axis=1)
    reached, at_most = float(corners.max()), corners + mesh.face_errors[rows]
    higher = at_most > reached
    if not higher.any():
        return reached
    faces, row = np.unique(face[higher], return_inverse=True)
    tops = model.shape.tops(direction, faces)[row.reshape(-1)]
    return max(reached, float(np.minimum(at_most[higher], tops).max()))
