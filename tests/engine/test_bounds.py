"""Bounds against the oracle: of any pair on every level, and on a whole way: swept pieces, first contacts."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, Phase, assume, example, given, settings
from hypothesis import strategies as st

from clamp3d import Motion, baselines, distance, first_contact, min_clearance, shapes
from clamp3d.engine import moving_pair
from clamp3d.engine.model import ModelCache
from clamp3d.engine.moving_groove import MovingInGroove
from clamp3d.engine.swept import swept_lower
from clamp3d.geometry.pose import inverse, rotation, translation
from clamp3d.kernel import Capsule, Cylinder, SweptArc
from clamp3d.testing import assert_distance, assert_lower_on_way, assert_motion, body, pose_at
from tests.kinds import BLOCK, DRAWN, faceted_shape, mesh_shape, poses

SLOW = settings(
    deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate], suppress_health_check=[*HealthCheck]
)
FACETED = [faceted_shape(shape, 0.3) for shape in DRAWN]
CACHE = ModelCache()
vector = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
points = vector.map(lambda v: 10.0 * np.array(v))
screws = st.builds(Motion.screw, vector, st.floats(-2.5, 2.5), point=points, travel=st.floats(-25.0, 25.0))
ways = screws | vector.map(lambda v: Motion.translate(40.0 * np.array(v)))


@settings(SLOW, max_examples=7)
@given(st.sampled_from(DRAWN), st.sampled_from(DRAWN), ways, poses(30.0), st.sampled_from([1.0, 0.3]))
def test_no_time_of_a_stretch_is_below_its_bound(a, b, way, start, until):
    stretch = [pose_at(way, t, start) for t in (0.0, 0.5 * until, until)]
    low = swept_lower(CACHE.model(a), CACHE.model(b), *stretch, angle=0.5 * until * way.angle)
    assume(low > -30.0)
    # What is lowest may be at an end, at the middle, or between them, where points stray from straight lines most.
    assert_lower_on_way(low, a, b, [pose_at(way, t * until, start) for t in np.linspace(0.0, 1.0, 5)], cells=2000)


@pytest.mark.parametrize("seed", [177, 414, 431, 527, 485])
def test_turns_that_are_carried_across_their_axis(seed):
    """Travel can cancel the turn: the places are close to each other, and the bow between them is deep all the same."""
    rng, block = np.random.default_rng(seed), shapes.box((6.0, 4.0, 2.0))
    half, aside, axis = rng.uniform(0.1, 0.7), rng.normal(size=3), rng.normal(size=3)
    T = rotation(rng.normal(size=3), 1.0)
    T[:3, 3] = aside / np.linalg.norm(aside) * rng.uniform(7.0, 10.0)
    point, travel = T[:3, 3] + 8.0 * rng.normal(size=3), 12.0 * rng.normal(size=3)
    way = Motion(axis / np.linalg.norm(axis), point, 2.0 * half, travel)
    least = min(distance(block, block, way.at(t, T), cache=CACHE).upper for t in np.linspace(0.0, 1.0, 17))
    pair = moving_pair.MovingPair(CACHE.model(block), CACHE.model(block), way, T, np.eye(4))
    assert pair.between(0.0, 1.0) <= least


@settings(SLOW, max_examples=5)
@given(st.sampled_from(DRAWN + FACETED), st.sampled_from(DRAWN), ways, poses(25.0))
def test_least_distances_and_first_contacts(monkeypatch, a, b, way, start):
    monkeypatch.setattr(moving_pair, "BUDGET", 500)
    assert_motion(min_clearance(a, b, way, start), a, b, way, start, tolerance=1e-5, cells=1500, times=5)
    assert_motion(first_contact(a, b, way, start), a, b, way, start, first=True, tolerance=1e-5, cells=1500, times=5)


@pytest.mark.parametrize("outer", [shapes.box((60.0, 60.0, 60.0)), faceted_shape(shapes.box((60.0, 60.0, 60.0)), 0.3)])
def test_what_is_inside_all_the_time_overlaps_all_the_time(outer):
    """No surface meets another on the way, and yet there is no clearance at any time, and contact from the start."""
    ways = Motion.translate((3.0, 2.0, -1.0)), Motion.screw((1.0, 2.0, 3.0), 0.4)
    for way, inner in zip(ways, (DRAWN[0], FACETED[4]), strict=True):
        for a, b in ((outer, inner), (inner, outer)):
            start = translation(1.0, 1.0, 1.0)
            hit, least = first_contact(a, b, way, start), min_clearance(a, b, way, start)
            assert hit.touches
            assert hit.t <= 1e-3
            assert least.touches
            assert least.distance.lower < 0.0
            stretch = [pose_at(way, t, start) for t in (0.0, 0.5, 1.0)]
            assert swept_lower(CACHE.model(a), CACHE.model(b), *stretch, angle=0.5 * way.angle) <= 0.0


@settings(SLOW, max_examples=6)
@given(st.floats(0.01, 0.99), st.floats(100.0, 2000.0), st.floats(0.05, 1.0), st.sampled_from([0, 1, 2]), st.booleans())
@example(0.51, 1000.0, 0.5, 0, False)
@example(0.49, 1000.0, 0.5, 1, True)
def test_a_thin_plate_is_met_wherever_on_the_way_it_stands(when, length, thick, kind, back):
    """A way of metres through a sheet: nothing between two times that are looked at may be stepped over."""
    sheet = shapes.box((50.0, 50.0, thick))
    pin = (Cylinder(2.0, 5.0), shapes.box((3.0, 4.0, 5.0)), FACETED[3])[kind]
    half = (2.5, 2.5, 20.0)[kind]
    start, way = translation(0.0, 0.0, when * length), Motion.translate((0.0, 0.0, -length))
    if back:
        start[:3, 3], way = [0.0, 0.0, -when * length], Motion.translate((0.0, 0.0, length))
    hit = first_contact(sheet, pin, way, start)
    assert hit.touches
    truth = max(0.0, when - (half + 0.5 * thick) / length)
    assert truth - 2e-4 / length * 1000.0 <= hit.t <= truth + 1e-9
    least = min_clearance(sheet, pin, way, start)
    assert least.touches
    beside = translation(25.0 + 15.0, 0.0, 0.0)  # past the sheet's edge it is known how near
    least = min_clearance(sheet, pin, way, beside @ start)
    assert not least.touches
    gap = 15.0 - (2.0, 1.5, 5.0)[kind]
    assert least.distance.lower <= gap + 1e-9
    assert least.distance.upper >= gap - 1e-9
    assert least.distance.upper <= 1.03 * gap + 1e-3


def assert_tight(bounds, truths, near=0.05):
    """Lower ``bounds`` (k,) that never are above the ``truths`` (k,), and half of them as ``near`` as said."""
    off = np.array(truths) - bounds
    assert off.min() >= -1e-9
    assert np.median(off) <= near
    assert off.max() <= 20.0 * near


def test_bounds_of_a_stretch_are_near_what_is_least_on_it():
    """Ways of a block, a pin, a needle and a disc over a plate, by hand, and of a pin in a bore, whoever moves.

    What is least is a corner of the block, or a rim of a cylinder, at any time; on short ways a bound is near it.
    """
    rng, plate = np.random.default_rng(9), CACHE.model(shapes.box((400.0, 400.0, 4.0)))
    corners = np.array([(x, y, z) for x in (-3.0, 3.0) for y in (-2.0, 2.0) for z in (-5.0, 5.0)])
    for radius, half, angle in ((0.0, 5.0, 0.04), (2.0, 5.0, 0.04), (0.5, 10.0, 2.9), (6.0, 2.0, 1.5), (0.0, 5.0, 2.9)):
        part = CACHE.model(shapes.cylinder(radius, 2.0 * half) if radius else shapes.box((6.0, 4.0, 10.0)))
        bounds, truths = [], []
        for k in range(16):
            middle = np.array((5.0 * k, 0.0, 9.0 if angle < 1.0 else 40.0))
            point = middle + (12.0 if angle < 1.0 else 3.0) * rng.normal(size=3)
            way = Motion.screw(rng.normal(size=3), angle, point=point, travel=float(rng.normal()))
            T = translation(*middle) @ rotation(rng.normal(size=3), rng.choice([0.0, 1.0, 0.5 * math.pi]))
            places = [pose_at(way, t, T) for t in np.linspace(0.0, 1.0, 41)]
            rim = [half * abs(P[2, 2]) + radius * math.hypot(P[2, 0], P[2, 1]) for P in places]
            reach = rim if radius else [(P[2, :3] @ corners.T).max() for P in places]
            bounds.append(swept_lower(plate, part, places[0], places[20], places[40], angle=0.5 * angle))
            truths.append(min(P[2, 3] - r for P, r in zip(places, reach, strict=True)) - 2.0)
        assert_tight(bounds, truths, math.inf if angle > 1.0 else 0.12 if radius else 0.05)
    pin, tube = CACHE.model(shapes.cylinder(2.0, 10.0)), CACHE.model(shapes.cylinder(6.0, 8.0, bore=2.5))
    bounds, truths = [], []
    for k in range(12):
        way = Motion.screw(rng.normal(size=3), 0.01 * (k % 3), point=rng.normal(size=3), travel=0.02)
        way = replace(way, travel=way.travel + 6.0 * np.eye(3)[2])
        T = translation(0.1, 0.2, rng.uniform(-5.0, 5.0)) @ rotation((1.0, 0.0, 0.0), 0.02 * (k % 2))
        stretch = [pose_at(way, t, T) for t in (0.0, 0.5, 1.0)]
        bounds.append(swept_lower(tube, pin, *stretch, angle=0.5 * way.angle))
        bounds.append(swept_lower(pin, tube, *map(inverse, stretch), angle=-0.5 * way.angle))
        places = [pose_at(way, t, T) for t in np.linspace(0.0, 1.0, 9)]
        truths += 2 * [min(distance(tube.shape, pin.shape, place, cache=CACHE).value for place in places)]
    assert_tight(bounds, truths, 0.06)


def test_bounds_of_a_stretch_in_a_groove_are_near_what_is_least_on_it():
    rng, bounds, truths = np.random.default_rng(6), [], []
    for k in range(60):
        groove = SweptArc(7.0, rng.uniform(0.5, 2.0), 30.0)
        pin = (Cylinder, Capsule)[k % 2](rng.uniform(1.0, 6.5), 20.0)
        T = rotation(rng.normal(size=3), rng.choice([0.0, 0.01, 1.0]))
        T[:3, 3] = rng.normal(size=3) * (3.0, 3.0, 9.0)
        way = Motion.screw(rng.normal(size=3), rng.choice([0.0, 0.02]), point=10.0 * rng.normal(size=3), travel=0.3)
        along = np.array([(0.0, 0.0, 5.0), 5.0 * T[:3, 2], rng.normal(size=3) * 0.1])[k % 3]
        pair = MovingInGroove(groove, pin, replace(way, travel=way.travel + along), T, None)
        start = rng.uniform(0.0, 0.8)
        stop = start + rng.choice([0.1, 0.2])
        bounds.append(pair.between(start, stop))
        truths.append(min(pair.contact(t).distance for t in np.linspace(start, stop, 21)))
    assert_tight(bounds, truths)


SOME = st.sampled_from([*DRAWN, *(faceted_shape(shape, 0.5) for shape in DRAWN)])
BARE = st.tuples(
    st.builds(SweptArc, st.floats(3.0, 15.0), st.floats(0.2, 3.0), st.floats(2.0, 60.0)),
    st.builds(Cylinder, st.floats(0.5, 12.0), st.floats(1.0, 90.0)),
)
ROUND = [shape for shape in DRAWN if any(e.profile.arcs for e in (*shape.bodies, *shape.holes))]


@settings(SLOW, max_examples=15)
@given(st.tuples(SOME, SOME) | BARE, poses(9.0) | poses(25.0))
def test_any_pair_of_solids_drawn_or_faceted(pair, T):
    a, b = pair
    assert_distance(distance(a, b, T), a, b, T, cells=8000)
    assert_distance(distance(b, a, inverse(T)), b, a, inverse(T), cells=8000)


@settings(SLOW, max_examples=8)
@given(st.sampled_from(ROUND), st.sampled_from([DRAWN[3], DRAWN[5]]), poses(20.0))
def test_a_fitted_mesh_has_the_bounds_of_the_part_it_comes_from(solid, b, T):
    """Its corners lie on the part's surface, so what is said of it must hold for the part."""
    found = distance(faceted_shape(solid, 0.05, "round"), b, T, accuracy=1e-3)
    assert_distance(replace(found, point_a=None, normal=None), solid, b, T)


