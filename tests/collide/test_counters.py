"""What a check says it did against the calls that were made, and its seconds against the clock."""

from __future__ import annotations

import time
from collections import Counter

import pytest
import trimesh

from clamp3d.collide import check as checking
from clamp3d.collide import judge, model, moving_pair, refine
from clamp3d.collide.check import check
from clamp3d.collide.model import ModelCache
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Verdict
from clamp3d.core import shapes
from clamp3d.core.mesh import make_mesh
from clamp3d.core.motion import Motion
from clamp3d.core.pose import rotation, translation
from clamp3d.core.primitives import SweptArc

GROOVE = shapes.groove_block(SweptArc(7.0, 1.0, 50.0), 40.0, 20.0)
WIRE = shapes.cylinder(6.5, 80.0)


def mesh_of(made: trimesh.Trimesh, fit: shapes.Fit = "off") -> shapes.MeshShape:
    return shapes.MeshShape(make_mesh(made.vertices, made.faces), fit)


def concave() -> shapes.MeshShape:
    return mesh_of(trimesh.creation.annulus(3.0, 8.0, 10.0, sections=24))


def meshes() -> Scene:
    scene, ring = Scene(clearance=1.0), concave()
    for k, at in enumerate([(0, 0, 0), (15.9, 0, 0), (16.5, 16.2, 0), (40, 0, 0), (0, 0, 10.3)]):
        scene = scene.add(f"ring{k}", ring, translation(*at))
    return scene.add("pin", mesh_of(trimesh.creation.cylinder(2.9, 30.0, sections=32), "round"))


def drawn() -> Scene:
    scene = Scene(clearance=0.5).add("block", GROOVE).add("wire", WIRE, translation(0, 0.2, 0.4))
    scene = scene.add("ring", concave(), translation(0, 0, 30)).add(
        "box", shapes.box((10, 10, 10)), translation(25, 0, 0)
    )
    return scene.add("box2", shapes.box((10, 10, 10)), rotation((1, 2, 3), 0.3) @ translation(30, 3, 3))


def moving() -> Scene:
    way = Motion.translate((0, 0, 12.0), parts=("wire",), name="down")
    turn = Motion.screw((0, 1, 0), 0.7, travel=3.0, parts=("ring", "box"), name="turn")
    scene = drawn()
    return Scene(scene.parts, clearance=0.5, motions=(way, turn))


def open_mesh() -> Scene:
    made = trimesh.creation.box((10, 10, 10))
    made.update_faces([k > 1 for k in range(12)])
    opened = shapes.MeshShape(make_mesh(made.vertices, made.faces), "off")
    return Scene().add("a", opened).add("b", opened, translation(9, 1, 1)).add("c", WIRE, translation(4, 0, 0))


SCENES = {"meshes": meshes, "drawn": drawn, "moving": moving, "open": open_mesh}
CALLS = {
    "features or hulls": (refine, "bodies_distance"),
    "facets": (refine, "rod_distance"),
    "meshes": (refine, "meshes_distance"),
    "open meshes": (refine, "open_distance"),
    "faces": (refine, "faces_distance"),
    "containment": (judge, "within"),
    "swept": (moving_pair, "swept_lower"),
    "boxes in motion": (moving_pair, "from_boxes"),
}


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("full", [False, True])
def test_counters_are_the_calls(kind, full, monkeypatch):
    scene, calls = SCENES[kind](), Counter()

    def traced(name, function):
        def run(*args, **kwargs):
            calls[name] += 1
            return function(*args, **kwargs)

        return run

    for name, (module, function) in CALLS.items():
        monkeypatch.setattr(module, function, traced(name, getattr(module, function)))
    monkeypatch.setattr(model, "hull", traced("hulls built", model.hull))
    surfaces = []
    counted = model.Model._counted
    monkeypatch.setattr(model.Model, "_counted", lambda self, made: surfaces.append(made) or counted(self, made))
    cache = ModelCache()
    check(scene.moved({}), cache=cache) if kind == "moving" else None  # what another check did is not this one's
    calls.clear()
    surfaces.clear()
    start = time.perf_counter()
    result = check(scene, full=full, cache=cache)
    wall = time.perf_counter() - start
    work, asked = result.work, Counter(result.work.queries)
    assert asked["features"] + asked["hulls"] == calls["features or hulls"]
    assert asked["boxes"] == work.candidates + calls["boxes in motion"]
    for name in ("facets", "meshes", "open meshes", "faces", "containment", "swept"):
        assert asked[name] == calls[name], name
    assert work.hulls == calls["hulls built"]
    assert work.meshes == len(surfaces)
    assert work.triangles == sum(len(made.faces) for made in surfaces)
    open_ = sum(row.verdict in (Verdict.FAILED, Verdict.UNCERTAIN) for row in result.pairs)
    assert sum(work.decided.values()) == work.pairs - open_
    assert work.parts == len(scene.parts)
    assert 0.0 <= sum(work.seconds.values()) <= wall


def test_a_pair_that_failed_was_not_decided_by_its_boxes(monkeypatch):
    def broken(*_, **__):
        raise ValueError("no answer")

    monkeypatch.setattr(checking, "judge", broken)
    result = check(Scene().add("a", GROOVE).add("b", WIRE).add("c", WIRE, translation(500, 0, 0)))
    assert result.verdict("a", "b") is Verdict.FAILED
    assert result.work.decided == {"broad phase": 2}
