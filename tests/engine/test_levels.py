"""Each level of the engine alone: its bound, or its certificate, against samples and against brute force."""

import math

import fcl
import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from clamp3d import Scene, Verdict, check, distance, shapes
from clamp3d.engine.batch import bounds_at_poses
from clamp3d.engine.facets import rods_distance
from clamp3d.engine.farthest import Pieces, farthest
from clamp3d.engine.mesh_distance import (
    are_apart,
    errors_nearby,
    meshes_distance,
    nearest_points,
    surface_distance,
    surfaces_meet,
)
from clamp3d.engine.model import ModelCache
from clamp3d.engine.near_faces import FaceMeshes, faces_nearby, near_faces
from clamp3d.engine.surface import SMOOTH, Surface, at_edges, fcl_pair, fcl_tree
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import inverse, rotation, to_target, translation
from clamp3d.geometry.primitives import SweptArc
from clamp3d.geometry.profile import Profile
from clamp3d.testing import assert_distance, body
from tests.kinds import DRAWN, TURNED, box_mesh, faceted_shape, mesh_shape, poses, row_of

QUICK = settings(deadline=None, max_examples=15, suppress_health_check=[*HealthCheck])
FACETED = [faceted_shape(shape, 0.5) for shape in DRAWN]
SOME = st.sampled_from(range(len(DRAWN)))
MODELS = ModelCache()


def surface(shape):
    return Surface(shape.mesh.vertices, shape.mesh.faces)


def sharp(found):
    return found.upper - found.lower < 1e-7


def sampled(one, count, seed=0):
    """Points (count, 3) of a surface."""
    made = trimesh.Trimesh(one.vertices, one.faces, process=False)
    return np.asarray(made.sample(count, seed=seed))


# --- Meshes -----------------------------------------------------------------------------------------------------------


def test_the_faces_that_can_be_the_nearest_are_those_whose_triangles_are():
    """Of two balls with a face for each column of triangles, each by itself, off by 0.01 and 0.02 mm."""
    balls = []
    for number, error in ((12, 0.01), (30, 0.02)):
        made = trimesh.creation.uv_sphere(radius=5.0, count=(9, number))
        angle = np.arctan2(*made.triangles_center.T[:2])
        face = 7 + 2 * np.floor((angle + math.pi) / (2.0 * math.pi) * number).astype(int)
        balls.append(FaceMeshes(Surface(made.vertices, made.faces, np.full(len(made.faces), error)), face))
    a, b = balls
    T = translation(10.4, 3.0, 1.0) @ rotation((1.0, 2.0, 3.0), 0.7)
    gap = nearest_points(a.surface, b.surface, T)[1]
    for one, other, pose, chosen in zip((a, b), (b, a), (T, inverse(T)), near_faces(a, b, T), strict=True):
        low, high = one.boxes
        for k, number in enumerate(one.numbers):
            rows = one.surface.faces[one.face == number]
            corners = one.surface.vertices[rows].reshape(-1, 3)
            assert (low[k], high[k]) == (pytest.approx(corners.min(axis=0)), pytest.approx(corners.max(axis=0)))
            apart = nearest_points(Surface(one.surface.vertices, rows), other.surface, pose)[1]
            assert (number in chosen) == (apart <= gap + 2.0 * 0.03)
    T = translation(9.0, 0.0, 0.0)  # they meet
    for one, other, pose, chosen in zip((a, b), (b, a), (T, inverse(T)), near_faces(a, b, T), strict=True):
        every = {k: Surface(one.surface.vertices, one.surface.faces[one.face == k]) for k in one.numbers.tolist()}
        meeting = {k for k, part in every.items() if surfaces_meet(part, other.surface, pose)}
        assert meeting <= set(chosen.tolist()) < set(every)
        assert meeting
    assert near_faces(a, FaceMeshes(a.surface, 0 * a.face), T) is None  # there are few


