"""From mesh files to features: formats, what is repaired on the way, and the command."""

import json
import re

import manifold3d
import numpy as np
import pytest
import trimesh

from clamp3d import fit_file, fit_mesh
from clamp3d.shapes import make_mesh
from tests.fit.fit_shapes import RADIUS, splint
from tests.refusals import refusals


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


test_other_files_are_refused = refusals((lambda: fit_file("a.dxf"), r"unknown format '.dxf'; available: .stl"))


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


def test_table_json_and_page(tmp_path, main):
    splint(0.05, hole=11.0).export(tmp_path / "part.stl")
    code, out, err = main("fit", tmp_path / "part.stl", "--json", tmp_path / "a.json", "--html", tmp_path / "a.html")
    assert code == 0
    assert re.search(r"^G1 +groove +23\.8012 ", out, re.MULTILINE)
    assert re.search(r"^H1 +through hole +11\.0000 ", out, re.MULTILINE)
    assert "note: STL carries no unit" in err
    data = json.loads((tmp_path / "a.json").read_text())
    assert [round(g["radius_mm"], 4) for g in data["grooves"]] == [RADIUS] * 2
    assert all(g["error_bound_mm"] >= g["fit_error_mm"] > 0.0 for g in data["grooves"])
    page = (tmp_path / "a.html").read_text()
    assert not re.search(r"""(src|href)\s*=|https?://|@import""", page)
    assert page.count("data-feature=") == 3


def test_mesh_without_features_is_an_answer(tmp_path, main):
    trimesh.creation.box([1.0, 2.0, 3.0]).export(tmp_path / "box.ply")
    code, out, _ = main("fit", tmp_path / "box.ply", "--html", tmp_path / "b.html")
    assert (code, "no groove, no cylinder, no hole" in out) == (0, True)
    assert "<tbody>" not in (tmp_path / "b.html").read_text()
