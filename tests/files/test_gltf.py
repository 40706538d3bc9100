"""glTF by its specification, written number by number: nodes, materials, strips, and what is refused by name."""

import base64
import json

import numpy as np
import pytest
import trimesh

from clamp3d import InputError, load
from clamp3d.files.formats import load_bodies
from clamp3d.shapes import load_mesh

CUBE = trimesh.creation.box((1.0, 2.0, 3.0))
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "f4")
INSTANCES = "EXT_mesh_gpu_instancing"
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


class Gltf:
    """A file in the making."""

    def __init__(self):
        self.binary = b""
        self.data = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "meshes": [], "nodes": []}

    def view(self, array):
        self.binary += b"\0" * (-len(self.binary) % 4)
        raw = np.ascontiguousarray(array).tobytes()
        self.data["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(raw)})
        self.binary += raw
        return len(self.data["bufferViews"]) - 1

    def numbers(self, array, **more):
        array = np.asarray(array)
        kinds = {"f4": 5126, "u4": 5125, "u2": 5123, "i2": 5122, "u1": 5121, "i1": 5120}
        kind = "VEC3" if array.ndim == 2 else "SCALAR"
        component = kinds[array.dtype.str[1:]]
        made = {"bufferView": self.view(array), "componentType": component, "count": len(array), "type": kind}
        self.data["accessors"].append(made | more)
        return len(self.data["accessors"]) - 1

    def mesh(self, *primitives, name="cube"):
        self.data["meshes"].append({"name": name, "primitives": list(primitives)})
        return len(self.data["meshes"]) - 1

    def cube(self, V=CUBE.vertices, F=CUBE.faces):
        position = self.numbers(np.asarray(V, "f4"))
        return {"attributes": {"POSITION": position}, "indices": self.numbers(np.asarray(F, "u2").ravel())}

    def node(self, **node):
        self.data["nodes"].append(node)
        return len(self.data["nodes"]) - 1

    def write(self, path, uri=None):
        text = base64.b64encode(self.binary).decode()
        uri = uri or f"data:application/octet-stream;base64,{text}"
        self.data["buffers"] = [{"byteLength": len(self.binary), "uri": uri}]
        path.write_text(json.dumps(self.data))
        return path


def only(tmp_path, *primitives_of):
    made = Gltf()
    made.node(children=[made.node(mesh=made.mesh(*(make(made) for make in primitives_of)))])
    (body,) = load_bodies(made.write(tmp_path / "a.gltf")).bodies
    return trimesh.Trimesh(body.shape.mesh.vertices / 1000.0, body.shape.mesh.faces)


def test_nodes_are_parts_with_names_places_and_shared_shapes(tmp_path):
    made = Gltf()
    cube = made.mesh(made.cube())
    turn = [0.0, 0.0, np.sin(0.3), np.cos(0.3)]
    small = made.node(name="small", mesh=cube, scale=[0.5, 0.25, 2.0], translation=[0.0, 1.0, 0.0])
    mirrored = made.node(name="mirrored", mesh=cube, scale=[-1.0, 1.0, 1.0])
    top = made.node(name="arm", children=[small, mirrored], rotation=turn, translation=[1.0, 2.0, 3.0])
    again = made.node(name="arm", mesh=cube, translation=[4.0, 0.0, 0.0])
    same = made.node(name="arm", mesh=cube)
    made.data["scenes"] = [{"nodes": [top, again, same]}]
    scene = load(made.write(tmp_path / "robot.gltf"))
    assert [part.name for part in scene.parts] == ["small", "mirrored", "arm_1", "arm_2"]
    assert scene.parts[2].shape is scene.parts[3].shape
    assert scene.notes == ()  # no winding is repaired
    truth = trimesh.load_scene(tmp_path / "robot.gltf")
    worlds = []
    for node in truth.graph.nodes_geometry:
        T, key = truth.graph[node]
        worlds.append(trimesh.transform_points(truth.geometry[key].vertices, T) @ Z_UP.T * 1000.0)
    for part in scene.parts:
        got = part.shape.mesh.vertices @ part.T_world[:3, :3].T + part.T_world[:3, 3]
        assert sum(np.allclose(np.sort(got, axis=0), np.sort(world, axis=0), atol=1e-2) for world in worlds) == 1
        assert part.shape.mesh.watertight
    every, V = np.vstack(worlds), load_mesh(tmp_path / "robot.gltf").vertices
    np.testing.assert_allclose([V.min(axis=0), V.max(axis=0)], [every.min(axis=0), every.max(axis=0)], atol=1e-2)


def test_materials_do_not_divide_a_body(tmp_path):
    mesh = only(tmp_path, lambda g: g.cube(F=CUBE.faces[:5]), lambda g: g.cube(F=CUBE.faces[5:]))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(6.0)


def test_strips(tmp_path):
    """A prism over five corners: its caps as strips, its walls as triangles without an index."""
    angle = np.linspace(0.0, 2 * np.pi, 5, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(5)])
    V = np.vstack([ring, ring + np.array([0.0, 0.0, 1.0])]).astype("f4")
    walls = [[k, (k + 1) % 5, 5 + k] for k in range(5)] + [[(k + 1) % 5, 5 + (k + 1) % 5, 5 + k] for k in range(5)]

    def cap(order):
        index = np.array(order, dtype="u4")
        return lambda g: {"attributes": {"POSITION": g.numbers(V)}, "indices": g.numbers(index), "mode": 5}

    def plain(g):
        return {"attributes": {"POSITION": g.numbers(V[np.ravel(walls)])}}

    mesh = only(tmp_path, cap([5, 6, 9, 7, 8]), cap([0, 4, 1, 3, 2]), plain)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.5 * 5 * np.sin(2 * np.pi / 5), rel=1e-6)


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2"])
def test_quantised_numbers(tmp_path, kind):
    most = np.iinfo(kind).max

    def quantised(g):
        position = g.numbers(np.where(np.asarray(CUBE.vertices) > 0, most, 0).astype(kind), normalized=True)
        return {"attributes": {"POSITION": position}, "indices": g.numbers(np.asarray(CUBE.faces, "u2").ravel())}

    assert only(tmp_path, quantised).volume == pytest.approx(1.0, rel=1e-6)


