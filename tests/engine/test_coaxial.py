"""Solids from CAD that are turned about one axis, by their sections: gaps and overlaps by formula."""

import numpy as np
import pytest

from clamp3d.engine import depth
from clamp3d.engine.answer import Distance
from clamp3d.engine.coaxial import coaxial_distance
from clamp3d.engine.judge import judge
from clamp3d.engine.refine import from_boxes
from clamp3d.engine.verdict import Thresholds, Verdict
from clamp3d.files.open_cascade import occ
from clamp3d.files.solid import BrepSolid
from tests.cad import block, cut, first_solid, moved, random_pose, ring, rod, shift
from tests.kinds import cad_model as model
from tests.public.placed_pairs import FAMILIES

THRESHOLDS = Thresholds()
COAXIAL = ["tube_in_tube", "taper_in_hub", "ring_in_groove", "ring_on_shaft", "ball_in_ring", "ring_on_plate"]
GAPS = (-0.0101, -0.0099, 1e-4, 0.0099, 0.0101, 0.3)
AT_ORIGIN = np.eye(4)


def is_decided(distance):
    return THRESHOLDS.verdict(distance) is not Verdict.UNCERTAIN


def joined(*solids):
    shape = solids[0]
    for solid in solids[1:]:
        shape = occ.BRepAlgoAPI_Fuse(shape, solid).Shape()
    return shape


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("family", COAXIAL)
def test_sections_decide_what_is_a_ten_thousandth_from_a_threshold(family, gap):
    rng = np.random.default_rng([len(family), int(1e4 * abs(gap))])
    one, other = FAMILIES[family](rng, gap)
    T = random_pose(rng)
    pair = [model(one), model(moved(other, np.linalg.inv(T)))]
    if rng.integers(2):
        pair, T = pair[::-1], np.linalg.inv(T)
    truth = Verdict.CLASH if gap < -0.01 else Verdict.CONTACT if gap <= 0.01 else Verdict.CLEAR
    distance = coaxial_distance(*pair, T, is_decided)
    assert distance.lower <= gap <= distance.upper
    assert THRESHOLDS.verdict(distance) is truth
    if gap > 0.0:
        distance = coaxial_distance(*pair, T, lambda distance: distance.upper - distance.lower <= 5e-5)
        assert distance.lower <= gap <= distance.upper
        assert distance.upper - distance.lower <= 5e-5
        assert np.linalg.norm(distance.point_b - distance.point_a) == pytest.approx(gap, abs=3e-5)
        on_b = np.linalg.inv(T) @ [*distance.point_b, 1.0]
        for part, point in zip(pair, (distance.point_a, on_b[:3]), strict=True):
            assert abs(part.depth(point[None])[0]) <= 2e-5


HUB = cut(rod(20.0, -8, 8), rod(10.0, -9, 9))
NOT_TURNED = {
    "key": (joined(HUB, block((8, -2, -8), (12, 2, 8))), rod(9.9, -8, 8)),
    "flat": (HUB, cut(rod(9.9, -8, 8), block((9, -10, -9), (10, 10, 9)))),
    "half": (HUB, cut(rod(9.9, -8, 8), block((-10, 0, -9), (10, 10, 9)))),
    "cross hole": (HUB, cut(rod(9.9, -8, 8), moved(rod(2, -20, 20), np.eye(4)[[2, 0, 1, 3]]))),
    "hole beside": (HUB, cut(rod(9.9, -8, 8), rod(1.0, -9, 9, 5.0))),
    "ball beside": (HUB, joined(rod(9.0, -8, 8), moved(ring(4.0, 1.0), shift(5.0, 0.0, 8.0)))),
    "off the axis": (HUB, rod(9.9, -8, 8, 1e-6)),
    "leaning": (HUB, moved(rod(9.9, -8, 8), np.array([[1, 0, 1e-7, 0], [0, 1, 0, 0], [-1e-7, 0, 1, 0], [0, 0, 0, 1]]))),
}


@pytest.mark.parametrize("name", NOT_TURNED)
def test_nothing_is_said_of_what_is_not_turned_about_one_axis(name):
    pair = [model(solid) for solid in NOT_TURNED[name]]
    assert coaxial_distance(*pair, AT_ORIGIN, is_decided) is None


