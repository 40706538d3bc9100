"""Bounds of distances: any pair, every level, meshes, fitted meshes and contact models, against the oracle."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from clamp3d import baselines, distance, shapes
from clamp3d.collide.answer import Distance
from clamp3d.collide.batch import by_kernel
from clamp3d.collide.convex import Rod
from clamp3d.collide.hull import hull
from clamp3d.collide.model import ModelCache
from clamp3d.collide.refine import from_boxes, refine
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.linear import to_target
from clamp3d.core.pose import inverse, rotation, translation
from clamp3d.core.primitives import Cylinder, SweptArc
from clamp3d.core.profile import Arc, Profile
from clamp3d.testing import assert_distance, body
from tests.kinds import BLOCK, DRAWN, faceted_shape, pose, poses

SLOW = settings(
    deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate], suppress_health_check=[HealthCheck.too_slow]
)
SOME = st.sampled_from(DRAWN)


@settings(SLOW, max_examples=20)
@given(SOME, SOME, poses(25.0))
def test_any_pair_of_drawn_solids(a, b, T):
    assert_distance(distance(a, b, T), a, b, T)


@settings(SLOW, max_examples=20)
@given(
    st.builds(SweptArc, st.floats(3.0, 15.0), st.floats(0.2, 3.0), st.floats(2.0, 60.0)),
    st.builds(Cylinder, st.floats(0.5, 12.0), st.floats(1.0, 90.0)),
    poses(25.0),
)
def test_a_bare_groove_and_a_cylinder(groove, wire, T):
    assert_distance(distance(groove, wire, T), groove, wire, T)
    assert_distance(distance(wire, groove, inverse(T)), wire, groove, inverse(T))


@settings(SLOW, max_examples=8)
@given(SOME, SOME, poses(22.0))
# A corner of the block is deepest in the hull of the other, and what it is nearest to is where that has a groove.
@example(DRAWN[1], DRAWN[2], pose((-0.06, -1.0, 0.0), 3.718, (-2.0825, -14.016, -17.5304)))
def test_every_level_on_the_way_to_an_answer(a, b, T):
    seen: list[Distance] = []
    cache = ModelCache()
    x, y = cache.model(a), cache.model(b)
    refine(x, y, T, from_boxes(x, y, T), Thresholds(), lambda known: bool(seen.append(known)))
    assert len({d.level for d in seen}) >= 2
    for known in {d.level: d for d in seen}.values():
        # On the way an overlap is known by its interference: a lower bound of that is none of the depth.
        assert_distance(replace(known, lower=-np.inf, normal=None) if known.lower < 0.0 else known, a, b, T)


FACETED = {
    (a.name, fit): (a, faceted_shape(a, 0.3 if fit == "off" else 0.05, fit))
    for a in DRAWN
    for fit in ("off", "round", "bound")
    if fit == "off" or any(e.profile.arcs for e in (*a.bodies, *a.holes))
}


@settings(SLOW, max_examples=8)
@given(st.sampled_from([key for key in FACETED if key[1] == "off"]), SOME, poses(20.0))
def test_facets_that_are_the_part(key, b, T):
    faceted = FACETED[key][1]
    assert_distance(distance(faceted, b, T, accuracy=1e-3), faceted, b, T, cells=3000)


@settings(SLOW, max_examples=20)
@given(st.sampled_from([key for key in FACETED if key[1] != "off"]), st.sampled_from([DRAWN[3], DRAWN[5]]), poses(20.0))
def test_a_fitted_mesh_has_the_bounds_of_the_part_it_comes_from(key, b, T):
    """Its corners lie on the part's surface, so what is said of it must hold for the part."""
    solid, faceted = FACETED[key]
    found = distance(faceted, b, T, accuracy=1e-3)
    assert_distance(replace(found, point_a=None, normal=None), solid, b, T)


@settings(SLOW, max_examples=10)
@given(st.floats(0.4, 1.4), st.floats(0.0, 3.0), st.floats(-16.0, 16.0), st.floats(-0.5, 4.0), st.floats(-0.2, 0.2))
@example(0.5774, 2.0288, -1.5449, 4.0, 0.0557)  # the shoulders reach 0.03 mm into the circle of the arc
def test_a_fitted_groove_between_shoulders(half, above, u, v, turn):
    """What stands above the ends of the arc is the part's, not air: the groove's mouth is as high as the part."""
    s, h, face = 7.0 * math.sin(half), -7.0 * math.cos(half), above - 7.0 * math.cos(half)
    arc = Arc((0.0, 0.0), 7.0, half - 0.5 * math.pi, -half - 0.5 * math.pi)
    wide, back = 20.0, -15.0
    corners = [(-wide, face), (-wide, back), (wide, back), (wide, face)]
    step = [(s + 2.0, face), (s + 2.0, h)] if above else []
    outline = Profile.of(*corners, *step, arc, *((-x, y) for x, y in reversed(step)))
    solid = shapes.Solid("raised", (Extrusion(outline, "Z", -15.0, 15.0),))
    wire = shapes.cylinder(3.0, 20.0)
    T = rotation((0.0, 1.0, 0.0), turn)
    T[:3, 3] = (u, face + 3.0 + v, 1.0)
    for fit in ("bound", "round"):
        found = distance(faceted_shape(solid, 0.05, fit), wire, T, accuracy=1e-3)
        assert_distance(replace(found, point_a=None, normal=None), solid, wire, T)


