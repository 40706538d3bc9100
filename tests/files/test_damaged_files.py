"""Damaged and hostile files of every format: refused in one line that names the fault, or read right."""

import os
import struct
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import trimesh

from clamp3d import InputError, load
from clamp3d.files.bodies import Reading, unique_names
from clamp3d.files.worker import LIMITS, OUTSIDE, process
from clamp3d.geometry.shells import volume
from clamp3d.shapes import load_mesh
from tests.docs.project import ROOT
from tests.files.test_gltf import Gltf
from tests.files.threemf import BEAMS, TIP, doubled, write_3mf
from tests.scenefile.test_read_parts import ROBOT

PIN = (ROOT / "examples" / "hinge" / "pin.stl").read_bytes()
COUNT = (len(PIN) - 84) // 50
TEXT = trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box((1.0, 2.0, 0.1))).encode()
PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
    b"property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)

CORNERS = b"0 0 0\n2 2 0\n4 0 0\n2 4 0\n"  # of one face: the second is a notch
OFF = b"OFF\n4 1 0\n" + CORNERS
NOTCHED_PLY = PLY[: PLY.index(b"0 0 0")].replace(b"vertex 3", b"vertex 4").replace(b"face 2", b"face 1") + CORNERS
MIXED_PLY = NOTCHED_PLY[: -len(CORNERS)].replace(b"ascii", b"binary_little_endian").replace(b"face 1", b"face 2")
MIXED_PLY += struct.pack("<12fB3iB4i", *map(float, CORNERS.split()), 3, 0, 1, 2, 4, 0, 1, 2, 3)
SHIFTED_PLY = MIXED_PLY[:-30].replace(b"face 2", b"face 3")
SHIFTED_PLY += struct.pack("<B4iB3iB5i", 4, 0, 1, 2, 3, 3, 0, 1, 2, 5, 0, 1, 2, 3, 0)
"""As long as three faces of four corners, which the first one has."""
NOTCHED_OBJ = b"".join(b"v " + line + b"\n" for line in CORNERS.splitlines()) + b"f 1 2 3 4\n"
WEDGE = (
    b"v 0 0 0 # first\nv 10 0 0\nv 10 1 0\nv 0 0 5\nv 10 0 5\nv 10 1 5\n"
    b"f 3 2 1\nf 4 5 6\n  f 1 2 5 4\nf 2 3 6\\\n 5\nf 3 1 4 6 # last\n"
)
"""Of triangles and quadrangles, an indented one and comments among them, with 6 degrees from face to face: 25 mm3."""


MOVE = "1 0 0 0 1 0 0 0 1 5 0 0"
"""A transform of 3MF."""


def refused(path, message, **options):
    with pytest.raises(InputError, match=message) as caught:
        load(path, **options)
    assert "\n" not in str(caught.value)
    assert path.name in str(caught.value)