def test_what_is_farther_from_the_axis_than_both_are_turned_may_be_nearer():
    """A pin 3 mm over a plate, and a block on the plate that is 0.5 mm from the pin."""
    plate = block((-30, -30, -10), (30, 30, -3))
    alone, beside = model(plate), model(joined(plate, block((5.5, -2, -3), (12, 2, 5))))
    pin = model(rod(5.0, 0, 8))
    distance = coaxial_distance(alone, pin, AT_ORIGIN, lambda _: False)
    assert 2.99 < distance.lower <= 3.0 <= distance.upper < 3.01
    assert 0.49 < coaxial_distance(beside, pin, AT_ORIGIN, lambda _: False).lower <= 0.5
    start, clearance = from_boxes(beside, pin, AT_ORIGIN), Thresholds(clearance=1.0)
    verdict, distance = judge(beside, pin, AT_ORIGIN, start, clearance, None)
    assert verdict is Verdict.CLEARANCE
    assert distance.lower <= 0.5 <= distance.upper


def test_an_overlap_that_is_deeper_than_its_section_shows_is_left_to_others():
    tube, pin = model(cut(rod(40.0, -30, 30), rod(8.0, -31, 31))), model(rod(20.0, -10, 10))
    distance = coaxial_distance(tube, pin, AT_ORIGIN, lambda _: False)
    assert distance.lower == -np.inf
    assert -12.0 <= distance.upper < -0.01


@pytest.mark.parametrize(("beside", "is_bounded"), [(1e-3, False), (0.0104, False), (0.0106, True), (0.5, True)])
def test_how_deep_an_edge_is_in_a_block_is_not_told_by_the_nearest_side_of_it(beside, is_bounded):
    """The end of a thin tube is 0.0105 mm below the top, and ``beside`` the middles of the block's sides."""
    edge = cut(rod(6.0 - beside, -0.0105, 5.0), rod(5.995 - beside, -1.0, 6.0))
    plate = model(block((-6, -6, -9), (6, 6, 0)))
    distance = coaxial_distance(plate, model(edge), AT_ORIGIN, lambda d: d.lower >= -0.011)
    assert distance.lower <= -0.0105 <= distance.upper
    assert np.isfinite(distance.lower) == is_bounded
    assert judge(plate, model(edge), AT_ORIGIN, Distance(), THRESHOLDS, None)[0] is Verdict.CLASH


def test_halves_of_one_surface_are_turned_as_the_whole():
    """A tube whose faces are each split at a plane through its axis, as some systems write it."""
    tube = cut(rod(12.0, -8, 8), rod(10.0, -9, 9))
    left, right = (
        cut(tube, block(*corners)) for corners in (((0, -13, -9), (13, 13, 9)), ((-13, -13, -9), (0, 13, 9)))
    )
    halves = joined(left, right)  # its faces stay halves
    assert sum(1 for _ in BrepSolid.of(first_solid(halves), "x").surfaces.kind) > 4
    distance = coaxial_distance(model(halves), model(rod(9.5, -20, 20)), AT_ORIGIN, lambda d: d.upper - d.lower <= 5e-5)
    assert distance.lower <= 0.5 <= distance.upper <= distance.lower + 5e-5


def test_rings_of_splines_are_turned_too():
    """Open CASCADE's usual integral says an area of their sections that is 7e-5 too large."""
    groove = cut(rod(9.0, -4.0, 4.0), ring(9.0, 1.486))
    seal = occ.BRepBuilderAPI_NurbsConvert(ring(9.0, 1.49), True).Shape()
    for one, other in ((groove, seal), (seal, groove)):
        distance = coaxial_distance(
            model(one), model(other), AT_ORIGIN, lambda d: d.lower >= -0.01 and d.upper <= -0.0039
        )
        assert -0.01 <= distance.lower <= -0.004 <= distance.upper <= -0.0039


@pytest.mark.parametrize("family", ["taper_in_hub", "ring_in_groove"])
def test_how_deep_a_press_fit_is_follows_from_its_sections(family, monkeypatch):
    """No common part is made: between faces that all but coincide it takes seconds."""
    pair = [model(solid) for solid in FAMILIES[family](np.random.default_rng(3), -0.04)]
    monkeypatch.setattr(depth, "exact_overlap", None)
    least, most = depth.penetration(*pair, AT_ORIGIN, Distance(-np.inf, -0.02)).interference
    assert 0.0399 <= least <= 0.04 <= most <= 1.06 * least
