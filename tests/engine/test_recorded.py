"""Answers of the engine as they were once recorded: a change of any number is seen.

What they were judged by then is in the other files here. ``python -m tests.engine.test_recorded`` records them again.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from clamp3d import Motion, Scene, check, distance, distances, first_contact, min_clearance, shapes
from clamp3d.engine.model import ModelCache
from clamp3d.engine.poses import check_poses
from clamp3d.kernel import Capsule, Cylinder, SweptArc, rotation, translation
from tests.kinds import DRAWN, faceted_shape, mesh_shape
from tests.recorded import differences, recorded

FILE = Path(__file__).with_name("data") / "answers.json"
SIZE = np.array((1.0, 0.8, 1.3))
BODIES = [
    *DRAWN[:8],  # recorded: shapes that are added later would draw other pairs
    shapes.extrusion([(-9, -9), (9, -9), (9, -3), (-3, -3), (-3, 9), (-9, 9)], 14.0, name="angle"),
    shapes.sphere(6.0),
    faceted_shape(shapes.cylinder(5.0, 24.0, name="scanned rod"), 0.02, "round"),
    faceted_shape(shapes.cylinder(8.0, 12.0, bore=4.0, name="scanned tube"), 0.05, "round"),
    faceted_shape(DRAWN[0], 0.03, "round"),
    mesh_shape(trimesh.creation.box((16.0, 12.0, 20.0)), error=0.02, name="cast box"),
    mesh_shape(trimesh.creation.icosphere(subdivisions=2, radius=8.0).apply_scale(SIZE), name="egg"),
    mesh_shape(trimesh.creation.torus(9.0, 3.0, major_sections=20, minor_sections=10), name="torus"),
]
GAPS = (-12.0, -8.0, -5.0, -3.0)
SLOW = {2, 3, 4, 5, 9, 12, 14, 15, 16, 17, 20, 21, 23, 28, 33, 36, 37, 40, 44, 49, 52, 53, 55, 56, 57}
"""Numbers of pairs that take a second and more."""


def random_pose(rng, gap, a, b):
    """A pose of b at which the boxes of two bodies overlap by ``-gap`` mm along some direction."""
    R = rotation(rng.normal(size=3), rng.choice((0.0, 1.0, 2.0, 3.0)))
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    boxes = [ModelCache().model(shape).bounds for shape in (a, b)]
    reach = 0.5 * sum(np.ptp(box, axis=0) for box in boxes) @ np.abs(way)
    return translation(*(boxes[0].mean(axis=0) + (reach + gap) * way)) @ R


def two_bodies(number):
    """Two of `BODIES`, the second at a pose that no other number gives."""
    rng = np.random.default_rng(number)
    a, b = (BODIES[k] for k in np.random.default_rng(1000 + number).choice(len(BODIES), 2))
    return a, b, random_pose(rng, GAPS[number % 4], a, b)


def rows(scene, **options):
    return [row.to_dict() for row in check(scene, **options).rows]


def pair(a, b, T):
    """What is said of two bodies: by a check, by one that measures all, and by the distance alone."""
    scene = Scene(clearance=0.5).add("a", a).add("b", b, T)
    measured = {"measured": rows(scene, distances=True), "distance": distance(a, b, T).to_dict()}
    return {"bodies": f"{a.name}, {b.name}", "rows": rows(scene), **measured}


def pairs(numbers):
    return [pair(*two_bodies(number)) for number in numbers if number not in SLOW]


def motions(numbers):
    """The least distances and first contacts of bodies that go past each other, and turn."""
    answers = []
    for number in numbers:
        a, b, T = two_bodies(number)
        rng = np.random.default_rng(number)
        way, turn = 8.0 * rng.normal(size=3), Motion.screw(rng.normal(size=3), 1.2, travel=6.0, parts="b", name="turn")
        motion = (Motion.translate(way, parts="b"), turn, replace(turn, travel=way))[number % 3]
        scene = Scene(clearance=0.5).add("a", a).add("b", b, T @ translation(*(-0.5 * way)))
        answers.append({"bodies": f"{a.name}, {b.name}", "rows": rows(scene.with_motion(motion))})
        for ask in (first_contact, min_clearance):
            answer = ask(a, b, motion, scene.parts[1].T_world)
            answers.append({key: getattr(answer, key) for key in ("touches", "t", "resolution")})
            answers.append(answer.distance.to_dict())
    return answers


def opened(error):
    """The walls of a box without a lid, off by ``error`` mm."""
    walls = trimesh.creation.box((14.0, 10.0, 12.0))
    up = walls.face_normals[:, 2] > 0.5
    return mesh_shape(trimesh.Trimesh(walls.vertices, walls.faces[~up]), error=error, name="open box")


def surfaces(numbers):
    """What is said of meshes that are open, or cross themselves, apart from others, around and across them."""
    crossed = mesh_shape(trimesh.creation.torus(3.0, 4.0, major_sections=16, minor_sections=12), name="crossed")
    turned = rotation((1.0, 2.0, 0.5), 0.4)
    places = [
        (opened(0.02), shapes.cylinder(2.0, 30.0), translation(13.0, 1.0, 4.0) @ turned),
        (opened(0.02), shapes.cylinder(2.0, 4.0), translation(1.0, 0.5, 1.0) @ turned),
        (crossed, BODIES[3], translation(3.0, 2.0, 25.0) @ turned),
        (crossed, BODIES[9], translation(5.0, 4.0, 6.0) @ turned),
        (opened(0.0), opened(0.01), translation(6.0, 5.0, 4.0) @ turned),
        (crossed, crossed, translation(1.0, 0.5, 14.0) @ turned),
    ]
    return [pair(*places[number]) for number in numbers]


def grooves(numbers):
    """First contacts and least distances of a wire in a bare groove, whose motion slides, turns and tilts it."""
    answers = []
    for number in numbers:
        rng = np.random.default_rng(number)
        wire = (Cylinder(5.5, 40.0), Capsule(6.0, 60.0))[number % 2]
        start = translation(*(0.3 * rng.normal(size=2)), 5.0) @ rotation(rng.normal(size=3), 0.02)
        axis, point = rng.normal(size=3), 20.0 * rng.normal(size=3)
        motion = replace(Motion.screw(axis, 0.05 * (number - 1), point=point), travel=np.array((0.4, -0.9, 8.0)))
        for ask in (first_contact, min_clearance):
            answer = ask(SweptArc(7.0, 1.2, 50.0), wire, motion, start)
            answers.append({key: getattr(answer, key) for key in ("touches", "t", "resolution")})
            answers.append(answer.distance.to_dict())
    return answers


def bores(numbers):
    """Distances of a body at many poses in a groove or a hole, measured together."""
    tube = shapes.cylinder(8.0, 12.0, bore=4.0)
    bodies = (DRAWN[0], 6.5), (tube, 3.5), (DRAWN[6], 3.8), (DRAWN[2], 6.6)
    answers = []
    for number in numbers:
        (holder, radius), rng = bodies[number % 4], np.random.default_rng(number)
        rod = shapes.sphere(radius) if number == 5 else shapes.cylinder(radius, 30.0)
        place = translation(3.0, 2.0, 0.0) if holder is DRAWN[6] else np.eye(4)
        T = [place @ translation(*(0.3 * rng.normal(size=3))) @ rotation(rng.normal(size=3), 0.02) for _ in range(9)]
        placed = (rod, holder, np.linalg.inv(T)) if number > 5 else (holder, rod, np.array(T))
        many = distances(*placed)
        answers.append({name: getattr(many, name).tolist() for name in ("lower", "upper")} | {"by": list(many.method)})
    return answers


def poses(numbers):
    """A body at many poses against another."""
    answers = []
    for number in numbers:
        a, b, _ = two_bodies(number)
        rng = np.random.default_rng(number)
        T = [random_pose(rng, rng.uniform(-12.0, -4.0), a, b) for _ in range(12)]
        verdicts = check_poses(Scene(clearance=1.0).add("a", a).add("b", b), "b", T)
        names = "row", "column", "least", "most", "kind", "worst"
        answers.append({"bodies": f"{a.name}, {b.name}", **{name: getattr(verdicts, name).tolist() for name in names}})
    return answers


def solids(numbers):
    """What is said of two solids from CAD: of a pin in its hole, and of overlaps."""
    pytest.importorskip("OCP")
    from clamp3d.files.solid import BrepSolid
    from tests import cad

    plate = cad.cut(cad.block((-12, -9, -3), (12, 9, 3)), cad.rod(4.0, -4, 4, 1.0))
    made = (
        plate,
        cad.rod(3.9, -8, 8),
        cad.ring(9.0, 2.0),
        cad.cone(3.0, 1.0, -5, 6),
        cad.ball(5.0, 1.0),
    )
    shapes = [BrepSolid.of(cad.first_solid(shape), f"solid {k}") for k, shape in enumerate(made)]
    places = {
        (0, 1): translation(1.05, 0.0, 2.0),
        (0, 2): translation(9.0, 4.0, 4.3) @ rotation((1.0, 2.0, 0.5), 0.4),
        (1, 3): translation(5.0, 1.0, 1.0) @ rotation((1.0, 1.0, 0.0), 0.7),
        (2, 4): translation(1.0, 11.0, 5.0),
        (3, 4): translation(4.5, 3.0, 5.0),
    }
    chosen = [list(places)[number] for number in numbers]
    return [pair(shapes[i], shapes[j], places[i, j]) for i, j in chosen]


RECORDS = {
    **{f"pairs from {k}": (pairs, range(k, k + 10)) for k in range(0, 60, 10)},
    "motions": (motions, (0, 5, 8)),
    "poses": (poses, range(12)),
    "solids": (solids, range(5)),
    "surfaces": (surfaces, range(6)),
    "grooves": (grooves, range(5)),
    "bores": (bores, (0, 1, 5, 7)),
}


def answer(name):
    ask, numbers = RECORDS[name]
    return recorded(ask(numbers))


@pytest.mark.parametrize("name", RECORDS)
def test_answers_are_those_that_were_recorded(name):
    assert differences(answer(name), json.loads(FILE.read_text(encoding="utf-8"))[name]) == []


if __name__ == "__main__":
    FILE.write_text(json.dumps({name: answer(name) for name in RECORDS}, indent=0) + "\n", encoding="utf-8")
