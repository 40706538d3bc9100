"""How deep points lie in solids with known faces: prisms, whose section tells it to the digit."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from shapely import MultiLineString, Point, Polygon

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from assemblies import ball, box, cone, cut, fuse, moved, ring, rod, solid_of
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Pnt, gp_Vec

from clamp3d.brep.solid import BrepSolid
from clamp3d.collide.faces import FaceModel, _at
from clamp3d.core.pose import rotation

LONG = 20.0
"""Half length of the prisms: their ends are further away than their sides."""
TURNED = rotation((1.0, 2.0, 3.0), 0.7)


def prism(points, half=LONG):
    outline = BRepBuilderAPI_MakePolygon()
    for x, y in points:
        outline.Add(gp_Pnt(float(x), float(y), -half))
    outline.Close()
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(outline.Wire()).Face(), gp_Vec(0.0, 0.0, 2.0 * half)).Shape()


def signed(section, x):
    """Signed distance of a point of the section's plane."""
    sides = MultiLineString([ring.coords for ring in (section.exterior, *section.interiors)])
    return sides.distance(Point(x)) * (-1.0 if section.contains(Point(x)) else 1.0)


def check_points(outline, holes, points):
    """Bounds of points of a prism with holes, in a frame that nothing is square to; the widest of them."""
    shape = cut(prism(outline), *(prism(hole, 2.0 * LONG) for hole in holes)) if holes else prism(outline)
    model = FaceModel(BrepSolid.of(solid_of(moved(shape, TURNED)), "prism"))
    section, widest = Polygon(outline, holes), 0.0
    for x in points:
        low, high = _at(model, TURNED[:3, :3] @ [*x, 0.3])
        truth = signed(section, x)
        assert low <= truth + 1e-6
        assert high >= truth - 1e-6
        widest = max(widest, truth - low)
    return widest


SQUARE = [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)]


@pytest.mark.parametrize("seed", range(6))
def test_points_in_and_about_prisms_with_hollow_corners(seed):
    """Stars of random arms: corners of all angles, inward and outward. Lower bounds are sharp, inside and out."""
    rng = np.random.default_rng(seed)
    turn = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9)) + np.linspace(0.0, 1e-3, 9)
    radius = np.where(np.arange(9) % 2, 1.5, 4.0) * rng.uniform(0.8, 1.2, 9)
    outline = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    if not Polygon(outline).is_valid or np.diff(turn).max() > 3.0:
        outline = np.array(SQUARE) * rng.uniform(0.5, 1.0, (4, 2))
    assert check_points(outline, [], rng.uniform(-5.0, 5.0, (40, 2))) <= 1e-3


@pytest.mark.parametrize("width", [1.5e-3, 1e-3])
def test_a_hollow_whose_mouth_is_thin_is_not_taken_for_the_outside(width):
    """Two faces at a right angle under a roof that comes down to them at a flat slope.

    From the point (1, 1), in the material above both, the nearest that is seen of either face is where the roof comes
    down to it: just there nothing of the roof looks over both, for it is within what faces may be off.
    """
    roof = [(0.0, 0.0), (0.5, 0.0), (0.5 - width, 2e-4), (0.1, 0.1), (2e-4, 0.5 - width), (0.0, 0.5)]
    beside = [(-0.05, 1.0), (-0.5, 0.8), (-0.5, 1.2)]  # so that neither face alone tells what lies above it
    below = [(y, x) for x, y in beside]
    check_points(SQUARE, [roof, beside, below], [(1.0, 1.0), (1.2, 1.2), (0.9, 0.95)])


def _outside(corners):
    """Length of what is positive of distances (k,) from sides that meet at right angles, or the largest of them."""
    apart = np.linalg.norm(np.maximum(corners, 0.0), axis=-1)
    return np.where(apart > 0.0, apart, np.max(corners, axis=-1))


def _rod(x, radius, low, high):
    across = np.hypot(x[:, 0], x[:, 1]) - radius
    return _outside(np.column_stack([across, np.maximum(low - x[:, 2], x[:, 2] - high)]))


def _section(x, outline):
    """Signed distance from a solid of revolution, by its section (r, z)."""
    section = Polygon([*outline, *((-r, z) for r, z in reversed(outline))])
    return np.array([signed(section, (math.hypot(a, b), c)) for a, b, c in x])


