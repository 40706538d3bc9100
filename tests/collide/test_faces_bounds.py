"""Bounds of many pieces of a face at once against points of them, measured by Open CASCADE."""

import math
import sys
from dataclasses import replace
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

from clamp3d.brep import borders, tessellate
from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.surfaces import CONE, CYLINDER, points_at
from clamp3d.brep.tessellate import explore
from clamp3d.collide import faces_block, faces_hollow, faces_tree
from clamp3d.collide.faces import FaceModel, faces_distance
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
COUNTERBORE = cut(box((-9, -9, 0), (9, 9, 9)), rod(3, -1, 10), rod(5, 3, 10))
POCKET = cut(box((0, 0, 0), (9, 9, 9)), box((3, 3, 3), (10, 10, 10)))
GROOVED = cut(rod(9, 0, 8), rod(5, -1, 9), rod(6, 3, 5.2))
PAIRS = [
    (WASHER, PLATE, placed((3e-3, 0, 0), 0.02, 0.01, 0.01)),
    (PLATE, WASHER, placed((3e-3, 2e-3, 0), 0.02, 0.01, -0.01)),
    (PLATE, rod(3.19, -8, 3), placed((1e-3, 0, 0), 0.03, 0.02, 0.0)),
    (box((0, 0, 0), (5, 5, 5)), box((4.98, 4.97, -1), (9, 9, 4.0)), placed((1e-3, 2e-3, 1e-3), 0, 0, 0)),
    (cut(box((-6, -6, 0), (6, 6, 5)), cone(2, 4, 0, 5)), cone(2, 4, 0, 5), placed((2e-3, 0, 0), 0.01, 0.0, 0.01)),
    (cut(box((-9, -9, 0), (9, 9, 8)), rod(3, -1, 9)), rod(3, -2, 7), placed((0, 0, 0), 0.02, 0.0123, 0.0)),
    (box((-9, -9, -5), (9, 9, 0)), rod(3, -4, 4), placed((1.0, 0, 0), 0.0, 0.0, 2.98) @ placed((0, 0, 0.01), 0, 0, 0)),
    (fuse(rod(2, -5, 0), rod(4, 0, 2)), PLATE, placed((1e-3, 0, 0), 1.21, 0.0, 0.01)),
    (COUNTERBORE, cut(rod(5, 3, 6), rod(3.5, 2, 7)), placed((1e-3, 0, 0), 0.01, 0.012, -0.01)),
    (POCKET, box((3, 3, 3), (7, 8, 6)), placed((0, 0, 1e-3), -0.01, -0.02, -0.015)),
    (GROOVED, cut(rod(6.1, 3, 5), rod(4.5, 2, 6)), placed((1e-3, 0, 0), 0.01, 0.01, -0.02)),
]
BOSS = 7
"""Between a boss and its flange one piece after the other has to be looked at."""
HOLLOW = 8
"""From here on in hollow corners: all faces of the other that lie in them are bounded sharply."""


def on_edges(shape):
    """Points on all edges of a shape: arcs bulge beyond the triangles."""
    points = []
    for edge in explore(shape, "EDGE"):
        curve = BRepAdaptor_Curve(edge)
        steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), 40)
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


def room(solid):
    """What a search works in, all but the place for a point."""
    near, stack = np.empty(4, dtype=np.int64), np.empty(faces_tree.DEEP, dtype=np.int64)
    chosen, over = np.empty(faces_hollow.TRIED, dtype=np.int64), np.empty(faces_hollow.TRIED)
    return near, chosen, over, np.empty(len(solid.kind)), stack, np.zeros((faces_block.WORK, 3, 3))


def bounds(a, b):
    """Of each face of b: lower bound of its signed distance from a, and how low a point is over a's faces."""
    frames, scratch = np.ascontiguousarray(b.frame.reshape(-1, 12)), room(a.faces)
    near, stack, whole = scratch[0], scratch[4], scratch[5]
    for g in range(len(b.kind)):
        rows = np.flatnonzero(b.face == g)
        whole[2, 0] = 0.5 * (b.corners[rows].min(axis=(0, 1)) + b.corners[rows].max(axis=(0, 1)))
        faces_tree.nearest(*a.arrays[:6], *whole[2, 0], np.inf, near, stack)
        own, limits = (b.kind, b.size, frames, b.deviation), (a.slack, 0.01, np.inf, 1e-5)
        asked = b.corners, b.uv, b.sag, g, own, a.arrays, limits, rows, -np.inf, np.inf, scratch, whole[-3:]
        yield faces_block.block(*asked)


def solids(k, chord):
    """One of the pairs: the model of the first, the faces of the second, and their shapes."""
    shape, other, T = PAIRS[k]
    a = FaceModel(BrepSolid.of(solid_of(shape), "a", chord=chord))
    b = FaceModel(BrepSolid.of(solid_of(moved(other, T)), "b", chord=chord)).faces
    return a, b, shape, list(explore(solid_of(moved(other, T)), "FACE"))


