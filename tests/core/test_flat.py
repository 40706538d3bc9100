"""Flat-ended cylinders: the kernel against branch and bound from the definition, Open CASCADE, and its own promises."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d.bench.stress.poses.flat_truth import flat_truth
from clamp3d.core import kernel_edges, kernel_flat
from clamp3d.core.distance import Feature, signed_distance, signed_distances
from clamp3d.core.pose import rotation, translation
from clamp3d.core.primitives import Capsule, Cylinder, SweptArc
from tests.core.oracle import make_oracle


def random_scene(rng):
    """A groove, a cylinder and a pose of any proportions; leans from none to square."""
    R = 10 ** rng.uniform(0, 1.5)
    half_angle = rng.uniform(0.1, 3.1) if rng.random() < 0.5 else rng.uniform(0.2, 1.57)
    groove = SweptArc(R, half_angle, R * 10 ** rng.uniform(-1, 1))
    wire = Cylinder(R * 10 ** rng.uniform(-1, 0.3), R * 10 ** rng.uniform(-1.3, 1))
    T = rotation(rng.normal(size=3), rng.choice([0, 1e-9, 1e-4, 0.02, 0.3, 1.0, 3.0]))
    if rng.random() < 0.2:
        T = rotation((rng.normal(), rng.normal(), 0), math.pi / 2)
    T[:3, 3] = rng.normal(size=3) * [R, R, (groove.length + wire.length) / 3]
    return groove, wire, T


def test_agrees_with_branch_and_bound_from_the_definition():
    rng = np.random.default_rng(7)
    seen, narrow = set(), 0
    for _ in range(800):
        groove, wire, T = random_scene(rng)
        R = groove.radius
        low, high = flat_truth(R, groove.half_angle, groove.length, wire.radius, wire.length, T, 1e-9 * R, 10_000)
        found = signed_distance(groove, wire, T)
        narrow += high - low < 1e-7 * R
        seen.add((found.feature, found.distance < 0.0))
        if found.axis_inside:  # nothing is left of the cylinder
            assert low <= -min(wire.radius, 0.5 * wire.length) + 1e-12 * R
        else:
            slack = found.error_bound + 1e-13 * R
            assert low - slack <= found.distance <= high + slack, (groove, wire, T.tolist())
            assert found.error_bound < 1e-12 * (np.abs(T[:3, 3]).max() + R + wire.radius + groove.length + wire.length)
    assert len(seen) == 2 * len(Feature)
    assert narrow > 260


def in_material(groove, points, slack):
    return make_oracle.point_distance(points, groove.radius, groove.half_angle, groove.length / 2) <= slack


def depth_in(wire, T, points):
    """How deep points (k, 3) lie in a flat-ended cylinder, negative outside it (not the distance there)."""
    m = (points - T[:3, 3]) @ T[:3, :3]
    return np.minimum(wire.radius - np.hypot(m[:, 0], m[:, 1]), 0.5 * wire.length - np.abs(m[:, 2]))


def test_witnesses_lie_on_both_bodies_and_the_normal_is_unit():
    rng = np.random.default_rng(8)
    for _ in range(3000):
        groove, wire, T = random_scene(rng)
        a = signed_distance(groove, wire, T)
        tol = 1e-11 * max(groove.radius, groove.length, wire.length, np.abs(T[:3, 3]).max())
        q, p = a.point_on_groove, a.point_on_cylinder
        assert abs(np.linalg.norm(a.normal) - 1.0) < 1e-12
        assert np.abs(q + a.distance * a.normal - p).max() <= tol
        on_groove = abs(make_oracle.point_distance(q[None], groove.radius, groove.half_angle, groove.length / 2)[0])
        if not a.axis_inside:
            assert on_groove <= tol or a.distance <= -0.5 * wire.length + tol  # a point within counts
            assert abs(depth_in(wire, T, p[None])[0]) <= tol, (groove, wire, T.tolist())
            if a.distance < 0.0:
                assert abs(depth_in(wire, T, q[None])[0] + a.distance) <= tol


def test_shrunk_by_the_inset_it_is_free_and_just_so():
    rng = np.random.default_rng(9)
    tried = 0
    for _ in range(3000):
        groove, wire, T = random_scene(rng)
        a = signed_distance(groove, wire, T)
        if not -0.99 * min(wire.radius, 0.5 * wire.length) < a.distance < -1e-3 * wire.radius:
            continue
        tried += 1
        for off, sign in ((1e-6, 1.0), (-1e-6, -1.0)):
            inset = -a.distance + off * wire.radius
            less = Cylinder(wire.radius - inset, wire.length - 2.0 * inset)
            rest = signed_distance(groove, less, T).distance * sign
            # It grows at a rate from 1 to the root of 2 outside, and at 1 inside.
            assert 0.99e-6 * wire.radius <= rest <= 1.42e-6 * wire.radius
    assert tried > 300


def test_capsule_is_never_farther_and_equal_where_the_normal_is_square_to_the_axis():
    rng = np.random.default_rng(10)
    equal = 0
    for _ in range(3000):
        groove, wire, T = random_scene(rng)
        flat, round_ = (signed_distance(groove, shape(wire.radius, wire.length), T) for shape in (Cylinder, Capsule))
        assert round_.distance <= flat.distance + flat.error_bound
        if round_.distance >= 0.0 and abs(round_.normal @ T[:3, 2]) < 1e-15:
            equal += 1
            assert abs(flat.distance - round_.distance) <= flat.error_bound
    assert equal > 500


def test_continuous_and_no_faster_than_its_points_move():
    rng = np.random.default_rng(11)
    for _ in range(150):
        groove, wire, T = random_scene(rng)
        v, w = rng.normal(size=3), rng.normal(size=3) / groove.radius
        step = 1e-3 * groove.radius
        last = None
        for k in range(60):
            M = rotation(w, k * step * np.linalg.norm(w))
            M[:3, 3] += k * step * v
            P = T.copy()
            P[:3, :3] = M[:3, :3] @ T[:3, :3]
            P[:3, 3] = T[:3, 3] + M[:3, 3]
            d = signed_distance(groove, wire, P).distance
            reach = math.hypot(wire.radius, 0.5 * wire.length)
            if last is not None:
                assert abs(d - last) <= 1.0001 * step * (np.linalg.norm(v) + np.linalg.norm(w) * reach)
            last = d


def test_batch_has_the_bits_of_single():
    rng = np.random.default_rng(0)
    for wire in (Cylinder(10.5, 80.0), Cylinder(10.5, 4.0)):
        groove = SweptArc(12.0, 1.2, 50.0)
        poses = np.array([rotation(rng.normal(size=3), rng.choice([0.0, 1e-9, 0.1, 1.0])) for _ in range(4000)])
        poses[:, :3, 3] = rng.normal(size=(len(poses), 3)) * [8.0, 8.0, 30.0]
        full = signed_distances(groove, wire, poses, full=True)
        assert np.array_equal(full.distance, signed_distances(groove, wire, poses))
        for i in range(0, len(poses), 97):
            one = signed_distance(groove, wire, poses[i])
            for name in ("distance", "feature", "axis_inside", "error_bound", "along", "gradient", "normal"):
                assert np.array_equal(getattr(one, name), getattr(full, name)[i]), name


@pytest.mark.parametrize(
    ("T", "wanted", "feature"),
    [
        (translation(0.0, -3.0, 73.0), 3.0, Feature.END_ARC),  # the end before the end face
        (translation(0.0, -3.0, 67.0), -1.5, Feature.ARC),  # in the groove, too low by the rest of the radius
        (translation(0.0, -40.0, 70.5), 0.5, Feature.END_FACE),
        (translation(0.0, -40.0, 69.0), -1.0, Feature.END_FACE),
    ],
)
def test_ends_before_an_end_face(T, wanted, feature):
    found = signed_distance(SweptArc(12.0, math.radians(70.0), 60.0), Cylinder(10.5, 80.0), T)
    assert found.distance == pytest.approx(wanted, abs=1e-13)
    assert found.feature is feature


@pytest.mark.parametrize("feature", list(Feature))
def test_normals_and_rates_at_points_of_every_feature(feature):
    """Outside from the point to the cylinder; inside to its side or end, and where both are as near between the two."""
    rng, s, h = np.random.default_rng(int(feature)), 12.0 * math.sin(1.2), -12.0 * math.cos(1.2)
    tied = 0
    for k in range(300):
        q, r, l = rng.normal(size=3) * 12.0, 3.0, 5.0  # noqa: E741
        if feature == Feature.ARC:
            q[:2] *= 12.0 / np.hypot(*q[:2])
        d = np.eye(3)[k % 3] if k % 2 else rng.normal(size=3)
        d /= np.linalg.norm(d)
        across = np.cross(d, rng.normal(size=3) if k % 5 else np.roll(np.eye(3)[k % 3], 1))
        across /= np.linalg.norm(across)
        e, g = rng.choice([-1.0, 0.5, -4.0]), rng.choice([-1.0, 0.5, -0.25])
        if k % 3 == 0:
            e = g = -1.0
        at = rng.choice([-1.0, 1.0]) * (l + e)
        c = q - at * d - (r + g) * across
        f = math.hypot(max(g, 0.0), max(e, 0.0)) or max(g, e)
        *found, t = kernel_flat.witness(f, *q, int(feature), 12.0, s, h, r, l, *c, *d, 1e-14)
        normal, rate = np.array(found[:3]), np.array(found[3:])
        assert t == pytest.approx(at, abs=1e-12)
        end, side = -math.copysign(1.0, at) * d, -across
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        if f > 0.0:
            assert normal == pytest.approx((max(g, 0.0) * side + max(e, 0.0) * end) / f, abs=1e-12)
            assert (rate == normal).all()
        elif g != e:
            assert normal == pytest.approx(side if g > e else end, abs=1e-12)
            assert (rate == normal).all()
        else:
            tied += 1
            share = float((rate - end) @ (side - end)) / 2.0
            assert -1e-12 <= share <= 1.0 + 1e-12
            assert rate == pytest.approx(share * side + (1.0 - share) * end, abs=1e-12)
            assert min(np.abs(normal - side).max(), np.abs(normal - end).max()) <= 1e-12
    assert tied > 50


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0, 2]))
def test_mirror_images(seed, axis):
    groove, wire, T = random_scene(np.random.default_rng(seed))
    mirror = np.eye(4)
    mirror[axis, axis] = -1.0
    a, b = signed_distance(groove, wire, T), signed_distance(groove, wire, mirror @ T @ mirror)
    assert abs(a.distance - b.distance) <= a.error_bound + b.error_bound


def test_open_cascade_measures_the_same_outside():
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    groove = SweptArc(12.0, math.radians(70.0), 60.0)
    block = open_cascade_block(groove)
    rng = np.random.default_rng(12)
    compared = features = 0
    for _ in range(400):
        wire = Cylinder(rng.uniform(1.0, 11.0), rng.uniform(2.0, 60.0))
        T = rotation(rng.normal(size=3), rng.choice([0.0, 0.05, 1.0, 2.0]))
        T[:3, 3] = rng.normal(size=3) * [9.0, 9.0, 45.0]
        found = signed_distance(groove, wire, T)
        if not 1e-3 < found.distance < 30.0:
            continue
        foot = T[:3, 3] - 0.5 * wire.length * T[:3, 2]
        solid = BRepPrimAPI_MakeCylinder(
            gp_Ax2(gp_Pnt(*foot.tolist()), gp_Dir(*T[:3, 2].tolist())), wire.radius, wire.length
        ).Shape()
        asked = BRepExtrema_DistShapeShape(block, solid)
        compared += 1
        features |= 1 << found.feature
        # Open CASCADE's own answers are distances of points of the two, so never too small; some are local minima.
        assert found.distance <= asked.Value() + 1e-7
        assert found.distance >= asked.Value() - 1e-6 or asked.Value() > found.distance + 1e-3
    assert compared > 150
    assert features.bit_count() >= 8


def open_cascade_block(groove):
    """A block with the groove as a solid of Open CASCADE, in the groove's frame, 400 mm wide and deep."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    h, H = -groove.radius * math.cos(groove.half_angle), 0.5 * groove.length
    box = BRepPrimAPI_MakeBox(gp_Pnt(-200.0, -200.0, -H), gp_Pnt(200.0, h, H)).Shape()
    tool = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, -H - 1), gp_Dir(0, 0, 1)), groove.radius, 2 * H + 2).Shape()
    return BRepAlgoAPI_Cut(box, tool).Shape()


def test_points_of_an_end_arc_that_are_as_near_are_all_found():
    """A cylinder across the groove's middle, in front of its end: on both sides of the arc alike."""
    found, work = np.empty((8, 1)), np.empty((200, 2))
    wire = (1.0, 5.0, 0.0, -2.0, 27.0, 1.0, 0.0, 0.0)
    count, left = kernel_edges.on_arc(25.0, 12.0, 1.2, *wire, math.inf, 1e-9, 1e-12, work, found)
    angle = np.linspace(-1.2, 1.2, 200_001)
    beside, beyond = np.hypot(12.0 * np.cos(angle) - 2.0, 2.0) - 1.0, np.abs(12.0 * np.sin(angle)) - 5.0
    gap = np.hypot(np.maximum(beside, 0.0), np.maximum(beyond, 0.0))
    least = np.abs(angle[gap <= gap.min() + 1e-8])
    assert count == 2
    assert np.allclose(sorted(found[:2, 0]), [-least.mean(), least.mean()], rtol=0, atol=1e-4)
    assert left >= gap.min() - 1e-9
