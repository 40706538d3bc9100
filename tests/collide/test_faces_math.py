"""Formulas for faces, each against points: of the surface, of the triangle, of the hulls. Run as plain Python.

What is sampled is in the sampled body, so a bound must hold for every sample; and a bound that is attained must be
within a sample's spacing of the best of them.
"""

import itertools
import math

import numpy as np
import pytest
import trimesh

from clamp3d.brep import surfaces
from clamp3d.collide import faces_ball, faces_math, faces_witness
from clamp3d.collide.depth_cover import nearest_behind
from clamp3d.collide.faces_math import CONE, CYLINDER, OTHER, PLANE, SPHERE, TORUS
from clamp3d.core import jit
from tests.hulls import apart

SIZES = {PLANE: (0.0, 0.0), CYLINDER: (2.0, 0.0), CONE: (2.0, 0.4), SPHERE: (3.0, 0.0), TORUS: (4.0, 1.5)}
KINDS = list(SIZES)
GRID = np.array([(i, j, 40 - i - j) for i in range(41) for j in range(41 - i)]) / 40.0
"""Weights of points spread over a triangle."""


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    """Formulas as they are written: what numba makes of them takes seconds each, and other tests run it."""
    monkeypatch.setattr(jit._Formula, "__call__", lambda self, *arguments: self._function(*arguments))


def frame(rng):
    """Origin and axes (4, 3) of a surface."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes[2] = np.cross(axes[0], axes[1])
    return np.vstack([rng.normal(size=3), axes])


def normal(kind, size, F, x):
    """Unit gradient (3,) of the height, by what each surface is."""
    local = (x - F[0]) @ F[1:].T
    across = np.array([local[0], local[1], 0.0])
    across /= np.linalg.norm(across)
    if kind == PLANE:
        n = np.array([0.0, 0.0, 1.0])
    elif kind == CYLINDER:
        n = across
    elif kind == CONE:
        n = math.cos(size[1]) * across - math.sin(size[1]) * np.array([0.0, 0.0, 1.0])
    else:
        n = local - (size[0] * across if kind == TORUS else 0.0)
    return n / np.linalg.norm(n) @ F[1:]


def some_uv(rng, kind, spread):
    """Parameters (3, 2) of a small triangle."""
    middle = rng.uniform(-1.0, 1.0, 2) + np.array([0.0, 0.5 if kind == CONE else 0.0])
    return middle + spread * rng.uniform(-1.0, 1.0, (3, 2))


@pytest.mark.parametrize("kind", KINDS)
def test_heights_are_distances_from_the_surface(kind):
    """Of a point beside the surface, along its normal: the step that was made."""
    rng = np.random.default_rng(0)
    a, b = SIZES[kind]
    for _ in range(20):
        F, (u, v), x = frame(rng), some_uv(rng, kind, 0.0)[0], np.empty(3)
        faces_math.surface_point(kind, a, b, F.ravel(), u, v, x)
        assert x == pytest.approx(surfaces.points_at(kind, F, (a, b), np.array([[u, v]]))[0], abs=1e-12)
        step = rng.uniform(-0.5, 3.0)
        y = x + step * normal(kind, (a, b), F, x)
        assert faces_math.height_at(kind, a, b, F.ravel(), *y) == pytest.approx(step, abs=1e-12)
        local = np.empty((3, 3))
        faces_math.to_frame(F.ravel(), np.array([x, y, F[0]]), local)
        assert local == pytest.approx((np.array([x, y, F[0]]) - F[0]) @ F[1:].T, abs=1e-12)
        assert faces_math.height(kind, a, b, *local[1]) == pytest.approx(step, abs=1e-12)


def below(kind, a, b, sense, x):
    """Sense * height of a point; in the hole of a solid cone less its distance from the cone, tip included."""
    if kind != CONE or sense > 0.0:
        return sense * faces_math.height(kind, a, b, *x)
    tip, slant = np.array([0.0, -a / math.tan(b)]), math.copysign(1.0, b) * np.array([math.sin(b), math.cos(b)])
    away = np.array([math.hypot(x[0], x[1]), x[2]]) - tip
    out = np.linalg.norm(away - max(0.0, away @ slant) * slant)
    return out if abs(slant[0] * away[1]) >= away[0] * abs(slant[1]) and away @ slant > 0.0 else -out


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("kind", KINDS)
def test_least_heights_over_triangles(kind, sense):
    """No point of a triangle is lower; plane, cylinder and ball attain it, the others but for the triangle's square."""
    rng, (a, b) = np.random.default_rng(1), SIZES[kind]
    for spread, _ in itertools.product((3.0, 1.0, 0.1), range(12)):
        V = rng.normal(size=3) * 3.0 + spread * rng.normal(size=(3, 3))
        least = faces_math.least_height(kind, a, b, sense, V)
        there = min(below(kind, a, b, sense, x) for x in GRID @ V)
        assert least <= there + 1e-12
        size = np.linalg.norm(V - np.roll(V, 1, axis=0), axis=1).max()
        lost = size / 40.0  # between the samples
        if kind == TORUS or (kind == CONE and sense > 0.0):
            across = np.hypot(V[:, 0], V[:, 1])
            far = min(across.min(), np.hypot(across - a, V[:, 2]).min())  # they bend most at the axis and at the ring
            lost += min(size, 2.0 * size * size / far)
        assert least >= there - lost


