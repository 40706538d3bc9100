"""Clamp files: what is right loads, what is wrong gives one line with file, key, value and rule."""

import re
from importlib import resources

import numpy as np
import pytest

from clamp3d import InputError, assemble, load_clamp
from clamp3d.clamp.conductors import catalogue, conductor

REFERENCE = resources.files("clamp3d.clamp").joinpath("data/reference.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "mm"', 'unit = "inch"', "unit: must be 'mm', got 'inch'"),
        ('unit = "mm"', "", "unit is missing"),
        ("thickness = 27.7260", "", "up_splint.thickness is missing"),
        ("thickness = 27.7260", "thicknes = 27.7260", "up_splint.thicknes is not a known key; did you mean thickness?"),
        ("radius = 23.8012", "radius = -23.0", "up_splint.line_groove.radius: must be at least 1e-06, got -23.0"),
        ("radius = 23.8012", 'radius = "23 mm"', "up_splint.line_groove.radius: must be a valid number, got '23 mm'"),
        ("radius = 23.8012", "radius = nan", "up_splint.line_groove.radius: must be a finite number"),
        ("radius = 23.8012", "radius = true", "up_splint.line_groove.radius: must be a valid number, got True"),
        ("offset = 46.0349", "offset = 60.0", "the arc leaves the splint at its edge: offset must be <= 57.4"),
        ('conductor = "LJ-630"', 'conductor = "LJ-631"', "line.conductor: unknown conductor 'LJ-631'; nearest: LJ-630"),
        ('conductor = "LJ-630"', "", "line.conductor or diameter: give one of them"),
        ("P4 = 2, P5", "P4 = 4, P5", "connections.P1.P4: must be 0, 1, 2 or 3, got 4"),
        ("P4 = { P5 = 1 }", "P4 = { P5 = -1 }", "connections.P4.P5: must be 0, 1, 2 or 3, got -1"),
        ("P4 = 2, P5", "P9 = 2, P5", "connections.P1.P9: must be 'P1', 'P2'"),
        ("P4 = { P5 = 1 }", "P5 = { P4 = 1 }", "connections.P5.P4: the matrix is given above its diagonal"),
        ("P4 = { P5 = 1 }", "P4 = { P4 = 1 }", "connections.P4.P4: the matrix is given above its diagonal"),
        ("[nut]", "[limits]\nline_load = -1\n[nut]", "limits.line_load: must be greater than 0"),
        ("[nut]", "[nut", "not valid TOML"),
        ("[nut]", f"x = {'1' * 5000}\n[nut]", "not valid TOML: Exceeds the limit"),
        ("[nut]", f"x = {'[' * 5000}\n[nut]", "not valid TOML: tables or arrays nested too deeply"),
        ("[nut]", f"[a{'.a' * 65}]\n[nut]", "not valid TOML: a key of more than 64 dots: a.a"),
        ("[nut]", f"[a{'.a' * 64}]\n[nut]", "a is not a known key"),
        ("[nut]", "[parts.nut]", "is a scene, not a clamp"),
        ("[nut]", "[include]", "is a scene, not a clamp"),
    ],
)
def test_bad_files_give_one_clear_line(tmp_path, old, new, message):
    assert old in REFERENCE
    path = tmp_path / "reference.toml"  # its name alone would be the built-in one's
    path.write_text(REFERENCE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_clamp(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert message in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("nothing.toml", "nothing.toml: no such file"),
        ("nothing", "unknown clamp 'nothing'; built in: reference; or give a .toml file"),
        (".", ".: not a regular file"),
        ("/proc/self/mem", "/proc/self/mem: cannot be read: Input/output error"),
        (3, "clamp must be a path, got 3"),
    ],
)
def test_a_file_that_is_not_there(source, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        load_clamp(source)


def test_a_file_that_is_not_text(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file in UTF-8"):
        load_clamp(path)


def test_wires_by_name_and_by_diameter():
    clamp = load_clamp(line="lj-500", jumper="21.6")
    assert clamp.line.radius == pytest.approx(14.56)
    assert clamp.line.label == "LJ-500"
    assert clamp.jumper.radius == pytest.approx(10.8)
    assert clamp.jumper.label == "diameter 21.6 mm"
    for number in (16, 16.0, np.float32(16), np.int64(16), np.array(16.0)):
        assert load_clamp(line=number).line.radius == 8.0


@pytest.mark.parametrize(
    "line", ["0", "-3", "nan", "inf", "1e9", 0, -1.0, np.nan, np.inf, True, [16], "LJ-17", b"16", "1" * 300]
)
def test_what_is_no_wire_is_named(line):
    with pytest.raises(
        InputError, match=r"^(line diameter must be > 0 |line must be a conductor's name |unknown conductor ).{,90}$"
    ):
        load_clamp(line=line)


def test_catalogue_is_complete():
    assert len(catalogue()) == 51
    assert conductor("Pigeon").diameter == 12.75
    assert all(0 < c.diameter < 50 and c.standard and c.source for c in catalogue().values())


def test_a_clamp_is_given_by_name_by_file_or_loaded(tmp_path):
    copy = tmp_path / "copy.toml"
    copy.write_text(REFERENCE, encoding="utf-8-sig")  # with a byte order mark
    found = [assemble(clamp, line="LJ-500", jumper=16) for clamp in ("reference", copy, load_clamp())]
    assert len({(a.status, a.distance) for a in found}) == 1
    assert repr(found[0]) == f"<Assembly reference: clamped, {found[0].distance:.3f} mm>"
    with pytest.raises(InputError, match=r"^reference: line: the diameter must be < "):
        load_clamp(load_clamp(), line=300.0)