@pytest.mark.parametrize(
    ("name", "raw", "message"),
    [
        ("a.stl", PIN[:-1], "cut off or damaged: its 216 triangles take 10884 bytes, it has 10883"),
        ("a.stl", PIN + PIN[-50:], "cut off or damaged"),
        ("a.stl", b"solid".ljust(80) + PIN[80:-7], "cut off or damaged"),
        ("a.stl", b"", "the file is empty"),
        ("a.glb", b"", "the file is empty"),
        ("a.stl", bytes(84), "no triangles"),
        ("a.stl", PIN[:80] + struct.pack("<I", 2**32 - 1) + PIN[84:], "cut off or damaged"),
        ("a.stl", PIN[:60], "cut off or damaged"),
        ("a.stl", PIN[:146] + struct.pack("<f", np.inf) + PIN[150:], "not finite"),
        ("a.stl", TEXT[: len(TEXT) // 2], "cut off"),
        ("a.stl", TEXT + TEXT[:80], "cut off"),
        ("a.stl", TEXT.replace(b"0.05", b"nan", 1), "not finite"),
        ("a.off", OFF, "cut off: 5 lines of vertices and faces are announced, 4 follow"),
        ("a.stl", PIN[:146] + struct.pack("<f", np.nan) + PIN[150:], "not finite"),
        ("a.stl", PIN[:146] + struct.pack("<f", 3e38) + PIN[150:], r"not within 1e\+12 mm"),
        ("a.stl", TEXT.replace(b"endsolid", b""), "cut off"),
        ("a.stl", TEXT.upper()[: len(TEXT) // 2], "cut off"),
        ("a.stl", TEXT.replace(b"endfacet", b"", 1), "cut off"),
        ("a.stl", TEXT.replace(b"0.05", b"zero", 1), "not a readable STL file"),
        ("a.stl", TEXT.replace(b"endloop", b"vertex 0 0 0\nendloop", 1), "cut off"),
        ("a.ply", PLY[:90], "the file is cut off: its header has no end"),
        ("a.ply", PLY, "cut off: 5 lines of vertices and faces are announced, 4 follow"),
        ("a.ply", PLY + b"2 0 1\n", "damaged: it announces 2 faces, 1 were read"),
        ("a.ply", MIXED_PLY, "cut off, or its faces have different numbers of corners: export it as triangles"),
        ("a.ply", SHIFTED_PLY, "cut off, or its faces have different numbers of corners: export it as triangles"),
        ("a.ply", PLY.replace(b"end_h", b"element tristrips 1\nend_h"), "triangle strips are not read: export it as a"),
        ("a.ply", NOTCHED_PLY + b"4 0 1 2 3\n", "a face folds back onto its neighbour"),
        ("a.obj", NOTCHED_OBJ, "a face folds back onto its neighbour"),
        ("a.off", OFF + b"4 0 1 2 3\n", "a face folds back onto its neighbour"),
        ("a.off", OFF + b"# 3 0 1 2\n", "cut off: 5 lines of vertices and faces are announced, 4 follow"),
        ("a.off", OFF + b"5 0 1 2 3 0\n", "a face has more than four corners"),
        ("a.off", OFF + b"10 0 1 2 3 0 1 2 3 0 1\n", "a face has more than four corners"),
        ("a.off", OFF + b"3 0 1 2\n3 0 1 3\n", "damaged: 5 lines of vertices and faces are announced, 6 follow"),
        ("a.off", (OFF + b"3 0 1 2\n").replace(b"OFF", b""), "it must begin with OFF and a line with the numbers of"),
        ("a.off", (OFF + b"3 0 1 2\n").replace(b"4 1", b"4\n1", 1), "it must begin with OFF"),
        ("a.off", b"4" + OFF, "4OFF"),
        ("a.off", b"n" + OFF, "nOFF"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n", "not a readable OBJ file|damaged|out of range"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf nan\n", "damaged: a face has 1 corners"),
        ("a.obj", WEDGE + b"  f 1 2 # 3\n", "damaged: a face has 2 corners"),
        ("a.obj", WEDGE + b"f 0 1 2\n", "damaged: 'f 0 1 2' names no vertex before it"),
        ("a.obj", WEDGE + b"f -1 -2 -7\n", "damaged: 'f -1 -2 -7' names no vertex before it"),
        ("a.obj", WEDGE + b"3 2 4\n", "a line begins with '3', which is not read: export it as triangles"),
        ("a.obj", WEDGE + b"f#3 2 4\n", "damaged: a face has 0 corners"),
        ("a.obj", WEDGE + b": 2 6 4\n", "a line begins with ':', which is not read"),
        ("a.obj", WEDGE + b"surf 0 1 0 1 1 2 3 4\n", "a line begins with 'surf', which is not read"),
        ("a.obj", WEDGE.replace(b"10 1 5", b"10 1"), "damaged: a vertex has 2 coordinates"),
        ("a.obj", WEDGE.replace(b"10 1 5", b"10 1 5/2"), "not a readable OBJ file .*5/2"),
        ("a.obj", WEDGE.replace(b"10 1 5", b"10 1 5mm"), "not a readable OBJ file .*5mm"),
        ("a.3mf", b"not a zip", "not a readable 3MF file"),
    ],
)
def test_a_file_that_is_not_whole_is_refused(tmp_path, name, raw, message):
    (tmp_path / name).write_bytes(raw)
    refused(tmp_path / name, message)


@pytest.mark.parametrize(
    "raw",
    [
        b"solid".ljust(80) + PIN[80:],
        TEXT.upper().replace(b"\n", b"\r\n"),
        b"\n\n" + TEXT.replace(b"facet n", b"   facet n").replace(b" 0.05", b" +5.0E-02"),
    ],
    ids=["binary that begins with solid", "capitals", "other numbers"],
)
def test_odd_files_that_are_whole_are_read(tmp_path, raw):
    (tmp_path / "a.stl").write_bytes(raw)
    (tmp_path / "b.stl").write_bytes(PIN if raw[80:] == PIN[80:] else TEXT)
    a, b = (load_mesh(tmp_path / name) for name in ("a.stl", "b.stl"))
    np.testing.assert_array_equal(a.vertices, b.vertices)
    np.testing.assert_array_equal(a.faces, b.faces)


def test_a_mesh_without_a_unit_is_taken_as_mm_and_what_is_said_of_it(tmp_path):
    (tmp_path / "a.obj").write_bytes(WEDGE)
    for unit, factor in (("m", 1e3), ("cm", 10.0), ("in", 25.4), (None, 1.0)):
        mesh = load_mesh(tmp_path / "a.obj", unit=unit)
        assert volume(mesh.vertices, mesh.faces) == pytest.approx(25.0 * factor**3)
        assert mesh.notes == (() if unit else ("OBJ carries no unit: taken as mm (largest extent 10 mm)",))
    trimesh.creation.box((0.1, 0.2, 0.5)).export(tmp_path / "a.stl")
    (note,) = load_mesh(tmp_path / "a.stl").notes
    assert note.endswith("(largest extent 0.5 mm; if they are metres, unit m makes that 500 mm)")


def test_numbers_of_an_obj_that_count_back_do_so_from_their_line(tmp_path):
    """And a byte order mark is no letter of the first line, nor does a comment go on in the next."""
    box = trimesh.creation.box((1.0, 2.0, 3.0))

    def body(x):
        corners = "".join(f"v {a + x} {b} {c}\n" for a, b, c in box.vertices)
        return corners + "".join("f {}/1/1 {} {}\n".format(*face) for face in box.faces - len(box.vertices))

    text = "\ufeff" + body(0.0) + "# the second \\\n" + body(50.0)
    (tmp_path / "a.obj").write_text(text, encoding="utf-8")
    mesh = load_mesh(tmp_path / "a.obj")
    assert np.ptp(mesh.vertices, axis=0).tolist() == [51.0, 2.0, 3.0]
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("objects", "build", "message"),
    [
        (TIP.replace('"model"', '"odd"'), '<item objectid="1"/>', r"missing: Invalid Model Object Type \(lib3mf\)"),
        (TIP.replace("3", "9"), '<item objectid="1"/>', "not a readable 3MF file"),
        (TIP, '<item objectid="1"/><item objectid="2"/>', "not a readable 3MF file"),
        (doubled(15), '<item objectid="16"/>', "more than 20000 bodies"),
        (doubled(50), '<item objectid="51"/>', "more than 20000 bodies"),
        (TIP, "", "no body in the file"),
        (TIP.replace("<triangle ", "<triangel ", 1), '<item objectid="1"/>', "an element in it is unknown to 3MF"),
        (TIP, '<item objectid="1"/><itm objectid="1"/>', "an element in it is unknown to 3MF, or in the wrong place"),
        (doubled(1).replace("<component ", "<compoInnent ", 1), '<item objectid="2"/>', "is unknown to 3MF"),
        (
            doubled(1).replace("<component ", f'<component transfrom="{MOVE}" '),
            '<item objectid="2"/>',
            "of component must be .*'transfrom'",
        ),
        (TIP, f'<item objectid="1" Transform="{MOVE}"/>', "attribute of item must be one of .*, got 'Transform'"),
        (
            TIP.replace("</mesh>", BEAMS + "</mesh>"),
            '<item objectid="1"/>',
            r"tip \(its beams are not read; export them as",
        ),
        (TIP.replace('x="1"', 'x="1O"'), '<item objectid="1"/>', "damaged: vertex must have numbers, got '1O 0 0'"),
        (TIP.replace('y="1"', 'y="0x10"'), '<item objectid="1"/>', "vertex must have numbers, got '0 0x10 0'"),
        (TIP.replace('z="1"', 'z="10mm"'), '<item objectid="1"/>', "vertex must have numbers, got '0 0 10mm'"),
        (TIP, f'<item objectid="1" transform="{MOVE}O"/>', "item must have numbers, got '1 0 0 0 1 0 0 0 1 5 0 0O'"),
    ],
)
def test_3mf_that_names_too_much_or_what_is_not_there(tmp_path, objects, build, message):
    refused(write_3mf(tmp_path / "a.3mf", objects, build), message)


def test_objects_components_and_build_items_of_3mf(tmp_path):
    objects = (
        f'{TIP}<object id="2" type="model" name="pair"><components><component objectid="1"/>'
        f'<component objectid="1" transform="{MOVE}"/></components></object>'
    )
    build = (
        '<item objectid="2" transform="0 1 0 -1 0 0 0 0 1 0 0 10"/>'
        '<item objectid="1" transform="2 0 0 0 2 0 0 0 2 9 0 0"/>'
    )
    scene = load(write_3mf(tmp_path / "a.3mf", objects, build, unit="inch"))
    assert [p.name for p in scene.parts] == ["tip_1", "tip_2", "tip_3"]
    first, second, third = scene.parts
    assert first.shape is second.shape
    np.testing.assert_allclose(first.T_world[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(second.T_world[:3, 3], 25.4 * np.array([0, 5, 10]), atol=1e-9)
    np.testing.assert_allclose(np.ptp(third.shape.mesh.vertices, axis=0), 2 * 25.4, rtol=1e-6)


def test_units_of_3mf(tmp_path):
    for unit, mm in (("micron", 1e-3), ("centimeter", 10.0), ("meter", 1e3), ("foot", 304.8)):
        (part,) = load(write_3mf(tmp_path / "a.3mf", unit=unit)).parts
        np.testing.assert_allclose(np.ptp(part.shape.mesh.vertices, axis=0), mm, rtol=1e-6)
    refused(write_3mf(tmp_path / "a.3mf", unit="furlong"), "unit must be one of micron, millimeter")
    noted = TIP.replace("<triangle ", '<triangle paint_color="8" ')  # by a slicer
    assert len(load(write_3mf(tmp_path / "a.3mf", noted)).parts) == 1
    unnamed, printable = TIP.replace(' name="tip"', ""), '<item objectid="1" printable="1"/>'
    assert [p.name for p in load(write_3mf(tmp_path / "a.3mf", unnamed, printable)).parts] == ["a"]


@pytest.mark.filterwarnings("error")
def test_a_turn_of_six_digits_is_a_turn(tmp_path):
    build = '<item objectid="1" transform="0.955336 0.29552 0 -0.29552 0.955336 0 0 0 1 0 0 0"/>'
    (part,) = load(write_3mf(tmp_path / "a.3mf", build=build)).parts
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(part.T_world[:3, :3], [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-6)
    np.testing.assert_allclose(part.T_world[:3, :3] @ part.T_world[:3, :3].T, np.eye(3), atol=1e-14)


def test_a_3mf_whose_numbers_were_changed_on_the_way_is_refused(tmp_path):
    path = write_3mf(tmp_path / "a.3mf", method=zipfile.ZIP_STORED)
    path.write_bytes(path.read_bytes().replace(b'x="1"', b'x="9"'))
    refused(path, "not a readable 3MF file")


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux alone")
def test_a_mesh_that_takes_too_much_memory_or_time(tmp_path, monkeypatch):
    trimesh.creation.icosphere(5).export(tmp_path / "a.obj")
    size, limits = (tmp_path / "a.obj").stat().st_size, {}
    with monkeypatch.context() as patch:
        patch.setenv(LIMITS, "2")
        patch.setattr(type(process()), "call", lambda *_, **most: limits.update(most) or Reading())
        refused(tmp_path / "a.obj", "no body in the file")
    assert limits == {"time_limit": pytest.approx(120 + 40e-6 * size), "memory": pytest.approx(2**32 + 120 * size)}
    monkeypatch.setenv(LIMITS, "1e-6")
    refused(tmp_path / "a.obj", "(takes more than 0.0 GB to read|not read in 0 s); CLAMP3D_READ_LIMITS=4 allows four")
    monkeypatch.setenv(LIMITS, "lots")
    with pytest.raises(InputError, match="CLAMP3D_READ_LIMITS must be a number > 0, got 'lots'"):
        load(tmp_path / "a.obj")


@pytest.mark.skipif(sys.platform != "linux", reason="signals as Linux has them")
def test_a_reader_that_ends_by_a_signal_is_said_and_the_next_file_is_read(tmp_path, monkeypatch):
    (tmp_path / "lib3mf.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    process().close()
    refused(write_3mf(tmp_path / "a.3mf"), "the reader ended with SIGSEGV: the file is damaged, or uses what the")
    (tmp_path / "lib3mf.py").unlink()
    folder = tmp_path / "cell"
    folder.mkdir()
    for name in ("a.stl", "b.stl"):
        (folder / name).write_bytes(PIN)
    assert [part.name for part in load(folder).parts] == ["a", "b"]


def test_a_gltf_reads_nothing_outside_of_its_folder(tmp_path, monkeypatch):
    made, path = Gltf(), tmp_path / "cell" / "a.gltf"
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    made.node(mesh=made.mesh({"attributes": {"POSITION": made.numbers(corners)}}))
    path.parent.mkdir()
    for file in (tmp_path / "secret.bin", path.parent / "own file.bin"):
        file.write_bytes(made.binary)

    def triangles(uri):
        return len(load(made.write(path, uri)).parts[0].shape.mesh.faces)

    for uri in ("../secret.bin", str(tmp_path / "secret.bin"), "%2e%2e/secret.bin", "http://127.0.0.1:9/x.bin"):
        with pytest.raises(InputError, match=r"outside of its folder|No such file"):
            triangles(uri)
    assert triangles("own%20file.bin") == 1
    monkeypatch.setenv(OUTSIDE, "1")
    assert triangles("../secret.bin") == 1


BASE, SLIDE = '<box size="0.1 0.1 0.02"/>', '<parent link="rail"/><child link="tip"/>'


@pytest.mark.parametrize(
    ("text", "instead", "message"),
    [
        ('  <link name="tip">', '</robot>\n  <link name="tip">', "not a readable URDF file .*junk after doc"),
        (SLIDE, '<parent link="tip"/><child link="rail"/>', "one tree of all links"),
        (SLIDE, '<parent link="rail"/><child link="arm"/>', "a joint must connect links, got 'arm'"),
        (ROBOT[ROBOT.index("  <joint name=\"slide\"") : -9], "", "one tree of all links"),
        ('"rail"><v', '"tip"><v', "2 of its links are called 'tip'"),
        ('<link name="tip">', "<link>", "not a readable URDF file"),
        ("sphere radius", "ball radius", "not a readable URDF file .*ball"),
        (BASE, "", "each collision of a link must have 1 shape, got 0"),
        (ROBOT[300:], "", "not a readable URDF file"),
        (SLIDE, '<parent link="tip"/><child link="tip"/>', "one tree of all links"),
        (BASE, '<mesh filename="../../no.stl"/>', "no such file in the robot's folder"),
        ('radius="0.01"', 'radius="big"', "not a readable URDF file"),
        ('"turn" type="revolute"', '"turn"', "type of joint turn must be one of revolute, .*got None"),
        (BASE, BASE + BASE, "each collision of a link must have 1 shape, got 2"),
        ('<mesh filename="rail.stl" scale="0.001 0.001 0.001"/>', "", "each visual of a link must have 1 shape, got 0"),
        ("</collision></link>", '</collision><link name="in"/></link>', "a link holds another link"),
        (BASE, '<mesh filename="no.stl"/>', r"missing: base \(.*no such file"),
        (BASE, '<mesh filename="../../away.stl"/>', "no such file in the robot's folder"),
        (BASE, '<mesh filename="arm.urdf"/>', r"base \(arm.urdf: a mesh must be one of .stl"),
        (BASE, '<mesh filename="arm.step"/>', r"base \(arm.step: a mesh must be one of .stl"),
        ('radius="0.01"', 'radius="-1"', r"missing: rail \(.*; tip \(radius of a sphere must be"),
        ('"turn" type="revolute"', '"turn" type="revolut"', "joint turn must be one of revolute, .*got 'revolut'"),
        ('<origin xyz="0 0 0.2"', '<orgin xyz="0 0 0.2"', "<joint> has 'orgin', not one of parent, child"),
        ('<origin xyz="0 0 0.2"', '<Origin xyz="0 0 0.2"', "<joint> has 'Origin', not one of parent, child, origin"),
        ('<origin xyz="0 0 0.012"', '<orgin xyz="0 0 0.012"', "<collision> has 'orgin', not one of origin, geo"),
        ('<origin xyz="0 0 0.2"', '<origin pos="0 0 0.2"', "<origin> has 'pos', not one of xyz, rpy"),
        ('<axis xyz="1 0 0"/>', '<axs xyz="1 0 0"/>', "<joint> has 'axs', not one of"),
        ('<limit lower="-1"', '<limit lowr="-1"', "<limit> has 'lowr', not one of lower, upper, effort"),
        ('<axis xyz="1 0 0"/>', '<mimic joint="zz"/>', "joint that slide follows must be one of turn, slide, got 'zz'"),
        ('<axis xyz="1 0 0"/>', '<mimic joint="turn" by="2"/>', "<mimic> has 'by', not one of joint, multiplier, offs"),
        ('scale="0.001', 'scal="0.001', "<mesh> has 'scal', not one of filename, scale"),
        ("</collision></link>", "</collision><collison/></link>", "<link> has 'collison', not one of inertial, visual"),
        ("robot", "robots", "it holds <robots>, not <robot>"),
        (ROBOT[ROBOT.index(">", ROBOT.index("<robot")) + 1 : -9], "", "no links in the file"),
        ('  <link name="tip">', '<x:arm xmlns:x="http://www.ros.org/wiki/xacro"/><link name="tip">', "expand them"),
        ('  <link name="tip">', f'<lk><visual><geometry>{BASE}</geometry></visual></lk><link name="tip">', "in <lk>"),
    ],
)  # fmt: skip
def test_a_robot_that_is_not_whole_is_refused(tmp_path, text, instead, message):
    pytest.importorskip("yourdfpy")
    assert text in ROBOT
    folder = tmp_path / "arm" / "urdf"
    folder.mkdir(parents=True)
    for name in (folder / "arm.step", tmp_path / "away.stl"):
        name.write_bytes(PIN)
    count = -1 if text == "robot" else 1
    (folder / "arm.urdf").write_text(ROBOT.replace(text, instead, count))
    refused(folder / "arm.urdf", message)


def test_joint_values_are_a_dict(tmp_path):
    (tmp_path / "arm.urdf").write_text(ROBOT)
    with pytest.raises(InputError, match=r"^joints must be a dict from names to values, got \[0, 1\]$"):
        load(tmp_path / "arm.urdf", joints=[0, 1])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
@pytest.mark.parametrize("suffix", ["", ".toml", ".stl", ".step", ".glb", ".3mf", ".urdf"])
def test_pipes_and_devices_are_no_files(tmp_path, suffix):
    pipe, device = tmp_path / f"pipe{suffix}", tmp_path / f"device{suffix}"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    for path in (pipe, device):
        with pytest.raises(InputError, match=r"not a regular file|unknown clamp or file"):
            load(path)


@pytest.mark.skipif(sys.platform != "linux", reason="limits as Linux has them")
def test_where_nothing_can_be_written_files_are_read(tmp_path):
    import resource

    two = '<item objectid="1"/><item objectid="1" transform="1 0 0 0 1 0 0 0 1 9 0 0"/>'
    write_3mf(tmp_path / "a.3mf", build=two)
    command = ["sh", "-c", f"{sys.executable} -m clamp3d check a.3mf >&- 2>&-"]
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))  # noqa: E731
    assert subprocess.run(command, preexec_fn=limit, cwd=tmp_path, check=False, timeout=120).returncode == 0


@pytest.mark.parametrize("key", ["a." * 50_000 + "b = 1", 'x = { "a" . ' + "b . " * 9000 + "c = 1 }"])
def test_a_key_of_a_hundred_kilobytes_is_refused(tmp_path, key):
    path = tmp_path / "scene.toml"
    path.write_text(key + "\n")
    with pytest.raises(InputError, match="a key of more than 64 dots"):
        load(path)


def test_names_are_unique_whatever_the_file_says():
    names = ["nut", "nut_1", "nut", "a b", "a:b", "", "\x1b[2J", "nut_1", "nut_2"]
    unique = unique_names(names)
    assert len(set(unique)) == len(names)
    assert unique == ["nut_1", "nut_1_1", "nut_3", "a-b_1", "a-b_2", "part", "2J", "nut_1_2", "nut_2"]
    assert all(name and not set(name) & set(" :,*?[]\t\n\x1b") for name in unique)
