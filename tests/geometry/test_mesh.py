"""Meshes: damage of every kind is mended and noted, or refused by name; edges; nearest points of triangles."""

import collections
import re

import numpy as np
import pytest
import scipy.optimize
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from trimesh.triangles import closest_point

from clamp3d.errors import InputError
from clamp3d.geometry.mesh import closed_mesh, edges_of, is_closed, make_mesh
from clamp3d.geometry.shells import inside_out, shells, volume, winding_numbers
from clamp3d.geometry.triangles import closest_points
from tests.refusals import refusals

BOX, BALL = trimesh.creation.box((2.0, 3.0, 4.0)), trimesh.creation.icosphere(2, 2.0)
CAVITY = trimesh.Trimesh(0.3 * BALL.vertices + (0.2, 0.5, 0.1), BALL.faces[:, ::-1], process=False)


def bodies(rng):
    """A ball with a cavity, up to two lesser boxes and balls beside it: vertices, faces, the rows of each surface."""
    made = [CAVITY, BALL, *([BOX, BALL][k] for k in rng.integers(0, 2, rng.integers(0, 3)))]
    V = [part.vertices * 0.9 ** (k > 1) + (9.0 * max(k - 1, 0), 0.0, 0.0) for k, part in enumerate(made)]
    F = [part.faces + sum(map(len, V[:k])) for k, part in enumerate(made)]
    return np.vstack(V), np.vstack(F), np.split(np.arange(sum(map(len, F))), np.cumsum([*map(len, F)])[:-1])


def turned(F, rows):
    F = F.copy()
    F[rows] = F[rows][:, ::-1]
    return F


@pytest.mark.parametrize("winding", ["right", "some", "all", "body"])
def test_a_damaged_mesh_is_mended_and_all_of_it_noted(winding):
    rng = np.random.default_rng(0)
    for _ in range(25):
        V, F, rows = bodies(rng)
        size, true, notes, last = len(V), volume(V, F), [], []
        if winding == "some":
            picks = np.concatenate([rng.choice(row, rng.integers(1, 6), replace=False) for row in rows])
            F, last = turned(F, picks), [f"{len(picks)} triangles turned to one winding"]
        elif winding == "all":
            F, last = turned(F, slice(None)), ["inside out: all triangles turned"]
        elif winding == "body" and len(rows) > 2:
            F, last = turned(F, rows[2]), [f"a body of {len(rows[2])} triangles inside out: turned"]
        F = rng.permutation(F)
        if rng.random() < 0.5:  # one of them the other way round
            doubles = F[rng.choice(len(F), 3, replace=False)]
            F = np.vstack([F, np.roll(doubles, 1, axis=1), doubles[:1, ::-1]])
            notes.append("4 doubled triangles left out")
        if rng.random() < 0.5:  # folded, and along an edge
            (a, b, _), V = F[0], np.vstack([V, V[F[0, :2]].mean(axis=0)])
            F = np.vstack([F, [[a, b, b], [a, b, size]]])
            notes.append("1 triangles without an area left out")
        else:  # corners of its own for each triangle, all but equal
            V, F = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
            V += rng.uniform(-2e-10, 2e-10, V.shape)
        made = make_mesh(np.vstack([V, [3 * [np.nan]]]), F, scale=0.25)
        assert (made.watertight, list(made.notes), len(made.vertices)) == (True, notes + last, size)
        assert volume(made.vertices, made.faces) == pytest.approx(true / 64.0, rel=1e-8)
        assert len(made.faces) == sum(map(len, rows))
        assert not inside_out(made.vertices, made.faces)


