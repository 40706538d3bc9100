"""The tree over a solid's pieces against all pieces one by one, and its marks against points of the pieces."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from assemblies import ball, box, cone, cut, fuse, moved, ring, rod, shift, solid_of
from test_faces_math import GRID

from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.surfaces import CONE, SPHERE, TORUS, height, points_at
from clamp3d.collide import faces_tree
from clamp3d.collide.faces import FaceModel
from clamp3d.core import jit
from tests.hulls import apart

SOLIDS = [
    cut(box((-4, -4, -2), (4, 4, 2)), rod(2, -3, 3)),
    cut(rod(4, -2, 2), ball(2.5, (0, 0, 2))),
    fuse(cone(3, 1, 0, 4), box((-5, -5, -1), (5, 5, 0))),
    cut(box((-5, -5, -1), (5, 5, 0.5)), ring(3, 1)),
    cut(rod(4, 0, 3), moved(cone(3, 1, 0, 2), shift(0, 0, 1))),
]


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    """Formulas as they are written: what numba makes of them takes seconds each, and other tests run it."""
    monkeypatch.setattr(jit._Formula, "__call__", lambda self, *arguments: self._function(*arguments))


def some_tree(rng, m, faces):
    """Random triangles (m, 3, 3) of some faces, with errors, and the tree over them: box, link, order, root."""
    face = np.sort(np.concatenate([np.arange(faces), rng.integers(0, faces, m - faces)]))
    P = 3.0 * rng.normal(size=(faces, 1, 3))[face] + rng.normal(size=(m, 1, 3)) + 0.5 * rng.normal(size=(m, 3, 3))
    err = rng.uniform(0.0, 0.3, m) * (rng.random(m) < 0.7)
    start = np.searchsorted(face, np.arange(faces + 1))
    middle = 0.5 * (P.min(axis=1) + P.max(axis=1))
    centre = np.array([middle[face == f].mean(axis=0) for f in range(faces)])
    box, link = np.full((2 * m + 2 * faces, 7), np.nan), np.zeros((2 * m + 2 * faces, 2), dtype=np.int64)
    order, root = np.arange(m), np.full(faces, -1)
    used = faces_tree._build(P, err, start, middle, centre, np.arange(faces), box, link, order, root)
    return P, err, face, box[:used], link[:used], order, root


def below(link, order, i):
    """Triangles below a node."""
    if link[i, 1] < 0:
        return [*below(link, order, link[i, 0]), *below(link, order, -link[i, 1])]
    return order[link[i, 0] : link[i, 0] + link[i, 1]].tolist()


@pytest.mark.parametrize(("m", "faces"), [(1, 1), (4, 1), (5, 1), (9, 9), (40, 6), (60, 2)])
def test_each_node_holds_what_is_below_it(m, faces):
    P, err, face, box, link, order, root = some_tree(np.random.default_rng(m), m, faces)
    assert sorted(order) == list(range(m))
    assert sorted(below(link, order, 0)) == list(range(m))
    for i in range(len(link)):
        rows = below(link, order, i)
        assert box[i] == pytest.approx([*P[rows].min(axis=(0, 1)), *P[rows].max(axis=(0, 1)), err[rows].max()], abs=0)
        assert link[i, 1] <= faces_tree.LEAF
        if link[i, 1] < 0:  # about half on either side
            one, other = (len(below(link, order, k)) for k in (link[i, 0], -link[i, 1]))
            assert len({face[t] for t in rows}) > 1 or abs(one - other) <= 1
    for f in range(faces):
        assert sorted(below(link, order, root[f])) == np.flatnonzero(face == f).tolist()


def test_halves_are_apart_along_the_widest_side():
    """Of triangles in a row those of one half lie before those of the other."""
    rng = np.random.default_rng(0)
    for axis in range(3):
        P = np.zeros((20, 3, 3)) + 0.01 * rng.normal(size=(20, 3, 3))
        P[:, :, axis] += 10.0 * rng.permutation(20)[:, None]
        middle, box, link = 0.5 * (P.min(axis=1) + P.max(axis=1)), np.empty((42, 7)), np.empty((42, 2), dtype=np.int64)
        order, start = np.arange(20), np.array([0, 20])
        faces_tree._build(P, np.zeros(20), start, middle, middle[:1], np.arange(1), box, link, order, np.zeros(1, int))
        one, other = (middle[below(link, order, k), axis] for k in (link[0, 0], -link[0, 1]))
        assert one.max() < other.min()


def test_what_is_nearest():
    rng, stack = np.random.default_rng(1), np.empty(faces_tree.DEEP, dtype=np.int64)
    for m, faces in ((1, 1), (12, 3), (50, 9)):
        P, err, face, box, link, order, root = some_tree(rng, m, faces)
        marks, rest = rng.choice([0, 1, 2, 3, 4], (2, m)).astype(np.int8)
        nodes, others = (
            np.array([np.bitwise_or.reduce(row[below(link, order, i)]) for i in range(len(link))])
            for row in (marks, rest)
        )
        for _ in range(25):
            x = 4.0 * rng.normal(size=3)
            d = np.array([apart(x[None], V) for V in P])
            near = np.empty(4, dtype=np.int64)
            tree = P, err, face, box, link, order
            found, low, high = faces_tree.nearest(*tree, *x, np.inf, near, stack)
            assert (low, high) == pytest.approx(((d - err).min(), (d + err).min()), abs=1e-7)
            assert (d + err)[found] == pytest.approx(high, abs=1e-7)
            assert face[np.argmin(d - err)] == near[0]
            named = near[near >= 0].tolist()
            assert len(set(named)) == len(named)
            assert faces_tree.nearest(*tree, *x, low - 0.1, near, stack)[1] == low - 0.1
            assert near[0] == -1
            least = [(d + err)[face == f].min() for f in range(faces)]
            assert [faces_tree.nearest_below(P, err, box, link, order, i, *x, stack) for i in root] == pytest.approx(
                least
            )
            rows, whole = np.stack([marks, rest]), np.empty((9, 3, 3))
            above = np.stack([nodes, others])
            solid = P, err, face, box, link, order, root, *[None] * 9, rows, above, err
            for bit, side, f in ((1, -1.0, -1), (2, -1.0, -1), (1, 1.0, 0), (2, 1.0, 0)):
                mine = (marks & rest & bit) != 0
                least = (d + side * err)[mine & ((f < 0) | (face == f))].min(initial=7.0)
                there = 0 if f < 0 else root[f]
                asked = there, bit, side, np.zeros(2), *x, 7.0, whole, stack
                told, t = faces_tree.nearest_marked(solid, (0, 1), 0, *asked)
                assert told == pytest.approx(least, abs=1e-7)
                assert (t < 0) == (told == 7.0)
                assert t < 0 or (mine[t] and (d + side * err)[t] == pytest.approx(told, abs=1e-7))
                assert faces_tree.nearest_marked(solid, np.array([1, 0]) - 5, 5, *asked) == (told, t)


@pytest.mark.parametrize("k", range(len(SOLIDS)))
def test_triangles_keep_the_distance_from_faces_that_is_said(k):
    """No point of a face is nearer; and it is no less than that of the triangles less their errors."""
    model, rng = FaceModel(BrepSolid.of(solid_of(SOLIDS[k]), "solid")), np.random.default_rng(k)
    P, err, face, box, link, order, _, _, _, kind, size, frames, _, deviation = model.arrays[:14]
    f, stack, work = model.faces, np.empty(faces_tree.DEEP, dtype=np.int64), np.empty((3, 3))
    on = [
        points_at(int(kind[i]), f.frame[i], tuple(size[i]), GRID[::29] @ uv) for i, uv in zip(f.face, f.uv, strict=True)
    ]
    there = cKDTree(np.concatenate(on))
    for spread, limit in ((2.0, np.inf), (0.3, np.inf), (0.3, 0.5), (0.0, 1.0)):
        V = rng.uniform(*model.bounds, 3) + spread * rng.normal(size=(3, 3))
        tree = P, err, face, box, link, order, kind, size, frames, deviation
        low = faces_tree.from_faces(*tree, V, np.empty(len(kind)), limit, work, stack)
        flat = min(apart(V, W) - e for W, e in zip(P, err, strict=True))
        assert min(flat, limit) - 1e-7 <= low <= min(there.query(GRID[::11] @ V)[0].min(), limit) + 1e-9


@pytest.mark.parametrize("k", range(len(SOLIDS)))
def test_each_piece_is_near_the_triangle_that_has_its_parameters(k):
    """Not only near to one of them: what is found of a piece, its mark say, is taken to be where its triangle is."""
    model = FaceModel(BrepSolid.of(solid_of(SOLIDS[k]), "solid"))
    f, beyond = model.faces, 0
    for i, uv, V, spread, error in zip(f.face, f.uv, f.corners, model.spread, f.error, strict=True):
        uv = np.where(np.isnan(uv), np.nanmean(uv, axis=0), uv)  # a pole has any u
        on = points_at(int(f.kind[i]), f.frame[i], tuple(f.size[i]), GRID[::5] @ uv)
        off = trimesh.triangles.closest_point(np.tile(V, (len(on), 1, 1)), on) - on
        away = np.linalg.norm(off, axis=1).max()
        assert away <= spread + 1e-9
        beyond += away > error + 1e-9
    assert (beyond > 0) == np.isin(f.kind, (CONE, SPHERE)).any()


@pytest.mark.parametrize("k", range(len(SOLIDS)))
def test_marks_tell_which_pieces_reach_above_and_below_a_face(k):
    """By points of each piece; a torus and the hollow of a cone may mark a little too much, none marks too little."""
    model = FaceModel(BrepSolid.of(solid_of(SOLIDS[k]), "solid"))
    solid, f, rng = model.arrays, model.faces, np.random.default_rng(k)
    P, _, face, _, link, order, _, uv, sag, kind, size, _, sense, deviation, group, _, marks, nodes, spread = solid
    m, slack, whole = len(face), np.full(2 * len(kind), 0.01), np.empty((3 + 2 * faces_tree.PIECES, 3, 3))
    stack = np.empty(faces_tree.DEEP, dtype=np.int64)
    on = np.array(
        [points_at(int(kind[i]), f.frame[i], tuple(size[i]), GRID[::7] @ x) for i, x in zip(face, uv, strict=True)]
    )
    for i in range(len(kind)):
        mark = np.array([faces_tree._mark(solid, i, slack, faces_tree.OPEN, t, whole) for t in range(m)])
        h = sense[i] * height(int(kind[i]), f.frame[i], tuple(size[i]), on.reshape(-1, 3)).reshape(m, -1)
        rim, own = sag + deviation[face], group[face] == group[i]
        assert (mark[own] == 0).all()
        for bit, way in ((1, h), (2, -h)):
            reaches = way.max(axis=1)
            assert (mark[~own & (reaches + rim > slack[i] + 1e-9)] & bit).all()
            easy = kind[i] != TORUS and (kind[i] != CONE or way is h)
            least = slack[i] - (0.02 if easy else 0.5)
            assert not (mark[reaches + rim < least] & bit).any()
        marks[i] = faces_tree.NEW  # a search asks for those on its way, and remembers them
        for bit in (1, 2) * 2:
            x = rng.uniform(*model.bounds)
            of = (mark & bit) != 0
            off = trimesh.triangles.closest_point(P[of], np.tile(x, (of.sum(), 1))) - x
            least = (np.linalg.norm(off, axis=1) - spread[of]).min(initial=9.0)
            asked = 0, bit, -1.0, slack, *x, 9.0, whole, stack
            assert faces_tree.nearest_marked(solid, (i,), 0, *asked)[0] == pytest.approx(least, abs=1e-7)
        for n in np.flatnonzero((nodes[i] != faces_tree.NEW) & (nodes[i] != faces_tree.OPEN)):
            assert nodes[i, n] == np.bitwise_or.reduce(mark[below(link, order, n)])