def test_distances_of_points_and_triangles():
    rng = np.random.default_rng(2)
    seen = set()
    for k in range(300):
        V, W = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)) * 0.7 + rng.normal(size=3) * rng.choice([0.3, 2.0])
        if k % 5 == 0:  # side by side in a plane, or with a side in common
            V[:, 2] = W[:, 2] = 0.0
        if k % 7 == 0:
            W[:2] = V[:2]
        x = rng.normal(size=3) * 2.0
        d, v, w = faces_math.point_triangle(*x, V)
        assert d == pytest.approx(apart(x[None], V), abs=1e-7)
        assert min(v, w, 1.0 - v - w) >= -1e-12
        assert np.linalg.norm((1.0 - v - w) * V[0] + v * V[1] + w * V[2] - x) == pytest.approx(d, abs=1e-12)
        far = apart(V, W)
        seen.add(far > 1e-6)
        assert faces_math.triangles(V, W) == pytest.approx(far, abs=1e-7)
    assert seen == {True, False}


@pytest.mark.parametrize("kind", [CYLINDER, CONE, SPHERE, TORUS])
def test_how_far_a_surface_bends_away_from_its_flat_pieces(kind):
    """No point is further from the flat piece's point of the same parameters; in the worst direction about as far."""
    rng, (a, b) = np.random.default_rng(3), SIZES[kind]
    tight = 0.0
    for k in range(60):
        uv = some_uv(rng, kind, rng.choice([0.05, 0.4]))
        if k % 3 == 0:
            uv[:, 1] = uv[0, 1] + 1e-3 * np.arange(3)
        if k % 3 == 1:
            uv[:, 0] = uv[0, 0] + 1e-3 * np.arange(3)
        du, v0, v1, u, v = faces_math.spans(uv)
        assert (du, v0, v1) == (np.ptp(uv[:, 0]), uv[:, 1].min(), uv[:, 1].max())
        assert (u, v) == pytest.approx(uv.mean(axis=0), abs=1e-15)
        F, P = frame(rng), np.empty((3, 3))
        for x, (p, q) in zip(P, uv, strict=True):
            faces_math.surface_point(kind, a, b, F.ravel(), p, q, x)
        off = np.linalg.norm(surfaces.points_at(kind, F, (a, b), GRID @ uv) - GRID @ P, axis=1).max()
        bound = faces_math.bend(kind, a, b, du, v1 - v0, v0, v1)
        assert off <= bound + 1e-12
        tight = max(tight, off / bound)
        G = frame(rng)
        G[1:] = np.linalg.qr(F[[3, 1, 2]].T + rng.choice([0.0, 1e-3, 0.5]) * rng.normal(size=(3, 3)))[0].T[[1, 2, 0]]
        rise = abs((surfaces.points_at(kind, F, (a, b), GRID @ uv) - GRID @ P) @ G[3]).max()
        less = faces_math.bend_over(kind, a, b, F.ravel(), du, v1 - v0, v0, v1, PLANE, G.ravel())
        assert rise <= less + 1e-12
        assert less <= bound
        if k % 3 == 1 and kind in (CYLINDER, CONE):
            assert bound <= 1e-3  # their lines along the axis are straight
    assert tight > 0.8


