"""One question, one answer: the 21 distances of a clamp are the same in every output, whatever its wires are."""

import csv
import io

import pytest

from clamp3d import assemble, check, measure, view
from clamp3d.output.report import make_report
from clamp3d.output.report_page import report_csv, report_to_dict
from clamp3d.output.scene_report import check_to_dict


@pytest.mark.parametrize("wires", [{}, {"line": "LGJ-240/40", "jumper": "12.5"}])
def test_every_output_says_the_same(wires, reference_report):
    found = make_report(assemble(**wires)) if wires else reference_report
    assembly = found.assembly
    truth = measure(assembly.scene)
    assert len(truth) == 21
    checked = check_to_dict(check(assembly.scene, distances=True))["pairs"]
    with view(assembly, serve=False, mesh_error=0.5) as viewer:
        shown = viewer.story["stops"][-1]["rows"]
    outputs = {
        "run": assembly.to_dict()["contacts"],
        "report.json": report_to_dict(found)["pairs"],
        "pairs.csv": list(csv.DictReader(io.StringIO(report_csv(found)))),
        "check": checked,
        "viewer": shown,
    }
    for name, rows in outputs.items():
        assert {frozenset((row["a"], row["b"])) for row in rows} == {frozenset(pair) for pair in truth}, name
        for row in rows:
            exact = truth.get((row["a"], row["b"])) or truth[row["b"], row["a"]]
            assert float(row["distance_mm"]) == pytest.approx(exact.value, abs=1e-9), (name, row["a"], row["b"])
    for row in checked:
        if row["at_least_mm"] is not None:
            assert row["at_least_mm"] <= row["distance_mm"] <= row["at_most_mm"]
