"""Surfaces of CAD faces, splines among them, and how far their triangles are from them, against Open CASCADE alone."""

import itertools

import numpy as np
import pytest
from igl import point_mesh_squared_distance

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")


from clamp3d import Verdict, check, load
from clamp3d.errors import Clamp3dError
from clamp3d.files import faces, tessellation
from clamp3d.files.faces import CONE, CYLINDER, OTHER, PLANE, SPHERE, TORUS, height
from clamp3d.files.open_cascade import explore, from_bytes, occ, to_bytes
from clamp3d.files.pairs import common, depths
from clamp3d.files.solid import BrepSolid
from clamp3d.files.tessellation import _deviation, border_sag, tessellate, triangles_of
from clamp3d.geometry.mesh import is_closed
from tests.cad import (
    array_of,
    ball,
    block,
    cone,
    cut,
    first_solid,
    location,
    moved,
    random_pose,
    ring,
    rod,
    shift,
    turn,
    volume,
)
from tests.files.assemblies import write_step
from tests.public.placed_pairs import arch, placed_pair

SOLIDS = {
    "drilled": (cut(block((-9, -9, 0), (9, 9, 4)), rod(3, -1, 5)), {PLANE, CYLINDER}),
    "cone": (cone(5, 2, 0, 7), {PLANE, CONE}),
    "hollow": (cut(block((-9, -9, -9), (9, 9, 9)), ball(5)), {PLANE, SPHERE}),
    "ring": (ring(8, 2), {TORUS}),
    "arch": (arch(9, 4, 12), {PLANE, OTHER}),
}


def as_splines(shape):
    return occ.BRepBuilderAPI_NurbsConvert(shape, True).Shape()


