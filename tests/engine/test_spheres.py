"""Spheres are balls, not facets: their distances against formulas, from drawn parts, meshes and CAD, and in motions."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from clamp3d import Motion, Scene, check, distance, distances, first_contact
from clamp3d.engine import moving_pair
from clamp3d.files.solid import BrepSolid
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import SweptArc, box, cylinder, groove_block, sphere
from tests.cad import block

places = st.tuples(*3 * (st.floats(-20.0, 20.0),)).map(np.array)
radii = st.floats(0.5, 20.0)
poses = st.tuples(st.floats(0.1, 1.0), st.floats(-3.0, 3.0)).map(lambda turn: rotation((turn[0], 1.0, -0.3), turn[1]))


def to_box(x, half):
    """Signed distance of a point from a box of half extents ``half``, negative inside."""
    out = np.abs(x) - half
    return float(np.linalg.norm(np.maximum(out, 0.0)) + min(out.max(), 0.0))


def to_cylinder(x, radius, half):
    return to_box(np.array([math.hypot(x[0], x[1]), 0.0, x[2]]), (radius, 1e9, half))


OTHERS = {
    "box": (box(10, 8, 6), lambda x: to_box(x, (5.0, 4.0, 3.0))),
    "rod": (cylinder(4.0, 10.0), lambda x: to_cylinder(x, 4.0, 5.0)),
    "ball": (sphere(7.0), lambda x: float(np.linalg.norm(x)) - 7.0),
    "mesh": (trimesh.creation.box((10, 8, 6)), lambda x: to_box(x, (5.0, 4.0, 3.0))),
}


@pytest.mark.parametrize("name", OTHERS)
@settings(max_examples=10, deadline=None)
@given(x=places, radius=radii, turn=poses)
def test_a_sphere_is_as_near_as_its_centre_less_its_radius(name, x, radius, turn):
    other, to_point = OTHERS[name]
    true = to_point(x) - radius
    is_outside = to_point(x) > 0.0
    T = translation(*x) @ turn
    for answer in (distance(other, sphere(radius), T), distance(sphere(radius), other, np.linalg.inv(T))):
        assert answer.lower - 1e-9 <= true <= answer.upper + 1e-9
        if true > 1e-6 or name != "mesh":  # about one middle all ways out are as long
            assert answer.upper - answer.lower <= (1e-6 if is_outside else 0.01 * (radius + 7.0))


@settings(max_examples=15, deadline=None)
@given(angle=st.floats(-0.9, 0.9), gap=st.floats(-0.3, 0.3), z=st.floats(-15.0, 15.0))
def test_a_sphere_in_a_groove_is_measured_by_the_kernel(angle, gap, z):
    cradle = groove_block(SweptArc(7.0, 1.0, 50.0), 40.0, 20.0)
    away = 0.5 - gap  # of the centre from the groove's axis
    T = translation(away * math.sin(angle), -away * math.cos(angle), z) @ rotation((1.0, 2.0, 3.0), z)
    answer = distance(cradle, sphere(6.5), T)
    assert answer.upper == pytest.approx(gap, abs=1e-9)
    assert (gap if gap >= 0.0 else gap - 0.05) - 1e-9 <= answer.lower <= gap + 1e-9  # a way out between both sides
    assert answer.method == "groove kernel"
    assert distances(cradle, sphere(6.5), [T, T]).upper == pytest.approx(gap, abs=1e-7)


@pytest.mark.parametrize(
    ("gap", "verdict"), [(0.011, "clear"), (0.009, "contact"), (-0.009, "contact"), (-0.011, "clash")]
)
def test_the_verdict_of_a_large_sphere_is_certain(gap, verdict):
    """Of facets within a thousandth of its radius nothing would be."""
    plates = (box(80, 80, 10), BrepSolid.of(block((-40, -40, -5), (40, 40, 5)), "plate"))
    for plate in (*plates, trimesh.creation.box((80, 80, 10))):
        scene = Scene().add("plate", plate).add("ball", sphere(50.0), translation(1.0, 2.0, 55.0 + gap))
        rows = check(scene, depths=False).pairs  # pairs that are far enough apart have none
        assert [row.verdict.value for row in rows] == [verdict] * (verdict != "clear")


@pytest.mark.parametrize("radius", [None, 28.0, 23.5])
def test_the_first_contact_of_a_sphere_is_that_of_its_centre(radius, monkeypatch):
    """Along a line, or on a circle, past a post; the smaller circle passes 0.5 mm away from it."""
    monkeypatch.setattr(moving_pair, "BUDGET", 500)  # the last digits of that distance take all there is
    post, ball = cylinder(4.0, 60.0), sphere(3.0)
    if radius is None:
        hit = first_contact(post, ball, Motion.translate((40, 0, 0)), translation(-20.0, 2.0, 5.0))
        assert hit.touches
        assert hit.t * 40.0 == pytest.approx(20.0 - math.sqrt(49.0 - 4.0), abs=1e-5)
        return
    turn = Motion.screw((0, 0, 1), math.pi, point=(0.0, 31.0, 0.0))
    hit = first_contact(post, ball, turn, translation(-radius, 31.0, 5.0))
    # The centre's distance from the post's axis follows from the triangle of both axes and it.
    cosine = (radius**2 + 31.0**2 - 49.0) / (2.0 * radius * 31.0)
    assert hit.touches == (cosine < 1.0)
    if hit.touches:
        assert hit.t * math.pi == pytest.approx(0.5 * math.pi - math.acos(cosine), abs=1e-5)
    else:
        assert hit.distance.value == pytest.approx(0.5, abs=1e-6)


def test_a_sphere_that_slides_0_001_mm_above_its_ground_never_touches_it():
    hit = first_contact(box(60, 20, 2), sphere(5.0), Motion.translate((30, 0, 0)), translation(-15.0, 0.0, 6.001))
    assert not hit.touches
    assert hit.distance.value == pytest.approx(0.001, abs=1e-6)


@pytest.mark.parametrize("moves", ["ball", "post"])
def test_a_sphere_that_grazes_a_post_is_found(moves):
    """It touches it for 0.2 of 40 mm, at none of the times at which a search that halves would look first."""
    aside = 6.9995
    bodies = [cylinder(4.0, 60.0), sphere(3.0)][:: 1 if moves == "ball" else -1]
    hit = first_contact(*bodies, Motion.translate((40, 0, 0)), translation(-17.3, aside, 5.0))
    assert hit.touches
    assert hit.t * 40.0 == pytest.approx(17.3 - math.sqrt(49.0 - aside**2), abs=1e-4)


@settings(max_examples=10, deadline=None)
@given(x=places, radius=st.floats(0.5, 4.0), turn=poses)
def test_a_sphere_beside_a_mesh_that_is_not_convex_is_measured_exactly(x, radius, turn):
    low, high = trimesh.creation.box((10, 8, 6)), trimesh.creation.box((4, 8, 6)).apply_translation((-3, 0, 6))
    angle = trimesh.boolean.union([low, high], engine="manifold")
    true = min(to_box(x, (5.0, 4.0, 3.0)), to_box(x - (-3, 0, 6), (2.0, 4.0, 3.0))) - radius
    assume(true > 1e-6)
    answer = distance(angle, sphere(radius), translation(*x) @ turn)
    assert (answer.lower, answer.upper) == pytest.approx((true, true), abs=1e-7)