def test_rounding_leaves_no_solid_without_a_nearest_face():
    """Of polyhedra without an error the nearest faces are as far apart as the whole, which is rounded otherwise."""
    bodies = [trimesh.creation.cylinder(5.0, 9.0, sections=n) for n in (17, 23)]
    a, b = (FaceMeshes(Surface(m.vertices, m.faces, np.zeros(len(m.faces))), np.arange(len(m.faces))) for m in bodies)
    rng = np.random.default_rng(3)
    for _ in range(50):
        T = translation(*rng.uniform(9.0, 40.0, 3)) @ rotation(rng.normal(size=3), 2.0)
        gap = nearest_points(a.surface, b.surface, T)[1]
        chosen = faces_nearby(a, b, T)
        on_a, on_b = (
            Surface(one.surface.vertices, one.surface.faces[faces]) for one, faces in zip((a, b), chosen, strict=True)
        )
        assert nearest_points(on_a, on_b, T)[1] == pytest.approx(gap, abs=1e-9)


@pytest.mark.parametrize(
    ("sides", "fit", "stands_out"), [(24, "round", True), (6, "round", True), (5, "round", False), (24, "off", False)]
)
def test_round_faces_through_the_corners_stand_out_of_their_facets_by_a_sagitta(sides, fit, stands_out):
    """Facets that turn by more than 65 degrees are no round face; the box is larger by the stated error besides."""
    bar = mesh_shape(trimesh.creation.cylinder(4.0, 10.0, sections=sides), fit, error=0.25)
    more = 0.25 + stands_out * 4.0 * (1.0 - math.cos(math.pi / sides))
    assert MODELS.model(bar).bounds == pytest.approx(surface(bar).box + np.array([[-more], [more]]))


@pytest.mark.parametrize(("e", "f"), [(0.0, 0.0), (0.1, 0.0), (0.0, 0.2), (0.1, 0.2)])
@pytest.mark.parametrize("gap", [2.0, 0.29, 0.0, -0.05, -0.5, -1.5])
def test_errors_of_both_meshes_widen_the_bounds_by_their_sum(gap, e, f):
    """Two boxes face to face: of an overlap the bounds are worth finding only where they can be enough."""
    a, b, off = box_mesh((10.0, 10.0, 10.0), e), box_mesh((6.0, 6.0, 6.0), f), e + f
    T = TURNED @ translation(0.2, 0.1, 8.0 + gap) @ inverse(TURNED)
    for one, other, place in ((a, b, T), (b, a, inverse(T))):
        one, other = (Surface(to_target(TURNED, s.vertices), s.faces, s.face_error) for s in (one, other))
        assert are_apart(one, other, place) == (gap > off)
        at_most, at_least = max(-gap, 0.0) + off, gap + off
        for share in (0.99, 1.02):
            limit = -share * at_most - 1e-9
            found = surface_distance(one, other, place, lambda d, limit=limit: d.lower >= limit)
            assert found.upper == pytest.approx(at_least, abs=1e-9)
            assert found.upper >= at_least
            if gap >= 0.0:
                assert found.lower == pytest.approx(gap - off, abs=1e-9)
            elif share > 1.0:
                assert -1.02 * at_most - 1e-9 <= found.lower <= -at_most
            else:
                assert found.lower == -math.inf
            assert found.lower <= gap - off
        decided = surface_distance(one, other, place, lambda d: d.upper < 0.0)
        assert (decided.lower == -math.inf) == (gap < 0.0)


