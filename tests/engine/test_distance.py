"""Distances and depths of pairs in closed form, and what an answer tells of itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from clamp3d import Distance, Verdict, distance, measure, shapes
from clamp3d.baselines import contact_model
from clamp3d.clamp.parts import parts
from clamp3d.engine.result import PairResult
from clamp3d.geometry.pose import inverse
from clamp3d.kernel import Cylinder, SweptArc, rotation, signed_distance, translation
from clamp3d.testing import assert_distance
from tests.kinds import faceted_shape, mesh_shape

GROOVE = SweptArc(7.0, math.radians(60.0), 50.0)
BLOCK = shapes.groove_block(GROOVE, 40.0, 20.0)
CUBE, ROD = shapes.box((2, 4, 6)), shapes.cylinder(1.0, 4.0)


def test_a_cylinder_has_flat_ends_and_the_kernel_a_lower_bound_of_them():
    groove, wire, T = SweptArc(12.0, math.radians(70.0), 60.0), Cylinder(10.5, 80.0), translation(0.0, -3.0, 73.0)
    d = distance(groove, wire, T)
    assert d.value == pytest.approx(3.0, abs=1e-9)
    assert d.uncertainty < 1e-9
    assert signed_distance(groove, wire, T).distance <= d.value
    assert distance(wire, groove, inverse(T)).value == pytest.approx(3.0, abs=1e-9)
    assert distance(shapes.groove_block(groove, 60.0, 40.0), shapes.cylinder(10.5, 80.0), T).value == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("a", "b", "T", "unique"),
    [
        (shapes.box((10, 10, 10)), shapes.box((10, 10, 10)), translation(12, 3, 0), False),
        (shapes.box((10, 10, 10)), shapes.box((10, 10, 10)), translation(12, 0, 0) @ rotation([1, 1, 0], 0.3), True),
        (shapes.cylinder(3, 20), shapes.cylinder(3, 20), translation(9, 0, 0), False),
        (shapes.cylinder(3, 20), shapes.cylinder(3, 20), translation(9, 0, 0) @ rotation([1, 0, 0], 1.0), True),
        (BLOCK, shapes.cylinder(6.5, 80), translation(0, -0.2, 0), False),
        (CUBE, CUBE, translation(0, 0, 9) @ rotation((1, 0, 0), 0.2), False),  # an edge along a face
        (CUBE, CUBE, translation(9, 0, 0) @ rotation((1, 0, 0), 0.4) @ rotation((0, 0, 1), 0.5), False),  # and edges
        (CUBE, ROD, translation(0, 0, 7), False),  # an end over a face
        (CUBE, ROD, translation(0, 0, 7) @ rotation((1, 0, 0), 0.5 * math.pi), False),  # its side along a face
        (CUBE, ROD, translation(0, 0, 9) @ rotation((1, 0, 0), 0.4), True),  # the lowest point of a rim
    ],
)
def test_nearest_points_that_are_not_the_only_ones_are_told(a, b, T, unique):
    found = distance(a, b, T)
    assert found.unique is unique
    assert found.point_a + found.value * found.normal == pytest.approx(found.point_b, abs=1e-9)
    # Moved together along the normal they touch.
    closer = T.copy()
    closer[:3, 3] -= found.value * found.normal
    assert distance(a, b, closer).value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-8, 3e-8, 1e-7])
def test_unique_is_not_claimed_where_rounding_decides(tilt):
    cube = shapes.box((4, 4, 4))
    assert distance(shapes.box((10, 10, 10)), cube, translation(0, 0, 9) @ rotation([1, 2, 0], tilt)).unique is not True


def test_a_bolt_whose_axis_lies_in_the_plane_between_the_halves_of_a_hole(run):
    splint, bolt = parts(run.clamp)["P1"], parts(run.clamp)["P4"]
    found = distance(bolt, splint, inverse(run.scene.parts[3].T_world))
    assert found.lower <= found.upper < -1.0


@pytest.mark.parametrize("name", ["chords", "wedges"])
def test_contact_models_answer_where_a_groove_is_nearest(name, run):
    model = contact_model(name, parts(run.clamp), unit_angle=math.radians(5.0))
    exact, asked = measure(run.scene), measure(run.scene, model=model)
    grooves = {pair for pair, d in asked.items() if d.method == name}
    assert grooves == {("P1", "P6"), ("P1", "P7"), ("P2", "P6"), ("P2", "P7"), ("P2", "P3")}
    for pair, d in asked.items():
        if pair in grooves:  # they lie in the hollow: never too wide
            assert d.lower <= d.value <= d.upper
            assert d.lower - 1e-9 <= exact[pair].value <= d.upper + 1e-9
            assert d.point_a + d.value * d.normal == pytest.approx(d.point_b, abs=1e-9)
        else:
            assert d.value == exact[pair].value
    assert name in asked["P1", "P6"].to_dict()["method"]


OCTAHEDRON = trimesh.convex.convex_hull(3.0 * np.vstack([np.eye(3), -np.eye(3)]))


@pytest.mark.parametrize("depth", [1e-2, 1e-3, 2e-4, 1e-5])
@pytest.mark.parametrize("gap", [0.05, 1e-3, 0.0])
def test_a_hole_that_just_breaks_through_a_face(depth, gap):
    """A tip in front of the slot that the hole leaves in the face: the slot's edge is nearest, far from any chord."""
    plate = shapes.box((20.0, 20.0, 10.0), holes=[shapes.Hole(5.0 + depth, (5.0, 0.0))])
    half = math.sqrt((5.0 + depth) ** 2 - 5.0**2)
    # The tip's edges fall back at 45 degrees, so the slot's edge is nearest to the tip, or to one of its edges.
    truth = math.hypot(gap, half) if half <= gap else (gap + half) / math.sqrt(2.0)
    tip = mesh_shape(OCTAHEDRON)
    d = distance(plate, tip, translation(13.0 + gap, 0.0, 0.0))
    assert d.lower <= truth + 1e-9
    assert d.upper >= truth - 1e-9


