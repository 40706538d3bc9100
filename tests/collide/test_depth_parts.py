"""What a depth is proven with: pieces inside bodies, sets of translations, the way out of their union."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from clamp3d import shapes
from clamp3d.collide import depth_cover, depth_pieces
from clamp3d.collide.depth_convex import crossed, directions, supports
from clamp3d.collide.depth_cover import Union, difference, nearest_behind
from clamp3d.collide.depth_pieces import around_in_form, around_in_mesh, closest_on_triangles
from clamp3d.collide.drilled import is_drilled
from clamp3d.collide.hull import hull
from clamp3d.collide.model import ModelCache
from clamp3d.collide.surface import Surface
from clamp3d.core.pose import rotation, translation
from clamp3d.core.primitives import SweptArc
from clamp3d.testing import body
from clamp3d.testing import directions as spread
from tests.hulls import apart
from tests.kinds import BLOCK, DRAWN, faceted_shape

CACHE = ModelCache()


def box_set(low, high):
    """Planes (6, 4), n . t <= d, of a box of translations."""
    return np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.append(high, np.negative(low))])


# --- Pieces inside bodies ---------------------------------------------------------------------------------------------


def check_piece(found, x, field, room):
    """A hull around x: its planes hold its corners, it is wholly in the body, and holds a part of the room about x."""
    height = found.vertices @ found.planes[:, :3].T + found.planes[:, 3]
    assert height.max() <= 1e-9
    assert np.linalg.norm(found.planes[:, :3], axis=1) == pytest.approx(1.0, abs=1e-12)
    rng = np.random.default_rng(0)
    inside = rng.dirichlet(np.full(len(found.vertices), 0.2), 200) @ found.vertices
    assert field(np.vstack([found.vertices, inside])).max() <= 1e-9
    assert -(found.planes[:, :3] @ x + found.planes[:, 3]).max() >= 0.9 * room


@pytest.mark.parametrize("shape", DRAWN, ids=lambda shape: shape.name)
def test_a_piece_around_a_point_of_a_closed_form(shape):
    rng, solid, seen = np.random.default_rng(1), body(shape), 0
    for form in CACHE.model(shape).bodies:
        for x in rng.uniform(*form.bounds, (25, 3)):
            found = around_in_form(form, x)
            room = float(form.depth(x[None])[0])
            assert (found is not None) == (room > 1e-9)
            if found is not None:
                seen += 1
                check_piece(found, x, solid.field, 0.99 * room)
    assert seen > 5


def test_a_piece_stays_as_far_inside_as_the_form_may_be_off():
    form = CACHE.model(DRAWN[3]).bodies[0]
    off = type(form)(form.outers, form.bores, 0.4)
    x = np.array([1.0, 0.5, 2.0])
    solid = body(shapes.cylinder(5.0 - 0.4, 40.0 - 0.8))
    check_piece(around_in_form(off, x), x, solid.field, 0.9 * float(form.depth(x[None])[0]) - 0.4)
    assert around_in_form(off, np.array([4.7, 0.0, 0.0])) is None


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("error", [0.0, 0.2])
@pytest.mark.parametrize("k", [0, 4, 6])
def test_a_piece_around_a_point_of_a_mesh(k, error, large, monkeypatch):
    """Against the mesh's own signed distance; where it may be off by an error, as far inside as that."""
    if large:
        monkeypatch.setattr(depth_pieces, "_LARGE", 0)
    made = faceted_shape(DRAWN[k], 0.3).mesh
    V, F = np.array(made.vertices), np.array(made.faces)
    mesh, rng, seen = Surface(V, F, np.full(len(F), error)), np.random.default_rng(2), 0
    for x in rng.uniform(V.min(axis=0), V.max(axis=0), (30, 3)):
        room = float(mesh.depth(x[None])[0]) - error
        if not mesh.contains(x[None])[0]:
            continue
        found = around_in_mesh(mesh, x, 3.0)
        assert (found is not None) == (room > 1e-9)
        if found is not None:
            seen += 1
            check_piece(found, x, lambda points: error - mesh.depth(points) - 1e-9, 0.3 * min(room, 3.0))
            assert not large or np.abs(found.vertices - x).max() <= 3.0 + 1e-9
    assert seen > 3


def test_planes_and_points_of_triangles():
    rng = np.random.default_rng(3)
    V = rng.normal(size=(12, 3))
    V[11] = 0.5 * (V[9] + V[10])  # a sliver
    mesh = Surface(V, np.arange(12).reshape(4, 3))
    N, d = mesh.planes
    assert np.linalg.norm(N[:3], axis=1) == pytest.approx(1.0, abs=1e-12)
    for k in range(3):
        a, b, c = V[3 * k : 3 * k + 3]
        assert (V[3 * k : 3 * k + 3] @ N[k]) == pytest.approx(d[k], abs=1e-12)
        assert np.cross(b - a, c - a) @ N[k] > 0.0
    assert d[3] == -np.inf
    for x in rng.normal(size=(20, 3)):
        feet = closest_on_triangles(V.reshape(4, 3, 3)[:3], x)
        for foot, triangle in zip(feet, V.reshape(4, 3, 3), strict=False):
            assert np.linalg.norm(foot - x) == pytest.approx(apart(x[None], triangle), abs=1e-7)


