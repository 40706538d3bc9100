"""The distance of boxes and cylinders in closed form, before truths that know only what the bodies are."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from clamp3d.collide.convex import Rod, convex_distance
from clamp3d.collide.depth_convex import convex_depth
from clamp3d.collide.distance import distance
from clamp3d.collide.hull import hull
from clamp3d.core import kernel_zonoid, shapes
from clamp3d.core.pose import rotation, translation
from clamp3d.core.primitives import Cylinder
from clamp3d.testing import assert_distance

HERE = np.eye(4)
SIGNS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def _pieces(rng):
    box = hull(SIGNS * rng.uniform(1.0, 9.0, 3))
    return [box, Rod(*rng.uniform(1.0, 9.0, 2), HERE), hull(SIGNS * rng.uniform(1.0, 9.0, 3))]


def _support(piece, n):
    """Height along n, from the definition."""
    if isinstance(piece, Rod):
        return piece.radius * np.hypot(n[0], n[1]) + 0.5 * piece.length * abs(n[2])
    return (piece.vertices @ n).max()


def _gap(a, b, T, n):
    """The gap between planes square to n; its largest value is the signed distance."""
    return float(n @ T[:3, 3]) - _support(a, n) - _support(b, T[:3, :3].T @ -n)


def _climbed(a, b, T, n):
    """A local maximum of the gap near n."""
    return -minimize(lambda v: -_gap(a, b, T, v / np.linalg.norm(v)), n, method="Nelder-Mead").fun


def test_it_is_the_widest_slab():
    """Apart no pair of points is nearer, and in an overlap no direction is a shorter way out."""
    rng = np.random.default_rng(5)
    apart = inside = 0
    for _ in range(60):
        pieces = _pieces(rng)
        a, b = (pieces[k] for k in rng.choice(3, 2, replace=False))
        T = translation(*(rng.normal(size=3) * 6.0)) @ rotation(rng.normal(size=3), rng.uniform(0.0, 3.0))
        d = convex_depth(a, HERE, b, T)
        assert d.upper - d.lower <= 1e-9
        assert _gap(a, b, T, d.normal) == pytest.approx(d.value, abs=1e-9)
        assert d.point_b - d.point_a == pytest.approx(d.value * d.normal, abs=1e-7)
        assert min(a.depth(d.point_a[None])[0], b.depth(((d.point_b - T[:3, 3]) @ T[:3, :3])[None])[0]) >= -1e-12
        starts = rng.normal(size=(200, 3))
        starts /= np.linalg.norm(starts, axis=1)[:, None]
        gaps = [_gap(a, b, T, n) for n in starts]
        for n in starts[np.argsort(gaps)[-3:]]:
            assert _climbed(a, b, T, n) <= d.upper + 1e-9
        apart, inside = apart + (d.lower > 0.0), inside + (d.upper < 0.0)
    assert min(apart, inside) >= 10


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_points_of_nearly_parallel_cylinders_are_as_far_apart_as_said(angle):
    """Lines that are almost parallel: the rate along them is lost in rounding, the points must not be."""
    a, b = Rod(3.0, 40.0, HERE), Rod(2.0, 30.0, HERE)
    for gap in (1e-9, 1e-5, 0.1):
        T = translation(5.0 + gap, 0.0, 6.0) @ rotation([1.0, 0.0, 0.0], angle)
        d = convex_distance(a, HERE, b, T)
        assert d.lower <= d.upper <= d.lower + 1e-10
        assert d.value == pytest.approx(gap, abs=1e-10)
        assert np.linalg.norm(d.point_b - d.point_a) == pytest.approx(d.value, abs=1e-10)


def test_coaxial_cylinders_come_free_in_any_direction():
    d = convex_depth(Rod(5.0, 60.0, HERE), HERE, Rod(3.0, 50.0, HERE), HERE)
    assert d.value == pytest.approx(-8.0, abs=1e-10)
    assert d.normal[2] == pytest.approx(0.0, abs=1e-10)


_TOUCHING = {
    "a rim all but along an edge": (
        shapes.box((2.491442923003952, 8.55521087021536, 26.258346480350113)),
        Cylinder(12.160449012951348, 30.85077835061726),
        [
            [0.0, -0.5894864883301247, 0.807778236941438, 0.20444283345262837],
            [-0.9643578693161994, -0.21373925086692805, -0.15597894898595965, -15.88570114015586],
            [0.26460139812162786, -0.7789872994568411, -0.5684759338767277, 16.78028989661837],
            [0.0, 0.0, 0.0, 1.0],
        ],
    ),
    "a rim in an edge by 1.5e-8 mm": (
        shapes.box((8.122834822590447, 2.918685107568892, 34.274075229694404)),
        Cylinder(7.345717370420728, 26.136398137459054),
        [
            [0.010120564103750587, -0.8044489618594282, -0.5939355536971248, 0.7146591208964872],
            [-0.0714979898139192, -0.5930278650936462, 0.8020012398213865, 6.611046362698823],
            [-0.9973893981965071, 0.034348493209461706, -0.06351826020483387, -24.882560712138034],
            [0.0, 0.0, 0.0, 1.0],
        ],
    ),
    "two rims": (
        Cylinder(8.438891598154685, 12.19938028232666),
        Cylinder(10.08818548730286, 34.222572627514104),
        [
            [-0.8175581104062842, 0.44776924428327214, -0.3620793283009862, -19.771509980470285],
            [0.5758461045356702, 0.6357208538372695, -0.5140625058176359, 4.103038515511449],
            [0.0, -0.6287779416220008, -0.7775849150604709, -10.373172349815231],
            [0.0, 0.0, 0.0, 1.0],
        ],
    ),
}


@pytest.mark.parametrize("name", _TOUCHING)
def test_points_where_a_search_one_segment_at_a_time_stalls(name):
    """Contacts of which single steps find points 1e-5 mm and more beside the nearest ones."""
    a, b, T = _TOUCHING[name]
    d = distance(a, b, T)
    assert d.upper - d.lower <= 1e-9
    gap = d.point_b - d.point_a
    assert gap == pytest.approx(d.value * d.normal, abs=2e-9)
    assert_distance(d, a, b, np.array(T), tolerance=1e-8)


def test_the_point_of_a_cell_is_a_point_of_the_sum():
    """Each segment and disc adds a point of its own; of those that do not turn over in the cell, the furthest."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        S, U = rng.normal(size=(3, 3)), rng.normal(size=(2, 4))
        U[:, :3] /= np.linalg.norm(U[:, :3], axis=1)[:, None]
        U[:, 3] = rng.uniform(0.5, 2.0, 2)
        n, c, X = rng.normal(size=3), rng.normal(size=3), np.empty((5, 3))
        n /= np.linalg.norm(n)
        rho = float(rng.choice([1e-3, 0.1, 0.6]))
        height, aside = kernel_zonoid.support(*n, rho, 5, 0.0, c, S, U, X)
        p = X.sum(axis=0) - c
        assert height == pytest.approx(p @ n, abs=1e-12)
        assert aside == pytest.approx(np.linalg.norm(p - (p @ n) * n), abs=1e-12)
        along = S @ n
        still = np.abs(along) > math.sin(rho) * np.linalg.norm(S, axis=1)
        assert np.allclose(X[:3][still], np.sign(along[still])[:, None] * S[still], rtol=0, atol=1e-12)
        assert np.linalg.norm(np.cross(X[:3], S), axis=1).max() <= 1e-12
        assert (np.linalg.norm(X[:3], axis=1) <= np.linalg.norm(S, axis=1) + 1e-12).all()
        assert np.abs((X[3:] * U[:, :3]).sum(axis=1)).max() <= 1e-12  # a disc is square to its axis
        assert (np.linalg.norm(X[3:], axis=1) <= U[:, 3] + 1e-12).all()