@pytest.mark.parametrize("z", [-27.0, 0.0, 27.0])
def test_a_pin_anywhere_in_the_fitted_bore_of_a_long_tube(z):
    """The bore is as long as the tube, which is longer than it is wide."""
    tube = mesh_shape(trimesh.creation.annulus(3.0, 8.0, 60.0, sections=48), "round")
    assert distance(tube, shapes.cylinder(2.9, 4.0), translation(0.0, 0.0, z)).value == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("drop", [0.01, 0.5, 3.0])
def test_bar_in_a_v_of_a_mesh(drop):
    outline = [(-30, -25), (30, -25), (30, 20), (20, 20), (0, 0), (-20, 20), (-30, 20)]
    block = faceted_shape(shapes.extrusion(outline, 80.0), 1.0)
    T = translation(0.0, 5.0 * math.sqrt(2.0) - drop, 0.0) @ rotation([0, 0, 1], math.pi / 4)
    d = distance(block, shapes.box((10.0, 10.0, 20.0)), T)
    assert d.lower - 1e-9 <= -drop <= d.upper + 1e-9
    assert d.lower >= -1.2 * drop - 0.2
    assert d.direction == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.7])
def test_what_touches_within_its_errors_comes_free_along_a_unit_normal(turn):
    """A wire on the floor of a groove that is known as a mesh only: its facets are 0.05 mm off."""
    groove, wire = shapes.groove_block(SweptArc(7.0, 1.0, 30.0), 24.0, 12.0), shapes.cylinder(3.0, 18.0)
    block = replace(faceted_shape(groove, 0.05), error=0.05)
    T = translation(4.0 * math.sin(turn), -4.0 * math.cos(turn), 0.0)
    d = distance(block, wire, T)
    assert d.lower < 0.0 < d.upper
    assert np.linalg.norm(d.normal) == pytest.approx(1.0, abs=1e-12)
    assert distance(groove, wire, translation(*((1e-6 - d.lower) * d.normal)) @ T).lower > 0.0


