"""What the engine measures with: segments, rims, overlaps, boxes that touch, bounds; against hulls of points."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import trimesh

from clamp3d import distance, shapes
from clamp3d.collide.answer import Distance
from clamp3d.collide.broad import Boxes, box_gaps
from clamp3d.collide.convex import Rod
from clamp3d.collide.meshes import within
from clamp3d.collide.model import ModelCache
from clamp3d.collide.nearest import rim_minimum, segment_pairs, to_faces
from clamp3d.collide.open_mesh import _pierced
from clamp3d.collide.overlap import common, deepest, deepest_at_most
from clamp3d.collide.touching import is_box, touching_boxes
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.linear import to_target
from clamp3d.core.pose import inverse, rotation, translation
from clamp3d.core.profile import Arc, Profile
from clamp3d.testing import body
from tests.hulls import apart
from tests.kinds import BLOCK, DRAWN, TURNED, box_mesh, faceted_shape

HERE = np.eye(4)


# --- Segments, faces, rims --------------------------------------------------------------------------------------------


def test_nearest_points_of_segments_and_faces():
    rng = np.random.default_rng(0)
    for k in range(60):
        a, b = rng.normal(size=(rng.integers(1, 4), 2, 3)), rng.normal(size=(rng.integers(1, 4), 2, 3)) * 2.0
        if k % 4 == 0:  # parallel
            b = a[:1] + rng.normal(size=3)
        if k % 5 == 0:
            a[0, 1] = a[0, 0]
        d, p, q = segment_pairs(a, b)
        assert d == pytest.approx(min(apart(x, y) for x, y in itertools.product(a, b)), abs=1e-7)
        assert np.linalg.norm(p - q) == pytest.approx(d, abs=1e-12)
        assert min(apart(p[None], x) for x in a) <= 1e-7
        assert min(apart(q[None], x) for x in b) <= 1e-7
        points, triangles = rng.normal(size=(3, 3)), rng.normal(size=(4, 3, 3)) * 3.0
        d, p, q = to_faces(points, triangles)
        feet = trimesh.triangles.closest_point(np.tile(triangles, (3, 1, 1)), np.repeat(points, 4, axis=0))
        parts = trimesh.triangles.points_to_barycentric(np.tile(triangles, (3, 1, 1)), feet)
        far = np.linalg.norm(feet - np.repeat(points, 4, axis=0), axis=1)
        inside = parts.min(axis=1) > 1e-9
        if not inside.any():
            assert d == math.inf
            continue
        assert d == pytest.approx(far[inside].min(), abs=1e-12)
        assert np.linalg.norm(p - q) == pytest.approx(d, abs=1e-12)
        assert np.linalg.norm(points - p, axis=1).min() == 0.0


def test_long_segments_that_are_parallel_but_for_rounding():
    rng = np.random.default_rng(0)
    for _ in range(300):
        along, turn, aside = rng.normal(size=(3, 3))
        a = 3e4 * np.array([[-along, along]])
        b = 3e4 * np.array([[-along - 1e-9 * turn, along + 1e-9 * turn]]) + 1e5 * aside
        square = 1e10 * (aside @ aside - (aside @ along) ** 2 / (along @ along))
        d, p, q = segment_pairs(a, b)
        assert d == pytest.approx(np.linalg.norm(p - q))
        if abs(1e5 * aside @ along) < 5e4 * (along @ along):
            assert d == pytest.approx(math.sqrt(square), abs=1e-3)


def test_the_point_of_a_rim_nearest_to_a_body():
    rng = np.random.default_rng(1)
    turn = np.linspace(0.0, 2.0 * math.pi, 20_001)
    for _ in range(20):
        T = TURNED @ rotation(rng.normal(size=3), 1.0)
        T[:3, 3] += 4.0 * rng.normal(size=3)
        rod = Rod(1.0, 3.0, HERE)
        found = rim_minimum(rod.closest, T, 2.0)
        rim = T[:3, 3] + 2.0 * (np.outer(np.cos(turn), T[:3, 0]) + np.outer(np.sin(turn), T[:3, 1]))
        truth = np.linalg.norm(rim - rod.closest(rim), axis=1)
        if truth.min() < 1e-3:
            continue
        p, q = found
        assert np.linalg.norm(p - q) == pytest.approx(truth.min(), abs=1e-6)
        assert np.linalg.norm(p - T[:3, 3]) == pytest.approx(2.0, abs=1e-12)
        assert abs((p - T[:3, 3]) @ T[:3, 2]) < 1e-12
    assert rim_minimum(Rod(9.0, 9.0, HERE).closest, HERE, 2.0) is None


def test_rims_beside_polyhedra_are_known_sharply():
    nut = shapes.Solid("nut", (Extrusion(Profile.hexagon(10.0), "Z", -3.0, 3.0),))
    rng = np.random.default_rng(0)
    for _ in range(25):
        T = rotation(rng.normal(size=3), rng.uniform(0.3, 1.5))
        T[:3, 3] = rng.normal(size=3)
        T[:3, 3] *= rng.uniform(14.0, 18.0) / np.linalg.norm(T[:3, 3])
        found = distance(nut, shapes.cylinder(3.0, 8.0), T)
        assert found.upper - found.lower <= 5e-7


# --- Overlaps ---------------------------------------------------------------------------------------------------------


def test_the_deepest_point_of_an_overlap():
    """Boxes turned in each other: no sample of the common part is deeper than the limit, one is as deep as found."""
    rng = np.random.default_rng(3)
    for _ in range(6):
        a, b = box_mesh((6.0, 5.0, 4.0)), box_mesh((5.0, 4.0, 6.0))
        T = rotation(rng.normal(size=3), 1.0)
        T[:3, 3] = rng.normal(size=3) * 1.5 + (2.0, 0.0, 0.0)
        shared = common(a, b, T)
        x = rng.uniform(*shared.box, (20_000, 3))
        own = 0.5 * np.array([6.0, 5.0, 4.0]) - np.abs(x)
        other = 0.5 * np.array([5.0, 4.0, 6.0]) - np.abs(to_target(inverse(T), x))
        both = (own.min(axis=1) > 0.0) & (other.min(axis=1) > 0.0)
        truth = np.maximum(own.min(axis=1), other.min(axis=1))[both].max()
        depth, at = deepest(a, b, T, shared)
        assert depth <= deepest_at_most(a, b, T, shared, depth) + 1e-9
        assert truth <= deepest_at_most(a, b, T, shared, depth) + 1e-9
        assert deepest_at_most(a, b, T, shared, depth) <= 1.1 * truth + 0.3
        here = max(
            (0.5 * np.array([6.0, 5.0, 4.0]) - np.abs(at)).min(),
            (0.5 * np.array([5.0, 4.0, 6.0]) - np.abs(to_target(inverse(T), at))).min(),
        )
        assert depth <= here + 1e-9
        assert shared.volume == pytest.approx(both.mean() * np.prod(np.ptp(shared.box, axis=0)), rel=0.1)
        assert np.linalg.norm(shared.directions(), axis=1) == pytest.approx(1.0)
        off = deepest(box_mesh((6.0, 5.0, 4.0), 0.2), box_mesh((5.0, 4.0, 6.0), 0.1), T, shared)[0]
        assert off <= depth - 0.1 + 1e-9 or off <= depth - 0.3 + 1e-9
    assert common(box_mesh((1, 1, 1)), box_mesh((1, 1, 1)), translation(3.0, 0.0, 0.0)) is None


@pytest.mark.parametrize("kind", [0, 1])
def test_what_lies_within_another(kind):
    """A box or a rod in a box, by how far it stands out; the slack is all that it may."""
    large = shapes.box((20.0, 20.0, 20.0))
    small = (shapes.box((4.0, 4.0, 4.0)), shapes.cylinder(2.0, 4.0))[kind]
    cache = ModelCache()
    for large_, small_ in ((large, small), (faceted_shape(large, 0.02), faceted_shape(small, 0.02))):
        a, b = cache.model(large_), cache.model(small_)
        for out in (-5.0, -0.1, 0.0, 0.3, 2.0, 9.0):
            for slack in (0.0, 0.5):
                assert within(b, a, translation(8.0 + out, 0.0, 0.0), 0.016, slack) == (out <= slack)
        assert not within(a, b, HERE, 0.016, 0.0)


# --- Boxes that touch, crossings, bounds ------------------------------------------------------------------------------


def test_boxes_that_touch():
    cache, unit = ModelCache(), np.array([[[-1.0] * 3, [1.0] * 3]])
    assert [is_box(cache.model(x)) for x in (shapes.box((2, 3, 4)), *DRAWN[3:6], BLOCK)] == [
        True,
        False,
        False,
        True,
        False,
    ]
    assert not is_box(cache.model(shapes.box((9, 9, 9), holes=[shapes.Hole(1.0)])))
    trapezium = shapes.Solid("t", (Extrusion(Profile.of((0, 0), (4, 0), (3, 2), (1, 2)), "Z", 0.0, 1.0),))
    assert not is_box(cache.model(trapezium))
    for P in (HERE, TURNED):
        places = [
            HERE,
            translation(2.0, 0.5, 0.0),
            translation(0.0, 2.0, 2.0),
            translation(2.1, 0.0, 0.0),
            translation(1.9, 0, 0),
        ]
        boxes = Boxes.of(np.repeat(unit, 5, axis=0), np.array([P @ T for T in places]))
        pairs = np.array([(0, k) for k in range(1, 5)])
        found = touching_boxes(boxes, np.ones(5, dtype=bool), pairs, box_gaps(boxes, pairs))
        assert sorted(found) == [0, 1]
        for row, d in found.items():
            for point, k in ((d.point_a, 0), (d.point_b, row + 1)):
                assert np.abs(to_target(inverse(P @ places[k]), point)).max() <= 1.0 + 1e-12
            assert d.lower <= 0.0 <= d.upper <= 1e-9
        assert touching_boxes(
            boxes, np.array([True, False, True, True, True]), pairs, box_gaps(boxes, pairs)
        ).keys() == {1}


def test_a_segment_that_pierces_a_triangle_still_does_after_a_short_move():
    rng = np.random.default_rng(4)
    seen = 0
    for _ in range(300):
        start, end, V = rng.normal(size=3), rng.normal(size=3), 2.0 * rng.normal(size=(3, 3))
        (margin,), (at,) = _pierced(start[None], end[None], V[None])
        parts = np.linalg.lstsq(np.column_stack([V[1] - V[0], V[2] - V[0], start - end]), start - V[0], rcond=None)[0]
        truly = parts[0] > 0 and parts[1] > 0 and parts[0] + parts[1] < 1 and 0 < parts[2] < 1
        assert (margin > 1e-12) == truly or margin < 1e-6
        if margin > 0.0:
            seen += 1
            assert at == pytest.approx(start + parts[2] * (end - start), abs=1e-9)
            for n in rng.normal(size=(30, 3)):
                moved = 0.999 * margin * n / np.linalg.norm(n)
                assert apart(np.array([start, end]) + moved, V) <= 1e-6
    assert seen > 15


def test_what_two_bounds_say_together():
    p, q, n = np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    wide, low = Distance(0.0, 3.0, p, q, None, None, "a", "a"), Distance(1.0, 5.0, None, None, n, None, "b", "b")
    both = wide.meet(low)
    assert (both.lower, both.upper, both.point_b is q, both.normal is n, both.method) == (1.0, 3.0, True, True, "b")
    assert (low.meet(wide).lower, low.meet(wide).upper) == (1.0, 3.0)
    assert wide.meet(Distance(-1.0, 4.0, normal=n)).normal is n
    near = Distance(1.0, 2.0, p, q, n, True)
    assert near.meet(Distance()) is near
    assert (near.union(wide).lower, near.union(wide).upper, near.union(wide).unique) == (0.0, 2.0, None)
    assert near.union(Distance(7.0, 9.0)).unique is True
    assert near.union(Distance(2.0, 2.0, p + 1.0, q + 1.0)).unique is False
    assert near.union(Distance(2.0, 2.0, p, q)).unique is True
    assert (near.widened(0.5).lower, near.widened(0.5).upper) == (0.5, 2.5)
    assert Distance(2.0, 1.0).ordered().lower == 1.0
    assert (near.value, near.uncertainty, near.depth, near.direction) == (2.0, 1.0, 0.0, None)
    deep = Distance(-2.0, -1.5, p, q, n)
    assert (deep.depth, deep.uncertainty, deep.direction is n) == (1.5, 0.5, True)
    assert deep.of_overlap().lower == -math.inf
    assert near.of_overlap().lower == 1.0
    assert deep.to_dict()["depth_mm"] == 1.5
    model = Distance(1.0, 3.0, estimate=1.5)
    assert (model.value, model.uncertainty) == (1.5, 1.5)


SLOT = Extrusion(Profile.of((-2.0, -1.0), (2.0, -1.0), (2.0, 1.5), (-2.0, 1.5)), "Z", -30.0, 30.0)
HALF_ROUND = Profile.of((-4.0, 0.0), (-4.0, -6.0), (4.0, -6.0), (4.0, 0.0), Arc((0.0, 0.0), 4.0, 0.0, math.pi))
MORE = [
    shapes.Solid("slotted plate", (Extrusion(Profile.rectangle(12.0, 9.0), "Z", -2.0, 2.0),), (SLOT,)),
    shapes.Solid("slotted rod", (Extrusion(Profile.circle(5.0), "Z", -3.0, 3.0),), (SLOT,)),
    shapes.Solid("round back", (Extrusion(HALF_ROUND, "Y", -3.0, 5.0),)),
]


@pytest.mark.parametrize("shape", [*DRAWN, *MORE], ids=lambda shape: shape.name)
def test_the_closed_forms_of_a_drawn_solid_are_the_solid(shape):
    """Every point of one is a point of the other, and the boxes around the forms hold them."""
    forms, solid = ModelCache().model(shape).bodies, body(shape)
    x = np.random.default_rng(5).uniform(solid.box[0] - 1.0, solid.box[1] + 1.0, (20_000, 3))
    field, depth = solid.field(x), np.max([one.depth(x) for one in forms], axis=0)
    clear = np.abs(depth) > 1e-9
    if len(forms) > 1:  # on the seams of pieces both are at their borders
        clear &= np.abs(field) > 1e-2
    assert ((depth > 0.0) == (field < 0.0))[clear].all()
    for one in forms:
        inside = x[one.depth(x) > 0.0]
        assert (inside >= one.bounds[0] - 1e-9).all()
        assert (inside <= one.bounds[1] + 1e-9).all()


def test_how_far_a_distance_is_from_the_thresholds_and_which_lie_between_bounds():
    plain, wide = Thresholds(0.01), Thresholds(0.01, 0.5)
    for x, expected, without in ((0.4, 0.1, 0.39), (0.002, 0.008, 0.008), (-0.3, 0.29, 0.29), (0.7, 0.2, 0.69)):
        assert wide.margin(x) == pytest.approx(expected, abs=1e-12)
        assert plain.margin(x) == pytest.approx(without, abs=1e-12)
    assert (plain.reach, wide.reach) == (0.01, 0.5)
    assert wide.between(Distance(-0.2, 0.6), 0.1) == [
        "a gap of 0.01 mm (contact)",
        "a gap of 0.5 mm (clearance)",
        "an overlap of 0.1 mm (allowed)",
    ]
    assert plain.between(Distance(-0.2, 0.005)) == ["an overlap of 0.01 mm (contact)"]
    assert plain.between(Distance(-0.005, 0.6), 0.001) == ["a gap of 0.01 mm (contact)"]
    assert plain.between(Distance(-0.02, -0.005), 0.001) == ["an overlap of 0.01 mm (allowed)"]
