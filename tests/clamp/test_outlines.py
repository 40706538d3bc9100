"""Distances of outlines against closed forms and against shapely on much finer polygons."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.outlines import outline_gap
from clamp3d.clamp.parts import parts
from clamp3d.core.pose import SectionPose

shapely = pytest.importorskip("shapely")
affinity = pytest.importorskip("shapely.affinity")

PARTS = parts(load_clamp())
ERROR = 1e-3
coordinate = st.floats(-150.0, 150.0)
pose = st.builds(SectionPose, coordinate, coordinate, st.floats(-0.3, 0.3))


def polygon(part, where):
    """The part in the section as shapely sees it: x, y down; a positive angle is counter-clockwise as seen."""
    shapes = []
    for body in part.bodies:
        if body.axis == "Y":
            shape = shapely.Polygon(body.profile.polygon(1e-5))
        else:
            (left, _), (right, _) = body.profile.bounds
            shape = shapely.box(left, -body.end, right, -body.start)
        shape = affinity.rotate(shape, -where.angle, origin=(0, 0), use_radians=True)
        shapes.append(affinity.translate(shape, where.x, where.y))
    return shapely.union_all(shapes)


@settings(max_examples=60, deadline=None)
@example(a="P1", b="P1", pose_a=SectionPose(0.0, 0.0, 1.1754943508222875e-38), pose_b=SectionPose(0.0, 28.0))
@given(a=st.sampled_from(sorted(PARTS)), b=st.sampled_from(sorted(PARTS)), pose_a=pose, pose_b=pose)
def test_distance_and_overlap_agree_with_shapely(a, b, pose_a, pose_b):
    p, q = polygon(PARTS[a], pose_a), polygon(PARTS[b], pose_b)
    expected = p.distance(q)
    assume(expected > 0.01 or p.intersection(q).area > 1.0)  # what lies between is within the chords' error
    found = outline_gap(PARTS[a], pose_a, PARTS[b], pose_b, ERROR)
    assert found.overlap == (expected == 0.0)
    assert abs(found.distance - expected) <= found.error_bound + 2e-5
    if not found.overlap:
        assert np.hypot(*(found.point_a - found.point_b)) == pytest.approx(found.distance, abs=1e-12)
        assert p.distance(shapely.Point(found.point_a)) < 2e-3
        assert q.distance(shapely.Point(found.point_b)) < 2e-3


@pytest.mark.parametrize("mesh_error", [0.1, 1e-3, 1e-5])
def test_two_wires_are_as_far_apart_as_their_circles_within_the_bound(mesh_error):
    angle = 0.7
    there = SectionPose(80 * math.cos(angle), 80 * math.sin(angle))
    found = outline_gap(PARTS["P6"], SectionPose(0, 0), PARTS["P7"], there, mesh_error)
    exact = 80 - 32.67 / 2 - 14.25 / 2
    assert 0.0 <= found.distance - exact <= found.error_bound <= 2 * mesh_error


def test_a_wire_inside_another_is_contained_and_one_across_its_edge_is_not():
    inside = outline_gap(PARTS["P6"], SectionPose(0, 0), PARTS["P7"], SectionPose(3, 0), ERROR)
    across = outline_gap(PARTS["P6"], SectionPose(0, 0), PARTS["P7"], SectionPose(16, 0), ERROR)
    assert (inside.overlap, inside.contained) == (True, True)
    assert (across.overlap, across.contained) == (True, False)


def test_a_part_that_is_there_twice_overlaps():
    for name, part in PARTS.items():
        where = SectionPose(3.0, -2.0, 0.1)
        assert outline_gap(part, where, part, where, ERROR).overlap, name