def off_face(face, points):
    """Distance (k,) of points (k, 3) from a face by Open CASCADE, mm."""
    vertices = (occ.BRepBuilderAPI_MakeVertex(occ.gp_Pnt(*point.tolist())).Vertex() for point in points)
    return np.array([occ.BRepExtrema_DistShapeShape(face, vertex).Value() for vertex in vertices])


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("splines", [False, True])
@pytest.mark.parametrize("name", SOLIDS)
def test_a_surface_is_known_whether_its_file_gives_a_spline_or_not(name, splines, mirrored):
    shape, kinds = SOLIDS[name]
    shape = as_splines(shape) if splines else shape
    if mirrored:
        mirror = occ.gp_Trsf()
        mirror.SetMirror(occ.gp_Ax2(occ.gp_Pnt(1, 2, 3), occ.gp_Dir(1, 1, 0)))
        shape = occ.BRepBuilderAPI_Transform(shape, mirror, True).Shape()
    brep = to_bytes(first_solid(shape.Moved(location(random_pose(np.random.default_rng(2))))))
    triangles, form = tessellate(brep, 0.05), faces.surfaces(brep)
    assert set(form.kind.tolist()) == kinds
    for face in explore(from_bytes(brep), "FACE"):
        surface, uv = occ.BRepAdaptor_Surface(face), np.random.default_rng(3).uniform(-1.0, 3.0, (9, 2))
        there = [surface.Value(*place).Coord() for place in uv.tolist()]
        assert faces.points_on(face, uv) == pytest.approx(np.array(there), abs=1e-12)
    corners = triangles.vertices[triangles.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for k in np.flatnonzero(form.kind != OTHER):
        rows = triangles.face == k
        data = int(form.kind[k]), form.frame[k], form.size[k]
        assert np.abs(height(*data, corners[rows].reshape(-1, 3))).max() < 1e-9
        step = 1e-3 * outward[rows] / np.linalg.norm(outward[rows], axis=1, keepdims=True)
        middles = corners[rows].mean(axis=1)
        rises = height(*data, middles + step) - height(*data, middles - step)
        assert (form.sense[k] * rises > 1e-3).all()


def test_a_bump_between_the_places_that_open_cascade_looks_at_is_found(monkeypatch):
    solid = first_solid(as_splines(ball(5)))
    spline = occ.BRep_Tool.Surface_s(next(explore(solid, "FACE")))
    data = SPHERE, np.vstack([np.zeros(3), np.eye(3)]), np.array([5.0, 0.0])
    for a, b in ((0.0, np.pi / 3), (np.pi / 3, 2 * np.pi / 3)):
        for share in (0.25, 0.5, 0.75):
            spline.InsertUKnot(a + share * (b - a), 1, 0.0)
    assert faces._coincides(spline, *data)
    with monkeypatch.context() as patch:
        patch.setattr(faces, "_MOST_PLACES", 100)
        assert not faces._coincides(spline, *data)
    spline.SetPole(4, 2, spline.Pole(4, 2).Translated(occ.gp_Vec(0, 0, 1e-5)))
    assert not faces._coincides(spline, *data)


def test_what_bends_up_as_much_as_down_is_no_plane():
    spline = occ.BRep_Tool.Surface_s(next(explore(as_splines(block((0, 0, 0), (4, 4, 4))), "FACE")))
    spline.IncreaseDegree(3, 3)
    plane = occ.GeomConvert_SurfToAnaSurf(spline).ConvertToAnalytical(1e-7)
    kind, *data = faces.form_of(occ.GeomAdaptor_Surface(plane))
    assert faces._coincides(spline, kind, *data)
    normal = occ.gp_Vec(*data[0][3].tolist())
    for u, v, rise in ((2, 2, 1e-5), (3, 2, -1e-5), (2, 3, -1e-5), (3, 3, 1e-5)):  # nothing at the middle
        spline.SetPole(u, v, spline.Pole(u, v).Translated(normal * rise))
    assert not faces._coincides(spline, kind, *data)


def test_what_open_cascade_takes_for_a_sphere_is_looked_at_once_more(monkeypatch):
    class Loose(occ.GeomConvert_SurfToAnaSurf):
        def ConvertToAnalytical(self, _):
            return super().ConvertToAnalytical(0.1)

    egg = first_solid(as_splines(ball(5)))
    spline = occ.BRep_Tool.Surface_s(next(explore(egg, "FACE")))
    spline.SetPole(3, 2, spline.Pole(3, 2).Translated(occ.gp_Vec(0, 0, 1e-5)))
    monkeypatch.setattr(occ, "GeomConvert_SurfToAnaSurf", Loose)
    assert faces.surfaces(to_bytes(first_solid(as_splines(ball(5))))).kind.tolist() == [SPHERE]
    assert faces.surfaces(to_bytes(egg)).kind.tolist() == [OTHER]


def test_corners_beside_a_surface_add_to_the_errors_of_its_triangles():
    shape = first_solid(rod(3, 0, 5))
    occ.BRepMesh_IncrementalMesh(shape, 0.05)
    every = [*explore(shape, "FACE")]
    form = faces.surfaces_of(every)
    for k, face in enumerate(every):
        points, triangles, uv = triangles_of(face, k)
        beside = points + form.frame[k, 3] * 0.01 * np.eye(len(points))[:, :1]
        exact, off = (_deviation(face, form, k, x, triangles, uv) for x in (points, beside))
        assert (off >= exact - 1e-12).all()
        if form.kind[k] == PLANE:
            assert off.min() >= 0.01 - 1e-12


def strip(bend):
    """A board whose plane faces have a border that crosses its chord in the middle; ``bend`` mm as a pole."""
    poles = array_of("gp_Pnt", [occ.gp_Pnt(*at, 0.0) for at in ((0, 0), (20 / 3, bend), (40 / 3, -bend), (20, 0))])
    edges = [occ.BRepBuilderAPI_MakeEdge(occ.Geom_BezierCurve(poles)).Edge()]
    corners = [occ.gp_Pnt(*at, 0.0) for at in ((20, 0), (20, -5), (0, -5), (0, 0))]
    edges += [occ.BRepBuilderAPI_MakeEdge(*ends).Edge() for ends in itertools.pairwise(corners)]
    face = occ.BRepBuilderAPI_MakeFace(occ.BRepBuilderAPI_MakeWire(*edges).Wire(), True).Face()
    return occ.BRepPrimAPI_MakePrism(face, occ.gp_Vec(0.0, 0.0, 3.0)).Shape()


def beyond(points, made, rows):
    """How far points (k, 3) are from the nearest of some triangles, as a share of its error; 0 within 1e-6 mm."""
    square, row, _ = point_mesh_squared_distance(points, made.vertices, made.faces[rows])
    return (np.maximum(np.sqrt(square) - 1e-6, 0.0) / np.maximum(made.errors[rows][row], 1e-9)).max()


TRIANGULATED = {name: shape for name, (shape, _) in SOLIDS.items()}
TRIANGULATED["sawn"] = cut(rod(5, 0, 12), moved(block((-9, -9, 6), (9, 9, 26)), turn((1, 1, 0), 0.7)))
"""With elliptical borders, and as a spline with triangles inside of its face that is a cylinder."""
TRIANGULATED |= {"bent": strip(1.0), "more bent": strip(2.0)}


@pytest.mark.parametrize("splines", [False, True])
@pytest.mark.parametrize("name", TRIANGULATED)
def test_no_triangle_is_further_from_its_face_nor_the_face_from_it_than_its_error(name, splines):
    brep = to_bytes(first_solid(as_splines(TRIANGULATED[name]) if splines else TRIANGULATED[name]))
    made, fine = tessellate(brep, 0.05), tessellate(brep, 0.008)
    shares = np.vstack([np.random.default_rng(5).dirichlet(np.ones(3), 5), 0.5 - 0.5 * np.eye(3)])
    for k in range(made.face.max() + 1):
        rows, its = made.face == k, fine.faces[fine.face == k]
        assert beyond(fine.vertices[its].reshape(-1, 3), made, rows) <= 1.001
        points = shares @ made.vertices[made.faces[rows]]
        square, *_ = point_mesh_squared_distance(points.reshape(-1, 3), fine.vertices, its)
        assert (np.sqrt(square).reshape(len(points), -1).max(axis=1) <= made.errors[rows] + 0.008).all()
    every, rng = [*explore(from_bytes(brep), "FACE")], np.random.default_rng(5)
    curved = np.flatnonzero(made.errors > 1e-9)
    for row in curved[np.argsort(made.errors[curved])[:: max(1, len(curved) // 30)]]:
        corners = made.vertices[made.faces[row]]
        middles = 0.5 * (corners + np.roll(corners, 1, axis=0))
        points = np.vstack([rng.dirichlet(np.ones(3), 9) @ corners, corners.mean(axis=0), middles])
        assert off_face(every[made.face[row]], points).max() <= made.errors[row] + 1e-7
    assert made.errors.max() < 0.15
    assert is_closed(made.faces)


@pytest.mark.parametrize("splines", [False, True])
@pytest.mark.parametrize("name", TRIANGULATED)
def test_triangles_are_fine_on_some_faces_coarse_on_others_and_close(name, splines):
    brep = to_bytes(first_solid(as_splines(TRIANGULATED[name]) if splines else TRIANGULATED[name]))
    coarse, fine = tessellate(brep, tessellation.COARSE), tessellate(brep, 0.008)
    shares, count = np.vstack([np.random.default_rng(5).dirichlet(np.ones(3), 5), np.eye(3)]), coarse.face.max() + 1
    sizes = []
    for k in range(count):
        made = tessellate(brep, 0.008, (k,))
        assert is_closed(made.faces)
        of_face = [(mesh.face == k).sum() for mesh in (coarse, made, fine)]
        assert of_face[1] >= max(of_face[0], 0.9 * of_face[2])
        sizes.append(len(made.faces))
        assert made.errors[made.face == k].max() <= 1.01 * fine.errors[fine.face == k].max() + 1e-9
        for other in range(count):
            rows, its = made.face == other, fine.faces[fine.face == other]
            # The nearest triangle need not be the one that stands for a point: so it may be a little more.
            assert beyond(fine.vertices[its].reshape(-1, 3), made, rows) <= 1.01
            points = (shares @ made.vertices[made.faces[rows]]).reshape(-1, 3)
            square, *_ = point_mesh_squared_distance(points, fine.vertices, its)
            assert (np.sqrt(square).reshape(rows.sum(), -1).max(axis=1) <= made.errors[rows] + 0.008).all()
    assert count < 5 or min(sizes) < 0.7 * len(fine.faces)


@pytest.mark.parametrize(
    ("shape", "most"),
    [(cone(5, 4, 0, 50), 1_000), (cut(cone(5, 4, 0, 50), ball(3)), 40_000)],
    ids=["whole", "with a hollow"],
)
def test_a_cone_that_is_a_spline_gets_no_more_triangles_than_it_needs(shape, most):
    """Where Open CASCADE looks whether they are near enough, it gets 190 000."""
    made = tessellate(to_bytes(first_solid(as_splines(shape))), 0.0018)
    assert is_closed(made.faces)
    assert made.errors.max() <= 0.0018
    assert len(made.faces) < most


def bumpy(count, at, height):
    """A spline over 40 x 40 mm, flat but for a bump, with the highest of ``count`` x ``count`` poles at ``at``."""
    ends = np.linspace(0.0, 40.0, count - 2)
    every = np.concatenate([[0.0] * 3, ends, [40.0] * 3])
    across = [float(every[k + 1 : k + 4].mean()) for k in range(count)]
    poles = [[occ.gp_Pnt(x, y, height * ((i, j) == at)) for j, y in enumerate(across)] for i, x in enumerate(across)]
    knots, times = array_of("double", ends.tolist()), array_of("int", [4, *[1] * (count - 4), 4])
    return occ.Geom_BSplineSurface(array_of("gp_Pnt", poles), knots, knots, times, times, 3, 3)


@pytest.mark.parametrize(
    ("count", "at", "offset"), [(21, (7, 12), 0.0), (21, (7, 12), 1.0), (41, (13, 26), 0.0), (81, (29, 51), 1.0)]
)
def test_no_bump_of_a_spline_is_overlooked(count, at, offset, monkeypatch):
    """Open CASCADE's own mesh of 0.1 mm leaves out all of a bump that is 0.89 mm high."""
    surface = bumpy(count, at, 2.0)
    if offset:
        surface = occ.Geom_OffsetSurface(surface, offset)
    brep = to_bytes(occ.BRepBuilderAPI_MakeFace(surface, 1e-7).Face())
    made = tessellate(brep, 0.1)
    u, v = (40.0 * (index - 1) / (count - 3) for index in at)
    steps = np.linspace(-3, 3, 25)
    true = np.array([surface.Value(u + du, v + dv).Coord() for du in steps for dv in steps])
    assert true[:, 2].max() > offset + 0.8
    assert made.vertices[:, 2].max() > offset + 0.7
    monkeypatch.setattr(tessellation, "_FINER", (1.0,))
    for mesh in (made, tessellate(brep, 0.1)):  # the errors of the second hold what it leaves out
        away, row, _ = point_mesh_squared_distance(true, mesh.vertices, mesh.faces)
        assert (np.sqrt(away) <= mesh.errors[row] + 0.01).all()  # where a knot is inside a triangle twice is not enough


def patch(heights):
    """A face over 20 x 20 mm whose heights are a polynomial, by its Bezier poles (n, m)."""
    x, y = (np.linspace(0.0, 20.0, count) for count in np.shape(heights))
    poles = [[occ.gp_Pnt(x[i], y[j], z) for j, z in enumerate(row)] for i, row in enumerate(heights.tolist())]
    surface = occ.Geom_BezierSurface(array_of("gp_Pnt", poles))
    return surface, occ.BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


CROWN = np.outer([0.0, 2.0, 0.0], [0.0, 1.2, 0.0])
"""0.6 mm high in the middle, with straight borders."""
WAVE = np.outer([0.0, 0.1, -0.1, 0.0], [1.0, 1.0])
"""Passes through the middle of its chord; also along its borders."""


@pytest.mark.parametrize("heights", [CROWN, WAVE, 0.3 * WAVE, CROWN + CROWN.T])
def test_a_face_is_as_near_to_its_triangles_as_said_between_the_middles_of_their_edges(heights):
    surface, face = patch(heights)
    made = tessellate(to_bytes(face), 0.1)
    true = np.array([surface.Value(u, v).Coord() for u in np.linspace(0, 1, 41) for v in np.linspace(0, 1, 41)])
    assert beyond(true, made, np.arange(len(made.faces))) <= 0.6  # what is seen of a spline counts twice


def test_a_pin_that_stands_in_a_crowned_face_clashes(tmp_path):
    """Between their edges the coarse triangles of the face are 0.15 mm off it."""
    plate = occ.BRepPrimAPI_MakePrism(patch(CROWN)[1], occ.gp_Vec(0.0, 0.0, -5.0)).Shape()
    parts = {"plate": plate, "pin": block((4.95, 9.95, 0.4), (5.05, 10.05, 8.0))}  # the face is at 0.45 mm there
    (row,) = check(load(write_step(parts, tmp_path / "crown.step")), depths=False).pairs
    assert row.verdict is Verdict.CLASH


def test_a_bump_that_stands_in_another_part_clashes(tmp_path):
    """Open CASCADE's own distance says that plate and lid are 0.09 mm apart: it leaves out the bump."""
    face = occ.BRepBuilderAPI_MakeFace(occ.Geom_OffsetSurface(bumpy(81, (29, 51), 2.0), 1.0), 1e-7).Face()
    plate = occ.BRepPrimAPI_MakePrism(face, occ.gp_Vec(0.0, 0.0, -9.0)).Shape()
    parts = {"plate": plate, "lid": block((0.0, 0.0, 1.09), (40.0, 40.0, 6.0))}
    (row,) = check(load(write_step(parts, tmp_path / "bump.step")), depths=False).pairs
    assert row.verdict is Verdict.CLASH
    assert -8.0 / 9.0 < row.distance.upper < -0.6


@pytest.mark.parametrize(("bend", "sag"), [(0.0, 0.0), (0.2, 0.1)])
def test_a_border_whose_parameters_are_uneven_is_off_by_what_it_bends_alone(bend, sag):
    """A face between a line and a parabola, which half of its parameters take to three tenths of its chord."""
    poles = array_of("gp_Pnt", [occ.gp_Pnt(x, y, 0.0) for x, y in ((0.0, 0.0), (1.0, -bend), (10.0, 0.0))])
    corners = [occ.gp_Pnt(x, y, 0.0) for x, y in ((10.0, 0.0), (10.0, 5.0), (0.0, 5.0), (0.0, 0.0))]
    wire = occ.BRepBuilderAPI_MakeWire(occ.BRepBuilderAPI_MakeEdge(occ.Geom_BezierCurve(poles)).Edge())
    for a, b in itertools.pairwise(corners):
        wire.Add(occ.BRepBuilderAPI_MakeEdge(a, b).Edge())
    face = occ.BRepBuilderAPI_MakeFace(wire.Wire(), True).Face()
    occ.BRepMesh_IncrementalMesh(face, 10.0)
    points, triangles, _ = triangles_of(face, 0)
    found = border_sag(face, points, triangles).max()
    assert found == pytest.approx(2.0 * sag, rel=0.1, abs=1e-12)


@pytest.mark.parametrize("far", [0.0, 800.0])
def test_planes_are_planes_however_their_splines_are_turned(far):
    """At the tolerance that they keep Open CASCADE takes every third for none."""
    rng = np.random.default_rng(1)
    for _ in range(3):
        solid = first_solid(as_splines(moved(block((-22, -22, -7), (22, 22, 7)), shift(far) @ random_pose(rng))))
        form = faces.surfaces_of([*explore(solid, "FACE")])
        assert set(form.kind.tolist()) == {PLANE}
        corners = np.array([occ.BRep_Tool.Pnt_s(vertex).Coord() for vertex in explore(solid, "VERTEX")])
        for kind, frame, size in zip(form.kind, form.frame, form.size, strict=True):
            assert (np.abs(height(kind, frame, size, corners)) <= 1e-7).sum() == 4 * 6  # each of 8 is met 6 times


def test_faces_with_places_of_their_own_make_a_closed_mesh():
    """The ends of a prism are one face at two places; moved once more, its corners differ in the last digits."""
    rng = np.random.default_rng(6)
    for _ in range(8):
        hexagon = moved(placed_pair("hexagon_in_bore", rng, 0.03, splines=0.0).b, random_pose(rng))
        assert is_closed(BrepSolid.of(first_solid(hexagon), "hexagon").tessellated(0.1).faces)


def without_triangles(monkeypatch, kind):
    """Has Open CASCADE make no triangles of faces of a kind, as it makes none of some."""
    mesh = occ.BRepMesh_IncrementalMesh

    def meshed(shape, how):
        mesh(shape, how)
        for face in explore(shape, "FACE"):
            if occ.BRepAdaptor_Surface(face).GetType() == kind:
                occ.BRepTools.Clean_s(face)

    monkeypatch.setattr(occ, "BRepMesh_IncrementalMesh", meshed, raising=False)


@pytest.mark.parametrize("is_near", [False, True])
def test_cones_of_which_open_cascade_makes_no_triangles_are_meshed_as_turned_lines(is_near, monkeypatch):
    """It makes none of some chamfers of holes, as they come from other CAD; what they have in common is not known."""
    plate = cut(block((-9, -9, 0), (9, 9, 4)), rod(3, -1, 5), cone(4, 3, -0.5, 0.5))
    brep = to_bytes(first_solid(plate))
    usual = tessellate(brep, 0.01)
    without_triangles(monkeypatch, occ.GeomAbs_SurfaceType.GeomAbs_Cone)
    (number,) = np.flatnonzero(faces.surfaces(brep).kind == CONE)
    made = tessellate(brep, 0.01, (int(number),) if is_near else None)
    assert is_closed(made.faces)
    on_cone = made.face == number
    assert set(made.face.tolist()) == set(usual.face.tolist())
    corners = made.vertices[made.faces]
    turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middles = corners.mean(axis=1)
    assert (np.einsum("ij,ij->i", turned[on_cone, :2], middles[on_cone, :2]) < 0.0).all()  # out of the plate
    cone_face = [*explore(from_bytes(brep), "FACE")][number]
    assert (off_face(cone_face, middles[on_cone]) <= made.errors[on_cone]).all()
    assert made.errors[on_cone].max() < 0.02
    assert made.errors.max() < (0.2 if is_near else 0.02)


def shared(shape, other):
    return occ.BRepAlgoAPI_Common(shape, other).Shape()


def polygon(sides, radius, height):
    """A prism over a regular polygon, from z = 0 up."""
    angles = np.arange(sides) * 2.0 * np.pi / sides
    outline = occ.BRepBuilderAPI_MakePolygon()
    for x, y in zip(radius * np.cos(angles), radius * np.sin(angles), strict=True):
        outline.Add(occ.gp_Pnt(x, y, 0.0))
    outline.Close()
    face = occ.BRepBuilderAPI_MakeFace(outline.Wire()).Face()
    return occ.BRepPrimAPI_MakePrism(face, occ.gp_Vec(0.0, 0.0, height)).Shape()


def with_torn_cones(monkeypatch):
    """Has Open CASCADE leave out some triangles of cones, as it does of some with curved borders."""
    mesh = occ.BRepMesh_IncrementalMesh

    def meshed(shape, how):
        mesh(shape, how)
        for face in explore(shape, "FACE"):
            triangles = occ.BRep_Tool.Triangulation_s(face, occ.TopLoc_Location())
            if occ.BRepAdaptor_Surface(face).GetType() == occ.GeomAbs_SurfaceType.GeomAbs_Cone and triangles:
                triangles.ResizeTriangles(triangles.NbTriangles() // 2, True)

    monkeypatch.setattr(occ, "BRepMesh_IncrementalMesh", meshed, raising=False)


CONES_WITH_CURVES = {
    "socket": cut(block((-5, -5, -5), (5, 5, 5)), shared(polygon(6, 2, 9), cone(0, 3, 0, 2))),
    "nut": shared(polygon(6, 2, 2), cone(2.6, 1.2, 0, 2)),
    "drilled": cut(cone(3, 1, 0, 3), moved(rod(0.6, -5, 5), shift(0, 0.4, 1) @ turn((0, 1, 0.2), 1.3))),
    "many sides": shared(polygon(24, 2, 2), cone(2.1, 1.2, 0, 2)),
}


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", CONES_WITH_CURVES)
def test_cones_that_open_cascade_meshes_badly_are_meshed_as_turned_lines(name, mirrored, monkeypatch):
    """Of those with many curved edges it is not even asked: one takes it 20 s."""
    shape = CONES_WITH_CURVES[name]
    if mirrored:
        mirror = occ.gp_Trsf()
        mirror.SetMirror(occ.gp_Ax2(occ.gp_Pnt(), occ.gp_Dir(1, 2, 3)))
        shape = occ.BRepBuilderAPI_Transform(shape, mirror, True).Shape()
    solid = first_solid(shape)
    brep = to_bytes(solid)
    if name == "many sides":
        without_triangles(monkeypatch, occ.GeomAbs_SurfaceType.GeomAbs_Cone)
    else:
        with_torn_cones(monkeypatch)
    made = tessellate(brep, 0.01)
    assert is_closed(made.faces)
    corners = made.vertices[made.faces]
    enclosed = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert enclosed == pytest.approx(volume(solid), rel=0.02)
    (number,) = np.flatnonzero(faces.surfaces(brep).kind == CONE)
    on_cone = made.face == number
    face = [*explore(from_bytes(brep), "FACE")][number]
    rows = np.flatnonzero(on_cone)[:: 1 + on_cone.sum() // 200]
    assert off_face(face, corners[rows, 0]).max() < 1e-6
    assert (off_face(face, corners[rows].mean(axis=1)) <= made.errors[rows]).all()
    assert made.errors.max() < 0.05


def test_a_cone_between_circles_gets_no_more_triangles_than_its_neighbours():
    made = tessellate(to_bytes(first_solid(cone(5, 2, 0, 7))), 0.0018)
    count = np.bincount(made.face)
    assert count.max() <= 1.1 * count.sum() / 2.0
    assert made.errors.max() <= 0.0018


def test_a_common_part_with_a_cone_without_triangles_has_a_border(monkeypatch):
    without_triangles(monkeypatch, occ.GeomAbs_SurfaceType.GeomAbs_Cone)
    a, b = (to_bytes(first_solid(shape)) for shape in (cone(5, 2, 0, 7), block((-6, -6, -1), (0, 6, 4))))
    part = common(a, b, np.eye(4), 0.01)
    assert len(part.borders) == 2
    for border, brep in zip(part.borders, (a, b), strict=True):
        assert len(border.triangles)
        assert np.abs(depths(brep, border.points[:: 1 + len(border.points) // 100])).max() < 1e-6


def test_other_faces_without_triangles_are_said(monkeypatch):
    without_triangles(monkeypatch, occ.GeomAbs_SurfaceType.GeomAbs_Plane)
    with pytest.raises(Clamp3dError, match="no triangles of face 1"):
        tessellate(to_bytes(first_solid(block((0, 0, 0), (1, 2, 3)))), 0.1)


def test_a_face_without_an_area_needs_no_triangles():
    """A block of which two faces meet in an edge each, with a plane face of no width between these."""
    builder, shell, wire = occ.BRep_Builder(), occ.TopoDS_Shell(), occ.TopoDS_Wire()
    first, *rest = explore(first_solid(block((0, 0, 0), (4, 5, 6))), "FACE")
    edge = next(explore(first, "EDGE"))
    other = edge.EmptyCopied()  # with the same curves
    for end in explore(edge, "VERTEX"):
        builder.Add(other, end)
    mend = occ.BRepTools_ReShape()
    mend.Replace(edge, other)
    builder.MakeShell(shell)
    builder.MakeWire(wire)
    for side in (edge.Reversed(), other):
        builder.Add(wire, side)
    sliver = occ.BRepBuilderAPI_MakeFace(occ.BRepAdaptor_Surface(first).Plane(), wire).Face()
    for face in (mend.Apply(first), sliver, *rest):
        builder.Add(shell, face)
    made = tessellate(to_bytes(occ.BRepBuilderAPI_MakeSolid(shell).Solid()), 0.1)
    assert is_closed(made.faces)
    assert set(made.face.tolist()) == {0, 2, 3, 4, 5, 6}