def test_a_pole_has_no_parameter_around_the_axis():
    uv = np.array([[np.nan, 1.5], [0.2, 1.0], [0.6, 1.2]])
    assert faces_math.spans(uv) == pytest.approx((0.4, 1.0, 1.5, 0.4, 3.7 / 3.0), abs=1e-15)
    assert faces_math.spans(np.full((3, 2), np.nan))[0] == 0.0


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(("kind", "other"), [(CYLINDER, CONE), (CONE, CYLINDER), (SPHERE, SPHERE), (TORUS, TORUS)])
def test_bands_over_surfaces_of_their_own_kind(kind, other, sense):
    """No point of a band is lower; attained by balls of any position, by the others where their axes are one."""
    rng, (a, b) = np.random.default_rng(9), SIZES[kind]
    c, d = SIZES[other][0] + 0.3, SIZES[other][1] + (0.2 if other == TORUS else 0.0)
    for k in range(12):
        F, shift, lean = frame(rng), 0.1 * rng.normal(size=3), 0.05 * rng.normal(size=(3, 3))
        if kind != SPHERE and k % 2 == 0:
            shift, lean = 0.0 * shift, 0.0 * lean
        G = np.vstack([F[0] + shift, np.linalg.qr((F[1:] + lean).T)[0].T])
        G[1:] *= np.sign((F[1:] * G[1:]).sum(axis=1))[:, None]
        v0, v1 = (-0.5 * math.pi, 0.5 * math.pi) if kind == SPHERE else sorted(rng.uniform(-1.0, 1.0, 2))
        uv = np.array(list(itertools.product(np.linspace(-math.pi, math.pi, 61), np.linspace(v0, v1, 31))))
        local = (surfaces.points_at(kind, F, (a, b), uv) - G[0]) @ G[1:].T
        there = min(below(other, c, d, sense, x) for x in local)
        low = faces_math.band_over(kind, a, b, F.ravel(), v0, v1, other, c, d, G.ravel(), sense)
        assert low <= there + 1e-12
        if kind == SPHERE or k % 2 == 0:
            # Two tori on one axis: the difference of their rings counts whole, in whatever direction it is.
            assert low >= there - (0.01 if kind == SPHERE else 2.0 * abs(a - c) if kind == TORUS else 1e-9)


@pytest.mark.parametrize("kind", [*KINDS, OTHER])
def test_the_halves_of_a_piece_are_the_piece(kind):
    """Their parameters share the new corner, which is on the surface; together they cover as much as before."""
    rng, (a, b) = np.random.default_rng(4), SIZES.get(kind, (0.0, 0.0))
    for side, bent in itertools.product(range(3), (False, True)):
        F, uv, V = frame(rng), some_uv(rng, kind, 0.4), np.empty((3, 3))
        for x, (u, v) in zip(V, uv, strict=True):
            faces_math.surface_point(kind, a, b, F.ravel(), u, v, x)
        uv1, V1, uv2, V2 = uv.copy(), V.copy(), np.empty((3, 2)), np.empty((3, 3))
        faces_math.cut(V1, uv1, side, kind, a, b, F.ravel(), V2, uv2)
        other, last = (side + 1) % 3, (side + 2) % 3
        middle = 0.5 * (uv[side] + uv[other])
        expected = 0.5 * (V[side] + V[other])
        if kind != OTHER:
            expected = surfaces.points_at(kind, F, (a, b), middle[None])[0]
        for half, points, kept, new in ((uv1, V1, side, other), (uv2, V2, other, side)):
            assert half[new] == pytest.approx(middle, abs=1e-15)
            assert points[new] == pytest.approx(expected, abs=1e-12)
            assert (half[[kept, last]] == uv[[kept, last]]).all()
            assert (points[[kept, last]] == V[[kept, last]]).all()
        long = faces_math.longest(V, uv, kind, a, b, bent)
        if not bent:
            assert long == np.argmax(np.linalg.norm(np.roll(V, -1, axis=0) - V, axis=1))
        elif kind == CYLINDER:
            assert long == np.argmax(np.abs(np.roll(uv[:, 0], -1) - uv[:, 0]))
    if kind in (SPHERE, CONE):
        for side in (0, 2):  # beside a pole, which has no u of its own
            uv = np.array([[np.nan, 1.2], [0.3, 0.9], [0.7, 0.8]])
            V, uv2, V2 = surfaces.points_at(kind, F, (a, b), uv), np.empty((3, 2)), np.empty((3, 3))
            u = uv[1 if side == 0 else 2, 0]
            v = 0.5 * (1.2 + uv[1 if side == 0 else 2, 1])
            faces_math.cut(V, uv, side, kind, a, b, F.ravel(), V2, uv2)
            assert uv2[side] == pytest.approx([u, v], abs=1e-15)