@pytest.mark.parametrize("depth", [5e-7, 1e-8])
def test_what_lies_over_a_bore_that_just_opens_a_face_is_measured_to_its_rim(depth):
    """Along the face there is no material for 0.017 mm: a bar that is half as wide is apart by half of that."""
    cube = shapes.box((1000.0, 1000.0, 1000.0), holes=[shapes.Hole(300.0, (0.0, 200.0 + depth))])
    half = math.sqrt(300.0**2 - (300.0 - depth) ** 2)
    found = distance(cube, shapes.box((half, 10.0, 2000.0)), translation(0.0, 505.0, 0.0))
    assert found.lower <= 0.5 * half <= found.upper + 1e-6


def test_witnesses_lie_on_the_bodies_where_meshes_decide():
    """A coin of many corners on edge in a tube: no closed form, so the meshes have the last word."""
    tube, turn = shapes.cylinder(8.0, 10.0, bore=5.0), np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    coin = shapes.extrusion(1.5 * np.column_stack([np.cos(turn), np.sin(turn)]), 0.5)
    T = translation(3.0, 0.4, 0.3) @ rotation([1, 0.3, 0.2], 1.1)
    d = distance(tube, coin, T)
    assert "meshes" in d.method
    assert_distance(d, tube, coin, T, tolerance=1e-9)
    assert d.point_a + d.value * d.normal == pytest.approx(d.point_b, abs=1e-9)


@pytest.mark.parametrize(
    ("lower", "upper", "estimate", "said"),
    [
        (9.99, math.inf, None, "at least 9.99 mm"),
        (-3.0, math.inf, None, "at least -3 mm"),
        (-math.inf, -2.0, None, "at most -2 mm"),
        (-math.inf, math.inf, None, "no bounds known"),
        (-math.inf, math.inf, 0.5, "0.5 mm by the model, no bounds known"),
        (0.25, 0.5, None, "0.5 mm, uncertainty 2.5e-01"),
    ],
)
def test_what_is_known_from_one_side_alone_is_said_as_an_inequality(lower, upper, estimate, said):
    found = Distance(lower, upper, estimate=estimate, method="boxes")
    assert repr(found) == f"Distance({said}, 'boxes')"
    assert found.uncertainty == (0.25 if lower == 0.25 else math.inf)
    assert f"distance={found!r}" in repr(PairResult("a", "b", Verdict.CLEARANCE, found))


def test_two_answers_together_have_the_points_of_the_shorter_and_the_normal_that_proves_the_gap():
    x, y = np.eye(3)[:2]
    loose = Distance(-1.0, 0.0, x, x, normal=x)  # its points touch
    proven = Distance(-0.5, 0.25, y, y, normal=y)  # along its normal they overlap by half a millimetre at most
    for met in (loose.meet(proven), proven.meet(loose)):
        assert (met.lower, met.upper) == (-0.5, 0.0)
        assert met.point_a is x
        assert met.normal is y
    assert loose.meet(replace(proven, normal=None)).normal is x


def test_the_nearer_of_two_pieces_and_whether_it_is_the_only_one():
    p, q = np.eye(3)[:2]
    near, far = Distance(1.0, 1.0, p, p, unique=True, method="near"), Distance(2.0, 2.0, q, q, unique=True)
    for other, expected, unique in (
        (far, (1.0, 1.0), True),
        (replace(far, lower=0.5), (0.5, 1.0), None),  # the other may be nearer
        (replace(near, point_a=q, method="other"), (1.0, 1.0), False),
        (replace(near, point_a=p + 1e-9), (1.0, 1.0), True),  # one place
        (replace(near, point_a=p + 1e-9, upper=1.1), (1.0, 1.0), None),
        (replace(near, point_a=None), (1.0, 1.0), None),
    ):
        for found in (near.union(other), other.union(near)):
            assert ((found.lower, found.upper), found.unique) == (expected, unique)
            assert found.point_a is not q or other.upper == 1.0
    assert (near.widened(0.25).lower, near.widened(0.25).upper) == (0.75, 1.25)
    deep = Distance(-3.0, -1.0, p, q, p, estimate=-2.5)
    assert (deep.value, deep.depth, deep.uncertainty) == (-2.5, 2.5, 1.5)
    assert (replace(deep, estimate=None).depth, near.depth) == (1.0, 0.0)
    assert (replace(far, lower=-1.0).of_overlap().lower, near.of_overlap()) == (-math.inf, near)
    assert (deep.direction is p, near.direction) == (True, None)
