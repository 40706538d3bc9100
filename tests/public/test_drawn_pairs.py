"""Signed distances of drawn bodies against formulas and Open CASCADE, of meshes against manifold3d."""

import itertools
import math

import manifold3d
import numpy as np
import pytest
import trimesh

from clamp3d import distance
from clamp3d.geometry.profile import Arc, Profile
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import Hole, SweptArc, box, cylinder, extrusion, groove_block, sphere
from tests.kinds import mesh_shape, row_of

HALF = math.radians(60.0)
BLOCK = groove_block(SweptArc(7.0, HALF, 50.0), 40.0, 20.0)  # its face is at y = -3.5
TUBE, PIN = cylinder(9.0, 40.0, bore=5.1), cylinder(5.0, 60.0)
PLATE = box((40.0, 30.0, 6.0), holes=[Hole(4.0, (3.0, 2.0))])
CLIP = extrusion(Profile.of(Arc((0.0, 0.0), 10.0, -1.2, 1.2), Arc((0.0, 0.0), 8.0, 1.2, -1.2)), 4.0)
THIN_CLIP = extrusion(Profile.of(Arc((0, 0), 12.0, -2.2, 2.2), Arc((0, 0), 11.6, 2.2, -2.2)), 5.0)
WIRE = cylinder(6.935, 80.0)
TILT = math.radians(0.1)
SQRT2 = math.sqrt(2.0)
QUARTER = rotation((1.0, 0.0, 0.0), math.pi / 2)

APART = {
    "faces of boxes": (box((10, 10, 10)), box((4, 6, 8)), translation(1, 1, 9.25), 0.25),
    "edges of boxes": (box((10, 10, 10)), box((4, 4, 4)), translation(10, 11, 0), 5.0),
    "corners of boxes": (box((10, 10, 10)), box((4, 4, 4)), translation(8, 9, 9), 3.0),
    "an edge over a face": (
        box((20, 20, 2)), box((4, 4, 9)), translation(0, 0, 1.5 + 6.5 / SQRT2) @ rotation((0, 1, 0), math.pi / 4), 0.5
    ),
    "parallel cylinders": (cylinder(5, 40), cylinder(3, 20), translation(6, 8, 5), 2.0),
    "crossed cylinders": (cylinder(5, 40), cylinder(3, 40), translation(8.001, 0, 0) @ QUARTER, 0.001),
    "cylinders end to end": (cylinder(5, 40), cylinder(3, 20), translation(1, 1, 30.4), 0.4),
    "rims of cylinders": (cylinder(5, 40), cylinder(3, 20), translation(11, 0, 34), 5.0),
    "a cylinder on a box": (box((20, 20, 10)), cylinder(3, 15), translation(0, 0, 8.0625) @ QUARTER, 0.0625),
    "a pin in a tube": (TUBE, PIN, translation(0, 0, 3), 0.1),
    "a pin off the middle of a tube": (TUBE, PIN, translation(0.03, 0.04, 3), 0.05),
    "a pin askew in a tube": (
        cylinder(8, 20, bore=5.05), cylinder(5, 30), rotation((1, 0, 0), 0.002),
        math.cos(0.002) * (5.05 - 10 * math.tan(0.002)) - 5,
    ),
    "a pin in a hole": (PLATE, cylinder(3.75, 20), translation(3, 2, 1), 0.25),
    "a pin inside a clip": (CLIP, cylinder(1.5, 10), translation(6, 0, 0), 0.5),
    "a ball inside a thin clip": (THIN_CLIP, sphere(1.0), np.eye(4), 10.6),
    "a wire in its groove": (BLOCK, WIRE, np.eye(4), 0.065),
    "a wire low in its groove": (BLOCK, WIRE, translation(0, -0.0649, 0), 1e-4),
    "a wire askew in its groove": (
        BLOCK, WIRE, rotation((1, 0, 0), TILT), math.cos(TILT) * (7 - 25 * math.tan(TILT)) - 6.935,
    ),
    "a square bar in a groove": (BLOCK, box((8, 8, 60)), np.eye(4), 7 - 4 * SQRT2),
    "a box over a groove": (BLOCK, box((30, 10, 10)), translation(0, 2.25, 0), 0.75),
}  # fmt: skip
LOOSE_APART = {"a square bar in a groove": 1e-3, "a pin inside a clip": 1e-3, "a ball inside a thin clip": 2e-3}
"""Pairs that meshes measure, to their chord error."""
OVERLAPPING = {
    "boxes by 0.01 um": (box((10, 10, 10)), box((4, 6, 8)), translation(1, 1, 9 - 1e-5), 1e-5),
    "boxes by 1 um": (box((10, 10, 10)), box((4, 6, 8)), translation(1, 1, 8.999), 1e-3),
    "boxes by 2 mm": (box((10, 10, 10)), box((4, 6, 8)), translation(1, 1, 7), 2.0),
    "a box in a box": (box((10, 10, 10)), box((2, 3, 4)), np.eye(4), 6.0),
    "equal boxes": (box((10, 12, 14)), box((10, 12, 14)), np.eye(4), 10.0),
    "parallel cylinders": (cylinder(5, 40), cylinder(3, 20), translation(4.8, 6.4 - 0.126125, 5), None),
    "crossed cylinders": (cylinder(5, 40), cylinder(3, 40), translation(7.9899, 0, 0) @ QUARTER, 0.0101),
    "a cylinder in a cylinder": (cylinder(5, 40), cylinder(2, 10), np.eye(4), 7.0),
    "cylinders end to end": (cylinder(5, 40), cylinder(3, 20), translation(1, 1, 29.5), 0.5),
    "a cylinder in a box": (box((20, 20, 10)), cylinder(3, 15), translation(0, 0, 7.5) @ QUARTER, 0.5),
    "a wire in a groove's bottom": (BLOCK, WIRE, translation(0, -0.565, 0), 0.5),
    "a box in a groove block": (BLOCK, box((30, 10, 10)), translation(0, 1.499, 0), 1e-3),
    "a cylinder in a tube's wall": (cylinder(30, 40, bore=10), cylinder(2, 60), translation(0, 20, 0), 12.0),
}
LOOSE = {"a cylinder in a tube's wall", "a wire in a groove's bottom"}
"""Overlaps of bodies that are not convex, whose depth is an interval."""