@pytest.mark.parametrize("closed", [True, False])
def test_what_is_cut_is_all_there_and_no_point_of_it_is_further_than_its_bound(closed):
    """Triangles in one wall of a bracket: their bounds close in on the furthest point, whatever is cut and how."""
    rng = np.random.default_rng(4)
    bracket = Surface(BRACKET.vertices, BRACKET.faces if closed else BRACKET.faces[1:])
    weights, gained = rng.dirichlet(np.ones(3), 200), 0
    for _ in range(8):
        triangles = rng.uniform((0.0, 0.0, 0.0), (5.0, 30.0, 20.0), (4, 3, 3))
        off = rng.choice([0.0, 0.01], (2, len(bracket.faces)))
        bracket = Surface(bracket.vertices, bracket.faces, off[0], has_own_errors=True)
        pieces = Pieces.of(bracket, triangles, off[1, :4])
        every = [pieces]
        gained += int((pieces.moved(np.arange(4)).at_most < 0.99 * pieces.at_most).sum())

        def end(bound, least):
            assert bound >= least - 1e-9
            return bound <= 1.01 * least

        sharp = farthest([pieces], end, 40_000)
        for k in range(60):
            rows = pieces.at_most >= (0.0 if k < 2 else np.sort(pieces.at_most)[-8])
            every.append((pieces.moved(np.flatnonzero(rows)) if k % 2 else pieces).cut(rows))
            pieces = every[-1]
        pieces = pieces.moved(np.arange(len(pieces.triangles)))
        area = trimesh.triangles.area(triangles).sum()
        for now in every:
            assert trimesh.triangles.area(now.triangles).sum() == pytest.approx(area, rel=1e-9)
            middles = now.triangles.mean(axis=1)
            assert now.middles == pytest.approx(bracket.distance(middles))
            assert (now.off >= now.errors).all()
        points = np.einsum("wc,mcx->mwx", weights, pieces.triangles)
        away = bracket.distance(points.reshape(-1, 3)).reshape(points.shape[:2]).max(axis=1)
        assert (pieces.at_most >= away + pieces.errors - 1e-9).all()
        corners = pieces.triangles.reshape(-1, 3)
        truth = max(bracket.distance(corners).max(), pieces.middles.max())
        assert truth + off.min() - 1e-9 <= sharp <= 1.02 * truth + 0.02
    assert gained > (10 if closed else 0)  # of 32; large ones are near the border of an open one


@pytest.mark.parametrize(("missing", "depth"), [([], 2.0), ([4], 1.02 * 2.0)])
@pytest.mark.parametrize(("crossed", "more"), [(16, 0.02), (17, 0.02), (10, 0.0)])
def test_a_piece_is_no_further_than_it_is_moved_and_what_is_off_there(missing, depth, crossed, more):
    """It spans two triangles of a wall, 2 mm below it: each may be crossed on the way out, others count for nothing."""
    errors = np.delete(np.eye(len(BRACKET.faces))[crossed] * 0.02, missing)
    bracket = Surface(BRACKET.vertices, np.delete(BRACKET.faces, missing, axis=0), errors, has_own_errors=True)
    piece = Pieces.of(bracket, np.array([[[2.0, 3.0, 3.0], [2.0, 27.0, 4.0], [2.0, 15.0, 17.0]]]), np.array([0.01]))
    assert piece.at_most[0] > 6.0
    assert piece.moved(np.arange(1)).at_most[0] == pytest.approx(depth + 0.01 + more, abs=1e-5)


def test_errors_within_a_distance_are_those_of_all_triangles_that_are_no_further():
    """Against the distance of each triangle by itself; groups of errors differ by at most half."""
    rng, ball = np.random.default_rng(8), trimesh.creation.icosphere(2, 10.0)
    counted = 0
    for k in range(12):
        errors = rng.choice([k % 2, 1.0], len(ball.faces)) * 10.0 ** rng.uniform(-2.0, 0.0, len(ball.faces))
        one = Surface(ball.vertices, ball.faces, errors, has_own_errors=True)
        triangles = rng.normal(size=(5, 1, 3)) * 7.0 + rng.normal(size=(5, 3, 3))
        reach = rng.uniform(0.0, 4.0, 5)
        each = [fcl_tree(one.vertices, row[None]) for row in one.faces]
        for triangle, most, within in zip(triangles, reach, one.errors_within(triangles, reach), strict=True):
            tree = fcl_tree(triangle, np.array([[0, 1, 2]]))
            near = np.array([fcl.distance(*fcl_pair(tree, other, np.eye(4))) for other in each]) <= most
            assert within >= errors[near].max(initial=0.0)
            counted += within <= 1.5 * errors[near].max(initial=0.0) + 0.02
        assert one.errors_within(triangles, np.full(5, 99.0)) == pytest.approx(errors.max())
    assert counted > 10  # of 60: the reach is taken from the middle of each


