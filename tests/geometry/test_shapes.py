"""Outlines of arcs and segments against their points and shapely, and shapes that are drawn by one call."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
import trimesh
from shapely import Polygon

from clamp3d import InputError, distance
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.meshing import _polygons, enclosed, enclosing, volume_bounds
from clamp3d.geometry.profile import Arc, Profile, Segment, sagitta
from clamp3d.geometry.shells import volume
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import Hole, MeshShape, Solid, SweptArc, box, cylinder, extrusion, groove_block, mesh, sphere
from tests.refusals import refusals

ANGLE = [(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (2.0, 2.0), (2.0, 10.0), (0.0, 10.0)]


def test_a_box_takes_three_numbers_or_one_sequence():
    assert box(10, 20.0, 5) == box((10, 20, 5)) == box(size=np.array([10.0, 20.0, 5.0]))
    named = replace(box(10, 20, 5), name="a", title="b", volume=1000.0, not_modelled="c")
    assert named == box(10, 20, 5)  # equal outlines are equal solids


@pytest.mark.parametrize("outline", [ANGLE, ANGLE[::-1], [*ANGLE, ANGLE[0]], Profile.of(*ANGLE)])
def test_an_extrusion_is_its_polygon_times_its_height(outline):
    solid = extrusion(outline, 4.0)
    assert solid.bounds.tolist() == [[0.0, 0.0, -2.0], [10.0, 10.0, 2.0]]
    made = mesh(solid)
    assert made.is_watertight
    assert made.volume == pytest.approx(4.0 * Polygon(ANGLE).area, rel=1e-12)
    found = distance(solid, box(2, 2, 2), translation(6.0, 7.0, 0.0))
    assert found.lower - 1e-9 <= 3.0 <= found.upper + 1e-9


@pytest.mark.parametrize("mesh_error", [None, 0.5])
def test_the_facets_of_a_sphere_have_their_corners_on_it(mesh_error):
    ball = sphere(5.0, mesh_error=mesh_error)
    assert 0.0 < ball.error <= (mesh_error or 5e-3)
    assert np.linalg.norm(ball.mesh.vertices, axis=1) == pytest.approx(5.0, abs=1e-12)
    centres = ball.mesh.vertices[ball.mesh.faces].mean(axis=1)
    assert 5.0 - np.linalg.norm(centres, axis=1).min() <= ball.error


test_what_is_no_shape_is_refused = refusals(
    (lambda: box(1, 2), "size of a box must be three numbers"),
    (lambda: box(1, 2, -1), "size must be a finite length > 0 mm, got -1"),
    (lambda: extrusion(ANGLE, 0.0), "height must be a finite length > 0 mm"),
    (lambda: extrusion([(0, 0), (1, 0)], 1.0), "outline must enclose an area"),
    (lambda: extrusion(3, 1.0), "outline must have shape"),
    (lambda: sphere(-1.0), "radius must be a finite length > 0 mm, got -1"),
    (lambda: sphere(1.0, mesh_error=1e-9), "mesh_error of a sphere must be >= 1e-05 mm"),
    (lambda: sphere(1.0, mesh_error=math.nan), "mesh_error must be a finite number"),
)


def test_a_surface_that_is_flat_to_rounding_has_no_volume():
    box = trimesh.creation.box((3.0, 4.0, 5.0))
    flat = (box.vertices * (1.0, 1.0, 0.0)) @ rotation((1.0, 2.0, 3.0), 0.7)[:3, :3].T + (100.0, 200.0, 300.0)
    assert volume(flat, box.faces) == 0.0
    assert volume(box.vertices, box.faces) == pytest.approx(60.0)


def plate(at, axis="z", radius=2.0):
    return box((10.0, 20.0, 6.0), holes=[Hole(radius, at, axis)])


def block(width=50.0, height=20.0, half=1.0, **more):
    return groove_block(SweptArc(7.0, half, 50.0), width, height, **more)


REACH, OTHER = 7.0 * math.sin(1.0), 5.0 * math.sin(0.9)


@pytest.mark.parametrize(
    ("make", "limit", "words"),
    [
        (lambda x: plate((x, 1.0)), 7.0, r"at \(.*, 1.0\) lies beside"),
        (lambda x: plate((5.0 + x, -10.0 - x)), math.sqrt(2.0), "lies beside"),
        (lambda x: plate((1.0, -x), "y"), 5.0, "lies beside"),
        (lambda x: plate((1.0, -2.0), radius=x), math.hypot(6.0, 12.0), "leaves nothing of the part"),
        (lambda x: plate((1.0, -2.0), "y", radius=x), math.hypot(6.0, 5.0), "leaves nothing of the part"),
        (lambda x: cylinder(5.0, 1.0, bore=x), 5.0, "bore must be between"),
        (lambda x: block(1.0 / x), 0.5 / REACH, r"x = 0 mm leaves the block: width must be > 11\.78"),
        (lambda x: block(1.0 / x, 40.0, 2.0), 1.0 / 14.0, "width must be > 14 mm"),
        (lambda x: block(others=[(x, 5.0, 0.9)]), 25.0 - OTHER, "leaves the block: width must be > 50 mm"),
        (lambda x: block(holes=[Hole(2.0, (1.0, -x), "y")]), 27.0, "lies beside"),
        (lambda x: block(height=1.0 / x), 1.0 / (7.0 - 7.0 * math.cos(1.0)), r"height must be > 3\.217"),
        (lambda x: block(others=[(-1.0 / x, 5.0, 0.9)]), 1.0 / (REACH + OTHER), r"must be > 9\.806"),
        (lambda x: MeshShape(sphere(2.0).mesh, error=x), 1e5, "error of a mesh must be >= 0 and < 100000 mm"),
    ],
)
def test_what_does_not_fit_is_refused_from_its_limit_on(make, limit, words):
    make(limit * (1.0 - 1e-9))
    with pytest.raises(InputError, match=words):
        make(limit * (1.0 + 1e-9))


def bulging(p, q, bulge):
    """Arc from p to q whose middle is off the chord, to the right where it is convex, by ``bulge`` half chords."""
    p, q = np.array(p), np.array(q)
    half, right = 0.5 * math.dist(p, q), np.array([q[1] - p[1], p[0] - q[0]]) / math.dist(p, q)
    radius = 0.5 * half * (abs(bulge) + 1.0 / abs(bulge))
    centre = 0.5 * (p + q) + (abs(bulge) * half - radius) * math.copysign(1.0, bulge) * right
    first, sweep = math.atan2(*(p - centre)[::-1]), 4.0 * math.atan(bulge)
    return Arc(tuple(centre.tolist()), radius, first, first + sweep)


def outlines(rng, count):
    """Polygons about the origin, some of whose sides bulge out or in."""
    for _ in range(count):
        n = int(rng.integers(3, 8))
        turn = 2.0 * math.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
        corners = (rng.uniform(5.0, 20.0) * np.column_stack([np.cos(turn), np.sin(turn)])).tolist()
        pieces = []
        for p, q in zip(corners, [*corners[1:], corners[0]], strict=True):
            bulge = float(rng.choice([0.0, -0.25, -0.1, 0.02, 0.3, 1.0]))
            pieces.append(bulging(p, q, bulge) if bulge else tuple(p))
            if bulge and rng.random() < 0.5:
                pieces.append(tuple(q))
        yield Profile.of(*pieces)


def points(profile, count):
    """Points (n, 2) on the outline, ``count`` on each arc."""
    found = []
    for edge in profile.edges:
        if isinstance(edge, Arc):
            t = np.linspace(edge.start_angle, edge.end_angle, count, endpoint=False)
            found.append(edge.centre + edge.radius * np.column_stack([np.cos(t), np.sin(t)]))
        else:
            found.append([edge.start])
    return np.vstack(found)


def test_area_bounds_and_reach_are_those_of_the_points():
    rng = np.random.default_rng(0)
    for profile in outlines(rng, 60):
        P = points(profile, 2000)
        assert profile.area == pytest.approx(Polygon(P).area, rel=1e-6)
        assert np.ravel(profile.bounds) == pytest.approx([*P.min(axis=0), *P.max(axis=0)], abs=1e-4)
        for angle in rng.uniform(-4.0, 4.0, 5):
            n = 3.0 * np.array([math.cos(angle), math.sin(angle)])
            assert (P @ n).max() <= profile.support(*n) + 1e-9 <= (P @ n).max() + 1e-4
        for edge, after in zip(profile.edges, [*profile.edges[1:], profile.edges[0]], strict=True):
            assert math.dist(edge.end, after.start) <= 1e-9
            assert not isinstance(edge, Segment) or math.dist(edge.start, edge.end) > 1e-9


def test_polygons_keep_their_error_and_their_side():
    rng = np.random.default_rng(1)
    one_sided = 0
    for profile in outlines(rng, 60):
        P, error = shapely.points(points(profile, 400)), float(rng.choice([1.0, 0.1, 0.003]))
        chords, inner, outer = (Polygon(profile.polygon(error, side)) for side in ("chords", "inner", "outer"))
        lost, gained = profile.chord_areas(error)
        assert chords.area == pytest.approx(profile.area - lost + gained, rel=1e-9)
        far, worst = shapely.distance(chords.exterior, P).max(), profile.chord_error(error)
        assert 0.98 * worst <= far <= worst + 1e-9
        assert worst <= error * (1.0 + 1e-9)
        for arc in profile.arcs:
            n = arc.chord_count(error)
            corners = arc.chords(error, arc.start)
            assert len(corners) == n
            assert n % 2 == 0
            assert len(arc.tangents(error, arc.start)) == max(n, 4) + 1
            assert np.hypot(*(np.array(corners) - arc.centre).T) == pytest.approx(arc.radius, abs=1e-9)
            wider = sagitta(arc.radius, abs(arc.sweep) / (n - 2)) if n > 2 else np.inf
            assert arc.sagitta(n) <= error * (1.0 + 1e-9) < wider * (1.0 + 2e-9)
        if inner.is_valid and outer.is_valid:
            one_sided += 1
            assert outer.buffer(1e-9).contains(P).all()
            assert not inner.buffer(-1e-9).contains(P).any()
            assert outer.area - inner.area <= 4.0 * error * chords.length
    assert one_sided > 40


@pytest.mark.parametrize("side", ["inner", "outer"])
def test_what_is_left_of_a_thin_lune_is_polygons(side):
    """Wall of 0.007 mm, chords off by 3.2 mm: the tangents of one arc run along the chords of the other."""
    half, inner = 0.7944527575456962, 0.7936696486020092
    outer, centre, radius = 18.429118643281132, -0.020243191978309483, 18.443308203518242
    profile = Profile.of(Arc((0.0, 0.0), outer, -half, half), Arc((centre, 0.0), radius, inner, -inner))
    pieces = _polygons(profile, 3.244780302252709, side)
    assert pieces
    assert all(piece.geom_type == "Polygon" and piece.area > 0.0 for piece in pieces)
    area = shapely.union_all(pieces).area
    assert area < profile.area if side == "inner" else area > profile.area


def test_of_chords_that_run_back_over_each_other_no_line_is_left():
    """A square with a horn so thin that both of its sides have the same chord."""
    corners = [(0.0, 0.0), (8.0, 0.0), (8.0, 8.0), (24.0, 8.0), (0.0, 8.0)]
    pieces = shapely.make_valid(Polygon(corners)).geoms
    assert [piece.geom_type for piece in pieces] == ["Polygon", "LineString"]
    horn = SimpleNamespace(polygon=lambda mesh_error, side="chords": np.array(corners), arcs=())
    (square,) = _polygons(horn, 0.1, "outer")
    assert square.bounds == (0.0, 0.0, 8.0, 8.0)
    assert square.area == 64.0


def test_hexagons_and_rectangles_have_their_sides():
    hexagon = Profile.hexagon(30.0)
    corners = np.array([edge.start for edge in hexagon.edges])
    assert np.hypot(*corners.T) == pytest.approx(30.0 / math.sqrt(3.0), abs=1e-12)
    assert [math.dist(edge.start, edge.end) for edge in hexagon.edges] == pytest.approx([30.0 / math.sqrt(3.0)] * 6)
    assert hexagon.bounds[1] == pytest.approx((30.0 / math.sqrt(3.0), 15.0))
    assert Profile.rectangle(4.0, 6.0, (11.0, -12.0)).bounds == ((9.0, -15.0), (13.0, -9.0))
    assert Profile.rectangle(4.0, 6.0, (11.0, -12.0)).area == 24.0


def edges(*corners):
    return tuple(Segment(start, end) for start, end in zip(corners, [*corners[1:], corners[0]], strict=True))


CROSSED = r"outline must not cross itself: .*self-intersection"
OPEN = (*edges((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))[:2], Segment((1.0, 1.1), (0.0, 0.0)))


test_outlines_that_are_open_clockwise_or_crossed_are_refused = refusals(
    (lambda: Profile(OPEN), r"outline must be closed: edge 2 starts at \(1.0, 1.1\)"),
    (lambda: Profile(edges((0.0, 0.0), (1.0, 1.0), (1.0, 0.0))), "counter-clockwise"),
    (lambda: Profile.of((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.5)), rf"{CROSSED}\[1.1111"),
    (lambda: Profile.of((-3, -1), Arc((0, 0), 3.0, -1.5, 1.5), (-3, 1), (4.0, 0.5), (-4, 0)), CROSSED),
    (lambda: Profile.of((-3e-3, -1e-3), Arc((0, 0), 3e-3, -1.5, 1.5), (-3e-3, 1e-3), (4e-3, 0), (-4e-3, 0)), "self"),
    (
        lambda: Profile.of((0, -15), (10, -15), Arc((10, 0), 10.01, -math.pi / 2, -1.5 * math.pi), (10, 15), (0, 15)),
        "self",
    ),
    # At a corner, and twice round.
    (lambda: Profile.of((1.0, 1.0), (0.0, 3.0), (2.0, 3.0), (1.0, 1.0), (0.0, 0.0), (5.0, 0.0)), CROSSED),
    (lambda: Profile.of((0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (0.0, 0.0), (3.0, 0.0), (0.0, 3.0)), CROSSED),
)


def test_an_outline_may_touch_itself_and_run_along_itself():
    assert Profile(edges((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))).area == 0.5
    corner = [(0.0, 0.0), (3.0, 0.0), (1.0, 1.0), (1.5, 2.0), (0.5, 2.0), (1.0, 1.0)]
    assert Profile.of(*corner).area == 2.0
    bridge = [(0.0, 4.0), (3.0, 4.0), (3.0, 6.0), (6.0, 6.0), (6.0, 3.0), (3.0, 3.0), (3.0, 4.0), (0.0, 4.0)]
    assert Profile.of((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0), *bridge).area == 72.0
    crescent = [Arc((0.0, 0.0), 5.0, 0.0, math.pi), Arc((-1.0, 0.0), 4.0, math.pi, 0.0), (4.0, 0.0)]
    assert Profile.of(*crescent).area == pytest.approx(4.5 * math.pi)


def test_the_mesh_of_an_outline_that_crosses_itself_within_rounding_is_not_inside_out():
    """An arc stands out of the opposite side by 0.0015 mm."""
    outline = Profile.of((-15, 0), Arc((0, 0), 10.0015, math.pi, 0.0), (15, 0), (15, 10), (-15, 10))
    for error in (0.1, 0.001):
        made = mesh(Solid("arch", (Extrusion(outline, "Z", 0.0, 2.0),)), error)
        assert made.volume == pytest.approx(2.0 * outline.area, rel=0.02)
        assert made.is_watertight


def test_what_is_drawn_of_an_outline_is_its_points_along_an_axis():
    rng, drill = np.random.default_rng(2), Profile.circle(1.0, (0.5, 0.2))
    assert len(drill.polygon(0.1, "outer")) == drill.arcs[0].chord_count(0.1)
    for k, profile in enumerate(outlines(np.random.default_rng(0), 30)):
        chords, hole = Polygon(profile.polygon(0.3)), Polygon(drill.polygon(0.3))
        if not chords.contains(hole.buffer(0.5)):
            continue
        (start, end), axis, (a, b) = np.sort(rng.uniform(-9.0, 9.0, 2)), "YZ"[k % 2], points(profile, 500).T
        corners = np.hstack([[a, z + 0.0 * a, -b] if axis == "Y" else [a, b, z + 0.0 * a] for z in (start, end)]).T
        body, n = Extrusion(profile, axis, start, end), rng.normal(size=3)
        assert (corners @ n).max() - 1e-9 <= body.support(n) <= (corners @ n).max() + 1e-2
        solid = Solid("drilled", (body,), (Extrusion(drill, axis, start, end),), volume=body.volume)
        made, (lost, gained) = mesh(solid, 0.3), profile.chord_areas(0.3)
        assert made.volume == pytest.approx((end - start) * (chords.area - hole.area), rel=1e-9)
        assert made.metadata["chord_error"] == max(profile.chord_error(0.3), drill.chord_error(0.3))
        bounds = body.volume + (end - start) * np.array([-lost, gained + math.pi - hole.area])
        assert volume_bounds(solid, 0.3) == pytest.approx(bounds)
        inner, outer = (trimesh.Trimesh(*make(solid, 0.3)).volume for make in (enclosed, enclosing))
        assert inner < body.volume - math.pi * (end - start) < outer
