"""Assemblies as engineers draw them, through a STEP file of products and instances, against Open CASCADE."""

import pytest

pytest.importorskip("bd_warehouse")

from clamp3d import check, load
from tests.files.assemblies import ASSEMBLIES, judged, near, nudged, truth, write_step


# scripts/check-assemblies does the same for them and for larger ones, as drawn and moved in several ways.
@pytest.mark.parametrize("name", ASSEMBLIES)
def test_verdicts_and_bounds_of_an_assembly_whose_parts_are_moved(name, tmp_path):
    parts = nudged(ASSEMBLIES[name](), 1)
    scene = load(write_step(parts, tmp_path / f"{name}.step"))
    assert len(scene.parts) == len(parts)
    depths = name != "taper"  # which take long; tests/engine/test_exact.py has those of cones, balls and rings
    rows = {(row.a, row.b): row for row in check(scene, depths=depths).pairs}
    solids, names, verdicts = list(parts.values()), [part.name for part in scene.parts], []
    for i, j in near(solids):
        row, distance = rows.get((names[i], names[j])), truth(solids[i], solids[j])
        bounds = ("clear", 0.0, float("inf"))
        if row is not None:
            bounds = row.verdict.value, row.distance.lower, row.distance.upper
        verdict, holds = judged(*bounds, distance)
        assert holds, (names[i], names[j], row, distance)
        verdicts.append(verdict)
    assert verdicts
    assert "wrong" not in verdicts
    assert verdicts.count("uncertain") <= 0.02 * len(verdicts)
