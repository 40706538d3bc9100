"""The report: rows against the geometry they describe, files against each other, one answer in every output."""

import base64
import csv
import io
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from clamp3d import Motion, Scene, assemble, check, measure, report, shapes, view
from clamp3d.clamp.contact import measure_contacts
from clamp3d.kernel import translation
from clamp3d.output.report import make_report
from clamp3d.output.report_page import report_csv, report_html, report_to_dict, write_report
from clamp3d.output.scene_report import check_to_dict
from tests.cli.boxes import boxes
from tests.docs.project import ROOT


def test_notes_tell_of_other_equilibria_and_of_what_is_declared_and_does_not_touch(reference_report, odd_page):
    """`run` listed other end states while the report said "Findings: None"."""
    assert {finding.severity for finding in reference_report.findings} == {"note"}
    others = reference_report.assembly.others
    assert len(others) == 1
    texts = [finding.text for finding in reference_report.findings]
    for other in others:
        assert str(other) in texts
        assert str(other) in odd_page
    for pair in ("P1-P4", "P2-P4"):
        (finding,) = (f for f in reference_report.findings if f.row is not None and f.row.name == pair)
        assert "does not touch: 1.000 mm apart" in finding.text
    (near,) = (f for f in reference_report.findings if f.row is not None and f.row.name == "P1-P2")
    assert near.text == "P1 up splint and P2 down splint are nearer than 5 mm, and nothing joins them: gap 3.729354 mm"


def test_a_wire_through_the_bolt_is_a_clash_not_a_pass(reference_report):
    assembly = reference_report.assembly
    poses = dict(assembly.poses)
    poses["P7"] = replace(poses["P7"], x=poses["P4"].x, y=poses["P4"].y + 60.0)
    contacts = measure_contacts(assembly.clamp, poses)
    found = make_report(replace(assembly, poses=poses, contacts=contacts))
    (row,) = (r for r in found.rows if r.name == "P4-P7")
    assert row.verdict in ("clash", "contained")
    assert row.severity == "error"
    assert row.distance.upper < 0.0
    assert not found.passed
    assert found.headline == "Not passed: see the findings."
    assert any(f.row is row and f.severity == "error" for f in found.findings)


def test_clamp_that_does_not_close_fails_with_its_reasons():
    loose = make_report(assemble(line="LGJ-10/2", jumper="LJ-150"))
    assert not loose.passed
    assert loose.findings[0].text.startswith("not clamped")
    severities = [f.severity for f in loose.findings]
    assert severities == sorted(severities, key=["error", "warning", "note"].index)
    assert any(f.text.startswith("P1-P2") for f in loose.findings if f.severity == "error")
    assert any(f.text.startswith("P2-P6") and "does not touch" in f.text for f in loose.findings)
    final = loose.steps[-1]
    assert "fully in both grooves" not in final.seat("P6")
    assert final.seat("P7") == "fully in both grooves"


def test_steps_are_what_a_line_worker_sees(reference_report):
    steps = reference_report.steps
    assert [s.waypoint for s in steps] == [*reference_report.assembly.path]
    first, last = steps[0], steps[-1]
    assert first.parallel
    assert first.opening_line == pytest.approx(first.opening_jumper)
    assert first.seat("P6") == first.seat("P7") == "not in the clamp yet"
    assert steps[2].seat("P6").startswith("in P1's groove")
    assert not last.parallel
    assert last.opening_line == pytest.approx(31.530, abs=5e-4)  # published
    assert last.opening_jumper == pytest.approx(3.05, abs=5e-3)
    assert math.degrees(last.tilt) == pytest.approx(12.0, abs=1e-3)
    assert last.turns == pytest.approx(reference_report.assembly.turns)
    assert steps[-2].turns == 0.0
    stages = reference_report.tightening
    assert stages[-1]["nut_turns"] == pytest.approx(last.turns)
    gaps = [s["saddle_gap_mm"] for s in stages]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[-1] == 0.0
    assert np.diff([s["way_mm"] for s in stages]) == pytest.approx(stages[-1]["way_mm"] / 4)


def sources(page):
    return re.findall(r"""(?:src|href)=["']([^"']*)["']""", page)


def pictures(page):
    return [s.partition("base64,")[2] for s in sources(page) if s.startswith("data:image/svg")]


def test_page_holds_everything_itself(reference_report, odd_page):
    assert all(s.startswith(("data:", "#")) for s in sources(odd_page))
    assert not re.search(r"url\(|@import", odd_page)
    # states, steps, and every pair that touches or is declared to but the thread
    assert len(pictures(odd_page)) == 2 + 9
    assert all(base64.b64decode(picture).count(b"</g>") > 20 for picture in pictures(odd_page))
    for row in reference_report.rows:
        assert odd_page.count(f'id="{row.name}"') == 1
    assert "&lt;b&gt;x&lt;/b&gt;&amp;" in odd_page
    assert not re.search("<b>x</b>|<script>", odd_page)
    assert len(re.findall(r'<td style="--c:#[0-9A-F]{6}" class="v-[a-z]+"><a href=', odd_page)) == 21