def test_no_more_triangles_are_added_than_there_are_cuts(monkeypatch):
    """A triangle that reaches over many of a ball's: most of its pieces are cut in three."""
    mesh = trimesh.creation.icosphere(3, 10.0)
    ball, sizes, cut_further = Surface(mesh.vertices, mesh.faces), [1], Pieces.cut

    def counted(*given):
        pieces = cut_further(*given)
        sizes.append(len(pieces.triangles))
        return pieces

    monkeypatch.setattr(Pieces, "cut", counted)
    triangle = np.array([[[-5.0, -5.0, 6.0], [6.0, -4.0, 6.0], [0.0, 6.0, 6.5]]])
    pieces = Pieces.of(ball, triangle, np.zeros(1))
    bounds = []
    for cuts in (60, 600):
        sizes[:] = [1]
        bounds.append(farthest([pieces], lambda *_: False, cuts))
        assert 20 < sizes[-1] - 1 <= cuts
    assert bounds[0] > bounds[1]


def test_triangles_are_outside_only_where_no_point_of_them_is_inside():
    rng, one = np.random.default_rng(6), Surface(BRACKET.vertices, BRACKET.faces)
    triangles = rng.uniform(-8.0, 45.0, (400, 1, 3)) + rng.uniform(-6.0, 6.0, (400, 3, 3))
    outside = one.is_outside(triangles)
    points = np.einsum("wc,mcx->mwx", rng.dirichlet(np.ones(3), 300), triangles)
    touched = one.contains(points.reshape(-1, 3)).reshape(400, 300).any(axis=1)
    assert not (outside & touched).any()
    assert outside.sum() > 50  # of those whose middle is nearest to an edge the side is not known
    on_top = np.array([[[1.0, 1.0, 20.0], [4.0, 1.0, 20.0], [1.0, 9.0, 20.0]]])
    assert one.is_outside(on_top + np.array([0.0, 0.0, 1e-6])).all()
    assert not one.is_outside(on_top).any()
    for unknown in (Surface(one.vertices, one.faces[1:]), Surface(one.vertices, one.faces, is_simple=False)):
        assert not unknown.is_outside(triangles).any()
    assert len(one.is_outside(triangles[:0])) == 0


def crossings(surface, starts, moves):
    """How often (n,) segments from points (n, 3) meet the triangles of a surface, by their equations alone."""
    a, b, c = (surface.vertices[surface.faces[:, k]][None] for k in range(3))
    normal = np.cross(b - a, c - a)
    along = (moves[:, None] * normal).sum(axis=2)
    share = ((a - starts[:, None]) * normal).sum(axis=2) / np.where(along == 0.0, np.nan, along)
    hit = starts[:, None] + share[:, :, None] * moves[:, None]
    inside = [(np.cross(q - p, hit - p) * normal).sum(axis=2) >= 0.0 for p, q in ((a, b), (b, c), (c, a))]
    return (np.all(inside, axis=0) & (share >= 0.0) & (share <= 1.0)).sum(axis=1)


def test_every_point_of_a_triangle_that_crosses_a_surface_does_so():
    """A wavy sheet with a hole, whose triangles are split at a seam, and a bracket without one of its triangles."""
    rng, x = np.random.default_rng(9), np.linspace(0.0, 10.0, 21)
    corners = np.array([(u, v, 0.6 * np.sin(u) * np.cos(0.5 * v)) for u in x for v in x])
    cells = np.array([i * 21 + j for i in range(20) for j in range(20) if not (8 <= i < 11 and 8 <= j < 10)])
    faces = np.concatenate(
        [np.column_stack([cells, cells + 21, cells + 22]), np.column_stack([cells, cells + 22, cells + 1])]
    )
    sheet = Surface(np.concatenate([corners, corners]), faces + 441 * (faces.max(axis=1) > 300)[:, None])
    sheets = sheet, Surface(BRACKET.vertices, BRACKET.faces[1:])
    crossed = []
    for surface in sheets:
        moves = rng.normal(size=(3000, 3)) * 10.0 ** rng.uniform(-2.0, 0.7, (3000, 1))
        on = (
            rng.dirichlet(np.ones(3), (3000, 1))
            @ surface.vertices[surface.faces[rng.integers(len(surface.faces), size=3000)]]
        )
        triangles = on - (rng.uniform(size=(3000, 1)) * moves)[:, None]
        sizes = 10.0 ** np.sort(rng.uniform(-2.0, 0.3, (3000, 1, 1)), axis=0)[::-1]
        triangles = triangles + rng.normal(size=(3000, 3, 3)) * sizes
        rows = np.flatnonzero(surface.is_crossed(triangles, moves))[:250]
        points = np.einsum("wc,mcx->mwx", rng.dirichlet(0.6 * np.ones(3), 25), triangles[rows]).reshape(-1, 3)
        assert (crossings(surface, points, np.repeat(moves[rows], 25, axis=0)) % 2 == 1).all()
        crossed.append(len(rows))
    assert crossed[0] > 150
    assert crossed[1] > 100
    assert not sheet.is_crossed(np.empty((0, 3, 3)), np.empty((0, 3))).any()


