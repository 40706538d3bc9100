"""Reading: units, axes, repairs, and one line for every kind of bad file."""

import manifold3d
import numpy as np
import pytest
import trimesh
from fit_shapes import RADIUS, splint

from clamp3d.errors import InputError
from clamp3d.files.mesh_file import load_mesh
from clamp3d.fit.fit import fit_file, fit_mesh
from clamp3d.geometry.mesh import make_mesh


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


def test_gltf_is_metres_and_y_up(part, tmp_path):
    # Written as the specification asks: (x, y, z) mm with Z up becomes (x, z, -y) m.
    V = np.column_stack([part.vertices[:, 0], part.vertices[:, 2], -part.vertices[:, 1]]) / 1000.0
    trimesh.Trimesh(V, part.faces, process=False).export(tmp_path / "part.glb")
    mesh = load_mesh(tmp_path / "part.glb")
    assert np.allclose(mesh.vertices.min(axis=0), part.vertices.min(axis=0), atol=1e-4)
    assert np.allclose(mesh.vertices.max(axis=0), part.vertices.max(axis=0), atol=1e-4)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", None, "no such file"),
        ("a.stl", b"", "no triangles"),
        ("a.stl", b"solid nothing\nendsolid nothing\n", "a.stl"),
        ("a.stl", b"\x00" * 84 + b"half a facet", "a.stl"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 9\n", "a.obj"),
        ("a.glb", b"not a glb", "GLB"),
        ("a.3mf", b"not a zip", "3MF"),
        ("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "a.ply"),
        ("a.dxf", b"", "unknown mesh format '.dxf'; available: .stl"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
    ],
)
def test_bad_files_give_one_line(tmp_path, name, content, message):
    file = tmp_path / name
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_mesh(file)
    assert "\n" not in str(caught.value)


def test_step_of_the_up_splint(tmp_path):
    pytest.importorskip("OCP")
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    block = BRepPrimAPI_MakeBox(gp_Pnt(-40, -20, 0), gp_Pnt(40, 0, 60)).Shape()
    tool = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(3, 15, -10), gp_Dir(0, 0, 1)), 23.8012, 100).Shape()
    writer = STEPControl_Writer()
    writer.Transfer(BRepAlgoAPI_Cut(block, tool).Shape(), STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "part.step"))
    result = fit_file(tmp_path / "part.step")
    assert result.mesh.watertight
    (g,) = result.features
    assert abs(g.radius - 23.8012) < 1e-6
    assert np.allclose(g.T_part_feature[:2, 3], [3, 15], atol=1e-6)
    assert abs(g.half_angle - np.arccos(15 / 23.8012)) < 1e-6
    assert g.chord_error <= 0.02
    (tmp_path / "bad.step").write_text("nothing")
    with pytest.raises(InputError, match="not a readable STEP file"):
        load_mesh(tmp_path / "bad.step")


def test_repairs_are_noted():
    box = trimesh.creation.box([1.0, 1.0, 1.0])
    faces = np.concatenate([box.faces[:, ::-1], box.faces[:1]])
    mesh = make_mesh(box.vertices, faces)
    assert mesh.watertight
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume > 0.0
    assert mesh.notes == ("1 doubled triangles left out", "inside out: all triangles turned")


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


def status(mesh):
    return manifold3d.Manifold(
        manifold3d.Mesh64(vert_properties=mesh.vertices, tri_verts=mesh.faces.astype(np.uint64))
    ).status()


@pytest.mark.parametrize("height", [0.0, 1e-15, 1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("float32", [False, True])
def test_watertight_is_true_of_what_is_returned(part, height, float32):
    """manifold3d takes every mesh that says so, slivers of any height among its triangles."""
    box = trimesh.creation.box([30.0, 20.0, 10.0])
    for source, edges in ((part, [3, 40, 77]), (box, range(0, 12, 3))):
        V, F = with_slivers(source, edges, height)
        V = V.astype(np.float32) if float32 else V
        mesh = make_mesh(V, F)
        assert mesh.watertight
        assert status(mesh) == manifold3d.Error.NoError
        assert mesh.slivers.any() or height > 1e-8
        result = fit_mesh(mesh)
        assert len(result.grooves) == (2 if source is part else 0)
        for feature in result.features:  # rows of the mesh, slivers left out
            area = trimesh.triangles.area(mesh.vertices[mesh.faces[feature.faces]]).sum()
            assert area == pytest.approx(feature.covered_area, rel=1e-9)
            assert not mesh.slivers[feature.faces].any()