ROUND = [
    ("ball", ball(3.0), lambda x: np.linalg.norm(x, axis=1) - 3.0),
    ("rod", rod(2.0, -3.0, 3.0), lambda x: _rod(x, 2.0, -3.0, 3.0)),
    ("ring", ring(4.0, 1.5), lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 4.0, x[:, 2]) - 1.5),
    ("cone", cone(3.0, 1.0, -2.0, 2.0), lambda x: _section(x, [(0, -2), (3, -2), (1, 2), (0, 2)])),
    ("hollow", cut(ball(4.5), ball(2.0)), lambda x: np.abs(np.linalg.norm(x, axis=1) - 3.25) - 1.25),
    (
        "tube",
        cut(rod(4.0, -3.0, 3.0), rod(2.0, -4.0, 4.0)),
        lambda x: _outside(np.column_stack([np.abs(np.hypot(x[:, 0], x[:, 1]) - 3.0) - 1.0, np.abs(x[:, 2]) - 3.0])),
    ),
    (
        "stepped",
        fuse(rod(4.0, -3.0, 0.0), rod(2.0, 0.0, 3.0)),
        lambda x: _section(x, [(0, -3), (4, -3), (4, 0), (2, 0), (2, 3), (0, 3)]),
    ),
    ("box", box((-3, -2, -1), (3, 2, 1)), lambda x: _outside(np.abs(x) - np.array([3.0, 2.0, 1.0]))),
]


@pytest.mark.parametrize(("shape", "truth"), [x[1:] for x in ROUND], ids=[x[0] for x in ROUND])
def test_points_in_and_about_round_solids(shape, truth):
    """Lower bounds hold, and are sharp but for the facets at edges; a depth that is told is one that the point has."""
    model = FaceModel(BrepSolid.of(solid_of(moved(shape, TURNED)), "solid"))
    x = np.random.default_rng(0).uniform(-5.0, 5.0, (250, 3))
    told = 0
    for point, value in zip(x @ TURNED[:3, :3].T, truth(x), strict=True):
        low, high = _at(model, point)
        assert low <= value + 1e-6
        assert high >= value - 1e-6
        assert low >= min(value, 0.5 * value) - 0.02 if value > 0.0 else low >= 2.0 * value - 0.02
        told += high < 0.0
        if value > 0.05:
            assert low > 0.0
            assert high <= value + 0.05
    assert told >= 5


THINS = {  # a solid, and points with a lower and an upper bound of how far they are out of it
    "slit between cylinders": (
        cut(rod(9.0, -5.0, 5.0), cut(rod(5.001, -3.0, 3.0), rod(5.0, -4.0, 4.0))),
        [((6.5, 0.0, 0.1), -1.499), ((3.0, 0.5, 0.0), -1.95862)],
    ),
    "slit between planes": (
        cut(box((-5, -5, -5), (5, 5, 5)), box((-4, -4, 0), (4, 4, 4e-4))),
        [((0.0, 0.1, 1.0), -0.9996), ((0.2, 0.1, -1.0), -1.0)],
    ),
    "sheet": (box((-4, -4, 0), (4, 4, 4e-4)), [((0.0, 0.1, 1.0), 0.9996), ((0.2, 0.1, -1.0), 1.0)]),
    "sliver of a cone": (
        cut(cone(1.5907863596721536, 1.7984556983573556, -4.0, 4.0), box((-9, -9, -9), (1.778939940408196, 9, 9))),
        [((-1.28369101, 0.56953457, -3.36829077), 7.31298938), ((-1.4, 0.0, -3.0), 7.01055)],
    ),
}


@pytest.mark.parametrize("name", THINS)
def test_what_is_behind_a_thin_wall_or_slit_is_as_far_away_as_it_is(name):
    """Both sides of it are within what a face may be off, so that neither is seen to end what the other begins."""
    shape, points = THINS[name]
    model = FaceModel(BrepSolid.of(solid_of(shape), name))
    for point, truth in points:
        low, high = _at(model, np.array(point))
        assert low <= truth + 1e-4
        assert high >= truth - 1e-4