def test_where_contacts_may_be_missing_no_triangle_is_outside(monkeypatch):
    one, across = Surface(BRACKET.vertices, BRACKET.faces), np.array([[[-9.0, 3, 5], [60.0, 3, 5], [20.0, 3, 9]]])
    apart = across + np.array([0.0, 0.0, 40.0])
    assert one.is_outside(np.concatenate([across, apart])).tolist() == [False, True]
    monkeypatch.setattr("clamp3d.engine.surface._CONTACTS", 1)
    assert one.is_outside(np.concatenate([across, apart])).tolist() == [False, False]


BRACKET = trimesh.creation.extrude_polygon(shapely.Polygon([(0, 0), (40, 0), (40, 5), (5, 5), (5, 30), (0, 30)]), 20)


@settings(max_examples=30, deadline=None)
@given(size=st.floats(-6.0, 0.3).map(lambda e: 10.0**e), apart=st.booleans(), turn=st.floats(0.0, 6.0))
def test_gaps_and_overlaps_of_concave_meshes_are_decided(size, apart, turn):
    """A box over the inner face of an L-bracket, both of them turned: gaps and overlaps of 1e-6 to 2 mm."""
    gap = size if apart else -size
    place = translation(3.0, -7.0, 11.0) @ rotation([0.3, -1.0, 0.5], turn)
    bracket, box = mesh_shape(BRACKET), mesh_shape(trimesh.creation.box((10, 10, 10)))
    T = translation(20.0, 10.0 + gap, 10.0)
    (row,) = check(Scene(clearance=50.0).add("bracket", bracket, place).add("box", box, place @ T)).pairs
    assert row.distance.lower - 1e-8 <= gap <= row.distance.upper + 1e-8
    right = Verdict.CLEARANCE if gap > 0.01 else Verdict.CONTACT if gap >= -0.01 else Verdict.CLASH
    assert row.verdict is right or abs(abs(gap) - 0.01) < 2e-6
    found = meshes_distance(MODELS.model(bracket), MODELS.model(box), T, 0.5, sharp)
    assert found.lower - 1e-8 <= gap <= found.upper + 1e-8
    assert gap < 0.0 or found.upper - found.lower < 1e-6


@settings(max_examples=15, deadline=None)
@given(size=st.floats(-6.0, -2.0).map(lambda e: 10.0**e), apart=st.booleans(), drawn=st.booleans())
def test_on_the_seam_of_a_union_gaps_and_overlaps_are_those_of_its_face(size, apart, drawn):
    """A box over the line where two blocks meet, which is no surface: 1e-6 to 1e-2 mm off them or in them."""
    gap = size if apart else -size
    left, right = (Extrusion(Profile.rectangle(20.0, 18.0, (x, 0.0)), "Z", -8.0, 0.0) for x in (-10.0, 10.0))
    floor = shapes.Solid("floor", (left, right))
    if not drawn:
        halves = [trimesh.creation.box((20, 18, 8)).apply_translation((x, 0, -4)) for x in (-10.0, 10.0)]
        floor = mesh_shape(trimesh.boolean.union(halves))
    row = row_of(floor, shapes.box((6, 6, 6)), translation(0.3, 1.0, 3.0 + gap), clearance=1.0)
    assert row.verdict is Verdict.CONTACT or abs(size - 0.01) < 1e-8
    assert row.distance.lower - 1e-8 <= gap <= row.distance.upper + 1e-8