@pytest.mark.parametrize("error", [1.0, 0.1])
@pytest.mark.parametrize("shape", DRAWN, ids=lambda shape: shape.name)
def test_a_drawn_solid_lies_between_its_two_meshes(shape, error):
    model = ModelCache().model(shape)
    rng = np.random.default_rng(0)
    inner, outer = model.inner(error), model.outer(error)
    corners = inner.vertices[inner.faces]
    on = np.einsum("mkc,mcd->mkd", rng.dirichlet(np.ones(3), (len(corners), 30)), corners).reshape(-1, 3)
    assert body(shape).field(np.vstack([inner.vertices, on])).max() <= 1e-9
    x = rng.uniform(*body(shape).box, (6000, 3))
    corners = outer.vertices[outer.faces]
    on = np.einsum("mkc,mcd->mkd", rng.dirichlet(np.ones(3), (len(corners), 30)), corners).reshape(-1, 3)
    assert body(shape).field(np.vstack([outer.vertices, on])).min() >= -1e-9
    assert outer.contains(x[body(shape).field(x) < 0.0]).all()


@settings(SLOW, max_examples=20)
@given(
    st.sampled_from(["chords", "wedges"]),
    st.sampled_from([2.0, 10.0, 30.0]),
    st.floats(-3.0, 3.0),
    st.floats(-2.0, 3.0),
    st.floats(-1.5, 1.5),
)
def test_contact_models_bound_what_they_approximate(name, unit, x, y, turn):
    wire = shapes.cylinder(5.0, 70.0)
    model = baselines.contact_model(name, {"block": BLOCK}, unit_angle=math.radians(unit))
    T = translation(x, y, 0.0) @ rotation((0.0, 0.0, 1.0), turn)
    found = distance(BLOCK, wire, T, model=model)
    assert found.lower <= found.value <= found.upper
    assert_distance(replace(found, point_a=None, normal=None, estimate=None), BLOCK, wire, T)


def test_of_a_model_without_known_bounds_none_are_claimed():
    wire, T = shapes.cylinder(5.0, 70.0), translation(0.0, 1.0, 0.0)
    model = baselines.contact_model("mesh", {"block": BLOCK, "cylinder": wire})
    found = distance(BLOCK, wire, T, model=model)
    assert (found.level, found.lower, found.upper) == ("model", -math.inf, math.inf)
    assert found.estimate == pytest.approx(distance(BLOCK, wire, T).value, abs=0.1)


@pytest.mark.parametrize(
    ("way", "dimension"),
    [((0, 0, 1), 2), ((0, 0, -1), 2), ((1, 0, 0), 1), ((0, -1, 0), 1), ((0.6, 0, 0.8), 0), ((0, 0.6, -0.8), 0)],
)
def test_what_of_a_rod_lies_furthest(way, dimension):
    T = rotation((1.0, 2.0, 3.0), 0.7)
    n = T[:3, :3] @ way
    found, line = Rod(3.0, 8.0, T).flatness(n)
    assert found == dimension
    assert line is None if dimension != 1 else abs(line @ n) < 1e-12
    face = Rod(3.0, 8.0, T).face(n)
    assert np.ptp(face @ n) < 1e-9
    assert np.linalg.matrix_rank(face - face[0], tol=1e-9) == dimension


@pytest.mark.parametrize("convex", [True, False])
def test_a_mesh_has_a_closed_form_exactly_if_it_is_convex(convex):
    shape = faceted_shape(DRAWN[3] if convex else DRAWN[4], 0.1)
    assert (ModelCache().model(shape).bodies is not None) == convex


@pytest.mark.parametrize("shape", DRAWN, ids=lambda shape: shape.name)
def test_bounding_boxes_hold_the_shape(shape):
    model = ModelCache().model(shape)
    low, high = body(shape).box
    x = np.random.default_rng(1).uniform(low - 5.0, high + 5.0, (20_000, 3))
    inside = body(shape).field(x) < 0.0
    assert (x[inside] >= model.bounds[0] - 1e-9).all()
    assert (x[inside] <= model.bounds[1] + 1e-9).all()
    for form in model.forms:
        deep = form.depth(x)
        assert (body(shape).field(x)[deep > 1e-9] <= 1e-9).all()


