"""From mesh files to features: formats, and what is repaired on the way."""

import manifold3d
import numpy as np
import pytest
import trimesh

from clamp3d import InputError, fit_file, fit_mesh
from clamp3d.shapes import make_mesh
from tests.fit.fit_shapes import RADIUS, splint


@pytest.fixture(scope="module")
def part():
    return splint(0.3, hole=11.0)


@pytest.mark.parametrize("kind", ["stl", "ply", "obj", "3mf"])
def test_formats_in_mm(part, tmp_path, kind):
    file = tmp_path / f"part.{kind}"
    part.export(file)
    result = fit_file(file)
    assert [round(g.radius, 2) for g in result.grooves] == [round(RADIUS, 2)] * 2
    assert result.mesh.watertight
    assert any("carries no unit" in note for note in result.notes) == (kind != "3mf")


def test_other_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"unknown mesh format '.dxf'; available: .stl"):
        fit_file(tmp_path / "a.dxf")


def with_slivers(mesh, edges, height):
    """``mesh`` with the middle of ``edges`` as new vertices: one side is split there, a sliver closes the other."""
    V, F = mesh.vertices.tolist(), mesh.faces.tolist()
    for k in edges:
        a, b, c = F[k]
        m = len(V)
        V.append((0.5 * (mesh.vertices[a] + mesh.vertices[b]) + height).tolist())
        F[k] = [a, m, c]
        F += [[m, b, c], [a, b, m]]
    return np.array(V), np.array(F)


@pytest.mark.parametrize(("height", "float32"), [(0.0, False), (1e-7, True), (1e-3, False)])
def test_watertight_is_true_of_what_is_returned(part, height, float32):
    """manifold3d takes every mesh that says so, slivers of any height among its triangles."""
    box = trimesh.creation.box([30.0, 20.0, 10.0])
    for source, edges in ((part, [3, 40, 77]), (box, range(0, 12, 3))):
        V, F = with_slivers(source, edges, height)
        V = V.astype(np.float32) if float32 else V
        mesh = make_mesh(V, F)
        assert mesh.watertight
        taken = manifold3d.Manifold(manifold3d.Mesh64(mesh.vertices, mesh.faces.astype(np.uint64)))
        assert taken.status() == manifold3d.Error.NoError
        assert mesh.slivers.any() or height > 1e-8
        result = fit_mesh(mesh)
        assert len(result.grooves) == (2 if source is part else 0)
        for feature in result.features:  # rows of the mesh, slivers left out
            area = trimesh.triangles.area(mesh.vertices[mesh.faces[feature.faces]]).sum()
            assert area == pytest.approx(feature.covered_area, rel=1e-9)
            assert not mesh.slivers[feature.faces].any()