@pytest.mark.parametrize("face", range(6))
def test_a_cell_of_directions_lies_within_its_radius(face):
    """Down to its corners; and not much wider is said."""
    rng = np.random.default_rng(face)
    for w in (1.0, 0.5, 0.125, 1e-3):
        u, v = rng.integers(0, round(1.0 / w), 2) * 2.0 * w - 1.0 + w
        *middle, rho = kernel_zonoid.middle(float(face), u, v, w)
        corners = np.array([(u + x * w, v + y * w) for x in (-1.0, 0.3, 1.0) for y in (-1.0, 0.3, 1.0)])
        n = np.insert(corners, face % 3, 1.0 if face < 3 else -1.0, axis=1)
        turned = np.arccos(np.clip(n @ middle / np.linalg.norm(n, axis=1), -1.0, 1.0))
        assert turned.max() <= rho <= 4.0 * turned.max()


def _sum(rng, kind):
    """Half segments (m, 3), discs (k, 4) and a point: flat and round sums, some with parallel or tiny parts."""
    S, U = rng.normal(size=(rng.integers(1, 7), 3)), rng.normal(size=(rng.choice([0, 1, 2, 6]), 4))
    if kind == 1:  # two boxes that lie alike
        S = np.vstack([np.diag(rng.uniform(0.5, 2.0, 3)), np.diag(rng.uniform(0.5, 2.0, 3))])
    if kind == 2:  # slabs and needles
        S *= 10.0 ** rng.uniform(-6.0, 0.0, (len(S), 1))
    U[:, :3] /= np.linalg.norm(U[:, :3], axis=1)[:, None]
    U[:, 3] = rng.uniform(0.5, 2.0, len(U))
    if kind == 3 and len(U):  # nearly square to a segment, or along it
        U[0, :3] = S[0] / np.linalg.norm(S[0])
        U[-1, :3] = np.cross(U[0, :3], S[-1] + 1e-6 * rng.normal(size=3)) + 1e-9
        U[-1, :3] /= np.linalg.norm(U[-1, :3])
    return S, U, rng.choice([0.0, 0.3, 1.0, 5.0]) * rng.normal(size=3)


