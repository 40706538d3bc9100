"""STL files read directly: the same mesh as trimesh's reader makes of them, and nothing read that is not plain."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from clamp3d.brep.mesh_file import _read_by_trimesh, load_mesh
from clamp3d.brep.stl_file import read_stl
from clamp3d.errors import InputError

ROOT = Path(__file__).parents[2]
PIN = (ROOT / "examples" / "hinge" / "pin.stl").read_bytes()
COUNT = (len(PIN) - 84) // 50
CUBE = trimesh.creation.box((1.0, 2.0, 0.1))
TEXT = trimesh.exchange.stl.export_stl_ascii(CUBE).encode()


def with_corner(raw: bytes, bits: int) -> bytes:
    """A binary file with another number in place of its second triangle's first one."""
    return raw[:146] + struct.pack("<I", bits) + raw[150:]


def same(raw: bytes, file: Path) -> None:
    """The mesh of ``raw`` is that of trimesh, to the bit."""
    file.write_bytes(raw)
    known, own = _read_by_trimesh(file, ".stl"), read_stl(raw)
    assert own is not None
    for a, b in zip(own, known, strict=True):
        assert a.dtype == b.dtype
        assert np.array_equal(a, b)
        assert np.array_equal(np.signbit(a), np.signbit(b))


@pytest.mark.parametrize("path", sorted([*ROOT.glob("meshes/*.stl"), *ROOT.glob("examples/*/*.stl")]), ids=str)
def test_files_of_the_repository(path, tmp_path):
    same(path.read_bytes(), tmp_path / "a.stl")
    mesh = trimesh.load(path, process=False)
    same(trimesh.exchange.stl.export_stl_ascii(mesh).encode(), tmp_path / "b.stl")


@pytest.mark.parametrize(
    "raw",
    [
        b"solid".ljust(80) + PIN[80:],
        TEXT,
        TEXT.upper().replace(b"\n", b"\r\n"),
        TEXT.replace(b"solid ", b"solid a box called vertex", 1).replace(b"endsolid", b"endsolid a box"),
        b"\n\n" + TEXT.replace(b"facet n", b"   facet n").replace(b" 0.05", b" +5.0E-02"),
    ],
    ids=["binary that begins with solid", "text", "capitals", "named", "other numbers"],
)
def test_plain_files(raw, tmp_path):
    if b"called vertex" in raw:  # trimesh takes the name for a vertex
        assert np.array_equal(read_stl(raw)[0], read_stl(TEXT)[0])
    else:
        same(raw, tmp_path / "a.stl")


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (PIN[:-1], "no triangles"),
        (PIN[:-50], "no triangles"),
        (PIN + b"\0", "no triangles"),
        (PIN + PIN[-50:], "no triangles"),
        (PIN[:80] + struct.pack("<I", COUNT - 1) + PIN[84:], "no triangles"),
        (PIN[:80] + struct.pack("<I", 2**32 - 1) + PIN[84:], "no triangles"),
        (PIN[:60], "no triangles"),
        (b"", "no triangles"),
        (b"solid".ljust(80) + PIN[80:-7], "no triangles"),
        (bytes(84), "no triangles"),
        (with_corner(PIN, 0x7FC00000), "not finite"),
        (with_corner(PIN, 0x7F800001), "not finite"),
        (with_corner(PIN, 0x7F800000), "not finite"),
        (with_corner(PIN, 0x7F7FFFFF), "must be within 1e\\+12 mm"),
        (TEXT[: len(TEXT) // 2], "cut off|no triangles"),
        (TEXT.replace(b"endsolid", b""), "cut off|no triangles"),
        (TEXT.replace(b"0.05", b"nan", 1), "not finite"),
        (TEXT.replace(b"0.05", b"zero", 1), "not a readable STL file"),
        (TEXT.replace(b"endloop", b"vertex 0 0 0\nendloop", 1), "cut off|not a readable"),
    ],
    ids=range(19),
)
def test_hostile_files_are_refused_as_trimesh_would(raw, message, tmp_path):
    file = tmp_path / "a.stl"
    file.write_bytes(raw)
    with pytest.raises(InputError, match=message) as found:
        load_mesh(file)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    "raw",
    [
        TEXT + TEXT,
        TEXT.replace(b"0.05", b"0_0.05", 1),
        TEXT.replace(b"0.05", b"0.05" + b"0" * 10**5, 1),
        TEXT.replace(b"facet normal", b"facet", 1),
        TEXT.replace(b"vertex", b"vertex 1", 1),
    ],
    ids=["two solids", "underscore", "long word", "no normal", "four numbers"],
)
def test_what_is_not_plain_is_left_to_trimesh(raw):
    assert read_stl(raw) is None