def test_flat_faces_of_a_part_with_a_hole_stay_exact():
    """The chords of one bolt hole say nothing against the flat faces."""
    solids = trimesh.creation.box((40, 40, 10)), trimesh.creation.cylinder(6.0, 30.0, sections=24)
    plate = mesh_shape(trimesh.boolean.difference(solids), "round")
    found = distance(plate, shapes.box((8, 8, 8)), translation(15, 15, 9.05))
    assert found.upper - found.lower < 1e-5


@pytest.mark.parametrize(
    ("angle", "errors", "apart", "widened"),
    [
        (60, (0.1, 0.2), None, (0.3 / math.sin(math.pi / 3), 0.3 / math.sin(math.pi / 3))),
        (30, (0.1, 0.0), None, (0.2, 0.0)),  # of the flat face every point is known
        (60, (0.1, 0.2), False, (0.1, 0.2)),  # one patch
        (120, (0.1, 0.2), None, (0.3, 0.3)),
        (120, (0.1, 0.0), None, (0.1, 0.0)),
        (160, (0.1, 0.2), None, (0.1, 0.2)),  # no edge of the part's
        (160, (0.1, 0.2), True, (0.3, 0.3)),
        (300, (0.1, 0.2), None, (0.3, 0.3)),
        (300, (0.0, 0.2), None, (0.0, 0.2)),
        (1, (0.1, 0.0), None, (0.1 / math.sin(math.radians(1)), 0.0)),
    ],
)
def test_errors_beside_an_edge_reach_the_true_edge(angle, errors, apart, widened):
    """Two faces, the material between them; where both bulge the true edge is where the lines beside them cross."""
    w = math.radians(angle)
    V = np.array([(0, 0, 0), (0, 0, 1), (3, 0, 0), (3, 0, 1), (3 * math.cos(w), 3 * math.sin(w), 0)])
    V = to_target(TURNED, np.vstack([V, V[4] + (0, 0, 1)]))
    F = np.array([(0, 2, 3), (0, 3, 1), (0, 1, 5), (0, 5, 4)])
    e, f = errors
    for step in (1, -1):
        patch = np.array([0, 0, 1, 1]) if apart is None else np.array([0, 0, int(apart), int(apart)])
        smooth = SMOOTH if apart is None else 0.0
        found = at_edges(V, F[::step], np.array([e, e, f, f])[::step], patch[::step], smooth)
        assert found[::step] == pytest.approx([e, *widened, f], rel=1e-9)
    if angle < 90 and apart is None:
        assert math.sqrt(e * e + f * f + 2.0 * e * f * math.cos(w)) / math.sin(w) <= max(widened) * (1.0 + 1e-9)


@pytest.mark.parametrize("gap", [0.003, -0.002])
def test_errors_of_triangles_that_are_far_from_the_other_mesh_do_not_count(gap):
    """Two boxes face to face, each side of them with an error of its own, up to a thousandth or up to a millimetre."""
    rng = np.random.default_rng(7)
    a, b = box_mesh((10.0, 10.0, 10.0)), box_mesh((6.0, 6.0, 6.0))
    T = TURNED @ translation(0.2, 0.1, 8.0 + gap) @ inverse(TURNED)
    for facing in (1e-3, 1.0, 1e-3, 1.0, 1e-3):
        errors = []
        for box, side in ((a, 1.0), (b, -1.0)):
            is_facing, is_opposite = box.normals[:, 2] * side > 0.9, box.normals[:, 2] * side < -0.9
            errors.append(rng.uniform(0.2, 1.0, len(box.faces)) * np.where(is_opposite, 1.0, 1e-3))
            errors[-1][is_facing] = facing * rng.uniform(0.2, 1.0)
        one, other = (
            Surface(to_target(TURNED, x.vertices), x.faces, e, has_own_errors=True)
            for x, e in zip((a, b), errors, strict=True)
        )
        off = errors[0][a.normals[:, 2] > 0.9].max() + errors[1][b.normals[:, 2] < -0.9].max()
        for first, second, place in ((one, other, T), (other, one, inverse(T))):
            lower = surface_distance(first, second, place, lambda _: False).lower
            if gap < 0.0:
                lower = surface_distance(first, second, place, lambda d, off=off: d.lower > -2.0 * off - 0.01).lower
            assert -3.0 * off - 0.01 <= lower <= gap - off
            assert errors_nearby(first, second, place) >= off * (off >= gap)


