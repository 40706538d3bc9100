"""Depth of pins in drilled plates against closed forms and against the bodies moved, by a search of their own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from clamp3d.bench.stress.poses.flat_truth import solid_truth
from clamp3d.collide.distance import distance
from clamp3d.core import shapes
from clamp3d.core.pose import inverse, rotation, translation
from clamp3d.core.primitives import Cylinder
from clamp3d.testing import assert_distance, directions

PLATE = shapes.box((60.0, 50.0, 8.0), holes=[shapes.Hole(5.0, (4.0, 0.0)), shapes.Hole(3.0, (-15.0, 5.0))])
WASHER = shapes.cylinder(12.0, 8.0, bore=5.0)


@pytest.mark.parametrize(
    ("body", "radius", "length", "at", "depth"),
    [
        (PLATE, 4.0, 30.0, (7.0, 0.0, 1.0), 2.0),  # back into its hole
        (PLATE, 4.0, 30.0, (1.6, -3.2, 0.0), 3.0),
        (PLATE, 2.0, 30.0, (-12.0, 9.0, 0.0), 4.0),  # into the nearer one of two
        (PLATE, 4.0, 30.0, (7.0, 0.0, 18.0), 1.0),  # out through the face
        (PLATE, 5.5, 20.0, (4.0, 0.0, 0.0), 14.0),  # too thick for the hole
        (WASHER, 4.0, 30.0, (0.0, 3.0, 0.0), 2.0),
        (WASHER, 4.0, 30.0, (14.5, 0.0, 0.0), 1.5),
    ],
)
def test_parallel_pins(body, radius, length, at, depth):
    pin = Cylinder(radius, length)
    found = distance(body, pin, translation(*at))
    assert -found.lower == pytest.approx(depth, abs=1e-7)
    assert -found.upper == pytest.approx(depth, abs=1e-7)
    other = distance(pin, body, inverse(translation(*at)))
    assert other.depth == pytest.approx(depth, abs=1e-7)
    np.testing.assert_allclose(other.normal, -found.normal, atol=1e-6)


def test_leaning_pins_come_free_by_their_depth_and_by_no_less():
    """By a search that knows the definition alone: moved by less than the depth, in any direction, they overlap."""
    rng = np.random.default_rng(0)
    half, seen = np.array([20.0, 18.0, 4.0]), 0
    plate = shapes.box(2.0 * half, holes=[shapes.Hole(5.0)])
    around = directions(60)
    for _ in range(40):
        pin = Cylinder(rng.uniform(2.0, 4.9), rng.uniform(2.0, 40.0))
        T = translation(*rng.uniform(-4.0, 4.0, 3)) @ rotation(rng.normal(size=3), rng.uniform(0.0, 0.6))
        found = distance(plate, pin, T)
        if found.upper >= -1e-3:
            continue
        assert found.upper - found.lower <= 1e-6
        seen += found.method == "hole"

        def bounds(t, most, pin=pin, T=T):
            return solid_truth(5.0, True, half, pin.radius, pin.length, translation(*t) @ T, 1e-7, most)

        # Where they touch along a line it takes long to tell.
        assert bounds(-found.lower * found.normal, 20_000)[0] > -1e-3
        near = found.normal + 0.1 * rng.normal(size=(20, 3))
        near /= np.linalg.norm(near, axis=1)[:, None]
        for way in (found.normal, *near, *around):  # mostly a point of both is found at once
            assert any(bounds(-0.99 * found.upper * way, most)[1] <= 1e-6 for most in (300, 20_000))
    assert seen > 10


def test_a_pin_that_only_just_fits_has_to_be_turned_or_drawn_out():
    """Leaning by more than its clearance allows it does not fit: the depth leaps from the way in to the way off."""
    plate = shapes.box((40.0, 40.0, 8.0), holes=[shapes.Hole(5.0)])
    pin = Cylinder(4.5, 40.0)
    # Along the lean the cut at either face reaches 4 tan(a) + 4.5 / cos(a) from the axis: 5 at this angle.
    limit = 2.0 * math.atan2(-4.0 + math.sqrt(16.0 + 25.0 - 20.25), 9.5)
    inside, stuck = (
        distance(plate, pin, translation(0.0, 1.0, 0.0) @ rotation((0.0, 1.0, 0.0), limit * part))
        for part in (0.9, 1.1)
    )
    assert inside.method == "hole"
    assert inside.depth < 1.5
    assert stuck.depth > 10.0


def test_a_hole_that_breaks_through_a_side_is_no_hole_of_a_plate():
    """Sideways it is open: the pin comes out there by less than out of the face."""
    open_ = shapes.box((20.0, 30.0, 30.0), holes=[shapes.Hole(4.0, (9.0, 0.0))])
    found = distance(open_, Cylinder(3.0, 40.0), translation(7.0, 0.0, 0.0))
    assert found.lower <= -1.0 <= found.upper


def test_the_points_of_a_pin_that_is_drawn_off_its_hole_are_on_the_plate():
    """The middle of the pin's end is above the hole when it leaves the tube; the points are where the faces meet."""
    tube, pin = shapes.cylinder(8.0, 12.0, bore=4.0), shapes.cylinder(5.0, 40.0)
    T = translation(0.0, 0.4778, 0.3698) @ rotation((0.0, 1.0, 1.0), np.pi)
    for a, b, place in ((tube, pin, T), (pin, tube, np.linalg.inv(T))):
        found = distance(a, b, place)
        assert found.lower == pytest.approx(0.3698 - 11.0, abs=1e-9)
        assert found.point_a is not None
        assert_distance(found, a, b, place)
