"""All pairs of an assembled clamp against Open CASCADE, for two pairs of wires."""

import itertools

import numpy as np
import pytest

from clamp3d import Verdict, assemble, check, distance, measure
from clamp3d.engine.model import ModelCache
from clamp3d.geometry.pose import inverse
from tests.kinds import measured_alike

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")

CACHE = ModelCache()


@pytest.mark.parametrize(("line", "jumper"), [(None, None), ("LJ-16", "LJ-800")])
def test_all_pairs_agree_with_open_cascade(line, jumper):

    from clamp3d.files.open_cascade import occ
    from clamp3d.output.step import solid
    from tests.cad import common_volume, location

    scene = assemble("reference", line=line, jumper=jumper).scene
    solids = {part.name: solid(part.shape).Moved(location(part.T_world)) for part in scene.parts}
    found = measure(scene, cache=CACHE)
    assert list(found) == list(itertools.combinations(solids, 2))
    result = check(scene, distances=True, cache=CACHE)
    assert {(row.a, row.b): row.distance.value for row in result.pairs} == {pair: d.value for pair, d in found.items()}
    for (a, b), d in found.items():
        if d.value < -1e-6:
            assert common_volume(solids[a], solids[b]) > 0.0, (a, b)
            assert result.verdict(a, b) in (Verdict.CLASH, Verdict.CONTAINED)
            continue
        assert d.uncertainty <= 1e-7, (a, b, d)
        assert abs(d.value - occ.BRepExtrema_DistShapeShape(solids[a], solids[b]).Value()) <= 1e-6, (a, b, d)
        # Witnesses lie on both bodies, and the normal leads from one to the other.
        assert abs(np.linalg.norm(d.normal) - 1.0) <= 1e-12
        assert np.abs(d.point_a + d.value * d.normal - d.point_b).max() <= 1e-8, (a, b)
        for name, point in ((a, d.point_a), (b, d.point_b)):
            part = scene.parts[scene.index(name)]
            local = (inverse(part.T_world) @ [*point, 1.0])[None, :3]
            assert abs(max(form.depth(local)[0] for form in CACHE.model(part.shape).bodies)) <= 1e-9, (a, b, name)


def test_the_reference_clamp(run):
    scene = run.scene
    found = measure(scene, cache=CACHE)
    assert found["P1", "P2"].value == pytest.approx(3.729354, abs=1e-6)
    assert found["P2", "P4"].value == pytest.approx(1.0, abs=1e-9)
    assert found["P1", "P4"].value == pytest.approx(1.0, abs=1e-9)
    touching = {pair for pair, d in found.items() if d.value <= 1e-6}
    assert touching == {(item.a, item.b) for item in scene.allowed} - {("P1", "P4"), ("P2", "P4")}
    measured_alike(scene, check(scene, cache=CACHE), CACHE)
    for groove, part in itertools.product(("P1", "P2"), ("P6", "P7")):
        assert found[groove, part].method == "groove kernel"
    for a, b in (("P1", "P2"), ("P3", "P5")):
        first, second = (scene.parts[scene.index(name)] for name in (a, b))
        T = inverse(first.T_world) @ second.T_world
        assert distance(first.shape, second.shape, T).value == found[a, b].value
        assert distance(second.shape, first.shape, inverse(T)).value == pytest.approx(found[a, b].value, abs=1e-9)
