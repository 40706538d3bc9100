"""An assembly of the size that engineers have, through a STEP file of products and instances, against Open CASCADE."""

import pytest

pytest.importorskip("bd_warehouse")

from assemblies import judged, near, nudged, truth, write_step
from bolted import plates

from clamp3d import check, load


# scripts/measure-step does the same for the others, as drawn and moved in several ways.
def test_moved_instances_of_a_file(tmp_path):
    parts = nudged(plates(), 1)
    scene = load(write_step(parts, tmp_path / "plates.step"))
    assert len({id(part.shape) for part in scene.parts}) == 9
    assert len(scene.parts) == len(parts) == 31
    rows = {(row.a, row.b): row for row in check(scene, depths=False).pairs}
    solids, names, told = list(parts.values()), [part.name for part in scene.parts], []
    for i, j in near(solids):
        row, known = rows.get((names[i], names[j])), truth(solids[i], solids[j])
        bounds = ("clear", 0.0, float("inf"))
        if row is not None:
            bounds = row.verdict.value, row.distance.lower, row.distance.upper
        said, holds = judged(*bounds, known)
        assert holds, (names[i], names[j], row, known)
        told.append(said)
    assert len(told) > 50
    assert "wrong" not in told
    assert told.count("uncertain") <= 0.02 * len(told)
