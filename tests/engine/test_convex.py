"""Convex pieces: their geometry against points, their signed distance against hulls and prisms of many sides."""

import math

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from clamp3d import Scene, Verdict, check, distance, shapes
from clamp3d.engine.convex import Rod, convex_distance
from clamp3d.engine.convex_depth import convex_depth
from clamp3d.engine.hull import Hull, hull, hull_error, prism
from clamp3d.geometry.pose import inverse, rotation, to_target, translation
from clamp3d.testing import directions
from tests.kinds import TURNED, manifold_shape

HERE = np.eye(4)
CUBE = hull(np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0)]))


def corners(piece, T, sides=90, scale=1.0):
    """Corners (k, 3) of a piece at ``T``; of a rod a prism in it, or with a larger ``scale`` around it."""
    if isinstance(piece, Hull):
        return to_target(T, piece.vertices)
    turn = 2.0 * math.pi * np.arange(sides) / sides
    rim = scale * piece.radius * np.column_stack([np.cos(turn), np.sin(turn)])
    ends = [np.column_stack([rim, np.full(sides, z * piece.length)]) for z in (-0.5, 0.5)]
    return to_target(T @ piece.T, np.vstack(ends))


def apart(one, other):
    """Distance of the convex hulls of two sets of points (k, 3) and (m, 3).

    By least squares over weights that are not negative (Lawson and Hanson, *Solving Least Squares Problems*, 1974,
    chapter 23).
    """
    ends = (one[:, None] - other[None]).reshape(-1, 3).T
    weights, _ = nnls(np.vstack([ends, np.ones(ends.shape[1])]), np.array([0.0, 0.0, 0.0, 1.0]))
    return float(np.linalg.norm(ends @ weights) / weights.sum())


def signed(one, other):
    """Signed distance of two hulls of points: minus the least translation that parts them, in an overlap."""
    gap = apart(one, other)
    if gap > 1e-9:
        return gap
    return float(ConvexHull((one[:, None] - other[None]).reshape(-1, 3)).equations[:, 3].max())


def some_piece(rng):
    if rng.random() < 0.4:
        return Rod(rng.uniform(0.5, 3.0), rng.uniform(0.5, 9.0), TURNED @ rotation(rng.normal(size=3), 1.0))
    return hull(rng.normal(size=(rng.choice([4, 8, 30, 70]), 3)) * rng.uniform(0.5, 3.0, 3))


def some_pair(seed):
    """Two pieces, one of them placed so that they are apart or overlap by a step from 1e-6 to 6 mm."""
    rng = np.random.default_rng(seed)
    a, b = some_piece(rng), some_piece(rng)
    if isinstance(a, Rod) and isinstance(b, Rod):
        b = CUBE if seed % 2 else hull(rng.normal(size=(12, 3)))
    T = rotation(rng.normal(size=3), rng.uniform(0.0, 3.0)) if seed % 3 else np.eye(4)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    reach = (corners(a, HERE) @ n).max() - (corners(b, T) @ n).min()
    return a, b, translation(*((reach + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-6.0, 0.8)) * n)) @ T


@pytest.mark.parametrize("gap", [-1e-9, -1e-12, 0.0, 1e-12, 1e-9])
def test_a_point_beside_a_piece_attests_no_overlap(gap):
    """Two boxes that touch within rounding: a point of one counts as one of the other, and is no deeper for it."""
    box = hull(np.array([(x, y, z) for x in (-5.0, 5.0) for y in (-5.0, 5.0) for z in (-5.0, 5.0)]))
    found = convex_distance(box, HERE, box, translation(10.0 + gap, 0.0, 0.0))
    assert found.lower - 1e-13 <= gap <= found.upper + 1e-13


@pytest.mark.parametrize("seed", range(60))
def test_the_signed_distance_of_two_pieces(seed):
    """Between bounds that hold, sharp where they are apart, with points of both pieces and the normal between them."""
    a, b, T = some_pair(seed)
    widest = 1.0 / math.cos(math.pi / 90)
    least, most = (signed(corners(a, HERE, scale=s), corners(b, T, scale=s)) for s in (widest, 1.0))
    for found in (convex_distance(a, HERE, b, T), convex_distance(b, T, a, HERE)):
        assert found.lower <= most + 1e-8
        assert found.lower <= found.upper
        if least > 1e-8:
            assert found.upper >= least - 1e-8
            assert found.upper - found.lower <= 1e-8 * (1.0 + found.upper)
        elif most < -1e-8:
            assert found.upper <= 1e-9
    if most < -1e-8:
        depth = convex_depth(a, HERE, b, T)
        assert depth.lower - 1e-11 <= most
        assert least <= depth.upper + 1e-11
        assert depth.upper - depth.lower <= 1e-8
        assert most > least or depth.value == pytest.approx(most, abs=1e-11)
    found = convex_distance(a, HERE, b, T)
    if found.point_a is None or found.upper == math.inf:
        return
    p, q = found.point_a, found.point_b
    assert min(a.depth(p[None])[0], b.depth(to_target(inverse(T), q)[None])[0]) >= -1e-7
    assert np.linalg.norm(found.normal) == pytest.approx(1.0, abs=1e-9)
    if found.lower > 1e-6:
        assert np.linalg.norm(q - p) == pytest.approx(found.upper, abs=1e-8)
        assert (q - p) == pytest.approx(found.upper * found.normal, abs=1e-5)
    elif found.upper < 0.0:  # a point of both is as deep in one of them: no shorter move parts them
        assert least <= found.upper + 1e-8