def test_of_several_scenes_one_is_read_and_what_is_no_body_in_it_is_noted(tmp_path):
    made = Gltf()
    other = made.node(name="other", mesh=made.mesh({"attributes": {"POSITION": made.numbers(CORNERS)}, "mode": 3}))
    cube = made.node(mesh=made.mesh(made.cube()), translation=[7.0, 0.0, 0.0])
    top = made.node(camera=0, children=[cube])
    made.data |= {"scenes": [{"nodes": []}, {"nodes": [top, other]}], "scene": 1, "skins": [{"joints": [0]}]}
    made.data |= {"extensionsRequired": ["KHR_mesh_quantization"], "cameras": [{"type": "perspective"}]}
    path = made.write(tmp_path / "a.gltf")
    scene, mesh = load(path, unit="mm"), load_mesh(path, unit="mm")
    assert scene.notes == mesh.notes == ("skins and morph targets are left at rest", "other: points or lines, left out")
    assert [(part.name, part.T_world[:3, 3].tolist()) for part in scene.parts] == [("cube", [7.0, 0.0, 0.0])]
    assert mesh.vertices.max(axis=0).tolist() == [7.5, 1.5, 1.0]


def test_binary_files(tmp_path):
    path, raw = tmp_path / "a.glb", CUBE.export(file_type="glb")
    for spoilt, message in (
        (raw[:4] + b"\1" + raw[5:], "not a readable GLB file .version 1."),
        (raw[:-1], "cut off: "),
    ):
        path.write_bytes(spoilt)
        with pytest.raises(InputError, match=message):
            load(path)
    path.write_bytes(raw)
    assert np.ptp(load_mesh(path).vertices, axis=0).tolist() == [1000.0, 3000.0, 2000.0]


