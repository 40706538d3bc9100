"""The reference clamp against the paper and the reconstruction's own, independently computed, figures."""

import json
import math

import numpy as np
import pytest

from clamp3d import assemble, check, distance, load_clamp

# Section 4.1 of the paper: x, y (mm, y down) and rotation (deg) from the power line's centre.
FINAL_STATE = {
    "P1": (-23.328, -41.374, 0.0),
    "P2": (45.172, -20.374, 12.0),
    "P3": (45.172, -21.604, 0.0),
    "P4": (45.172, -120.184, 0.0),
    "P5": (45.172, -67.774, 0.0),
    "P7": (94.969, -9.260, 0.0),
}
EXACT_CHORDS = {1: 31.5314, 5: 31.564, 20: 32.080}  # computed apart from this program, +-0.002
DIAMETERS = {"LJ-16": 5.10, "LJ-120": 14.25, "LJ-500": 29.12, "LJ-630": 32.67, "LGJ-10/2": 4.50}


@pytest.fixture(scope="module")
def assembly():
    return assemble("reference")


def printed(main, *arguments):
    code, out, _ = main("run", *arguments, "--quiet", "--json", "-")
    return code, json.loads(out)


@pytest.mark.parametrize("part", FINAL_STATE)
def test_parts_end_where_the_paper_prints_them(part, assembly):
    x, y, degrees = FINAL_STATE[part]
    pose, T = assembly.poses[part], assembly.T_world(part)
    assert (round(pose.x, 3), round(pose.y, 3)) == (x, y)
    assert math.degrees(pose.angle) == pytest.approx(degrees, abs=0.01)
    assert (T[0, 3], T[2, 3]) == pytest.approx((pose.x, -pose.y))
    assert T[2, 0] == pytest.approx(math.sin(math.radians(degrees)), abs=1e-4)


def test_the_splints_end_as_far_apart_as_published(assembly):
    assert assembly.status == "clamped"
    assert round(assembly.distance, 3) == 31.530
    assert assembly.distance == pytest.approx(31.5298, abs=5e-5)
    assert assembly.violation < 1e-9
    assert assembly.optimality < 1e-9
    assert {(c.a, c.b) for c in assembly.contacts if c.relation == "interior contact"} == {
        ("P1", "P6"), ("P1", "P7"), ("P2", "P3"), ("P2", "P6"), ("P2", "P7"),
    }  # fmt: skip


@pytest.mark.parametrize(("degrees", "truth"), EXACT_CHORDS.items())
def test_chords_in_place_of_arcs(degrees, truth, main):
    code, data = printed(main, "--method", "chords", "--unit-angle-deg", degrees)
    assert code == 0
    assert data["distance_mm"] == pytest.approx(truth, abs=0.0021)


def test_conductors_have_their_diameters(main):
    code, out, _ = main("conductors")
    rows = dict(line.split()[:2] for line in out.splitlines())
    assert code == 0
    for name, diameter in DIAMETERS.items():
        assert load_clamp(line=name).line.radius == pytest.approx(diameter / 2)
        assert rows[name] == f"{diameter:.2f}"


@pytest.mark.parametrize(
    ("line", "jumper", "code", "distance_mm"),
    [("LJ-500", None, 0, 27.233), (None, "LJ-16", 1, None), ("LJ-16", "LJ-16", 1, None)],
)
def test_other_wires(line, jumper, code, distance_mm, main):
    wires = [x for name, wire in (("--line", line), ("--jumper", jumper)) if wire for x in (name, wire)]
    ended, data = printed(main, *wires)
    assert ended == code
    assert (data["status"] == "clamped") == (code == 0)
    if distance_mm:
        assert round(data["distance_mm"], 3) == distance_mm


def test_the_assembled_clamp_is_a_scene_that_is_clean(assembly):
    result = check(assembly.scene)
    assert not {row.verdict.value for row in result.pairs} & {"clash", "contained", "failed", "uncertain"}
    assert result.verdict("P1", "P6").value in ("contact", "allowed")
    T = {name: assembly.T_world(name) for name in ("P1", "P4")}
    shapes = {part.name: part.shape for part in assembly.scene.parts}
    bolt = distance(shapes["P1"], shapes["P4"], np.linalg.inv(T["P1"]) @ T["P4"])
    assert bolt.lower - 1e-6 <= 1.0 <= bolt.upper + 1e-6  # a bolt of 20 in the middle of a hole of 22
