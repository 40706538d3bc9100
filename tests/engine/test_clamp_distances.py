"""All pairs of an assembled clamp against Open CASCADE, for two pairs of wires."""

import itertools

import numpy as np
import pytest

from clamp3d.clamp.assemble import assemble
from clamp3d.engine.check import check
from clamp3d.engine.distance import distance, measure
from clamp3d.engine.model import ModelCache
from clamp3d.engine.verdict import Verdict
from clamp3d.geometry.pose import inverse

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")

WIRES = [(None, None), ("LJ-16", "LJ-800")]
CACHE = ModelCache()
SHAPES = {}


def placed(part):
    from OCP.gp import gp_Trsf
    from OCP.TopLoc import TopLoc_Location

    from clamp3d.output.step import solid

    if part.shape not in SHAPES:
        SHAPES[part.shape] = solid(part.shape)
    move = gp_Trsf()
    move.SetValues(*part.T_world[:3].ravel().tolist())
    return SHAPES[part.shape].Moved(TopLoc_Location(move))


def least(a, b):
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    return BRepExtrema_DistShapeShape(a, b).Value()


def common_volume(a, b):
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(BRepAlgoAPI_Common(a, b).Shape(), properties)
    return properties.Mass()


@pytest.mark.parametrize(("line", "jumper"), WIRES)
def test_all_pairs_agree_with_open_cascade(line, jumper):
    scene = assemble("reference", line=line, jumper=jumper).scene
    shapes = {part.name: placed(part) for part in scene.parts}
    found = measure(scene, cache=CACHE)
    assert list(found) == list(itertools.combinations(shapes, 2))
    verdicts = check(scene, distances=True, cache=CACHE)
    for (a, b), d in found.items():
        if d.value < -1e-6:
            assert common_volume(shapes[a], shapes[b]) > 0.0, (a, b)
            assert verdicts.verdict(a, b) in (Verdict.CLASH, Verdict.CONTAINED)
            continue
        assert d.uncertainty <= 1e-7, (a, b, d)
        assert abs(d.value - least(shapes[a], shapes[b])) <= 1e-6, (a, b, d)
        contract(scene, a, b, d)


def contract(scene, a, b, d):
    """Witnesses lie on both bodies, and the normal leads from one to the other."""
    assert d.normal is not None, (a, b)
    assert abs(np.linalg.norm(d.normal) - 1.0) <= 1e-12
    assert np.abs(d.point_a + d.value * d.normal - d.point_b).max() <= 1e-8, (a, b)
    for name, point in ((a, d.point_a), (b, d.point_b)):
        part = scene.parts[scene.index(name)]
        local = (inverse(part.T_world) @ [*point, 1.0])[None, :3]
        depth = max(form.depth(local)[0] for form in CACHE.model(part.shape).bodies)
        assert abs(depth) <= 1e-9, (a, b, name, depth)


def test_the_reference_clamp():
    scene = assemble().scene
    found = measure(scene)
    assert found["P1", "P2"].value == pytest.approx(3.729354, abs=1e-6)
    assert found["P2", "P4"].value == pytest.approx(1.0, abs=1e-9)
    assert found["P1", "P4"].value == pytest.approx(1.0, abs=1e-9)
    touching = {pair for pair, d in found.items() if d.value <= 1e-6}
    declared = {(item.a, item.b) for item in scene.allowed}
    assert touching == declared - {("P1", "P4"), ("P2", "P4")}
    rows = {(row.a, row.b): row.distance.value for row in check(scene, distances=True).pairs}
    assert rows == {pair: d.value for pair, d in found.items()}
    for a, b in (("P1", "P2"), ("P3", "P5")):
        first, second = (scene.parts[scene.index(name)] for name in (a, b))
        T = inverse(first.T_world) @ second.T_world
        assert distance(first.shape, second.shape, T).value == found[a, b].value
        assert distance(second.shape, first.shape, inverse(T)).value == pytest.approx(found[a, b].value, abs=1e-9)
