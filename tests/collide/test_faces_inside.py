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

from clamp3d import Scene, check
from clamp3d.brep.solid import BrepSolid
from clamp3d.collide.faces import FaceModel, _at
from clamp3d.core.pose import rotation
from clamp3d.errors import Clamp3dError

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


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("wall", [False, True])
def test_a_slit_or_wall_that_is_thin_in_part_hides_what_is_behind_it(seed, wall):
    """Its roof is within what its floor may be off, and goes on to far below it: in one face, bent or flat.

    A point above the roof is above the floor too, with nothing in between that reaches further above the floor.
    """
    rng = np.random.default_rng(seed)
    width, high = rng.uniform(0.8, 2.0), rng.uniform(1e-4, 4.5e-4)
    drop = rng.uniform(0.1, 0.9) * high / width
    end = rng.uniform(5.0, 7.0)
    roof = [(end, high - drop * end), (0.0, high)]
    outline = np.array([(0.0, 0.0), (width, 0.0), (width + 0.2, -1.0), (end, -1.0), *roof]) - [3.0, 0.0]
    big = 2.5 * np.array(SQUARE)
    points = np.column_stack([rng.uniform(-3.0, width - 3.0, 12), rng.choice([-1, 1], 12) * rng.uniform(0.3, 2.0, 12)])
    check_points(outline if wall else big, [] if wall else [outline], points)


@pytest.mark.parametrize("seed", [0, 2])
def test_random_slits_against_open_cascade(seed):
    """Slits and walls of balls, rods and cones from 1e-6 mm on: no point is told to be on the wrong side."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.TopAbs import TopAbs_State

    rng, told = np.random.default_rng(seed), 0
    for k in range(6):
        w, r, h = 10.0 ** rng.uniform(-6.0, -2.0), 10.0 ** rng.uniform(0.0, 1.7), 10.0 ** rng.uniform(0.0, 1.3)
        tilt = rotation(rng.normal(size=3), 10.0 ** rng.uniform(-7.0, -3.0))
        shell = [
            cut(rod(r + w, -h, h), moved(rod(r, -2.0 * h, 2.0 * h), tilt)),
            cut(ball(r + w), ball(r)),
            cut(cone(r + w, 0.5 * r + w, -h, h), moved(cone(r, 0.5 * r, -h, h), tilt)),
        ][k % 3]
        block = box((-2 * r, -2 * r, -2 * h - 2 * r), (2 * r, 2 * r, 2 * h + 2 * r))
        shape = solid_of(cut(block, shell) if k > 2 else shell)
        try:
            model = FaceModel(BrepSolid.of(shape, "thin"))
        except Clamp3dError:  # a face so thin that the mesher leaves it out
            continue
        if not BRepCheck_Analyzer(shape).IsValid() or not model.solid.mesh.watertight:
            continue
        corners = model.faces.corners
        near = corners[rng.integers(0, len(corners), 15)].mean(axis=1)
        for x in near + rng.normal(size=(15, 3)) * 10.0 ** rng.uniform(-3.0, math.log10(r), (15, 1)):
            low, high = _at(model, x)
            inside = BRepClass3d_SolidClassifier(shape, gp_Pnt(*x.tolist()), 1e-9).State() == TopAbs_State.TopAbs_IN
            assert not (low > 0.0 and inside)
            assert not (high < 0.0 and not inside)
            told += low > 0.0 or high < 0.0
    assert told > 15


def test_a_pin_that_fills_a_thin_tube_is_not_contained_in_it():
    """What of the pin is out of the tube has all its corners on the tube's bore; a pin in a thick wall is contained."""
    tube = BrepSolid.of(solid_of(cut(rod(50.1, -20.0, 20.0), rod(50.0, -30.0, 30.0))), "tube")
    for pin, verdict in ((rod(50.05, -10.0, 10.0), "clash"), (cut(rod(50.08, -9, 9), rod(50.02, -9, 9)), "contained")):
        scene = Scene().add("tube", tube).add("pin", BrepSolid.of(solid_of(pin), "pin"))
        assert check(scene).verdict("tube", "pin").value == verdict