def test_the_error_of_a_triangle_counts_where_it_is_and_a_quarter_of_it_not_elsewhere():
    """Bounds by groups of errors against each triangle alone; on an edge the errors of both triangles count."""
    rng = np.random.default_rng(5)
    ball, far = trimesh.creation.icosphere(subdivisions=2, radius=10.0), box_mesh((1.0, 2.0, 3.0))
    for k in range(7):
        most = 10.0 ** rng.uniform(-3.0, 0.0)
        error = rng.choice([0.0, 1.0], len(ball.faces)) * most * 4.0 ** -rng.uniform(0.0, 6.0, len(ball.faces))
        error[0] = most if k else 0.0
        one, T = Surface(ball.vertices, ball.faces, error if k else 0.0 * error), TURNED.copy()
        T[:3, 3] = rng.normal(size=3)
        T[:3, 3] *= 14.0 / np.linalg.norm(T[:3, 3])
        each = [fcl_tree(one.vertices, row[None]) for row in one.faces]
        gaps = np.array([fcl.distance(*fcl_pair(tree, far.bvh, T)) for tree in each])
        lower, upper, *_ = nearest_points(one, far, T) if k % 2 else nearest_points(far, one, inverse(T))
        assert upper == pytest.approx(gaps.min(), abs=1e-9)
        coarse = np.where(one.face_error > 0.0, np.maximum(4.0 * one.face_error, most / 64.0), 0.0)
        assert (gaps - np.minimum(coarse, most)).min() - 1e-9 <= lower <= (gaps - one.face_error).min() + 1e-9
        middles = ball.triangles_center
        near = (ball.faces[:, None, :, None] == ball.faces[None, :, None, :]).any((2, 3))
        assert one.error_at(middles) == pytest.approx(np.where(near, one.face_error, 0.0).max(axis=1))
        one.has_own_errors = True
        assert one.error_at(middles) == pytest.approx(one.face_error)
        on_edges = ball.vertices[ball.face_adjacency_edges].mean(axis=1)
        assert one.error_at(on_edges) == pytest.approx(one.face_error[ball.face_adjacency].max(axis=1))
        every = [one.face_error[(ball.faces == corner).any(axis=1)].max() for corner in range(len(ball.vertices))]
        assert (one.error_at(ball.vertices) >= every).all()
        assert one.error_at(1.01 * middles) == pytest.approx(one.face_error.max())


def test_large_convex_meshes_are_asked_as_meshes_and_their_depth_is_found():
    """A hull of so many faces takes gigabytes; the true balls overlap by 0.1 mm, their facets by up to 0.03 less."""
    ball = mesh_shape(trimesh.creation.icosphere(subdivisions=5, radius=10.0))
    cache = ModelCache()
    scene = Scene().add("a", ball).add("b", ball, translation(19.9, 0.0, 0.0))
    (row,) = check(scene, cache=cache).pairs
    assert cache.counters.built["hulls"] == 0
    assert row.verdict is Verdict.CLASH
    assert -0.100001 <= row.distance.lower <= row.distance.upper <= -0.07
    assert row.distance.upper - row.distance.lower <= 0.01