# --- Sets of translations ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("many", [False, True])
def test_the_set_of_translations_that_overlap(many, monkeypatch):
    """Just inside it two hulls share a point, just outside they do not; of many edges it is a set inside."""
    rng = np.random.default_rng(4)
    if many:
        monkeypatch.setattr("clamp3d.collide.depth_convex._ALL", 0)
    for count in (5, 12):
        a, b = hull(rng.normal(size=(count, 3)) * 2.0), hull(rng.normal(size=(count, 3)) + 0.3)
        truth = ConvexHull((a.vertices[:, None] - b.vertices[None]).reshape(-1, 3)).equations
        inner = a.vertices.mean(axis=0) - b.vertices.mean(axis=0)
        planes = difference(a, b)
        for n in spread(60):
            reach = ((planes[:, 3] - planes[:, :3] @ inner) / np.maximum(planes[:, :3] @ n, 1e-300)).min(
                where=planes[:, :3] @ n > 1e-12, initial=np.inf
            )
            most = (-(truth[:, 3] + truth[:, :3] @ inner) / np.maximum(truth[:, :3] @ n, 1e-300)).min(
                where=truth[:, :3] @ n > 1e-12, initial=np.inf
            )
            assert reach <= most + 1e-9
            assert reach >= (0.8 if many else 1.0 - 1e-9) * most
            assert apart(a.vertices, b.vertices + inner + 0.999 * reach * n) <= 1e-6


def test_the_nearest_point_behind_planes():
    """Of all points behind them none is nearer: by the conditions of Karush, Kuhn and Tucker, and by samples."""
    rng, seen = np.random.default_rng(5), 0
    for _ in range(60):
        count = int(rng.integers(1, 6))
        N = rng.normal(size=(count, 3))
        N /= np.linalg.norm(N, axis=1)[:, None]
        planes, start = np.column_stack([N, rng.normal(size=count)]), rng.normal(size=3)
        found = nearest_behind(planes, start)
        if (planes[:, 3] <= N @ start).all():
            assert found is start
            continue
        if found is start:  # none is behind all of them
            samples = 1e3 * rng.normal(size=(2000, 3))
            assert not (samples @ N.T >= planes[:, 3]).all(axis=1).any()
            continue
        seen += 1
        assert (N @ found - planes[:, 3]).min() >= -1e-9
        held = N @ found - planes[:, 3] <= 1e-9
        _, left = nnls(N[held].T, found - start)
        assert left <= 1e-8
    assert seen > 30


def brute(low, high, limit, step=0.05):
    """Length of the shortest translation of a grid that is in no box, and how far a grid can miss it."""
    side = np.arange(-limit, limit + step, step)
    grid = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    held = np.zeros(len(grid), dtype=bool)
    for a, b in zip(low, high, strict=True):
        held |= ((grid > a) & (grid < b)).all(axis=1)
    return np.linalg.norm(grid[~held], axis=1).min(initial=np.inf), step * math.sqrt(3.0)


