"""Meshes made by trimesh against manifold3d."""

import itertools

import manifold3d
import numpy as np
import pytest
import trimesh

from clamp3d import check, distance, load
from clamp3d.kernel import rotation, translation
from tests.kinds import mesh_shape, row_of

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


def test_a_stated_chord_widens_the_bounds(tmp_path):
    ball = trimesh.creation.icosphere(3, 10.0)
    for name, x in (("a", 0.0), ("b", 20.3)):
        ball.copy().apply_translation((x, 0, 0)).export(tmp_path / f"{name}.stl")
    chord = 10.0 - np.abs((ball.triangles[:, 0] * ball.face_normals).sum(axis=1)).min()  # how far facets are inside
    row = check(load(tmp_path, chord=chord), distances=True).pairs[0]
    assert row.distance.lower <= 0.3 <= row.distance.upper
    assert row.distance.upper - row.distance.lower >= 2 * chord