@pytest.mark.parametrize("error", [1.0, 0.1])
@pytest.mark.parametrize("shape", DRAWN, ids=lambda shape: shape.name)
def test_a_drawn_solid_lies_between_its_two_meshes(shape, error):
    model = ModelCache().model(shape)
    inner, outer = model.inner(error), model.outer(error)

    def on(surface):
        sampled = trimesh.Trimesh(surface.vertices, surface.faces, process=False).sample(20_000, seed=0)
        return body(shape).field(np.vstack([surface.vertices, sampled]))

    assert on(inner).max() <= 1e-9
    assert on(outer).min() >= -1e-9
    x = np.random.default_rng(0).uniform(*body(shape).box, (6000, 3))
    assert outer.contains(x[body(shape).field(x) < 0.0]).all()


def test_of_a_model_without_known_bounds_none_are_claimed():
    wire, T = shapes.cylinder(5.0, 70.0), translation(0.0, 1.0, 0.0)
    model = baselines.contact_model("mesh", {"block": BLOCK, "cylinder": wire})
    found = distance(BLOCK, wire, T, model=model)
    assert (found.level, found.lower, found.upper) == ("model", -math.inf, math.inf)
    assert found.estimate == pytest.approx(distance(BLOCK, wire, T).value, abs=0.1)