@pytest.mark.parametrize("seed", range(6))
def test_the_shortest_way_out_of_a_union(seed, monkeypatch):
    """By planes and by cubes, against every translation of a grid: never longer, and to the digit where it ends."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    low, high = -rng.uniform(0.05, 1.2, (count, 3)), rng.uniform(0.05, 1.2, (count, 3))
    union = Union([box_set(a, b) for a, b in zip(low, high, strict=True)], 1.0)
    truth, off = brute(low, high, 1.0)
    length, way = union.shortest(5000)
    assert length <= truth + 1e-9
    assert length >= min(truth - off, 1.0)
    if way is not None:
        assert np.linalg.norm(way) == pytest.approx(length, abs=1e-9)
        assert union.reach(way[None])[0] <= 1e-9
        assert not ((way > low + 1e-9) & (way < high - 1e-9)).all(axis=1).any()
    assert union.shortest(1)[0] <= length + 1e-12
    for cells in (60_000, 500):
        monkeypatch.setattr(depth_cover, "CELLS", cells)
        least, outside = union.clearance(1e-3, 1e-3)
        assert least <= min(truth, 1.0) + 1e-9
        if cells > 500:
            assert least >= min(length, 1.0) - 0.02
        if outside is not None:
            assert union.reach(outside[None])[0] <= 1e-9
            assert least <= np.linalg.norm(outside) + 1e-9
            assert np.linalg.norm(union.way_out(outside)) <= np.linalg.norm(outside) + 1e-12
    points = rng.uniform(-1.5, 1.5, (200, 3))
    inside = np.minimum(points[:, None] - low, high - points[:, None]).min(axis=2).max(axis=1)
    near = np.abs(points).max(axis=1) < 1.0  # planes beyond the limit are left out
    reach = union.reach(points)
    assert (reach >= inside - 1e-12)[near].all()
    assert ((reach > 0.0) == (inside > 0.0))[near & (np.linalg.norm(points, axis=1) < 1.0)].all()


def test_a_set_that_holds_all_translations_leaves_none_open():
    union = Union([box_set([-2.0] * 3, [2.0] * 3), box_set([-0.1] * 3, [0.1] * 3)], 1.0)
    assert union.shortest(100) == (1.0, None)
    assert union.clearance(0.01, 0.01) == (1.0, None)
    nothing = Union([box_set([1.5, 0.0, 0.0], [2.0, 1.0, 1.0])], 1.0)  # does not come so near
    assert nothing.shortest(100) == (0.0, None)


# --- Directions -------------------------------------------------------------------------------------------------------


def test_support_points_are_furthest():
    rng, T = np.random.default_rng(6), translation(1.0, 2.0, 3.0) @ rotation((1.0, 2.0, 3.0), 0.7)
    for shape in (shapes.cylinder(2.0, 6.0), shapes.box((2.0, 3.0, 4.0))):
        (piece,) = CACHE.model(shape).bodies[0].outers
        N = rng.normal(size=(40, 3))
        found = supports(piece, T)(N)
        x = rng.uniform(-4.0, 4.0, (20_000, 3))
        inside = x[body(shape).field(x) <= 0.0] @ T[:3, :3].T + T[:3, 3]
        assert body(shape).field((found - T[:3, 3]) @ T[:3, :3]).max() <= 1e-9
        best = (N * found).sum(axis=1)
        assert (best >= (N @ inside.T).max(axis=1)).all()
        assert piece.support(N @ T[:3, :3]) == pytest.approx((found - T[:3, 3]) @ T[:3, :3], abs=1e-12)


def test_directions_and_their_crossings():
    E = np.array([[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.0]])
    found = directions(E)
    assert sorted(map(tuple, found.tolist())) == [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]
    both = crossed(found, np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    assert len(both) == 6
    assert np.linalg.norm(both, axis=1) == pytest.approx(1.0)
    assert both.sum(axis=0) == pytest.approx([0.0] * 3)


# --- Plates -----------------------------------------------------------------------------------------------------------


def test_which_pairs_are_a_pin_and_a_drilled_plate():
    def form(shape):
        (only,) = CACHE.model(shape).bodies
        return only

    hole, pin = shapes.Hole, form(shapes.cylinder(2.0, 9.0))
    plates = [
        shapes.box((20, 20, 5), holes=[hole(3.0)]),
        shapes.box((20, 30, 5), holes=[hole(3.0, (4.0, 4.0)), hole(3.0, (-4.0, 4.0)), hole(2.0, (0.0, -9.0))]),
        shapes.box((20, 20, 5), holes=[hole(1.0, (3.0, 0.0), "y")]),
        shapes.cylinder(9.0, 5.0, bore=8.9),
    ]
    others = [
        shapes.box((20, 20, 5)),
        shapes.box((20, 20, 5), holes=[hole(3.0), hole(3.0, (5.9, 0.0))]),  # they meet
        shapes.box((20, 20, 5), holes=[hole(3.0, (7.5, 0.0))]),  # open at the side
        shapes.box((20, 20, 9), holes=[hole(1.0, (3.0, 0.0), "y"), hole(1.0, (-7.0, 0.0))]),
        BLOCK,
    ]
    for shape in plates:
        plate = form(shape)
        assert is_drilled(plate, pin)
        assert not is_drilled(plate, form(plates[0]))
        assert not is_drilled(pin, plate)
        for wrong in (
            type(plate)(plate.outers, plate.bores, 0.1),
            type(plate)(plate.outers, plate.bores, 0.0, lambda x: x[:, 0]),
        ):
            assert not is_drilled(wrong, pin)
        short = [type(bore)(bore.radius, bore.half_angle, 0.9 * bore.length, bore.T) for bore in plate.bores]
        away = [type(b)(b.radius, b.half_angle, b.length, translation(*(0.3 * b.T[:3, 2])) @ b.T) for b in plate.bores]
        lean = [type(b)(b.radius, b.half_angle, b.length, b.T @ rotation((1.0, 0.0, 0.0), 1e-3)) for b in plate.bores]
        arc = [type(b)(b.radius, 3.0, b.length, b.T) for b in plate.bores]
        mixed = [*plate.bores[:-1], lean[-1]]
        for bores in (short, away, lean, mixed, arc):
            assert not is_drilled(type(plate)(plate.outers, tuple(bores)), pin)
    for wrong in (
        type(pin)(pin.outers, form(plates[0]).bores),
        type(pin)(pin.outers, (), 0.1),
        type(pin)(pin.outers, (), 0.0, lambda x: x[:, 0]),
    ):
        assert not is_drilled(form(plates[0]), wrong)
    for shape in others:
        assert not is_drilled(form(shape), pin)
    groove = shapes.groove_block(SweptArc(7.0, 1.0, 30.0), 24.0, 12.0)
    for first, second in itertools.product([groove, *plates], [groove]):
        assert not is_drilled(form(first), form(second))