def exactly(truth, measured, sharp=1e-6):
    assert measured.lower - 1e-9 <= truth <= measured.upper + 1e-9
    assert measured.upper - measured.lower < sharp


@pytest.mark.parametrize("case", APART)
def test_distances_of_bodies_apart(case):
    a, b, T, truth = APART[case]
    measured = distance(a, b, T)
    sharp = LOOSE_APART.get(case, 1e-6)
    exactly(truth, measured, sharp)
    assert np.linalg.norm(measured.point_b - measured.point_a) == pytest.approx(truth, abs=1e-6)
    np.testing.assert_allclose(measured.point_b - measured.point_a, truth * measured.normal, atol=1e-6)
    back = distance(b, a, np.linalg.inv(T))
    exactly(truth, back, sharp)


@pytest.mark.parametrize("case", OVERLAPPING)
def test_depths_of_bodies_that_overlap(case):
    a, b, T, truth = OVERLAPPING[case]
    measured = distance(a, b, T)
    truth = 8.0 - float(np.hypot(T[0, 3], T[1, 3])) if truth is None else truth
    assert measured.lower - 1e-9 <= -truth <= measured.upper + 1e-9
    assert measured.upper < 0.0
    if case not in LOOSE:
        assert measured.upper - measured.lower < max(0.01, 0.05 * truth)
    if measured.normal is not None and math.isfinite(measured.lower):
        way = translation(*(-(measured.lower - 1e-6) * measured.normal))
        assert distance(a, b, way @ T).lower >= -1e-6


def test_a_wire_at_the_edge_of_contact_is_decided():
    for depth, expected in ((0.0101, "clash"), (0.0099, "contact")):
        for turn in (np.eye(4), QUARTER):
            row = row_of(cylinder(5, 40), cylinder(3, 40), translation(8 - depth, 0, 0) @ turn)
            assert row.verdict.value == expected


# --- Open CASCADE -----------------------------------------------------------------------------------------------------


