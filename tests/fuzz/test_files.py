"""Clamp, scene and mesh files, spoilt: an answer, or a refusal in one line; a file written otherwise is the same."""

import functools
import json
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from clamp3d import shapes
from clamp3d.shapes import SweptArc, mesh
from tests.fuzz.rules import assert_outputs, call, examples, is_refused, new_folder
from tests.fuzz.samples import CLAMP, SCENE, TETRA
from tests.fuzz.spoil import pick, power, spoil, spoil_bytes, to_toml

FORMATS = ("stl", "stl_ascii", "obj", "ply", "glb", "3mf")
BLOCK = mesh(shapes.groove_block(SweptArc(7.0, 1.0, 30.0), 30.0, 15.0), 0.05)
"""A block with a groove of radius 7 in 16 chords."""
WRONG_WORDS = (b"nan", b"inf", b"x", b"", b"1e400", b"1,5", b"0x1F", b"9" * 400, b"\xff", b"-1", b"4294967296")


def as_file(body, form):
    """A mesh as a file of a format, as other programs write it."""
    out = body.export(file_type=form)
    return out.encode() if isinstance(out, str) else bytes(out)


@functools.cache
def good_file(form):
    return as_file(BLOCK, form)


def spoilt_text(draw, text):
    """A TOML file spoilt, and whether it still says the same."""
    data = tomllib.loads(text)
    ways = {
        "rewritten": lambda: to_toml(data).encode(),
        "CRLF": lambda: text.replace("\n", "\r\n").encode(),
        "UTF-8 with a mark": lambda: b"\xef\xbb\xbf" + text.encode(),
        "UTF-16": lambda: text.encode("utf-16"),
        "bytes": lambda: spoil_bytes(draw, text.encode()),
        "spoilt": lambda: to_toml(spoil(draw, data)).encode("utf-8", "surrogatepass"),
    }
    way = pick(draw, *ways, "bytes", *["spoilt"] * 5)
    return ways[way](), way in ("rewritten", "CRLF", "UTF-8 with a mark")


@pytest.mark.parametrize(("name", "text", "command"), [("clamp", CLAMP, "run"), ("scene", SCENE, "check")])
@examples(15)
@given(data=st.data())
def test_clamp_and_scene_files(name, text, command, data):
    with new_folder() as folder:
        content, is_same = spoilt_text(data.draw, text)
        Path(f"{name}.toml").write_bytes(content)
        is_whole = pick(data.draw, True, True, True, False)
        Path("tetra.stl").write_bytes(TETRA if is_whole else spoil_bytes(data.draw, TETRA))
        code, _ = call([command, f"{name}.toml", "--quiet", "--json", "r.json"])
        assert_outputs(code, folder, [], [folder / "r.json"])
        is_same &= is_whole or command == "run"
        assert not (is_same and is_refused(code))
        if not is_refused(code):
            answer = json.loads(Path("r.json").read_text(encoding="utf-8"))
            if command == "check":
                assert_plausible(code, answer)
            assert not is_same or command == "check" or answer["distance_mm"] == pytest.approx(31.5298, abs=1e-4)


def assert_plausible(code, data):
    """The exit code says what the verdicts say, and no bounds are crossed."""
    rows = [*data.get("pairs", []), *data.get("motions", [])]
    verdicts = {row["verdict"] for row in rows}
    findings = {"clash", "contained", "duplicate"}
    assert code == (1 if verdicts & findings else 3 if "uncertain" in verdicts else 0)
    for row in rows:
        low, high = row["at_least_mm"], row["at_most_mm"]
        assert low is None or high is None or low <= high + 1e-9 * max(1.0, abs(low))


def bad_mesh(draw):
    """The grooved block of another size, far away, flat, rough or twice; tests/geometry/test_mesh.py has more."""
    V, F = np.array(BLOCK.vertices), np.array(BLOCK.faces)
    rough = np.random.default_rng(draw(st.integers(0, 2**32 - 1))).normal(0.0, power(draw, -6, 1), V.shape)
    changed = [V * power(draw, -40, 40), V + power(draw, 0, 38), V * [1.0, 0.0, 1.0], V + rough]
    twice = np.vstack([V, V + 1.0]), np.vstack([F, F + len(V)])
    return trimesh.Trimesh(*pick(draw, *((other, F) for other in changed), twice), process=False)


def spoilt_mesh(draw, form):
    """A mesh file that is damaged, of another format than its name says, or of a mesh with a flaw."""
    way = pick(draw, "bytes", "mesh", "mesh", "words", "other")
    if way == "words" and form in ("obj", "stl_ascii"):
        words = good_file(form).split(b" ")
        for k in draw(st.lists(st.integers(0, len(words) - 1), min_size=1, max_size=6)):
            words[k] = pick(draw, *WRONG_WORDS)
        return b" ".join(words)
    if way == "other":
        return good_file(pick(draw, *[other for other in FORMATS if other[:3] != form[:3]]))
    if way == "mesh":
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return as_file(bad_mesh(draw), form)
    return spoil_bytes(draw, good_file(form))


@pytest.mark.parametrize("form", FORMATS)
@examples(6)
@given(data=st.data())
def test_mesh_files(form, data):
    with new_folder() as folder:
        is_whole = pick(data.draw, False, False, False, False, True)
        name = f"part.{form.removesuffix('_ascii')}"
        Path(name).write_bytes(good_file(form) if is_whole else spoilt_mesh(data.draw, form))
        wire = '[parts.wire]\nshape = "cylinder"\nradius = 6.5\nlength = 50\n'
        Path("scene.toml").write_text(f'[parts.part]\nshape = "mesh"\nfile = "{name}"\n{wire}', encoding="utf-8")
        command = pick(data.draw, ["fit", name], ["check", "scene.toml"])
        code, printed = call([*command, "--quiet", "--json", "r.json"])
        assert_outputs(code, folder, [], [folder / "r.json"])
        assert not (is_whole and is_refused(code))
        assert not (is_whole and command[0] == "fit") or "groove" in printed
