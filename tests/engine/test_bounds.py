"""Bounds of distances: any pair, every level, meshes, fitted meshes and contact models, against the oracle."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from clamp3d import baselines, distance, shapes
from clamp3d.engine.model import ModelCache
from clamp3d.geometry.pose import inverse, rotation, translation
from clamp3d.geometry.primitives import Cylinder, SweptArc
from clamp3d.testing import assert_distance, body
from tests.kinds import BLOCK, DRAWN, faceted_shape, mesh_shape, poses

SLOW = settings(
    deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate], suppress_health_check=[HealthCheck.too_slow]
)
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
    for form in model.enclosing:
        deep = form.depth(x)
        assert (body(shape).field(x)[deep > 1e-9] <= 1e-9).all()


@pytest.mark.parametrize("height", [8.0, 800.0])
def test_the_box_of_a_mesh_holds_the_round_surface_through_its_corners(height):
    """A bar of six flats, none of whose corners is where the cylinder around it reaches furthest along x."""
    bar = trimesh.creation.cylinder(radius=5.0, height=height, sections=6)
    bar.apply_transform(rotation((0.0, 0.0, 1.0), math.pi / 6.0))
    low, high = ModelCache().model(mesh_shape(bar, "round")).bounds
    assert low[0] <= -5.0
    assert high[0] >= 5.0
