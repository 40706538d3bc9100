"""Errors of meshes and of closed forms: on either side of a distance they count once, each where it is near."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from clamp3d import distance
from clamp3d.collide.body import ClosedForm, bodies_distance
from clamp3d.collide.convex import Rod
from clamp3d.collide.facets import axis_gap, hull_gap, rod_distance
from clamp3d.collide.hull import Hull, hull
from clamp3d.collide.meshes import any_inside, gap, nearest_of, surface_distance
from clamp3d.collide.surface import Surface
from clamp3d.collide.swept import swept_lower
from clamp3d.core.linear import to_target
from clamp3d.core.pose import inverse, rotation, translation
from clamp3d.core.primitives import Cylinder, SweptArc
from clamp3d.kernel import signed_distance
from tests.kinds import TURNED, box_mesh

HERE = np.eye(4)


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
    assert inside.upper == pytest.approx(-3.0 + off + other, abs=1e-9)
    vertex = surface_distance(a, b, translation(6.0, 0.5, 0.0), lambda _: True)
    assert vertex.upper == pytest.approx(-1.0 + off + other, abs=1e-9)
    assert inside.lower == -math.inf
    for rounding in (0.0, 1e-11):
        touching = surface_distance(a, b, translation(7.0 + rounding, 0.0, 0.0))
        assert (touching.lower, touching.upper) == pytest.approx((-off - other, off + other), abs=1e-9)
    deep = surface_distance(a, b, translation(6.0, 0.0, 0.0))  # to 1 mm: the corners of the smaller one lie in it
    assert deep.upper == pytest.approx(-1.0 + off + other, abs=1e-6)
    assert deep.lower == pytest.approx(-1.0 - off - other, abs=1e-6)


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
        [trimesh.creation.box((0.5, 0.5, 0.5)).apply_translation(t) for t in ((0, 0, 0), (3.5, 0, 0), (9, 0, 0))]
    )
    assert any_inside(mesh, Surface(np.array(two.vertices), np.array(two.faces)), HERE)


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
        one = form(rod, off)
        for T, truth in ((lying, 5.0), (standing, 4.0), (turned, 7.0 - tip)):
            found = rod_distance(facets, one, T)
            assert found.lower <= truth - error - off + 1e-9
            assert found.upper >= truth + error + off - 1e-9
            assert found.upper <= truth + error + off + 1e-6
            assert axis_gap(facets, rod, T) <= truth - error + 1e-9
        assert rod_distance(facets, one, lying).lower == pytest.approx(5.0 - error - off, abs=1e-6)
        assert axis_gap(facets, rod, lying) == pytest.approx(5.0 - error, abs=1e-6)
        deep = rod_distance(facets, one, translation(6.0, 0.0, 0.0) @ back)
        assert deep.lower <= -1.0 - error - off + 1e-6
        assert -1.0 + error + off <= deep.upper + 1e-6
        inside = rod_distance(facets, one, translation(1.0, 0.0, 0.0) @ back)
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


# --- Closed forms with errors -----------------------------------------------------------------------------------------


def form(piece, error=0.0):
    return ClosedForm((piece,), (), error)


def cube(x):
    return hull(to_target(translation(x, 0.0, 0.0), np.array(list(itertools.product((-1.0, 1.0), repeat=3)))))


@pytest.mark.parametrize(("off", "other"), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.4), (0.3, 0.4)])
def test_errors_of_both_closed_forms_count(off, other):
    """A box and a cylinder face to face, 3 mm apart or 1 mm in each other: at rest and sliding along the face."""
    box_, rod = form(cube(0.0), off), form(Rod(1.0, 2.0, HERE), other)
    for x, y in ((box_, rod), (rod, box_), (box_, form(cube(0.0), other))):
        errors = x.error + y.error
        for z, truth in ((5.0, 3.0), (1.0, -1.0)):
            found = bodies_distance(x, y, translation(0.0, 0.0, z), lambda _: False)
            assert found.lower == pytest.approx(truth - errors, abs=1e-9)
            assert found.upper == pytest.approx(truth + errors, abs=1e-9)
        stretch = [translation(t, 0.0, 5.0) for t in (-0.5, 0.0, 0.5)]
        models = [SimpleNamespace(forms=(one,), bodies=(one,), facets=None) for one in (x, y)]
        assert swept_lower(*models, *stretch, angle=0.0) == pytest.approx(3.0 - errors, abs=1e-9)


def test_the_nearest_of_several_forms_counts_on_a_way():
    stretch = [translation(0.0, t, 5.0) for t in (-0.5, 0.0, 0.5)]
    near, far = form(Rod(1.0, 2.0, HERE), 0.1), form(Rod(1.0, 2.0, translation(0.0, 0.0, 4.0)))
    for forms in ((near, far), (far, near)):
        several = SimpleNamespace(forms=forms, bodies=forms, facets=None)
        one = SimpleNamespace(forms=(form(cube(0.0)),), bodies=(form(cube(0.0)),), facets=None)
        assert swept_lower(one, several, *stretch, angle=0.0) == pytest.approx(2.9, abs=1e-9)
        back = [inverse(T) for T in stretch]
        assert swept_lower(several, one, *back, angle=0.0) == pytest.approx(2.9, abs=1e-9)
        wide = SimpleNamespace(forms=(form(cube(0.0), 9.0),), bodies=None, facets=box_mesh((2.0, 2.0, 2.0), 0.2))
        # Of a cylinder the facets' distance from the axis counts, less the radius and what it slides across it.
        assert swept_lower(wide, several, *stretch, angle=0.0) == pytest.approx(4.0 - 1.0 - 1.5 - 0.3, abs=1e-6)
        blocks = tuple(form(cube(x), 0.1) for x in (0.0, 0.5))
        several = SimpleNamespace(forms=blocks, bodies=blocks, facets=None)
        assert swept_lower(wide, several, *stretch, angle=0.0) == pytest.approx(2.7, abs=1e-6)
    assert swept_lower(one, several, *stretch, angle=1.6) == -math.inf


@pytest.mark.parametrize("when", [0.25, 0.5, 0.75])
def test_what_swings_past_facets_strays_from_straight_lines(when):
    """A box and a cylinder on an arm about z, half a millimetre from a wall of facets where the way bows out most."""
    arm, angle, size = 20.0, 2.8, 0.4
    wall = SimpleNamespace(forms=(form(cube(0.0), 99.0),), bodies=None, facets=box_mesh((200.0, 2.0, 50.0)))
    back = translation(0.0, -(arm + size + 0.5 + 1.0), 0.0)
    stretch = [
        back @ rotation((0.0, 0.0, 1.0), angle * (t - when)) @ translation(0.0, arm, 0.0) for t in (0.0, 0.5, 1.0)
    ]
    block = hull(size * cube(0.0).vertices)
    for piece in (block, Rod(size, 2.0 * size, HERE)):
        one = form(piece)
        swung = SimpleNamespace(forms=(one,), bodies=(one,), facets=None)
        assert swept_lower(wall, swung, *stretch, angle=0.5 * angle) <= 0.5 + 1e-9


def test_a_groove_and_a_cylinder_are_known_to_rounding():
    """Bounds that hold have to be narrow too: some fifty roundings of the sizes."""
    rng, seen = np.random.default_rng(0), 0
    for _ in range(80):
        groove = SweptArc(rng.uniform(3.0, 15.0), rng.uniform(0.2, 3.0), rng.uniform(2.0, 60.0))
        wire = Cylinder(rng.uniform(0.5, 12.0), rng.uniform(1.0, 90.0))
        T = rotation(rng.normal(size=3), rng.choice([0.01, 0.3, 2.0]))
        T[:3, 3] = 10.0 * rng.normal(size=3)
        if signed_distance(groove, wire, T).distance <= 0.0:
            continue  # the depth is another search's
        found = distance(groove, wire, T)
        if found.lower > 0.0:
            seen += 1
            size = groove.radius + groove.length + wire.radius + wire.length + np.abs(T[:3, 3]).max()
            assert found.upper - found.lower <= 1.2e-14 * size
    assert seen > 15