def test_points_of_an_overlap_lie_on_both_surfaces_and_part_last():
    rng = np.random.default_rng(3)
    deep = 0
    for k in range(60):
        rods = (Rod(*rng.uniform(1.0, 6.0, 2), TURNED @ rotation(rng.normal(size=3), 1.0)) for _ in "ab")
        a, b = (CUBE if rng.random() < 0.5 else rod for rod in rods)
        T = translation(*rng.uniform(-3.0, 3.0, 3)) @ (rotation(rng.normal(size=3), 2.0) if k % 3 else HERE)
        d = convex_depth(a, HERE, b, T)
        if d.upper > -1e-3:
            continue
        deep += 1
        on_b = to_target(inverse(T), d.point_b)
        assert a.depth(d.point_a[None])[0] == pytest.approx(0.0, abs=1e-7)
        assert b.depth(on_b[None])[0] == pytest.approx(0.0, abs=1e-7)
        assert d.point_b == pytest.approx(d.point_a + d.value * d.normal, abs=1e-7)
    assert deep > 20


def test_cylinders_that_touch_are_apart_along_the_line_between_their_axes():
    a, b = shapes.cylinder(3.5791532715129657, 1.2), shapes.cylinder(0.07041993482427572, 0.5)
    d = distance(a, b, translation(3.6495732063755963, 0.0, 0.0) @ rotation((0.0, 1.0, -1.4), 2e-10))
    assert d.method == "convex"
    assert d.normal == pytest.approx([1.0, 0.0, 0.0], abs=1e-5)


def test_what_is_left_before_a_plane():
    rng = np.random.default_rng(1)
    for _ in range(20):
        n = rng.normal(size=3)
        plane = np.append(n / np.linalg.norm(n), rng.uniform(-2.5, 2.5))
        left = CUBE.clipped(plane)
        truth = trimesh.intersections.slice_mesh_plane(
            trimesh.convex.convex_hull(CUBE.vertices), plane[:3], -plane[3] * plane[:3], cap=True
        )
        if left is None:
            assert truth.is_empty
            continue
        assert ConvexHull(left.vertices).volume == pytest.approx(truth.volume, rel=1e-9)
        assert (left.vertices @ plane[:3] + plane[3]).min() >= -1e-9
    assert CUBE.clipped(np.array([0.0, 0.0, 1.0, 3.0])) is CUBE
    assert CUBE.clipped(np.array([0.0, 0.0, 1.0, -3.0])) is None


@pytest.mark.parametrize("frame", [np.eye(3), TURNED[:3, :3], TURNED[:3, :3] @ np.diag([1.0, -1.0, 1.0])])
def test_a_prism_is_the_hull_of_its_corners(frame):
    """Also in a left-handed frame; corners on a straight line are none."""
    drawn = prism(np.array([(0, 0), (2, 0), (4, 0), (5, 3), (2, 5), (-1, 2.0)]), -1.0, 2.0, frame)
    made = trimesh.Trimesh(drawn.vertices, drawn.faces, process=False)
    outline = ConvexHull(np.array([(0, 0), (4, 0), (5, 3), (2, 5), (-1, 2.0)]))
    assert made.is_watertight
    assert made.volume == pytest.approx(3.0 * outline.volume)
    assert (len(drawn.vertices), len(drawn.planes), len(drawn.edges)) == (10, 7, 15)
    truth = hull(drawn.vertices)
    assert sorted(drawn.planes.round(9).tolist()) == sorted((truth.planes.round(9) + 0.0).tolist())


@pytest.mark.parametrize("tilt", [0.0, 8e-10, -8e-10])
def test_the_depth_of_cylinders_that_lean_by_less_than_counts_as_parallel(tilt):
    """End on end, 0.1 mm in each other: the narrower one's rim goes as much deeper as it leans."""
    T = translation(0.0, 0.0, 9.9) @ rotation((1.0, 0.0, 0.0), tilt)
    found = convex_depth(Rod(20.0, 10.0, HERE), HERE, Rod(10.0, 10.0, HERE), T)
    truth = -0.1 - 10.0 * abs(tilt)
    assert found.lower - 1e-14 <= truth <= found.upper + 1e-14
    assert found.upper - found.lower <= 40.0 * abs(tilt) + 1e-12