def test_a_segment_crosses_a_box_exactly_if_some_of_its_points_are_inside():
    box = hull(np.array(list(itertools.product((-2.0, 2.0), (-3.0, 3.0), (-4.0, 4.0)))))
    rng = np.random.default_rng(2)
    s = np.linspace(0.0, 1.0, 2001)[:, None]
    counted = [0, 0]
    for _ in range(300):
        ends = rng.uniform(-6.0, 6.0, (2, 3))
        deepest = (np.abs(ends[0] + s * (ends[1] - ends[0])) - (2.0, 3.0, 4.0)).max(axis=1).min()
        if abs(deepest) > 0.01:
            assert box.crossed_by(ends) == (deepest < 0.0)
            counted[int(deepest < 0.0)] += 1
    assert min(counted) > 50


def _narrow(concave):
    """Two grooves, or two bumps, whose arcs all but meet: the tangents of each cross the other's."""
    if concave:
        return shapes.groove_block(SweptArc(12.0, 1.9, 40.0), 90.0, 30.0, others=[(24.02, 12.0, 1.9)])
    foot = -12.0 * math.sin(0.6)
    bumps = [Arc((x, 0.0), 12.0, -0.6, math.pi + 0.6) for x in (12.01, -12.01)]
    outline = Profile.of((-40.0, foot), (-40.0, -20.0), (40.0, -20.0), (40.0, foot), *bumps)
    return shapes.Solid("bumps", (Extrusion(outline, "Z", -20.0, 20.0),))


@pytest.mark.parametrize("error", [1.0, 0.2])
@pytest.mark.parametrize("concave", [True, False])
def test_a_wall_or_gap_thinner_than_its_facets_keeps_both_meshes_apart(concave, error):
    shape = _narrow(concave)
    inner, outer = (getattr(ModelCache().model(shape), side)(error) for side in ("inner", "outer"))
    middles = inner.vertices[inner.faces].mean(axis=1)
    assert body(shape).field(np.vstack([inner.vertices, middles])).max() <= 1e-9
    x = np.random.default_rng(4).uniform(*body(shape).box, (20_000, 3))
    assert outer.contains(x[body(shape).field(x) < 0.0]).all()


def _points_of(rod):
    """Points (n, 3) of a cylinder: on its axis, and on circles that fill it."""
    r, turn = rod.radius * np.array([0.0, 0.5, 1.0]), np.linspace(0.0, 2.0 * math.pi, 49)[1:]
    grid = np.array(list(itertools.product(r, turn, rod.length * np.linspace(-0.5, 0.5, 25))))
    return np.column_stack([grid[:, 0] * np.cos(grid[:, 1]), grid[:, 0] * np.sin(grid[:, 1]), grid[:, 2]])


@pytest.mark.parametrize("shape", [DRAWN[k] for k in (0, 1, 2, 4, 6)], ids=lambda shape: shape.name)
def test_what_grooves_and_holes_say_of_many_poses_holds(shape):
    """No point of the cylinder is deeper in the body than said, and the points named are as deep, or as near."""
    rng, whole, cache = np.random.default_rng(11), body(shape), ModelCache()
    told = {"apart": 0, "overlap": 0, "lower": 0}
    measured = shape is not DRAWN[2]  # a hole across the outline: near it the definition gives no more than a bound
    for radius, length in ((3.0, 20.0), (5.5, 60.0), (1.0, 3.0)):
        rod = shapes.cylinder(radius, length)
        inside, points = body(rod), _points_of(Cylinder(radius, length))
        T = np.array([rotation(rng.normal(size=3), rng.choice([0.01, 0.3, 1.5])) for _ in range(80)])
        T[:, :3, 3] = rng.normal(size=(80, 3)) * rng.choice([1.0, 9.0], 80)[:, None]
        swapped = by_kernel(cache.model(rod), cache.model(shape), inverse(T))
        found = by_kernel(cache.model(shape), cache.model(rod), T)
        assert np.allclose(found.lower, swapped.lower, rtol=0, atol=1e-9)
        for k, P in enumerate(T):
            lower, upper, p, q = found.lower[k], found.upper[k], found.point_a[k], found.point_b[k]
            told["lower"] += lower > -math.inf
            if math.isfinite(lower) and measured:
                assert lower <= whole.field(points @ P[:3, :3].T + P[:3, 3]).min() + 1e-9
            if upper == math.inf:
                continue
            if lower > 0.0:
                assert upper == pytest.approx(swapped.upper[k], abs=1e-9)
                assert p == pytest.approx(to_target(P, swapped.point_b[k]), abs=1e-6)
            assert np.linalg.norm(found.normal[k]) == pytest.approx(1.0, abs=1e-9)
            trials = np.array([p, 0.5 * (p + q), q])
            in_a, in_b = whole.field(trials), inside.at(P).field(trials)
            if upper >= 0.0:
                assert max(in_a[0], in_b[2]) <= 1e-9
                assert np.linalg.norm(q - p) <= upper + 1e-9
                assert q - p == pytest.approx(upper * found.normal[k], abs=1e-8)
            elif measured:
                assert np.minimum(in_a, in_b)[np.maximum(in_a, in_b) <= 1e-9].min() <= upper + 1e-9
            told["apart" if upper > 0.0 else "overlap"] += 1
    assert min(told.values()) >= 20, told
