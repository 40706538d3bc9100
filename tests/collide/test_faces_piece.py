"""Bounds of one flat triangle, known to a little only, against points of it and the distances that these have."""

import sys
from pathlib import Path

import numpy as np
import pytest
from shapely import Point, Polygon
from shapely import box as rectangle

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from assemblies import ball, box, cone, cut, fuse, moved, ring, rod, solid_of
from test_faces_inside import ROUND, TURNED, _outside, signed
from test_faces_math import GRID

from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.surfaces import OTHER
from clamp3d.collide.faces import FaceModel
from clamp3d.collide.faces_search import Descent


def _ring(x, major, minor):
    return np.hypot(np.hypot(x[:, 0], x[:, 1]) - major, x[:, 2]) - minor


def asked(model, triangle, sag=(0.0, 0.0, 0.0), deviation=0.0):
    """Lower and upper bound of a triangle's least signed distance, and how far out a point of it is said to be."""
    none, c = np.zeros(1, dtype=np.int64), np.asarray(triangle, dtype=float)
    tree = np.array([[*c.min(axis=0), *c.max(axis=0), 0.0]]), np.array([[0, 1]]), none, none
    surface = np.array([OTHER]), np.zeros((1, 2)), np.zeros((1, 12)), np.array([deviation])
    pieces = c[None].copy(), np.zeros((1, 3, 2)), none, np.array([sag], dtype=float)
    search = Descent(model, pieces, tree, np.eye(4), surface, (1.0, 0.0, 1e-3), 0)
    return search.go(0, np.inf), float(search.out[0]), float(search.out[8])


BLOCK = box((-4.6, -4.6, -4.6), (4.6, 4.6, 4.6))
HELD = {"ball": ball(3.0), "rod": rod(2.0, -3.0, 3.0), "ring": ring(2.5, 1.5), "cone": cone(3.0, 1.0, -2.0, 2.0)}
"""Of these there are closed forms, and so of a block that has one of them for a hollow."""


def hollowed(truth):
    return lambda x: np.maximum(_outside(np.abs(x) - 4.6), -truth(x))


TRUTHS = {name: truth for name, _, truth in ROUND} | {"ring": lambda x: _ring(x, 2.5, 1.5)}
SOLIDS = ROUND + [(f"without a {name}", cut(BLOCK, shape), hollowed(TRUTHS[name])) for name, shape in HELD.items()]


@pytest.mark.parametrize(("shape", "truth"), [x[1:] for x in SOLIDS], ids=[x[0] for x in SOLIDS])
@pytest.mark.parametrize("size", [0.0, 0.3, 4.0])
def test_no_point_of_a_triangle_is_nearer_than_its_bound(shape, truth, size):
    """Nor any that is as far off it as its border or its face may be; and one of its points is as near as is said."""
    model, rng = FaceModel(BrepSolid.of(solid_of(moved(shape, TURNED)), "solid")), np.random.default_rng(3)
    told = 0
    for k in range(120):
        corners = rng.uniform(-5.0, 5.0, 3) + size * rng.uniform(-1.0, 1.0, (3, 3))
        off = (0.0, 0.05)[k % 2]
        sag = np.zeros(3)
        sag[k % 3] = 0.0 if k % 4 == 3 else off
        low, high, out = asked(model, corners @ TURNED[:3, :3].T, sag, off if k % 4 == 3 else 0.0)
        s = truth(np.vstack([corners.mean(axis=0), corners, GRID[::23] @ corners]))
        assert low <= s.min() - off + 1e-6
        assert high >= s[0] + off - 1e-6
        assert out <= max(0.0, s.max()) + 1e-6
        told += high < 0.0
    assert told >= 2


def test_a_triangle_in_a_rod_that_is_all_but_covered_is_deeper_than_the_rod_says():
    """Only what stands 0.2 mm out of a block is seen of the rod: what is beyond its axis has a longer way out."""
    block = box((-20, -20, -20), (4.8, 20, 20))
    model = FaceModel(BrepSolid.of(solid_of(fuse(rod(5, -20, 20), block)), "solid"))
    section = Point(0.0, 0.0).buffer(5.0, quad_segs=4000).union(rectangle(-20, -20, 4.8, 20))
    for *xs, y in ((-1.0, -1.0, 4.4, 0.3), (-1.0, -1.2, 4.2, 0.3), (-0.6, -0.6, 4.6, 0.3), (-0.25, -0.2, 0.6, 0.1)):
        triangle = [(xs[0], y, 0.0), (xs[1], -y, 0.1), (xs[2], 0.0, -0.1)]
        low, high, _ = asked(model, triangle)
        s = [signed(Polygon(section.exterior), x) for x in (GRID[::7] @ np.array(triangle))[:, :2]]
        assert low <= min(s) + 1e-5
        assert high >= min(s) - 1e-5
