"""The oracle against closed forms and manifold3d, and every assertion against answers that are wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest

from clamp3d import Cylinder, Distance, Motion, distance, first_contact, load_clamp, min_clearance, shapes
from clamp3d.clamp.parts import parts
from clamp3d.geometry.meshing import chord_error
from clamp3d.geometry.pose import inverse
from clamp3d.kernel import SweptArc, rotation, translation
from clamp3d.testing import Body, assert_distance, assert_lower_on_way, assert_motion, body, common, separation
from tests.kinds import BLOCK, DRAWN, faceted_shape

BALL = Body(lambda x: np.linalg.norm(x, axis=1) - 2.0, np.array([[-2.0] * 3, [2.0] * 3]))
BOX = shapes.box((10.0, 10.0, 10.0))


@pytest.mark.parametrize("shape", DRAWN, ids=lambda shape: shape.name)
def test_fields_agree_with_a_mesh_of_the_same_shape(shape):
    """Drawn solids are defined by outlines, meshes by solid angles: two definitions that share nothing."""
    error = 0.02
    faceted = body(faceted_shape(shape, error))
    x = np.random.default_rng(0).uniform(*(1.3 * faceted.box), (600, 3))
    exact, near = body(shape).field(x), faceted.field(x)
    assert ((exact > 0.0) == (near > 0.0))[np.abs(near) > 2.0 * chord_error(shape, error) + 1e-9].all()
    assert (np.abs(exact) <= np.abs(near) + 2.0 * chord_error(shape, error) + 1e-9).all()
    if all(hole.axis == shape.bodies[0].axis for hole in shape.holes):  # then it is the distance itself
        outside = exact > 0.0
        assert np.abs(exact - near)[outside].max() <= 2.0 * chord_error(shape, error) + 1e-9


@pytest.mark.parametrize("gap", [0.3, -0.3])
def test_a_sphere_is_defined_by_its_radius(gap):
    ball, place = shapes.sphere(5.0, mesh_error=1.0), translation(3.0, 4.0, 0.0)
    place[:3, 3] *= (10.0 + gap) / 5.0
    answer = distance(ball, ball, place)
    assert_distance(answer, ball, ball, place)
    with pytest.raises(AssertionError):
        assert_distance(replace(answer, upper=answer.upper - 0.5, lower=-math.inf), ball, ball, place)


def test_fields_are_nowhere_steeper_than_one():
    rng = np.random.default_rng(1)
    primitives = Cylinder(3.0, 8.0), SweptArc(7.0, 2.0, 9.0), SweptArc(7.0, 0.5, 9.0)
    for shape in (*DRAWN, *primitives, *parts(load_clamp()).values()):
        x = rng.uniform(-30.0, 30.0, (4000, 3))
        step = rng.normal(size=x.shape) * 10.0 ** rng.uniform(-6, 1, (4000, 1))
        field = body(shape).field
        assert (np.abs(field(x + step) - field(x)) <= np.linalg.norm(step, axis=1) * (1.0 + 1e-9) + 1e-12).all()


def test_separation_and_common_in_closed_form():
    for T, gap in ((translation(9.0, 0.0, 0.0), 2.0), (translation(8.0, 8.0, 8.0), 3.0 * math.sqrt(3.0) - 2.0)):
        found = separation(BOX, BALL, T)
        assert found.lower <= gap <= found.upper + 1e-9
        assert found.lower > gap - 0.1
        assert found.upper == pytest.approx(gap, abs=1e-7)
    deep = common(BOX, BALL, translation(6.0, 0.0, 0.0), accuracy=1e-3)  # one millimetre deep
    assert deep.lower <= -0.5 <= deep.upper
    assert deep.upper < -0.45
    groove, wire = SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0)
    assert separation(groove, wire, translation(0.0, -1.0, 0.0)).upper == pytest.approx(0.5, abs=1e-9)
    assert common(groove, wire, translation(0.0, -2.0, 0.0)).upper < -0.2


T_APART = rotation((1.0, 2.0, 3.0), 0.7)
T_APART[:3, 3] = (14.0, 20.0, 5.0)
APART = distance(BLOCK, BOX, T_APART)
T_DEEP = translation(9.0, 0.3, 0.2)
DEEP = Distance(-1.0, -1.0, np.array([5.0, 0.0, 0.0]), np.array([4.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))


def test_right_answers_pass():
    assert_distance(APART, BLOCK, BOX, T_APART)
    assert_distance(APART.swapped().moved(inverse(T_APART)), BOX, BLOCK, inverse(T_APART))
    assert_distance(DEEP, BOX, BOX, T_DEEP)
    assert_distance(Distance(), BLOCK, BOX, T_APART)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lower": APART.lower + 1e-3, "upper": APART.upper + 1e-3}, "lower .* > attained"),
        ({"upper": APART.upper - 1e-3, "lower": -math.inf}, "further apart than upper"),
        ({"upper": APART.upper - 0.5, "lower": -math.inf, "point_a": None}, "upper .* < proven"),
        ({"point_a": APART.point_a + 0.01 * APART.normal}, "point on a is 0.01 mm outside"),
        ({"point_b": APART.point_b - 0.01 * APART.normal}, "point on b is 0.01 mm outside"),
        ({"normal": 1.1 * APART.normal}, "no unit vector"),
        ({"lower": APART.upper + 1e-3, "normal": None}, "crossed"),
    ],
)
def test_wrong_answers_apart_are_seen(change, message):
    with pytest.raises(AssertionError, match=message):
        assert_distance(replace(APART, **change), BLOCK, BOX, T_APART)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lower": -0.9, "upper": -0.9}, "share a ball"),
        ({"lower": -1.5, "upper": -1.5}, "parted by less than 1.5"),
        ({"normal": np.array([0.0, 1.0, 0.0])}, "along the normal they overlap"),
    ],
)
def test_wrong_answers_in_an_overlap_are_seen(change, message):
    with pytest.raises(AssertionError, match=message):
        assert_distance(replace(DEEP, **change), BOX, BOX, T_DEEP)


def test_wrong_motions_are_seen():
    pin, start, way = Cylinder(2.0, 6.0), translation(20.0, 0.0, 0.0), Motion.translate((-40.0, 8.0, 0.0))
    least, hit = min_clearance(BOX, pin, way, start), first_contact(BOX, pin, way, start)
    assert_motion(least, BOX, pin, way, start)
    assert_motion(hit, BOX, pin, way, start, first=True)
    with pytest.raises(AssertionError, match="on the way"):
        assert_motion(replace(least, distance=replace(least.distance, lower=-0.1)), BOX, pin, way, start)
    late = replace(hit, t=hit.t + 0.05, pose=way.at(hit.t + 0.05, start))
    with pytest.raises(AssertionError, match="on the way"):
        assert_motion(late, BOX, pin, way, start, first=True)
    with pytest.raises(AssertionError, match="the pose is not that of t"):
        assert_motion(replace(hit, t=0.9), BOX, pin, way, start, first=True)
    with pytest.raises(AssertionError, match="at pose 1"):
        assert_lower_on_way(5.0, BOX, BALL, [translation(20, 0, 0), translation(9, 0, 0)])