@pytest.mark.parametrize("one", KINDS)
@pytest.mark.parametrize("other", KINDS)
def test_the_angle_between_two_surfaces_and_the_way_out_of_both(one, other):
    rng = np.random.default_rng(6)
    kind, size = np.array([one, other]), np.array([SIZES[one], SIZES[other]])
    for _ in range(3):
        F, x = np.array([frame(rng), frame(rng)]), 3.0 * rng.normal(size=3)
        cosine = normal(one, size[0], F[0], x) @ normal(other, size[1], F[1], x)
        way, sense, heights = np.empty(3), rng.choice([-1.0, 1.0], 2), rng.uniform(-1.0, 0.2, 2)
        faces = kind, size, F.reshape(2, 12), sense, 0, 1, *x
        turn = faces_ball.cosine(*faces)
        assert turn == pytest.approx(sense.prod() * cosine, abs=1e-5)
        length = faces_ball.way_above_both(*heights, turn, *faces, way)
        n = [sense[0] * normal(one, size[0], F[0], x), sense[1] * normal(other, size[1], F[1], x)]
        planes = np.column_stack([n, -heights])
        assert length * way == pytest.approx(nearest_behind(planes, np.zeros(3)), abs=1e-3 / (1.0 - turn * turn))


def test_how_often_triangles_wind_round_a_point():
    ring = trimesh.creation.torus(3.0, 1.0, major_sections=12, minor_sections=7)
    points = np.random.default_rng(7).uniform(-4.0, 4.0, (80, 3)) * np.array([1.0, 1.0, 0.3])
    held = ring.contains(points)
    assert 5 < held.sum() < 75
    for x, inside in zip(points, held, strict=True):
        assert faces_witness.winding(ring.triangles, *x) == pytest.approx(float(inside), abs=1e-9)
    assert faces_witness.winding(ring.triangles, 3.0, 0.0, 0.0) == pytest.approx(1.0, abs=1e-9)
    assert faces_witness.winding(ring.triangles, 0.0, 0.0, 0.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("kind", [*KINDS, OTHER])
def test_the_witness_is_a_point_of_the_piece(kind):
    """On the surface, within the triangle's parameters: the nearest one where the point's foot is among them."""
    rng, (a, b) = np.random.default_rng(8), SIZES.get(kind, (0.0, 0.0))
    for k in range(30):
        F, uv, P, q = frame(rng), some_uv(rng, kind, 0.3), np.empty((3, 3)), np.empty(3)
        for x, (u, v) in zip(P, uv, strict=True):
            faces_math.surface_point(kind, a, b, F.ravel(), u, v, x)
        point = rng.dirichlet(np.ones(3)) @ P + rng.normal(size=3) * (1.0 if k % 2 else 0.05)
        d = faces_witness.witness(kind, a, b, F.ravel(), P, uv, *point, q)
        assert d == pytest.approx(np.linalg.norm(q - point), abs=1e-6)
        if kind == OTHER:
            assert d == pytest.approx(apart(point[None], P), abs=1e-7)
            continue
        assert abs(surfaces.height(kind, F, (a, b), q[None])[0]) <= 1e-6
        made = surfaces.parameters(kind, F, (a, b), q[None])[0]
        if kind != PLANE:
            made[0] += 2.0 * math.pi * round((uv[0, 0] - made[0]) / (2.0 * math.pi))
        parts = np.linalg.solve(np.vstack([uv.T, np.ones(3)]), np.append(made, 1.0))
        assert parts.min() >= -1e-4
        least = np.linalg.norm(surfaces.points_at(kind, F, (a, b), GRID @ uv) - point, axis=1).min()
        if parts.min() > 1e-3 and least < 0.2:
            assert d <= least + 0.05