BODIES = {
    "box": box((10, 8, 6)),
    "cylinder": cylinder(4.0, 16.0),
    "tube": cylinder(6.0, 14.0, bore=4.0),
    "plate": box((24, 18, 4), holes=[Hole(3.0, (4.0, 2.0))]),
    "groove": groove_block(SweptArc(7.0, HALF, 24.0), 30.0, 10.0),
}
PAIRS = ["box-cylinder", "cylinder-cylinder", "tube-box", "tube-cylinder", "plate-cylinder", "groove-cylinder",
         "groove-box", "groove-plate"]  # fmt: skip


@pytest.mark.parametrize("pair", PAIRS)
def test_random_poses_as_open_cascade_measures_them(pair):
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")

    from clamp3d.output.step import solid
    from tests.cad import common_volume, moved, occ, random_pose

    one, two = (BODIES[name] for name in pair.split("-"))
    rng = np.random.default_rng(len(pair))
    seen = set()
    for k in range(10):
        T = random_pose(rng, 6.0 if k % 2 else 14.0)
        a, b = solid(one), moved(solid(two), T)
        truth, measured = occ.BRepExtrema_DistShapeShape(a, b).Value(), distance(one, two, T)
        seen.add(truth > 0.0)
        if truth > 0.0:
            exactly(truth, measured, 2e-6)
        elif common_volume(a, b) > 1e-6:
            assert measured.upper < 0.0
            for way in rng.normal(size=(4, 3)):  # no shorter translation parts them
                near = moved(b, translation(*(0.99 * -measured.upper * way / np.linalg.norm(way))))
                assert occ.BRepExtrema_DistShapeShape(a, near).Value() < 1e-9
            if measured.normal is not None and math.isfinite(measured.lower):
                free = moved(b, translation(*(-measured.lower * measured.normal)))
                assert common_volume(a, free) < 1e-4
    assert seen == {True, False}


SKEW = rotation((1.0, 2.0, 3.0), 0.7)
MADE = {
    "icosphere": trimesh.creation.icosphere(3, 10.0),
    "cylinder": trimesh.creation.cylinder(6.0, 20.0, sections=48),
    "box": trimesh.creation.box((12.0, 10.0, 8.0)),
    "torus": trimesh.creation.torus(10.0, 3.0, 48, 24),
}


def manifold(mesh, T=None):
    vertices = trimesh.transform_points(mesh.vertices, np.eye(4) if T is None else T)
    raw = manifold3d.Mesh64(np.ascontiguousarray(vertices), np.ascontiguousarray(mesh.faces, dtype=np.uint64))
    return manifold3d.Manifold(raw)


def placed(rng, reach):
    T = rotation(rng.normal(size=3), rng.uniform(0, 3))
    way = rng.normal(size=3)
    T[:3, 3] = reach * way / np.linalg.norm(way)
    return T


@pytest.mark.parametrize(("a", "b"), [*itertools.combinations_with_replacement(MADE, 2)])
def test_gaps_and_common_volumes_as_manifold_measures_them(a, b):
    rng = np.random.default_rng(0)
    for reach in (9.0, 14.0, 22.0):
        T = placed(rng, reach)
        one, two = manifold(MADE[a]), manifold(MADE[b], T)
        volume, row = (one ^ two).volume(), row_of(mesh_shape(MADE[a]), mesh_shape(MADE[b]), T, clearance=30.0)
        if volume > 0.1:
            assert row.verdict.value in ("clash", "contained")
            low, high = row.where.volume
            assert low * 0.999 - 1e-6 <= volume <= high * 1.001 + 1e-6
        elif volume == 0.0:
            measured = distance(mesh_shape(MADE[a]), mesh_shape(MADE[b]), T)
            gap = one.min_gap(two, 60.0)
            assert measured.lower - 1e-6 <= gap <= measured.upper + 1e-6
            assert measured.upper - measured.lower < 1e-4


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("offset", [0.0, 0.005])
def test_one_mesh_twice_is_an_overlap(name, offset):
    shape = mesh_shape(MADE[name])
    assert row_of(shape, shape, translation(offset, 0, 0) @ SKEW).verdict.value in ("duplicate", "contained", "clash")