@pytest.mark.parametrize("size", [1e-5, 3e-5, 1e-3])
def test_tiny_boxes_have_their_pieces(size):
    d = distance(shapes.box(size, size, 1.0), shapes.box(1.0, 1.0, 1.0), translation(0.0, 0.0, 3.0))
    assert (d.lower, d.upper) == (pytest.approx(2.0, abs=1e-9), pytest.approx(2.0, abs=1e-9))


def test_a_small_cylinder_and_a_large_box_are_as_sharp_in_either_order():
    rng, a, b = np.random.default_rng(3), shapes.cylinder(1.0, 1.0), shapes.box(1000.0, 1000.0, 10.0)
    for _ in range(60):
        T = rotation(rng.normal(size=3), rng.uniform(0.0, 3.0))
        T[:3, 3] = 600.0 * rng.normal(size=3)
        one, other = distance(a, b, T), distance(b, a, inverse(T))
        assert max(one.lower, other.lower) <= min(one.upper, other.upper) + 1e-9
        assert one.upper - one.lower < 1e-4


# --- Hulls of points that nearly lie in faces, and meshes that are nearly convex --------------------------------------


def roof(rise, n=5):
    """A plate of 2 by 2 by 0.3 below z = 0 whose top is a grid that rises by ``rise`` in its middle."""
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-1.0, 1.0, n), np.linspace(-1.0, 1.0, n)))
    top = np.column_stack([x, y, 0.5 * rise * (2.0 - x * x - y * y)])
    return np.vstack([top, np.column_stack([x, y, np.full(n * n, -0.3)])])


@settings(max_examples=60, deadline=None)
@given(st.sampled_from([0.0, 1e-13, 1e-10, 1e-8, 5e-8, 1e-6]), st.integers(0, 2**32 - 1))
def test_no_point_is_left_out(rise, seed):
    """By the support function: along any direction the hull reaches as far as the furthest point."""
    rng = np.random.default_rng(seed)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    points = (roof(rise) + rise * rng.normal(size=(50, 3)) * [0.0, 0.0, 0.3]) @ turn.T * 40.0
    made = hull(points)
    assert (points @ made.planes[:, :3].T + made.planes[:, 3]).max() <= 1e-13 * 40.0
    N = np.vstack([directions(300), turn[:, 2] + 1e-7 * rng.normal(size=(300, 3))])
    assert (made.vertices @ N.T).max(axis=0) == pytest.approx((points @ N.T).max(axis=0), abs=1e-12)
    assert len(made.vertices) - 1.5 * len(made.faces) + len(made.faces) == 2


def plate(middle):
    """A plate of 100 by 100 by 10 mm below z = 0 with a pyramid of 0.1 by 0.1 mm on it, or in it below 0."""
    block = manifold3d.Manifold.cube((100.0, 100.0, 10.0), True).translate((0.0, 0.0, -5.0))
    base = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (0.0, -0.1 if middle > 0.0 else 0.01)]
    pyramid = manifold3d.Manifold.hull_points([*base, (0.0, 0.0, middle)])
    return manifold_shape(block + pyramid if middle > 0.0 else block - pyramid)


def test_a_small_dent_is_not_filled():
    """A tip in a dent of 0.1 by 0.1 mm that is 0.02 mm deep, a part in 1e9 of the plate's volume."""
    corners = np.array([(0.0, 0.0, -0.01), (0.003, 0.0, 1.0), (-0.003, 0.003, 1.0), (-0.003, -0.003, 1.0)])
    tip = manifold_shape(manifold3d.Manifold.hull_points(corners))
    dented = plate(-0.02)
    truth = 0.01 * np.cos(np.arctan(0.02 / 0.05))  # of the tip from the dent's sides
    found = distance(dented, tip)
    assert found.lower - 1e-12 <= truth <= found.upper + 1e-12
    assert found.upper - found.lower < 1e-8
    assert check(Scene(contact=1e-3).add("dented", dented).add("tip", tip)).verdict("dented", "tip") is Verdict.CLEAR


@pytest.mark.parametrize("rise", [1e-7, 5e-6])
def test_a_small_rise_is_seen(rise):
    """What a roof stands out by is less than 1e-7 of the plate's size."""
    found = distance(plate(rise), shapes.box((10.0, 10.0, 10.0)), translation(0.0, 0.0, 5.0 + 1e-3))
    assert found.lower <= 1e-3 - rise <= found.upper
    assert found.upper - found.lower < 1e-9


def test_a_dent_in_a_face_is_within_the_error_of_the_hull():
    """The middle of a face is pressed in by 1e-7 mm: the hull covers it, and says so."""
    cube = trimesh.creation.box((10.0, 10.0, 10.0)).subdivide()
    V = np.array(cube.vertices)
    V[np.argmax(V @ (1.0, 1e-3, 1e-3) - np.abs(V[:, 1:]).sum(axis=1)), 0] -= 1e-7
    assert 0.9e-7 <= hull_error(V, np.array(cube.faces)) <= 1e-6