def bad_cube(g, accessor=None, **primitive):
    cube = g.cube() | primitive
    if accessor is not None:
        accessor(g.data["accessors"][cube["attributes"]["POSITION"]])
    g.node(name="bad", mesh=g.mesh(cube))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda g: g.node(name="bad", mesh=7), "node 1, or its mesh, is not in the file"),
        (lambda g: g.node(name="bad", mesh=-1), "node 1, or its mesh, is not in the file"),
        (lambda g: g.node(name="bad", mesh=g.mesh(g.cube(F=[[0, 1, 8]]), g.cube())), r"bad \(face index 8 is out of"),
        (lambda g: g.data.update(scenes=[{"nodes": [0, 9]}]), "node 9, or its mesh, is not in the file"),
        (lambda g: g.data.update(scenes=[{"nodes": [-1]}]), "node -1, or its mesh, is not in the file"),
        (lambda g: g.node(mesh=0, children=[g.node(children=[2])]), "node 1 is below itself"),
        (lambda g: g.data.update(extensionsRequired=["EXT_meshopt"]), "needs EXT_meshopt, which is not read"),
        (lambda g: g.node(name="bad", mesh=0, extensions={INSTANCES: {}}), r"missing: bad \(its instances .* are not"),
        (lambda g: g.data.update(scenes=[{"nodes": [g.node(children=[0, 0])]}]), "in the tree twice"),
        (lambda g: g.data.update(scenes=[{"nodes": [g.node(children=[1])]}]), "in the tree twice"),
        (lambda g: [g.node(name="bad", mesh=0, scale=[1, 1, 0]) for _ in range(5)], r"missing: .*\); and 1 more"),
        (
            lambda g: g.node(name="bad", mesh=0, translation=[np.nan] * 3),
            r"missing: bad \(its placement is flat or not",
        ),
        (lambda g: g.node(rotation=[0.0, 0.0, 0.0, 2.0]), "rotation of a node must be a quaternion of length 1, got"),
        (lambda g: bad_cube(g, lambda accessor: accessor.update(count=10**9)), "not a readable GLTF file"),
        (lambda g: bad_cube(g, lambda accessor: accessor.pop("bufferView")), "sparse or empty numbers are not read"),
        (lambda g: bad_cube(g, lambda accessor: accessor.update(sparse={})), "sparse or empty numbers are not read"),
        (lambda g: bad_cube(g) or g.data["accessors"][-1].update(sparse={}), "sparse or empty numbers are not read"),
        (lambda g: g.node(mesh=0, matix=np.eye(4).ravel().tolist()), "a key of nodes must be one of .*, got 'matix'"),
        (lambda g: bad_cube(g, lambda accessor: accessor.update(bteOffset=4)), "key of accessors .*, got 'bteOffset'"),
        (lambda g: g.data["bufferViews"][0].update(byteStrid=16), "key of bufferViews must be .*, got 'byteStrid'"),
        (lambda g: bad_cube(g, indces=0), "a key of primitives must be one of .*, got 'indces'"),
        (
            lambda g: g.node(name="bad", mesh=0) and g.data.update(scenes=[{"nodes": [0]}]),
            r"only 1 of 2 bodies read; missing: bad \(node 1 is not in the scene that is read\)",
        ),
        (lambda g: bad_cube(g, mode=6), "triangles of mode 6 are not read"),
    ],
)
def test_what_is_not_whole_is_refused(tmp_path, spoil, message):
    made = Gltf()
    made.node(name="good", mesh=made.mesh(made.cube()))
    spoil(made)
    path = made.write(tmp_path / "a.gltf")
    with pytest.raises(InputError, match=message) as caught:
        load(path)
    assert "\n" not in str(caught.value)
    if "missing" in str(caught.value):
        assert len(load(path, partial=True).parts) == 1
