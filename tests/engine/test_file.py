"""Scene files: what is read, and one clear line for every fault."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from clamp3d import InputError, Verdict, check, load_scene, shapes
from clamp3d.kernel import SweptArc
from clamp3d.scenefile.file import parse_scene
from clamp3d.scenefile.pose_table import Pose

WIRE = '[parts.wire]\nshape = "cylinder"\nlength = 80\n'
HALF = "{ radius = 18, at = [%d, 0] }"
BOX = '[parts.box]\nshape = "box"\nsize = [10, 20, 30]\n'


def pose_of(text):
    return parse_scene(BOX + f"pose = {{ {text} }}\n").parts[0].T_world


@pytest.mark.parametrize(
    "text",
    [
        "translation = [1, 2, 3], rpy_deg = [0, 0, 90]",
        "translation = [1, 2, 3], axis = [0, 0, 2], angle_deg = 90",
        "translation = [1, 2, 3], quaternion = [0, 0, 0.7071067811865476, 0.7071067811865476]",
        "translation = [1, 2, 3], quaternion = [0, 0, 0.707, 0.707]",
        "matrix = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]]",
        "matrix = [[0.000001, -1, 0, 1], [1, 0.000001, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]",
    ],
)
def test_poses(text):
    expected = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], dtype=float)
    np.testing.assert_allclose(pose_of(text), expected, atol=2e-6)


EVERY_KIND = """
clearance = 0.5
[parts]
wire = { shape = "cylinder", diameter = 13.87, length = 80 }
line = { shape = "cylinder", conductor = "LJ-630", length = 80, pose.translation = [0, 100, 0] }
tube = { shape = "cylinder", radius = 20, bore_diameter = 32.9, length = 10, pose.translation = [0, 100, 0] }
plate = { shape = "box", size = [30, 30, 5], holes = [{ radius = 3 }], pose.translation = [200, 0, 0] }
cube = { shape = "mesh", file = "cube.stl", unit = "mm", fit = "off", pose.translation = [200, 0, 7.5] }
ball = { shape = "sphere", diameter = 8, pose.translation = [200, 0, 16.6] }
twin = { shape = "sphere", radius = 4, pose.translation = [200, 0, 16.6] }
splint = { shape = "clamp-part", part = "P1", pose.translation = [-300, 0, 0] }
[parts.block]
shape = "groove-block"
radius = 7
half_angle_deg = 60
length = 50
width = 60
height = 20
grooves = [{ x = 18, radius = 5, half_angle_deg = 50 }]
holes = [{ diameter = 4, at = [-15, 3], axis = "y" }]
[[allowed]]
parts = ["cube", "pla*"]
"""


def test_every_kind_of_part(tmp_path):
    trimesh.creation.box((10, 10, 10)).export(tmp_path / "cube.stl")
    file = tmp_path / "all.toml"
    file.write_text(EVERY_KIND, encoding="utf-8")
    scene = load_scene(file)
    groove, others = SweptArc(7.0, math.radians(60), 50.0), [(18.0, 5.0, math.radians(50))]
    block = shapes.groove_block(groove, 60.0, 20.0, others=others, holes=[shapes.Hole(2.0, (-15.0, 3.0), "y")])
    assert {part.name: part.shape for part in scene.parts}["block"] == block
    result = check(scene)
    assert result.verdict("block", "wire") is Verdict.CLEARANCE
    assert result.verdict("line", "tube") is Verdict.CLEARANCE  # 16.45 - 16.335
    assert result.verdict("cube", "plate") is Verdict.ALLOWED
    assert result.verdict("ball", "cube") is Verdict.CLEARANCE
    assert result.verdict("ball", "twin") is Verdict.DUPLICATE  # equal spheres are one shape
    assert result.counts == {"duplicate": 1, "clearance": 4, "allowed": 1, "clear": 30}
    assert next(r for r in result.pairs if {r.a, r.b} == {"cube", "ball"}).distance.value == pytest.approx(
        0.1, abs=1e-9
    )
    row = next(r for r in result.pairs if r.a == "line")
    assert row.distance.value == pytest.approx(32.9 / 2 - 32.67 / 2, abs=1e-6)


def test_whole_clamp_with_its_own_connections():
    scene = parse_scene('[clamp]\nname = "reference"\njumper = "LJ-150"\npose = { rpy_deg = [0, 0, 30] }\n')
    assert [p.name for p in scene.parts] == ["P1", "P2", "P3", "P4", "P5", "P6", "P7"]
    result = check(scene)
    assert result.clean
    assert result.verdict("P1", "P7") is Verdict.ALLOWED


def test_motions():
    scene = parse_scene(
        WIRE
        + "radius = 2\n"
        + '[[motions]]\nparts = ["wire"]\ntranslate = [0, 0, 5]\n'
        + '[[motions]]\nname = "turn"\nparts = ["wire"]\nscrew = { axis = [0, 0, 1], angle_deg = 720, pitch = 2.5 }\n'
        + '[[motions]]\nparts = ["wire"]\nto = { translation = [1, 2, 3] }\n'
    )
    assert [m.name for m in scene.motions] == ["motion 1", "turn", "motion 3"]
    np.testing.assert_allclose(scene.motions[1].travel, [0, 0, 5.0])
    assert scene.motions[1].angle == pytest.approx(4 * math.pi)
    np.testing.assert_array_equal(scene.motions[1].point, [0, 0, 0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[parts.wire]\nshape = ", "not valid TOML"),
        ('[parts.a]\nshape = "cyl"\n', 'parts.a: must have shape = one of "cylinder", '),
        (WIRE, "parts.wire.radius: give exactly one of radius, diameter, conductor"),
        (WIRE + "radius = -2\n", "parts.wire.radius: must be at least 1e-06, got -2"),
        (WIRE + 'conductor = "LJ-631"\n', "parts.wire.conductor: unknown conductor 'LJ-631'; nearest: LJ-630"),
        (WIRE + 'radius = "2"\n', "parts.wire.radius: must be a valid number, got '2'"),
        (BOX.replace("30]", "30, 1]"), "parts.box.size"),
        (BOX + "pose.translate = [0, 0, 0]\n", "parts.box.pose.translate is not a known key; did you mean translation"),
        (BOX + "pose = { axis = [0, 0, 1] }\n", "parts.box.pose.axis: give axis and angle_deg together"),
        (BOX + "pose = { matrix = [[2,0,0,0],[0,1,0,0],[0,0,1,0]] }\n", "parts.box.pose.matrix: must be rigid"),
        (BOX + "pose.matrix = [[-1,0,0,0],[0,1,0,0],[0,0,1,0]]\n", "pose.matrix: must be rigid: it reflects"),
        (BOX + "holes = [{ radius = 3, at = [90, 0] }]\n", "parts.box: hole of radius 3 mm at (90.0, 0.0) lies beside"),
        (BOX + "holes = [{ radius = 3, diameter = 6 }]\n", "holes.0.radius: give exactly one of radius, diameter"),
        (
            BOX + f"holes = [{HALF % -10}, {HALF % 10}]\n",
            "2 holes together leave nothing of the part that is thicker than 0.006 mm",
        ),
        (BOX + "pose = { quaternion = [0, 0, 0, 2] }\n", "parts.box.pose.quaternion: must have length 1, got 2"),
        (BOX + "pose = { translation = [nan, 0, 0] }\n", "parts.box.pose.translation.0: must be a finite number"),
        (BOX + '[[allowed]]\nparts = ["box", "bax"]\n', "allowed: unknown part 'bax'; available: box"),
        (BOX + '[[allowed]]\nparts = ["box", "box"]\n', "allowed must name two parts, got 'box' twice"),
        (BOX + '[[motions]]\nparts = ["box"]\n', "motions.0.translate: give exactly one of translate, rotate, screw"),
        ("clearence = 1\n" + BOX, "clearence is not a known key; did you mean clearance?"),
        ("clearance = 0.001\n" + BOX, "clearance must be 0 or > contact = 0.01 mm, got 0.001"),
        ('unit = "inch"\n' + BOX, "unit: must be 'mm', got 'inch'"),
        ("parts.p = 3\n", "parts.p: must have shape = one of"),
        ('[parts."a b"]\nshape = "box"\nsize = [1, 1, 1]\n', "parts.a b: part name must not be empty or hold a space"),
        ('[parts.m]\nshape = "mesh"\nfile = "none.stl"\n', "none.stl"),
        ('[parts.p]\nshape = "clamp-part"\npart = "P8"\n', "parts.p.part: must be 'P1', 'P2'"),
        ('[parts.p]\nshape = "clamp-part"\npart = "P1"\nclamp = "other"\n', "parts.p: unknown clamp 'other'"),
    ],
)
def test_faults(text, message):
    with pytest.raises(InputError) as caught:
        parse_scene(text, origin="scene.toml")
    line = str(caught.value)
    assert line.startswith("scene.toml: ")
    assert message in line
    assert "\n" not in line


@given(st.tuples(*[st.floats(-720.0, 720.0)] * 3))
def test_roll_pitch_yaw_are_scipys_extrinsic_angles(angles):
    table = Pose(rpy_deg=list(angles))
    np.testing.assert_allclose(
        table.T()[:3, :3], Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), atol=2e-14
    )