def test_corners_are_one_within_a_billionth_of_the_extent_and_thin_is_within_the_rounding():
    V, F = BOX.vertices[BOX.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    for apart, is_closed_so in ((3.9e-9, True), (4.1e-9, False)):  # the box is 4 mm high
        V[0] = BOX.vertices[BOX.faces[0, 0]] * (1.0, 1.0, 1.0 + 0.5 * apart)
        assert make_mesh(V, F).watertight == is_closed_so
    # A corner more on an edge: the triangle that closes the mesh there is as high as the corner is off the edge.
    (a, b, c), V, up = BOX.faces[0], BOX.vertices / 2.0, BOX.face_normals[0]
    F = np.vstack([BOX.faces[1:], [[a, 8, c], [8, b, c], [a, b, 8]]])
    for high, unit, thin in ((3.0, 2.0**-24, 1), (5.0, 2.0**-24, 0), (3.0, 2.0**-50, 0)):
        corner = V[[a, b]].mean(axis=0) + high * 2.0**-24 * up
        made = make_mesh(np.vstack([V, corner]), F, float32=unit == 2.0**-24)
        assert (made.watertight, made.rounding, made.slivers.sum()) == (True, unit, thin)
    assert make_mesh(np.float32(V), BOX.faces).rounding == 2.0**-24


def test_edges_are_those_that_are_counted_one_by_one():
    rng = np.random.default_rng(1)
    for _ in range(60):
        F = np.array([rng.choice(7, 3, replace=False) for _ in range(rng.integers(1, 12))])
        sides = collections.defaultdict(list)
        for row, face in enumerate(F.tolist()):
            for a, b, across in (np.roll(face, -k).tolist() for k in range(3)):
                sides[max(a, b), min(a, b)].append((row, across, a < b))
        for uses in (1, 2, 3):
            counted = [(high, low) for high, low in sorted(sides) if len(sides[high, low]) == uses]
            found = [array.tolist() for array in edges_of(F, uses)]
            assert found[0] == [[low, high] for high, low in counted]
            assert found[1:] == [[[side[i] for side in sides[edge]] for edge in counted] for i in (0, 1)]
        assert is_closed(F) == all(sorted(up for _, _, up in some) == [0, 1] for some in sides.values())


def test_what_a_surface_winds_round():
    V, F, rows = bodies(np.random.default_rng(3))
    assert sorted(row.tolist() for row in shells(F)) == [row.tolist() for row in rows]
    assert volume(V + 1e7, F) == pytest.approx(volume(V, F), rel=1e-7)
    x = np.random.default_rng(4).uniform(-2.5, 2.5, (40, 3))
    out, into = np.linalg.norm(x, axis=1), np.linalg.norm(x - (0.2, 0.5, 0.1), axis=1)
    sure = np.flatnonzero((abs(out - 2.0) > 0.1) & (abs(into - 0.6) > 0.05))
    wanted = 1.0 * (out < 2.0) - (into < 0.6)
    for some in (sure, sure[:8]):
        assert winding_numbers(V, F, x[some]) == pytest.approx(wanted[some], abs=1e-9)


V, F = np.add(BOX.vertices, (1.0, 1.5, 2.0)), np.array(BOX.faces)


def _with(array, row, value):
    out = array.astype(np.result_type(array, np.asarray(value)))
    out[row] = value
    return out


def refused(*cases):
    """A test for each case of vertices, faces and what is said of them."""
    return refusals(
        *((lambda V=V, F=F: closed_mesh(V, F, "part P9"), f"^part P9.*{re.escape(rule)}") for V, F, rule in cases)
    )


test_bad_mesh_is_one_clear_line = refused(
    (_with(V, 3, np.nan), F, "vertex 3 is not finite, or not within 1e+12 mm: [nan, nan, nan]"),
    (np.zeros((0, 3)), F, "is out of range for 0 vertices"),
    (V, np.zeros((0, 3), dtype=int), "faces must have shape (m, 3), got (0, 3)"),
    (V[:, :2], F, "must have shape (n, 3), got (8, 2)"),
    ([[0, 0], [1, 2, 3]], F, "must be an array of numbers"),
    (V, _with(F, 5, [0, 1, 8]), "face index 8 is out of range for 8 vertices"),
    (V, _with(F, 5, [0, 1, 2.5]), "faces must be integers, got float64"),
    (V, _with(F, 5, [0, 5, 5]), "not closed: 3 edges with one triangle"),
    (V, F[1:], "not closed: 3 edges with one triangle"),
    (np.vstack([V, V + 9.0]), np.vstack([F, F[:, ::-1] + 8]), "a body of 12 triangles inside out"),
    (np.vstack([2.0 * V, V - 9.0]), np.vstack([F, F[:, ::-1] + 8]), "a body of 12 triangles inside out"),
    (np.vstack([2.0 * V, V - 1.0]), np.vstack([F, F[:, ::-1] + 8]), "a body of 12 triangles inside out"),
    (_with(V, 3, 1e300), F, "within 1e+12 mm"),
    (V, np.vstack([F, F[:1]]), "1 doubled triangles left out"),
    (V, np.vstack([F[:1, ::-1], F[1:]]), "1 triangles turned to one winding"),
    (V, F[:, ::-1], "inside out: all triangles turned"),
    (V * [1.0, 1.0, 0.0], F, "the surface encloses no volume"),
)


def test_corners_of_triangles_are_merged_and_cavities_kept():
    assert len(closed_mesh(V[F].reshape(-1, 3), np.arange(36).reshape(-1, 3)).vertices) == 8
    assert len(closed_mesh(np.vstack([4.0 * V, V + 1.0]), np.vstack([F, F[:, ::-1] + 8])).faces) == 24


def test_a_fin_and_the_wall_between_two_bodies_enclose_nothing():
    """Each is a triangle or two that are there twice, once in each direction."""
    edge = F[0, :2]
    fin = np.array([[*edge, 8], [*edge[::-1], 8]])
    made = make_mesh(np.vstack([V, [V.mean(axis=0) + 9.0]]), np.vstack([F, fin]))
    assert (made.watertight, len(made.faces), made.vertices.max()) == (True, 12, V.max())
    reflected = V * (-1.0, 1.0, 1.0) + (2.0 * V[:, 0].max(), 0.0, 0.0)
    made = make_mesh(np.vstack([V, reflected]), np.vstack([F, F[:, ::-1] + 8]))
    assert (made.watertight, len(made.faces)) == (True, 20)
    assert volume(made.vertices, made.faces) == pytest.approx(2.0 * volume(V, F))


def test_a_void_is_in_the_body_that_holds_all_of_it_and_is_filled_by_those_that_overlap_it():
    """A body fills most of another one's void; and of two bodies that overlap each has a void, which overlap too."""
    box = trimesh.creation.box
    large, small, middle = box((20, 20, 20)), box((11, 14, 14)).apply_translation((-3.5, 0, 0)), box((14, 14, 14))
    six, four, five = (trimesh.creation.icosphere(3, radius) for radius in (6.0, 4.0, 5.0))
    for bodies, voids in (([large, small], [six]), ([large, middle], [four.apply_translation((1, 0, 0)), five])):
        inverted = [trimesh.Trimesh(void.vertices, void.faces[:, ::-1], process=False) for void in voids]
        whole = trimesh.util.concatenate([*bodies, *inverted])
        made = make_mesh(whole.vertices, whole.faces)
        points = np.random.default_rng(1).uniform(-11.0, 11.0, (2000, 3))
        inside = winding_numbers(whole.vertices, np.asarray(whole.faces), points) > 0.5
        assert ((winding_numbers(made.vertices, made.faces, points) > 0.5) == inside).all()


numbers = st.floats(-10.0, 10.0).map(lambda x: round(x, 3))


@given(hnp.arrays(float, (5, 3, 3), elements=numbers), hnp.arrays(float, (5, 3), elements=numbers))
@settings(deadline=None, max_examples=150)
def test_nearest_points_of_triangles(triangles, points):
    """No further away than trimesh's, and points of the triangles (of no area too)."""
    found = closest_points(triangles, points)
    away = np.linalg.norm(found - points, axis=1)
    with np.errstate(invalid="ignore"):  # trimesh 5.0 divides by areas that are zero
        theirs = np.linalg.norm(closest_point(triangles, points) - points, axis=1)
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    assert (away <= theirs + 1e-9).all()
    small = np.linalg.norm(closest_points(1e-3 * triangles, 1e-3 * points) - 1e-3 * points, axis=1)
    assert np.abs(1e3 * small - away).max() < 1e-9  # sides may be far shorter than a millimetre
    assert np.abs(away - theirs)[area > 1e-2].max(initial=0.0) < 1e-9
    for triangle, point in zip(triangles, found, strict=True):
        shares = scipy.optimize.nnls(np.vstack([triangle.T, np.full(3, 1e3)]), np.append(point, 1e3))
        assert shares[1] < 1e-6


def test_of_a_mesh_far_from_the_origin_nothing_is_merged_that_is_apart():
    """A ball of 0.5 mm, whose corners are closer to each other than numbers in single precision are that far away."""
    ball = trimesh.creation.icosphere(4, 0.5)
    V = np.vstack([BOX.vertices, ball.vertices + np.array([9.0, 0.0, 0.0])]) + np.array([3e5, 0.0, 0.0])
    F = np.vstack([BOX.faces, ball.faces + len(BOX.vertices)])
    for faces in (F, turned(F, [50])):
        mesh = make_mesh(V, faces, float32=True)
        assert (len(mesh.vertices), len(mesh.faces), mesh.watertight) == (len(V), len(F), True)
        assert mesh.vertices.max(axis=0) == pytest.approx(V.max(axis=0), abs=1e-9)
    with pytest.raises(InputError, match="open, and vertices are as near to each other as its numbers are rounded"):
        make_mesh(V, F[:-1], float32=True)