@pytest.mark.parametrize(("k", "coarse"), [*((k, False) for k in range(len(PAIRS))), (0, True), (6, True), (8, True)])
def test_no_point_of_a_face_is_nearer_or_deeper_than_its_bound(monkeypatch, k, coarse):
    """Also where the borders bulge far beyond the sides of coarse triangles, which are cut on to such a border."""
    if coarse:
        for module in (borders, tessellate):
            monkeypatch.setattr(module, "BORDER", 0.2)
    a, b, shape, faces = solids(k, 0.2 if coarse else 0.02)
    tight = 0
    for g, (bound, low) in enumerate(bounds(a, b)):
        rows = np.flatnonzero(b.face == g)
        inner = rows[(b.sag[rows] == 0.0).all(axis=1)]
        uv = [b.uv[rows].reshape(-1, 2), *(GRID[::29] @ b.uv[i] for i in inner)]
        points = points_at(int(b.kind[g]), b.frame[g], tuple(b.size[g]), np.concatenate(uv))
        points = np.vstack([*on_edges(faces[g]), points[np.linspace(0, len(points) - 1, 40).astype(int)]])
        least = signed(points, shape)
        assert bound <= least + 1e-6, (g, bound, least)
        tight += bound > least - 4e-3 and low < 0.5
    assert tight >= (3 if k >= HOLLOW else 1) or k == BOSS or coarse


@pytest.mark.parametrize(("k", "kind", "lost"), [(5, CYLINDER, 1e-3), (4, CONE, 0.02)])
def test_borders_that_bulge_over_their_chords_leave_a_bound(k, kind, lost):
    """Of a hole's rim the triangles beside it reach into the hole: by its slack, not by rounding alone."""
    a, b, shape, faces = solids(k, 0.02)
    assert a.slack[: len(a.faces.kind)].max() > 4e-4 > 50.0 * a.slack[len(a.faces.kind) :].max()
    g = int(np.flatnonzero(b.kind == kind)[0])
    assert list(bounds(a, b))[g][0] > signed(on_edges(faces[g]), shape) - lost


@pytest.mark.parametrize("k", [0, 2, 6, 8])
def test_pieces_cut_on_coarse_borders_are_off_by_their_bulge(monkeypatch, k):
    """A search cuts pieces whose sides are chords of the border: those of a hole's rim lie in the hole.

    It tells no less depth than the deepest point of the edges has, and no more: here no other is deeper.
    """
    for module in (borders, tessellate):
        monkeypatch.setattr(module, "BORDER", 0.2)
    shape, other, T = PAIRS[k]
    shapes = shape, moved(other, T)
    a, b = (FaceModel(BrepSolid.of(solid_of(s), "x", chord=0.2)) for s in shapes)
    edges = ([x for face in explore(solid_of(s), "FACE") for x in on_edges(face)] for s in shapes)
    least = min(signed(points, s) for points, s in zip(edges, shapes[::-1], strict=True))
    for tol in (1e-3, 5e-3):
        found = faces_distance(a, b, np.eye(4), contact=1e-3, tol=tol)
        assert found.lower <= least
        assert found.upper >= least - 1e-3


@pytest.mark.parametrize("wall", [False, True])
def test_the_way_out_of_a_corner_ends_where_the_corner_is_seen_to_be_open(wall):
    """A triangle, tip up, in the material below a pit, and deepest at both ends of its base.

    Straight above these is more of the material: the pit is half as wide. Its cone is no face of a corner, and further
    from the middle of the triangle's box, which is that of the base, than any point of the triangle is.
    """
    size, R = 8.0, np.eye(4)
    R[:3, :3] = np.array([[1.0, 0.0, 1.0], [0.0, math.sqrt(2.0), 0.0], [-1.0, 0.0, 1.0]]) / math.sqrt(2.0)
    high = size / math.sqrt(2.0)
    shape = cut(box((-30, -30, -40), (30, 30, 30)), cone(0.5 * high, 0.46 * high, 0, 31))
    if wall:
        shape = fuse(shape, box((-29, -29, -1), (29, -0.5, 29)))
    shape = solid_of(moved(shape, R))
    other = cut(box((-size, 0, -size), (0, 0.1, 0)), moved(box((-20, -1, -20), (20, 1, -high)), R))
    a = FaceModel(BrepSolid.of(shape, "a", chord=0.02))
    b = FaceModel(BrepSolid.of(solid_of(other), "b", chord=0.02)).faces
    least = signed([(-size, 0.0, 0.0), (-size, 0.1, 0.0)], shape)
    assert least == pytest.approx(-math.hypot(high, 0.5 * high), abs=2e-3)
    for k in range(3):
        rows = {name: np.roll(getattr(b, name), k, axis=1).copy() for name in ("corners", "uv", "sag")}
        for g, (bound, _) in enumerate(bounds(a, replace(b, **rows))):
            corners = b.corners[b.face == g].reshape(-1, 3)
            if (np.abs(corners - [-size, 0.0, 0.0]).max(axis=1) < 0.2).any():
                assert bound <= least + 2e-3, (k, g, bound, least)