def test_triangles_with_parallel_sides_are_as_far_apart_as_their_planes():
    """FCL stops at some of these pairs of sides."""
    floor = Surface(
        np.array([[-20.0, -25, 0], [20, -25, 0], [20, 25, 0], [-20, 25, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    )
    rng = np.random.default_rng(0)
    for leg, x, y in rng.uniform([1.0, -14.0, -14.0], [5.0, 9.0, 14.0], (300, 3)):
        corner = Surface(np.array([[0.0, -leg, 0], [0, leg, 0], [1, leg, 0]]), np.array([[0, 1, 2]]))
        assert nearest_points(floor, corner, translation(x, y, 3.5))[0] == pytest.approx(3.5, abs=1e-9)


# --- Cylinders on facets ----------------------------------------------------------------------------------------------


@QUICK
@given(SOME, st.floats(0.5, 6.0), st.floats(2.0, 40.0), poses(22.0))
@example(0, 4.0, 5.535025103436983, translation(7, 0, 0))
def test_a_cylinder_on_facets(i, radius, length, T):
    """A lower bound against samples of both surfaces, an upper one against the cylinder's own definition."""
    mesh, rod = surface(FACETED[i]), shapes.cylinder(radius, length)
    found = rods_distance(mesh, MODELS.model(rod).bodies, T)
    points = to_target(inverse(T), sampled(mesh, 4000))
    away = body(rod).field(points).min()
    if away > 0.0:  # the field is never more than the distance
        across = np.hypot(points[:, 0], points[:, 1]) - radius
        along = np.abs(points[:, 2]) - 0.5 * length
        truth = np.hypot(np.maximum(across, 0.0), np.maximum(along, 0.0)).min()
        assert found.lower <= truth + 1e-9
    else:
        assert found.lower <= away + 1e-9
    if found.point_b is not None and 0.0 < found.upper < math.inf:
        assert mesh.distance(found.point_a[None])[0] <= 1e-6
        assert body(rod).field(to_target(inverse(T), found.point_b[None]))[0] <= 1e-6
        assert np.linalg.norm(found.point_b - found.point_a) <= found.upper + 1e-9
    if found.upper < -1e-6:  # samples miss the deepest point of an edge: its own point attests it
        assert mesh.distance(found.point_a[None])[0] <= 1e-6 or mesh.contains(found.point_a[None])[0]
        assert body(rod).field(to_target(inverse(T), found.point_a[None]))[0] <= found.upper + 1e-6


# --- Many poses -------------------------------------------------------------------------------------------------------

GROOVES = [SweptArc(12.0, 1.2, 50.0), SweptArc(7.0, 1.05, 9.0), SweptArc(7.0, 2.1, 30.0)]
HOLDERS = [
    *(shapes.groove_block(groove, 40.0, 30.0) for groove in GROOVES),
    shapes.box((40.0, 40.0, 10.0), holes=[shapes.Hole(6.0, (3.0, 0.0))]),
    shapes.cylinder(9.0, 20.0, bore=6.0),
]


@settings(QUICK, max_examples=6)
@given(st.sampled_from(HOLDERS), st.floats(0.3, 11.0), st.floats(0.5, 80.0), st.integers(0, 10**6))
def test_bounds_at_many_poses_hold_for_each_of_them(holder, radius, length, seed):
    """With single answers and with the bodies' definition; from the other body they are the same."""
    rng = np.random.default_rng(seed)
    T = np.array([rotation(rng.normal(size=3), t) for t in rng.choice([0.0, 0.003, 0.3, 2.0], 8)])
    T[:, :3, 3] = rng.normal(size=(8, 3)) * rng.choice([0.1, 1.0, 9.0], 8)[:, None]
    wire = shapes.cylinder(radius, length)
    a, b = MODELS.model(holder), MODELS.model(wire)
    many, other = bounds_at_poses(a, b, T), bounds_at_poses(b, a, inverse(T))
    assert np.allclose(many.lower, other.lower, rtol=0.0, atol=1e-9)
    for k, pose in enumerate(T):
        alone = bounds_at_poses(a, b, pose[None])
        for name in ("lower", "upper", "point_a", "point_b", "normal"):
            assert getattr(alone, name)[0] == pytest.approx(getattr(many, name)[k], abs=1e-9, nan_ok=True), name
        one = distance(holder, wire, pose, cache=MODELS)
        assert many.lower[k] <= max(one.upper, 0.0) + 1e-9
        assert one.lower <= many.upper[k] + 1e-9
        assert not 1e-9 < many.upper[k] - many.lower[k] < np.inf  # where both are known, but for rounding
    assert_distance(distance(holder, wire, T[0], cache=MODELS), holder, wire, T[0], cells=4000)