def test_a_clashing_scene_says_so_worst_first(tmp_path):
    """A wire 0.2 mm in its groove's block, a box 0.3 mm beside the block, and one that is pushed in."""
    groove = shapes.SweptArc(7.0, math.radians(60.0), 50.0)
    scene = Scene(name="<i>clash</i>", clearance=0.5).add("block", shapes.groove_block(groove, 40.0, 20.0))
    scene = scene.add("wire", shapes.cylinder(6.8, 80.0), translation(0, -0.4, 0))
    scene = scene.add("near", shapes.box((10, 10, 10)), translation(25.3, -10, 0))
    scene = scene.add("far", shapes.box((5, 5, 5)), translation(60, -10, 0))
    clashing = replace(scene, motions=(Motion.translate((-30.0, 0, 0), parts=("far",), name="push in"),))
    found = make_report(clashing)
    assert not found.passed
    assert found.headline.startswith("2 clashes (1 in motion)")
    assert {f.row.name for f in found.findings if f.severity == "error"} == {"block-wire", "far-near"}
    assert [f.severity for f in found.findings][-1] == "note"
    rows = {row.name: row for row in found.rows}
    assert (len(rows), found.n_pairs) == (2, 6)  # those that are far apart have no row
    assert rows["block-wire"].distance.value == pytest.approx(-0.2, abs=1e-6)
    assert (rows["block-near"].verdict, rows["block-near"].severity) == ("clearance", "note")
    assert rows["block-near"].distance.value == pytest.approx(0.3, abs=1e-6)
    (pushed,) = (row for row in found.motions if row.name == "far-near")
    assert pushed.contact_at == pytest.approx((60 - 2.5 - 30.3) / 30, abs=1e-3)
    page, data, table = (path.read_text() for path in write_report(found, tmp_path))
    lines = list(csv.DictReader(io.StringIO(table)))
    assert [(line["a"], line["b"]) for line in lines] == [(r.a, r.b) for r in (*found.rows, *found.motions)]
    assert not [cell for line in lines for cell in line.values() if cell[:1] in ("[", "{")]  # a number a column
    (hit,) = (line for line in lines if line["b"] == "wire" and line["verdict"] == "clash")
    assert 0.0 < float(hit["volume_at_least_mm3"]) <= float(hit["volume_at_most_mm3"])
    assert float(hit["box_y_min"]) <= float(hit["inside_y"]) <= float(hit["box_y_max"])
    assert "<i>clash" not in page
    assert page.count("--c:#") == page.count("--c:") > 0  # a clear cell of the matrix has its colour too
    assert len(pictures(page)) == 1 + len(found.findings)
    ids = set(re.findall(r'id="([^"]*)"', page))
    assert {s[1:] for s in sources(page) if s.startswith("#")} <= {i.replace("&#39;", "'") for i in ids}
    data = json.loads(data)
    assert (data["passed"], data["headline"]) == (False, found.headline)
    assert [f["text"] for f in data["findings"]] == [f.text for f in found.findings]
    assert [(p["a"], p["b"]) for p in data["pairs"]] == [(r.a, r.b) for r in found.rows]
    engine = measure(clashing)
    for pair in data["pairs"]:
        assert pair["distance_mm"] == pytest.approx(engine[pair["a"], pair["b"]].value, abs=1e-9)
    motion = next(m for m in data["motions"] if {m["a"], m["b"]} == {"far", "near"})
    assert motion["contact_at"] == pushed.contact_at


def test_scenes_without_findings_pairs_or_parts(tmp_path):
    assert "No issues found." in report(Scene().add("pin", shapes.cylinder(5.0, 40.0)), tmp_path)[0].read_text()
    assert report(Scene(), tmp_path)[2].read_text().startswith("a,b,verdict,distance_mm")


@pytest.mark.usefixtures("without_pictures")
def test_of_many_parts_the_near_ones_have_rows():
    grid = Scene()
    for i in range(40):
        grid = grid.add(f"p{i}", shapes.box((1, 1, 1)), translation(2.0 * i, 0, 0))
    found = make_report(grid.add("x", shapes.box((1, 1, 1)), translation(0.5, 0, 0)))
    assert (found.n_pairs, len(found.rows)) == (820, 1)
    page = report_html(found)
    assert "819 pairs are not listed: clear." in page
    assert "Parts of pairs that are not clear: 2 of 41 parts." in page


@pytest.mark.usefixtures("without_pictures")
def test_command_takes_scenes_and_meshes(tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    boxes(tmp_path / "boxes.toml", {"a": 0, "b": 9, "c": 30})
    assert main("report", "boxes.toml", "-q", "-o", "out")[0] == 1
    data = json.loads((tmp_path / "out" / "report.json").read_text())
    assert [(p["a"], p["b"], p["verdict"]) for p in data["pairs"]] == [("a", "b", "clash")]
    assert main("report", ROOT / "examples" / "hinge" / "pin.stl", "-q", "-o", "pin")[0] == 0
    assert "mesh pin.stl of 216 triangles" in (tmp_path / "pin" / "report.html").read_text()


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


def test_a_contact_within_bounds_is_short_in_the_matrix_and_a_result_can_be_reported(tmp_path):
    box = trimesh.creation.box((10, 10, 10))
    cube = shapes.MeshShape(shapes.make_mesh(box.vertices, box.faces), error=0.004)
    result = check(Scene().add("a", cube).add("b", shapes.box((10, 10, 10)), translation(0, 0, 10)))
    page = report(result, tmp_path)[0].read_text()
    assert "contact<br><small>± 0.004</small>" in page
