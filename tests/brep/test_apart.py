"""Files that crash, swell or never end: one line, and this process goes on."""

import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from clamp3d import InputError, load
from clamp3d.brep import apart
from clamp3d.brep.bodies import unique_names
from clamp3d.brep.mesh_file import load_bodies
from clamp3d.brep.placing import Placer
from clamp3d.brep.threemf_file import read_3mf
from clamp3d.core import child
from clamp3d.core.child import run_child

TYPES = (
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" '
    'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
    'Target="/3D/3dmodel.model" Id="a" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>"
)
CORNERS = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
SIDES = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
SOLID = f"<mesh><vertices>{CORNERS}</vertices><triangles>{SIDES}</triangles></mesh>"


def write_3mf(path, objects, build, unit="millimeter"):
    model = (
        f'<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f"<resources>{objects}</resources><build>{build}</build></model>"
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, text in (("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS), ("3D/3dmodel.model", model)):
            made.writestr(name, '<?xml version="1.0" encoding="UTF-8"?>' + text)
    return path


def test_objects_components_and_build_items_of_3mf(tmp_path):
    objects = (
        f'<object id="1" type="model" name="tip">{SOLID}</object><object id="2" type="model" name="pair"><components>'
        '<component objectid="1"/><component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/></components></object>'
    )
    build = (
        '<item objectid="2" transform="0 1 0 -1 0 0 0 0 1 0 0 10"/>'
        '<item objectid="1" transform="2 0 0 0 2 0 0 0 2 9 0 0"/>'
    )
    scene = load(write_3mf(tmp_path / "a.3mf", objects, build, unit="inch"))
    assert [p.name for p in scene.parts] == ["tip_1", "tip_2", "tip_3"]
    first, second, third = scene.parts
    assert first.shape is second.shape
    turn = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(first.T_world[:3, :3], turn, atol=1e-12)
    np.testing.assert_allclose(second.T_world[:3, 3], 25.4 * np.array([0, 5, 10]), atol=1e-9)
    np.testing.assert_allclose(np.ptp(third.shape.mesh.vertices, axis=0), 2 * 25.4, rtol=1e-6)


@pytest.mark.parametrize(
    ("objects", "build"),
    [
        (f'<object id="1" type="model">{SOLID.replace("3", "9")}</object>', '<item objectid="1"/>'),
        (f'<object id="1" type="model">{SOLID}</object>', '<item objectid="1"/><item objectid="2"/>'),
    ],
)
def test_a_3mf_that_names_what_is_not_there_is_refused(tmp_path, objects, build):
    with pytest.raises(InputError, match="not a readable 3MF file"):
        load(write_3mf(tmp_path / "a.3mf", objects, build))


def test_components_doubled_again_and_again_are_counted_not_made(tmp_path):
    levels = range(2, 20)
    twice = "".join(
        f'<object id="{k}" type="model"><components><component objectid="{k - 1}"/><component objectid="{k - 1}"/>'
        "</components></object>"
        for k in levels
    )
    objects = f'<object id="1" type="model">{SOLID}</object>{twice}'
    path = write_3mf(tmp_path / "a.3mf", objects, f'<item objectid="{levels[-1]}"/>')
    assert path.stat().st_size < 2000
    placed = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Placer, "place", lambda *given: placed.append(given))
        with pytest.raises(InputError, match="more than 20000 bodies"):
            read_3mf(path)
    assert not placed


@pytest.mark.parametrize("copied", [False, True])
@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
            "the reader ended with SIGSEGV",
        ),
        ("import os; os._exit(7)", "the reader ended with exit code 7"),
        ("import time; time.sleep(600)", "not read in 1 s; CLAMP3D_READ_LIMITS=4 allows four times as much"),
        ("from clamp3d.brep.apart import _limit; _limit(2**28); bytearray(2**29)", "takes more than 0.0 GB to read"),
    ],
)
@pytest.mark.skipif(sys.platform != "linux", reason="signals and limits as Linux has them")
def test_a_reader_that_fails_is_one_line(tmp_path, monkeypatch, body, message, copied):
    (tmp_path / "stand_in.py").write_text(f"def main(*given):\n    {body}\nif __name__ == '__main__':\n    main()\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "stand_in", raising=False)
    monkeypatch.setattr(child, "can_copy", lambda: copied)
    monkeypatch.setattr(apart, "run_child", lambda module, *a, **k: run_child("stand_in", *a, **k))
    if "not read" in message:
        monkeypatch.setenv(apart.LIMITS, "0.015")
    else:
        monkeypatch.setattr(apart, "_MEMORY", 0)
    path = write_3mf(tmp_path / "a.3mf", f'<object id="1" type="model">{SOLID}</object>', '<item objectid="1"/>')
    with pytest.raises(InputError, match=message) as caught:
        load(path)
    assert str(caught.value).startswith(str(path))


_MAIN = "from clamp3d.cli import main"


@pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")
@pytest.mark.parametrize(
    ("first", "read", "copied"),
    [
        ("import clamp3d", "clamp3d.load(path)", False),  # somebody's program, a notebook: who knows what runs in it
        (_MAIN, "main()", True),
        (f"{_MAIN}; import threading as t; t.Thread(target=t.Event().wait, daemon=True).start()", "main()", False),
    ],
)
def test_only_the_command_lines_own_process_is_copied(tmp_path, first, read, copied):
    path = write_3mf(tmp_path / "a.3mf", f'<object id="1" type="model">{SOLID}</object>', '<item objectid="1"/>')
    program = f"""
import os, sys
path = sys.argv[-1]
sys.argv[1:] = ["fit", path, "--quiet"]
forks, fork = [], os.fork
os.fork = lambda: forks.append(1) or fork()
{first}
try:
    {read}
except SystemExit:
    pass
print(bool(forks))
"""
    given = [sys.executable, "-c", program, str(path)]
    done = subprocess.run(given, capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == str(copied), done.stdout + done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")
def test_a_copy_ends_with_its_caller_and_keeps_its_output(tmp_path, monkeypatch):
    (tmp_path / "stand_in.py").write_text(
        "import os, sys, time\nfrom clamp3d.core.child import end_with_caller\n"
        "def main(path):\n    end_with_caller()\n    os.write(1, b'said\\n')\n    time.sleep(float(path))\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(child, "can_copy", lambda: True)
    assert run_child("stand_in", "0", time_limit=10.0, copy=True) == (0, ["said"])
    assert run_child("stand_in", "60", time_limit=0.3, copy=True) == (None, ["said"])
    orphan = child.Copy("stand_in", ("60",))
    orphan.stdin.close()  # as the end of this process would
    assert orphan.wait(timeout=10.0) == 1


def test_a_limit_that_is_no_number_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv(apart.LIMITS, "lots")
    path = write_3mf(tmp_path / "a.3mf", f'<object id="1" type="model">{SOLID}</object>', '<item objectid="1"/>')
    with pytest.raises(InputError, match="CLAMP3D_READ_LIMITS must be a number > 0, got 'lots'"):
        load(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
@pytest.mark.parametrize("suffix", ["", ".toml", ".stl", ".step", ".glb", ".3mf", ".urdf"])
def test_pipes_and_devices_are_no_files(tmp_path, suffix):
    pipe, device = tmp_path / f"pipe{suffix}", tmp_path / f"device{suffix}"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    for path in (pipe, device):
        with pytest.raises(InputError, match=r"not a regular file|unknown clamp or file"):
            load(path)


@pytest.mark.parametrize(
    "key", ["a." * 50_000 + "b = 1", "[" + "a." * 50_000 + "b]", 'x = { "a" . ' + "b . " * 9000 + "c = 1 }"]
)
def test_a_key_of_a_hundred_kilobytes_is_refused(tmp_path, key):
    path = tmp_path / "scene.toml"
    path.write_text(key + "\n")
    with pytest.raises(InputError, match="a key of more than 64 dots"):
        load(path)
    path.write_text("# " + "a" * 200_000 + "\nnote = '" + "x" * 200_000 + "'\n" + "clearance = 1.0\n")
    with pytest.raises(InputError, match=r"neither a clamp|note is not a known key"):
        load(path)


CUBE = """solid cube
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid cube
"""


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("cut.stl", CUBE + CUBE[:80]),
        ("cut.stl", CUBE + CUBE[:-15]),
        ("cut.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
         "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("cut.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("cut.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n"),
    ],
)  # fmt: skip
def test_a_mesh_file_that_lost_its_end_is_refused(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=r"cut off|damaged|not a readable"):
        load_bodies(path)
    whole = {".stl": CUBE * 2}.get(path.suffix)
    if whole:
        path.write_text(whole)
        assert len(load_bodies(path).bodies) == 1


def test_names_are_unique_whatever_the_file_says():
    given = ["nut", "nut_1", "nut", "a b", "a:b", "", "\x1b[2J", "nut_1"]
    made = unique_names(given)
    assert len(set(made)) == len(given)
    assert made == ["nut_1", "nut_1_1", "nut_2", "a-b_1", "a-b_2", "part", "2J", "nut_1_2"]
    assert all(name and not set(name) & set(" :,*?[]\t\n\x1b") for name in made)
