"""FCL against closed forms: distances and normals of boxes and wires, containment, and what must be refused."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from clamp3d import Cylinder, InputError
from clamp3d.baselines.fcl_shapes import Wire, bvh, contained, convex, distance, facets, measure
from clamp3d.baselines.wedges import prism
from clamp3d.kernel import rotation, translation

V = prism(np.array([[-20.0, -10.0], [20.0, -10.0], [20.0, 10.0], [-20.0, 10.0]]), -25.0, 25.0)
BOX, MESH = convex(V), bvh(trimesh.convex.convex_hull(V))


def placed(radius, length, T):
    wire = Wire(Cylinder(radius, length))
    wire.place(T)
    return wire


def _box_distance(x, y, r):
    """Signed distance of a long wire along z at (x, y) from the section 40 x 20."""
    a, b = abs(x) - 20.0, abs(y) - 10.0
    return (math.hypot(max(a, 0.0), max(b, 0.0)) if max(a, b) > 0.0 else max(a, b)) - r


def assert_touches_when_moved(shape, wire, normal, d):
    """Moving the wire by -distance along the normal makes the two just touch."""
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
    before = wire.T
    wire.place(translation(*(-d * normal)) @ before)
    assert distance(shape, wire) == pytest.approx(0.0, abs=6e-6 + 1e-5 * abs(d))
    wire.place(before)


@settings(max_examples=60, deadline=None)
@given(
    x=st.floats(-40.0, 40.0), y=st.floats(-30.0, 30.0), r=st.floats(0.5, 30.0), length=st.floats(1.0, 300.0),
    turn=st.floats(-3.0, 3.0), axis=st.tuples(*[st.floats(0.1, 1.0)] * 3),
)  # fmt: skip
def test_parallel_wire_and_box(x, y, r, length, turn, axis):
    exact = _box_distance(x, y, r)
    assume(exact > -0.39 * min(r, length / 2))  # beyond, the depth is a bound
    assume(exact > -0.4 * min(length, 50.0))  # the way out along the axis must be longer
    move = translation(50.0, -30.0, 7.0) @ rotation(axis, turn)
    shape = convex(V @ move[:3, :3].T + move[:3, 3])
    wire = placed(r, length, move @ translation(x, y, 0.0))
    found = measure(shape, wire)
    assert found.distance == pytest.approx(exact, abs=3e-6 + 1e-5 * abs(exact))  # FCL stops by relative progress
    assert found.distance > exact - 1e-9  # FCL errs on the far side
    assert distance(shape, wire) == pytest.approx(found.distance, abs=1e-12)
    assert_touches_when_moved(shape, wire, found.normal, found.distance)


@pytest.mark.parametrize("gap", [1.0, 1e-2, 1e-4, 1e-6, 1e-9, 0.0, -1e-9, -1e-6, -1e-4, -1e-2, -1.0])
def test_normal_is_right_however_small_the_gap(gap):
    for turn in np.linspace(0.0, 6.0, 7):
        T = translation(3.0, 17.0 + gap, 1.0) @ rotation([0.0, 0.0, 1.0], turn)
        found = measure(BOX, placed(7.0, 200.0, T))
        assert found.distance == pytest.approx(gap, abs=1e-8)
        assert np.abs(found.normal - [0.0, 1.0, 0.0]).max() < 1e-3
        assert np.abs(found.point[1] - 10.0) < 1e-6


@pytest.mark.parametrize("gap", [1.0, 1e-2])
def test_normal_at_a_rim_is_the_way_to_the_part(gap):
    T = translation(0.0, 10.0 + gap + (10.0 + 7.0) * math.sqrt(0.5), 0.0) @ rotation([1.0, 0.0, 0.0], math.pi / 4)
    found = measure(BOX, placed(7.0, 20.0, T))
    assert found.distance == pytest.approx(gap, abs=1e-6)
    assert np.abs(found.normal - [0.0, 1.0, 0.0]).max() < 1e-3


def test_touching_poses_neither_end_nor_hang_the_interpreter():
    # FCL's own signed distance aborts on some of these.
    rng = np.random.default_rng(0)
    for _ in range(200):
        r, length = rng.uniform(0.5, 30.0), rng.uniform(1.0, 300.0)
        off = rng.choice([0.0, 1e-14, 1e-12, 1e-9, 1e-6]) * rng.uniform(-1.0, 1.0)
        T = translation(rng.uniform(-18, 18), 10.0 + r + off, 1.0) @ rotation([0, 0, 1], rng.uniform(-3, 3))
        assert abs(measure(BOX, placed(r, length, T)).distance - off) < 3e-6


@settings(max_examples=40, deadline=None)
@given(x=st.floats(-40.0, 40.0), y=st.floats(-30.0, 30.0), r=st.floats(0.5, 12.0))
@example(1.0, 9.625, 0.5)
def test_mesh_knows_apart_from_crossing(x, y, r):
    exact = _box_distance(x, y, r)
    assume(abs(exact) > 1e-6)
    wire = placed(r, 200.0, translation(x, y, 0.0))
    found = measure(MESH, wire)
    assert (found.distance > 0.0) == (exact > 0.0)
    if exact > 0.0:
        assert found.distance == pytest.approx(exact, abs=3e-6)
        assert_touches_when_moved(MESH, wire, found.normal, found.distance)
    single = [measure(facet, wire).distance for facet in facets(MESH)]
    assert len(single) == 6
    if exact > -0.39 * r:  # beyond, the depth is a bound, and FCL's contact of a triangle is another one's
        assert min(single) == pytest.approx(found.distance, abs=1e-6)


def test_wire_inside_the_wall_is_contained():
    found = measure(MESH, placed(2.0, 10.0, translation(11.0, 3.0, 5.0)))
    assert found.distance == pytest.approx(-(5.0 + 4.0), abs=1e-6)  # 5 mm under the top, 4 mm thick
    assert found.normal == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)
    pipe = trimesh.creation.annulus(r_min=20.0, r_max=40.0, height=100.0)
    shape = bvh(pipe)
    for x, inside in ((0.0, False), (30.0, True), (300.0, False)):  # in the hollow, in the wall, beside
        wire = placed(2.0, 10.0, translation(x, 0.0, 0.0))
        assert contained(shape, wire) == inside == (measure(shape, wire).distance < 0.0)


def test_sizes_that_fcl_does_not_measure_well_are_refused():
    for factor in (1e-3, 1e4):  # metres, or far too large
        with pytest.raises(InputError, match=r"largest extent must be from 0\.1 to 10000 mm for FCL"):
            convex(V * factor)
    with pytest.raises(InputError, match=r"cylinder radius must be from 0\.1 to 10000 mm"):
        Wire(Cylinder(0.0105, 0.2))