@pytest.mark.parametrize("shape", DRAWN, ids=lambda shape: shape.name)
def test_bounding_boxes_hold_the_shape(shape):
    model = ModelCache().model(shape)
    low, high = body(shape).box
    x = np.random.default_rng(1).uniform(low - 5.0, high + 5.0, (20_000, 3))
    inside = body(shape).field(x) < 0.0
    assert (x[inside] >= model.bounds[0] - 1e-9).all()
    assert (x[inside] <= model.bounds[1] + 1e-9).all()
    deep = np.max([form.depth(x) + form.error for form in model.enclosing], axis=0)
    assert (deep[inside] >= -1e-9).all()
    if model.bodies is not None:
        assert inside[deep > 1e-9].all()


@pytest.mark.parametrize("height", [8.0, 800.0])
def test_the_box_of_a_mesh_holds_the_round_surface_through_its_corners(height):
    """A bar of six flats, none of whose corners is where the cylinder around it reaches furthest along x."""
    bar = trimesh.creation.cylinder(radius=5.0, height=height, sections=6)
    bar.apply_transform(rotation((0.0, 0.0, 1.0), math.pi / 6.0))
    low, high = ModelCache().model(mesh_shape(bar, "round")).bounds
    assert -5.0 - 1e-9 < low[0] <= -5.0
    assert 5.0 <= high[0] < 5.0 + 1e-9
