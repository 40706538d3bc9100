"""Reading: units, axes, repairs, and one line for every kind of bad file."""

import numpy as np
import pytest
import trimesh
from fit_shapes import RADIUS, splint

from clamp3d.errors import InputError, MissingLibraryError
from clamp3d.fit.fit import fit_file
from clamp3d.fit.mesh_file import load_mesh, make_mesh


@pytest.fixture(scope="module")
def part():
    return splint(0.3, hole=11.0)


@pytest.mark.parametrize("kind", ["stl", "ply", "obj", "3mf"])
def test_formats_in_mm(part, tmp_path, kind):
    if kind == "3mf":
        pytest.importorskip("lxml")
        pytest.importorskip("networkx")
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


def test_unit_option(part, tmp_path):
    part.export(tmp_path / "part.stl")
    assert np.isclose(np.ptp(load_mesh(tmp_path / "part.stl", unit="inch").vertices[:, 0]), 137 * 25.4, rtol=1e-6)
    with pytest.raises(InputError, match="unknown unit 'foot'; available: mm, cm, m, inch"):
        load_mesh(tmp_path / "part.stl", unit="foot")


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


def test_step_says_what_to_do(tmp_path):
    with pytest.raises(MissingLibraryError, match="STEP"):
        load_mesh(tmp_path / "part.step")


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], r"shape \(n, 3\)"),
        (np.eye(3), [[0, 1]], r"shape \(m, 3\)"),
        (np.eye(3), [[0, 1, 3]], "face index 3 is out of range for 3 vertices"),
        (np.eye(3), [[0, 1, -1]], "face index -1"),
        (np.eye(3), [[0.0, 1.0, 2.0]], "integers"),
        (np.full((3, 3), np.inf), [[0, 1, 2]], "not finite"),
        (np.zeros((3, 3)), [[0, 1, 2]], "one point"),
        (np.diag([1.0, 0, 0]), [[0, 1, 2], [0, 0, 1]], "no triangle with an area"),
    ],
)
def test_bad_arrays(vertices, faces, message):
    with pytest.raises(InputError, match=message):
        make_mesh(vertices, np.array(faces))


def test_repairs_are_noted():
    box = trimesh.creation.box([1.0, 1.0, 1.0])
    faces = np.concatenate([box.faces[:, ::-1], box.faces[:1]])
    mesh = make_mesh(box.vertices, faces)
    assert mesh.watertight
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume > 0.0
    assert mesh.notes == ("1 doubled triangles left out", "inside out: all triangles turned")
