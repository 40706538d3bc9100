"""Bounds of many pieces of a face at once against points of them, measured by Open CASCADE."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from assemblies import box, cone, cut, from_shell, fuse, moved, rod, solid_of
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_State
from test_faces_math import GRID

from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.surfaces import points_at
from clamp3d.brep.tessellate import explore
from clamp3d.collide import faces_block, faces_bounds, faces_tree
from clamp3d.collide.faces import FaceModel
from clamp3d.core import jit


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    """Formulas as they are written: what numba makes of them takes seconds each, and other tests run it."""
    monkeypatch.setattr(jit._Formula, "__call__", lambda self, *arguments: self._function(*arguments))


def placed(turn, x, y, z):
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(np.eye(3) + np.cross(np.eye(3), turn))[0]
    T[:3, :3] *= np.sign(np.diag(T[:3, :3]))
    T[:3, 3] = x, y, z
    return T


WASHER = cut(rod(6, 0, 1.2), rod(3.2, -1, 2))
PLATE = cut(box((-9, -12, -6), (14, 10, 0)), rod(3.2, -7, 1))
PAIRS = [
    (WASHER, PLATE, placed((3e-3, 0, 0), 0.02, 0.01, 0.01)),
    (PLATE, WASHER, placed((3e-3, 2e-3, 0), 0.02, 0.01, -0.01)),
    (PLATE, rod(3.19, -8, 3), placed((1e-3, 0, 0), 0.03, 0.02, 0.0)),
    (box((0, 0, 0), (5, 5, 5)), box((4.98, 4.97, -1), (9, 9, 4.0)), placed((1e-3, 2e-3, 1e-3), 0, 0, 0)),
    (cut(box((-6, -6, 0), (6, 6, 5)), cone(2, 4, 0, 5)), cone(2, 4, 0, 5), placed((2e-3, 0, 0), 0.01, 0.0, 0.01)),
    (cut(box((-9, -9, 0), (9, 9, 8)), rod(3, -1, 9)), rod(3, -2, 7), placed((0, 0, 0), 0.02, 0.0123, 0.0)),
    (box((-9, -9, -5), (9, 9, 0)), rod(3, -4, 4), placed((1.0, 0, 0), 0.0, 0.0, 2.98) @ placed((0, 0, 0.01), 0, 0, 0)),
    (fuse(rod(2, -5, 0), rod(4, 0, 2)), PLATE, placed((1e-3, 0, 0), 1.21, 0.0, 0.01)),
]


HOLLOW = 7
"""In a hollow corner no face alone has all of the solid below it: one piece after the other has to be looked at."""


def on_edges(shape):
    """Points on all edges of a shape: arcs bulge beyond the triangles."""
    points = []
    for edge in explore(shape, "EDGE"):
        curve = BRepAdaptor_Curve(edge)
        steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), 60)
        points += [curve.Value(float(t)).Coord() for t in steps]
    return points


def signed(points, shape):
    """Least signed distance (mm) of points from a solid, by Open CASCADE."""
    apart, least = from_shell(solid_of(shape)), np.inf
    for x in points:
        point = gp_Pnt(*map(float, x))
        inside = BRepClass3d_SolidClassifier(solid_of(shape), point, 1e-9).State() == TopAbs_State.TopAbs_IN
        least = min(least, apart(point) * (-1.0 if inside else 1.0))
    return least


@pytest.mark.parametrize("k", range(len(PAIRS)))
def test_no_point_of_a_face_is_nearer_or_deeper_than_its_bound(k):
    shape, other, T = PAIRS[k]
    a = FaceModel(BrepSolid.of(solid_of(shape), "a", chord=0.02))
    b = FaceModel(BrepSolid.of(solid_of(moved(other, T)), "b", chord=0.02)).faces
    frames, n, near = np.ascontiguousarray(b.frame.reshape(-1, 12)), len(a.faces.kind), np.empty(4, dtype=np.int64)
    own, stack = (b.kind, b.size, frames, b.deviation), np.empty(faces_tree.DEEP, dtype=np.int64)
    chosen, over = np.empty(faces_bounds.TRIED, dtype=np.int64), np.empty(faces_bounds.TRIED)
    whole = np.zeros((faces_block.WORK, 3, 3))
    place, scratch = whole[-3:], (near, chosen, over, np.empty(n), stack, whole)
    placed_faces, tight = list(explore(solid_of(moved(other, T)), "FACE")), 0
    for g in range(len(b.kind)):
        rows = np.flatnonzero(b.face == g)
        middle = 0.5 * (b.corners[rows].min(axis=(0, 1)) + b.corners[rows].max(axis=(0, 1)))
        whole[2, 0] = middle
        faces_tree.nearest(*a.arrays[:6], *middle, np.inf, near, stack)
        limits = a.slack, 0.01, np.inf, 1e-5
        asked = b.corners, b.uv, b.sag, g, own, a.arrays, limits, rows, -np.inf, np.inf, scratch, place
        bound, low = faces_block.block(*asked)
        inner = rows[(b.sag[rows] == 0.0).all(axis=1)]
        uv = [b.uv[rows].reshape(-1, 2), *(GRID[::29] @ b.uv[i] for i in inner)]
        points = points_at(int(b.kind[g]), b.frame[g], tuple(b.size[g]), np.concatenate(uv))
        edges = on_edges(placed_faces[g])
        points = np.vstack([*edges, points[np.linspace(0, len(points) - 1, 40).astype(int)]])
        least = signed(points, shape)
        assert bound <= least + 1e-6, (g, bound, least)
        tight += bound > least - 4e-3 and low < 0.5
    assert tight or k == HOLLOW
