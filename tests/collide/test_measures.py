"""What the engine measures with: segments, facets, overlaps, meshes with errors; against hulls of points and boxes."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import trimesh
from scipy.optimize import nnls

from clamp3d import distance, shapes
from clamp3d.collide.answer import Distance
from clamp3d.collide.body import ClosedForm
from clamp3d.collide.broad import Boxes, box_gaps
from clamp3d.collide.convex import Hull, Rod, hull
from clamp3d.collide.facets import axis_gap, hull_gap, rod_distance
from clamp3d.collide.meshes import any_inside, gap, nearest_of, surface_distance, within
from clamp3d.collide.model import ModelCache
from clamp3d.collide.nearest import rim_minimum, segment_pairs, to_faces
from clamp3d.collide.open_mesh import _pierced
from clamp3d.collide.overlap import common, deepest, deepest_at_most
from clamp3d.collide.surface import Surface
from clamp3d.collide.touching import is_box, touching_boxes
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.linear import to_target
from clamp3d.core.pose import inverse, rotation, translation
from clamp3d.core.profile import Arc, Profile
from clamp3d.testing import body
from tests.kinds import BLOCK, DRAWN, faceted_shape

HERE = np.eye(4)
TURNED = translation(1.0, -2.0, 0.5) @ rotation((1.0, 2.0, 3.0), 0.7)


def apart(one, other):
    """Distance of the convex hulls of two sets of points (Lawson and Hanson 1974, chapter 23)."""
    ends = (one[:, None] - other[None]).reshape(-1, 3).T
    weights, _ = nnls(np.vstack([ends, np.ones(ends.shape[1])]), np.array([0.0, 0.0, 0.0, 1.0]))
    return float(np.linalg.norm(ends @ weights) / weights.sum())


def box_mesh(size, error=None, point_error=None):
    made = trimesh.creation.box(size)
    errors = [None if e is None else np.full(12, e) for e in (error, point_error)]
    return Surface(np.array(made.vertices), np.array(made.faces), *errors)


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


# --- Meshes with errors -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "other"), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.4), (0.3, 0.4)])
def test_both_errors_count_once_on_either_side(off, other):
    """Boxes 5 mm apart, face to face, in frames that nothing is square to: the gap less, or more, both errors."""
    a, b = box_mesh((10.0, 10.0, 10.0), off), box_mesh((4.0, 4.0, 4.0), other)
    for T in (translation(12.0, 0.0, 0.0), translation(0.0, -12.0, 1.0), translation(0.5, 0.0, 12.0)):
        for x, y, P in ((a, b, T), (b, a, inverse(T))):
            found = surface_distance(x, y, P)
            assert found.lower == pytest.approx(5.0 - off - other, abs=1e-9)
            assert found.upper == pytest.approx(5.0 + off + other, abs=1e-9)
            assert gap(x, y, P) == pytest.approx(5.0 - off - other, abs=1e-9)
            least, best, p, q = nearest_of(x, y, P)
            assert (least, best) == pytest.approx((5.0 - off - other, 5.0), abs=1e-9)
            assert np.linalg.norm(p - q) == pytest.approx(5.0, abs=1e-9)
    assert gap(a, b, translation(6.5, 0.0, 0.0)) == -math.inf
    assert gap(a, b, HERE) == gap(b, a, HERE) == -math.inf
    assert nearest_of(a, b, translation(6.5, 0.0, 0.0))[:2] == (-math.inf, 0.0)
    inside = surface_distance(a, b, translation(1.0, 0.0, 0.0))
    assert -7.0 + off + other - 1e-9 <= inside.upper <= -2.0 + off + other + 1e-9
    assert inside.lower == -math.inf
    deep = surface_distance(a, b, translation(6.0, 0.0, 0.0))  # to 1 mm: the corners of the smaller one lie in it
    assert deep.upper == pytest.approx(-1.0 + off + other, abs=1e-6)
    assert deep.lower == pytest.approx(-1.0 - off - other, abs=1e-6) or deep.lower == -math.inf


def test_errors_of_single_faces():
    """The face that is off counts where it is near, and not where others are."""
    made = trimesh.creation.box((10.0, 10.0, 10.0))
    right = made.face_normals[:, 0] > 0.5
    mesh = Surface(np.array(made.vertices), np.array(made.faces), np.where(right, 0.2, 0.0))
    x = np.array([[8.0, 0.0, 0.0], [-8.0, 0.0, 0.0], [0.0, 0.0, 1.0], [4.0, 0.0, 0.0]])
    assert mesh.distance_at_least(x) == pytest.approx([2.8, 3.0, 4.0, 0.8], abs=1e-12)
    on = np.array([[5.0, 1.0, 1.0], [-5.0, 1.0, 1.0], [4.9, 5.0, 0.0], [0.0, 5.0, 0.0]])
    assert mesh.error_at(on) == pytest.approx([0.2, 0.0, 0.2, 0.0], abs=1e-12)
    assert mesh.error == 0.2
    assert box_mesh((1.0, 1.0, 1.0)).error_at(on).tolist() == [0.0] * 4
    small = Surface(mesh.vertices, mesh.faces, mesh.face_error, np.where(right, 0.05, 0.0))
    assert small.error_at(on) == pytest.approx([0.05, 0.0, 0.05, 0.0], abs=1e-12)
    block = box_mesh((2.0, 2.0, 2.0))
    assert surface_distance(mesh, block, translation(8.0, 0.0, 0.0)).lower == pytest.approx(1.8, abs=1e-9)
    assert surface_distance(mesh, block, translation(-8.0, 0.0, 0.0)).lower == pytest.approx(2.0, abs=1e-9)
    errors = np.array([0.0, 1e-3, 0.01, 0.04, 0.2, 0.5, 0.9, 1.0, 0.3, 0.02, 0.0, 0.7])
    levels = Surface(mesh.vertices, mesh.faces, errors)
    for rows, error in levels.levels:
        assert levels.face_error[rows].max() == error
    assert np.sum([rows for rows, _ in levels.levels], axis=0).tolist() == [1] * 12


def test_depths_of_points_in_a_mesh():
    """Of a box with a hollow: what the nearest triangle alone tells is right; the hollow is outside."""
    outer, inner = trimesh.creation.box((10.0, 10.0, 10.0)), trimesh.creation.box((4.0, 4.0, 4.0))
    mesh = Surface(
        np.vstack([outer.vertices, inner.vertices]),
        np.vstack([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
    )
    x = np.random.default_rng(2).uniform(-6.0, 6.0, (400, 3))
    far = np.abs(x).max(axis=1)
    truth = np.minimum(
        5.0 - far, np.where(far > 2.0, np.linalg.norm(np.maximum(np.abs(x) - 2.0, 0.0), axis=1), far - 2.0)
    )
    inside = truth > 0.0
    assert mesh.depth(x)[inside] == pytest.approx(truth[inside], abs=1e-12)
    assert (mesh.depth(x)[~inside] < 0.0).all()
    certain = mesh.certain_depth(x)
    known = certain > -np.inf
    assert certain[known] == pytest.approx(truth[known], abs=1e-12)
    assert known[inside & (truth == 5.0 - far)].mean() > 0.9
    assert len(mesh.shells) == 2
    assert any_inside(mesh, box_mesh((0.5, 0.5, 0.5)), translation(3.5, 0.0, 0.0))
    assert not any_inside(mesh, box_mesh((0.5, 0.5, 0.5)), translation(0.5, 0.0, 0.0))
    two = trimesh.util.concatenate(
        [trimesh.creation.box((0.5, 0.5, 0.5)).apply_translation(t) for t in ((3.5, 0, 0), (9, 0, 0))]
    )
    assert any_inside(mesh, Surface(np.array(two.vertices), np.array(two.faces)), HERE)


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
        for out in (-5.0, -0.1, 0.3, 2.0, 9.0):
            for slack in (0.0, 0.5):
                assert within(b, a, translation(8.0 + out, 0.0, 0.0), 0.016, slack) == (out <= slack)
        assert not within(a, b, HERE, 0.016, 0.0)


# --- Cylinders and hulls beside facets --------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [0.0, 0.25])
def test_cylinders_and_hulls_beside_facets(error):
    """A rod lying beside a box, standing before it, or through it; its gap is known to the digit."""
    facets, rod = box_mesh((10.0, 10.0, 10.0), error), Rod(2.0, 6.0, TURNED)
    back = inverse(TURNED)
    lying = translation(12.0, 0.0, 0.0) @ back
    standing = translation(12.0, 0.0, 0.0) @ rotation((0.0, 1.0, 0.0), 0.5 * math.pi) @ back
    turned = translation(12.0, 0.0, 0.0) @ rotation((0.0, 1.0, 0.0), 0.5 * math.pi - 0.5) @ back
    tip = 3.0 * math.cos(0.5) + 2.0 * math.sin(0.5)
    for off in (0.0, 0.1):
        form = ClosedForm((rod,), (), off)
        for T, truth in ((lying, 5.0), (standing, 4.0), (turned, 7.0 - tip)):
            found = rod_distance(facets, form, T)
            assert found.lower <= truth - error - off + 1e-9
            assert found.upper >= truth + error + off - 1e-9
            assert found.upper <= truth + error + off + 1e-6
            assert axis_gap(facets, rod, T) <= truth - error + 1e-9
        assert rod_distance(facets, form, lying).lower == pytest.approx(5.0 - error - off, abs=1e-6)
        assert axis_gap(facets, rod, lying) == pytest.approx(5.0 - error, abs=1e-6)
        deep = rod_distance(facets, form, translation(6.0, 0.0, 0.0) @ back)
        assert deep.lower <= -1.0 - error - off + 1e-6
        assert -1.0 + error + off <= deep.upper + 1e-6
        inside = rod_distance(facets, form, translation(1.0, 0.0, 0.0) @ back)
        assert inside.upper <= -3.0 + error + off
        assert inside.lower == -math.inf
    assert axis_gap(facets, rod, back) == axis_gap(facets, rod, translation(5.0, 0.0, 0.0) @ back) == -math.inf
    around = hull(to_target(translation(9.0, 0.0, 0.0), np.array(list(itertools.product((-1.0, 1.0), repeat=3)))))
    assert hull_gap(facets, around) == pytest.approx(3.0 - error, abs=1e-9)
    for shift in (-9.0, -4.0, -3.0):
        moved = Hull(
            around.vertices + np.array([shift, 0.0, 0.0]),
            around.planes - [0, 0, 0, 1] * (around.planes[:, :1] * shift),
            around.faces,
        )
        assert hull_gap(facets, moved) == -math.inf
    wide = hull(30.0 * np.array(list(itertools.product((-1.0, 1.0), repeat=3))))
    assert hull_gap(facets, wide) == -math.inf


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
    field, depth = solid.field(x), np.max([form.depth(x) for form in forms], axis=0)
    clear = np.abs(depth) > 1e-9
    if len(forms) > 1:  # on the seams of pieces both are at their borders
        clear &= np.abs(field) > 1e-2
    assert ((depth > 0.0) == (field < 0.0))[clear].all()
    for form in forms:
        inside = x[form.depth(x) > 0.0]
        assert (inside >= form.bounds[0] - 1e-9).all()
        assert (inside <= form.bounds[1] + 1e-9).all()