def test_a_direction_is_led_to_a_local_minimum_of_the_width():
    """Of round sums, whose width is smooth; on the circle square to a segment, where that is the edge that counts."""
    rng = np.random.default_rng(8)
    reached = 0
    for k in range(300):
        U, S = rng.normal(size=(3, 4)), rng.normal(size=(1, 3)) if k % 2 else np.empty((0, 3))
        U[:, :3] /= np.linalg.norm(U[:, :3], axis=1)[:, None]
        U[:, 3], c, on = rng.uniform(0.5, 2.0, 3), rng.choice([0.3, 5.0]) * rng.normal(size=3), len(S) - 1
        start = rng.normal(size=3)
        start /= np.linalg.norm(start)

        def widths(n, S=S, U=U, c=c):
            rims = np.linalg.norm(np.cross(n[:, None], U[:, :3]), axis=2) @ U[:, 3]
            return np.abs(n @ S.T).sum(axis=1) + rims - n @ c

        f, *n = kernel_zonoid.polish(*start, c, S, U, on, 1e-14)
        n = np.array(n)
        near = n + 1e-3 * rng.normal(size=(200, 3))
        if len(S):
            edge = S[0] / np.linalg.norm(S[0])
            assert abs(n @ edge) <= 1e-12
            start -= (start @ edge) * edge
            start /= np.linalg.norm(start)
            near -= (near @ edge)[:, None] * edge
        near /= np.linalg.norm(near, axis=1)[:, None]
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-12)
        assert f == pytest.approx(widths(n[None])[0], abs=1e-12)
        assert f <= widths(start[None])[0] + 1e-12
        reached += f <= widths(near).min() + 1e-12
    assert reached >= 265


def _least(c, S, U, tolerance, most=20_000, cells=kernel_zonoid.CELLS):
    """The kernel's bounds, direction and nearest point of the sum, and the cells that it looked at."""
    parts, out, heap = np.empty((len(S) + len(U), 3)), np.empty(5), np.full((cells + 8, 5), np.nan)
    count = kernel_zonoid.zonoid(c, S, U, tolerance, most, heap[:cells], parts, out)
    assert np.isnan(heap[cells:]).all()
    return out[0], out[1], out[2:], parts.sum(axis=0) - c, count


def test_no_direction_is_better_than_the_least_width():
    """By directions all round. Whoever lets it look at few cells only is told a wider bound, but a true one."""
    rng = np.random.default_rng(7)
    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    apart = inside = 0
    for k in range(400):
        S, U, c = _sum(rng, k % 4)

        def widths(n, S=S, U=U, c=c):
            rims = np.linalg.norm(np.cross(n[:, None], U[:, :3]), axis=2) @ U[:, 3]
            return np.abs(n @ S.T).sum(axis=1) + rims - n @ c

        size = np.abs(S).sum() + U[:, 3].sum() + np.abs(c).sum()
        lower, upper, at, p, count = _least(c, S, U, 1e-6 * size)
        apart, inside = apart + (upper < 0.0), inside + (lower > 0.0)
        assert np.linalg.norm(at) == pytest.approx(1.0, abs=1e-12)
        assert upper == pytest.approx(widths(at[None])[0], abs=1e-13 * size)
        assert lower <= min(widths(n).min(), upper)
        assert count == 20_000 or upper - lower <= 1.000001e-6 * size
        if upper < 0.0:  # the nearest point attests it from the other side
            assert np.linalg.norm(p) >= -upper - 1e-13 * size
        assert upper - 2e-3 * size <= p @ at <= upper + 1e-13 * size
        for rough, most, cells in ((1e-6, 1, 4000), (1e-6, 24, 4000), (1e-6, 100, 12), (0.03, 20_000, 4000)):
            below, above, *_ = _least(c, S, U, rough * size, most, cells)
            assert below <= upper
            assert above >= lower
            assert most < 20_000 or above - below <= 1.000001 * rough * size
    assert min(apart, inside) >= 50
