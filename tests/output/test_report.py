"""The report: rows against the geometry they describe, files against each other, the page in a browser's terms."""

import base64
import csv
import io
import json
import math
import re
from dataclasses import replace
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import clamp3d
from clamp3d.baselines.chords import Chords
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.contact import measure_contacts
from clamp3d.clamp.matrix import PAIRS
from clamp3d.collide.check import check
from clamp3d.collide.distance import measure
from clamp3d.collide.scene import Scene
from clamp3d.core import shapes
from clamp3d.core.motion import Motion
from clamp3d.core.pose import translation
from clamp3d.core.primitives import SweptArc
from clamp3d.errors import InputError
from clamp3d.output.export import export
from clamp3d.output.report import make_report, report
from clamp3d.output.report_page import FILES, report_csv, report_html, report_to_dict, write_report
from clamp3d.scenefile.file import load_scene

ROOT = Path(__file__).resolve().parents[2]
LOOSE = {"line": "LGJ-10/2", "jumper": "LJ-150"}
WIRES = [{}, {"line": "LJ-500", "jumper": "LJ-185"}]


@pytest.fixture(scope="module")
def loose():
    return make_report(assemble(**LOOSE))


@pytest.fixture(scope="module")
def clashing():
    """A wire 0.2 mm in its groove's block, a pin across the block, a box 0.3 mm beside it, one that is pushed in."""
    groove = SweptArc(7.0, math.radians(60.0), 50.0)
    scene = Scene(name="<i>clash</i>", clearance=0.5).add("block", shapes.groove_block(groove, 40.0, 20.0))
    scene = scene.add("wire", shapes.cylinder(6.8, 80.0), translation(0, -0.4, 0))
    scene = scene.add("near", shapes.box((10, 10, 10)), translation(25.3, -10, 0))
    scene = scene.add("far", shapes.box((5, 5, 5)), translation(60, -10, 0))
    return replace(scene, motions=(Motion.translate((-30.0, 0, 0), parts=("far",), name="push in"),))


def step_distances(file: Path) -> list[float]:
    """Distances of all pairs of solids in a STEP file, by Open CASCADE."""
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    reader = STEPControl_Reader()
    reader.ReadFile(str(file))
    reader.TransferRoots()
    explorer, solids = TopExp_Explorer(reader.OneShape(), TopAbs_ShapeEnum.TopAbs_SOLID), []
    while explorer.More():
        solids.append(explorer.Current())
        explorer.Next()
    assert len(solids) == 7
    found = []
    for i, a in enumerate(solids):
        for b in solids[i + 1 :]:
            asked = BRepExtrema_DistShapeShape(a, b)
            assert asked.IsDone()
            found.append(asked.Value())
    return found


@pytest.mark.parametrize("wires", WIRES, ids=["reference", *(w["line"] for w in WIRES[1:])])
def test_all_distances_are_those_of_the_engine_and_of_open_cascade(wires, tmp_path):
    """P1-P2 was told as 3.812670 and P2-P4 as 1.567108: 3.729354 and 1.000000 are true of the reference clamp."""
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
    assembly = assemble(**wires)
    made = make_report(assembly)
    data = json.loads(json.dumps(report_to_dict(made)))
    lines = list(csv.DictReader(io.StringIO(report_csv(made))))
    truth = step_distances(export(assembly, tmp_path / "final.step").files[0])
    engine = measure(assembly.scene, model=assembly.model)
    for k, (a, b) in enumerate(PAIRS):
        pair, line, found = data["pairs"][k], lines[k], engine[a, b]
        assert (pair["a"], pair["b"]) == (line["a"], line["b"]) == (a, b)
        for value in (pair["distance_mm"], float(line["distance_mm"])):
            assert value == pytest.approx(found.value, abs=1e-9)
            # The thread is modelled as a cylinder in a cylinder of its own size.
            assert value == pytest.approx(truth[k], abs=1e-6), f"{a}-{b}"
        assert pair["at_least_mm"] <= truth[k] + 1e-6
        assert pair["at_most_mm"] >= truth[k] - 1e-6
        for key in ("point_a", "point_b", "normal"):
            assert len(pair[key]) == 3
        between = np.subtract(pair["point_b"], pair["point_a"])
        np.testing.assert_allclose(between, pair["distance_mm"] * np.array(pair["normal"]), atol=2e-6)


def test_pairs_of_the_reference_clamp(reference_report):
    assert [(row.result.a, row.result.b) for row in reference_report.rows] == list(PAIRS)
    by_verdict = {}
    for row in reference_report.rows:
        by_verdict.setdefault(row.verdict, set()).add(row.name)
    touching = {"P1-P5", "P1-P6", "P1-P7", "P2-P3", "P2-P6", "P2-P7", "P3-P4", "P4-P5"}
    assert by_verdict["allowed"] == touching | {"P1-P4", "P2-P4"}  # declared, and nearer than the clearance
    assert by_verdict["clearance"] == {"P1-P2"}
    assert set(by_verdict) == {"allowed", "clearance", "clear"}
    assert reference_report.passed
    assert {row.name for row in reference_report.rows if row.severity != "ok"} == {"P1-P2", "P1-P4", "P2-P4"}


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


def test_clamp_that_does_not_close_fails_with_its_reasons(loose):
    assert not loose.passed
    assert loose.findings[0].text.startswith("not clamped")
    assert [f.severity for f in loose.findings] == sorted(
        (f.severity for f in loose.findings), key=["error", "warning", "note"].index
    )
    assert any(f.text.startswith("P1-P2") for f in loose.findings if f.severity == "error")
    assert any(f.text.startswith("P2-P6") and "does not touch" in f.text for f in loose.findings)
    final = loose.steps[-1]
    assert "fully in both grooves" not in final.seat("P6")
    assert final.seat("P7") == "fully in both grooves"


def test_a_state_found_by_chords_is_not_told_to_touch():
    """Chords leave wires 0.02 mm from their arcs: a warning, and what is stated of them holds the true distance."""
    assembly = assemble(model=Chords(math.radians(5.0)))
    found = make_report(assembly)
    exact = measure(assembly.scene)
    for row in found.rows:
        if row.name in ("P1-P6", "P2-P7"):
            assert (row.severity, row.verdict in ("allowed", "uncertain")) == ("warning", True)
            assert any(f.severity == "warning" and f.row is row for f in found.findings)
        truth = exact[row.result.a, row.result.b]
        assert row.distance.lower <= truth.upper + 1e-9
        assert row.distance.upper >= truth.lower - 1e-9


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
    assert stages[-1].turns == pytest.approx(last.turns)
    assert [s.saddle_gap for s in stages] == sorted((s.saddle_gap for s in stages), reverse=True)
    assert stages[-1].saddle_gap == 0.0
    assert np.diff([s.way for s in stages]) == pytest.approx(stages[-1].way / 4)


def test_findings_of_a_clamp_name_their_pair(reference_report, loose):
    found = [finding for made in (reference_report, loose) for finding in made.assembly.findings]
    named = [(f.a, f.b) for f in found if f.a is not None]
    assert named
    assert named == [m.groups() for f in found if (m := re.match(r"(P\d)-(P\d) ", f.text))]
    for made in (reference_report, loose):
        told = {f.text: f.row for f in made.findings}
        for f in made.assembly.findings:
            assert (f.a is None) == (told[f.text] is None)


def test_csv_and_json_tell_the_same(reference_report):
    data = json.loads(json.dumps(report_to_dict(reference_report), allow_nan=False))
    lines = list(csv.DictReader(io.StringIO(report_csv(reference_report))))
    assert len(lines) == len(data["pairs"]) == 21
    for line, pair in zip(lines, data["pairs"], strict=True):
        for key in ("a", "b", "verdict", "relation", "method"):
            assert line[key] == pair[key]
        for key in ("distance_mm", "error_bound_mm", "at_least_mm", "at_most_mm"):
            assert float(line[key]) == pair[key]
        assert (int(line["declared"]), int(line["measured"])) == (pair["declared"], pair["measured"])
        for key in ("point_a", "point_b", "normal"):
            assert [float(line[f"{key}_{axis}"]) for axis in "xyz"] == pair[key]
    assert data["versions"]["clamp3d"] == clamp3d.__version__
    assert data["settings"]["method"] == "cas"


def sources(page):
    return re.findall(r"""(?:src|href)=["']([^"']*)["']""", page)


def pictures(page):
    return [s.partition("base64,")[2] for s in sources(page) if s.startswith("data:image/svg")]


def test_page_holds_everything_itself(reference_report, odd_page):
    assert all(s.startswith(("data:", "#")) for s in sources(odd_page))
    assert "url(" not in odd_page
    assert "@import" not in odd_page
    # states, steps, and every pair that touches or is declared to but the thread
    assert len(pictures(odd_page)) == 2 + 9
    for picture in pictures(odd_page):
        root = ElementTree.fromstring(base64.b64decode(picture))
        assert root.tag.endswith("svg")
        assert len(list(root.iter())) > 100
    for row in reference_report.rows:
        assert odd_page.count(f'id="{row.name}"') == 1
    assert len(re.findall(r'<td style="--c:#[0-9A-F]{6}" class="v-[a-z]+"><a href=', odd_page)) == 21


def test_names_are_text_not_markup(odd_page, clashing):
    assert "<b>x</b>" not in odd_page
    assert "<script>" not in odd_page
    assert "&lt;b&gt;x&lt;/b&gt;&amp;" in odd_page
    assert "<i>clash" not in report_html(make_report(clashing))


def test_a_clashing_scene_says_so_worst_first(clashing, tmp_path):
    """Headline, findings, pictures and exit code of a scene tell one story, motions included."""
    found = make_report(clashing)
    assert not found.passed
    assert found.headline.startswith("3 clashes (2 in motion)" if len(found.motions) > 1 else "2 clashes (1 in motion)")
    assert {f.row.name for f in found.findings if f.severity == "error"} == {"block-wire", "far-near"} | {
        row.name for row in found.motions if row.severity == "error"
    }
    assert [f.severity for f in found.findings][-1] == "note"
    rows = {row.name: row for row in found.rows}
    assert (len(rows), found.n_pairs) == (2, 6)  # those that are far apart have no row
    assert rows["block-wire"].distance.value == pytest.approx(-0.2, abs=1e-6)
    assert (rows["block-near"].verdict, rows["block-near"].severity) == ("clearance", "note")
    assert rows["block-near"].distance.value == pytest.approx(0.3, abs=1e-6)
    (pushed,) = (row for row in found.motions if row.name == "far-near")
    assert pushed.result.contact_at == pytest.approx((60 - 2.5 - 30.3) / 30, abs=1e-3)
    lines = list(csv.DictReader(io.StringIO(report_csv(found))))
    assert [(line["a"], line["b"]) for line in lines] == [
        (r.result.a, r.result.b) for r in (*found.rows, *found.motions)
    ]
    assert not [cell for line in lines for cell in line.values() if cell[:1] in ("[", "{")]  # a number a column
    (hit,) = (line for line in lines if line["b"] == "wire" and line["verdict"] == "clash")
    assert 0.0 < float(hit["volume_at_least_mm3"]) <= float(hit["volume_at_most_mm3"])
    assert float(hit["box_y_min"]) <= float(hit["inside_y"]) <= float(hit["box_y_max"])
    page = report_html(found)
    assert len(pictures(page)) == 1 + len(found.findings)
    ids = set(re.findall(r'id="([^"]*)"', page))
    assert {s[1:] for s in sources(page) if s.startswith("#")} <= {i.replace("&#39;", "'") for i in ids}
    data = json.loads(report(clashing, tmp_path)[1].read_text())
    assert (data["passed"], data["headline"]) == (False, found.headline)
    assert [f["text"] for f in data["findings"]] == [f.text for f in found.findings]
    assert [(p["a"], p["b"]) for p in data["pairs"]] == [(r.result.a, r.result.b) for r in found.rows]
    engine = measure(clashing)
    for pair in data["pairs"]:
        assert pair["distance_mm"] == pytest.approx(engine[pair["a"], pair["b"]].value, abs=1e-9)
    motion = next(m for m in data["motions"] if {m["a"], m["b"]} == {"far", "near"})
    assert motion["contact_at"] == pushed.result.contact_at


def test_a_finding_is_drawn_at_its_moment(monkeypatch):
    """Motions follow each other: the hinge's leaf is where the first one left it when the second one clashes."""
    from clamp3d.output import scene_figures
    from clamp3d.output.common import overlap

    found = make_report(load_scene(ROOT / "examples" / "hinge" / "scene.toml"))
    (finding,) = found.findings
    drawn = []
    monkeypatch.setattr(scene_figures, "draw_solids", lambda ax, solids, *a, **k: drawn.append(solids))
    scene_figures.finding_figure(found.scene, finding.row.result)
    a, b = drawn[0]
    assert overlap(a.mesh, a.T, b.mesh, b.T).volume > 100.0
    assert [len(solids) for solids in drawn] == [2, 1, 2, 1]  # whole and enlarged, with what the two have in common


def test_a_report_asks_as_much_as_check(monkeypatch):
    """A pair whose verdict is certain is measured no further: a pin that touches its hole, from CAD."""
    pytest.importorskip("OCP")
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder

    from clamp3d.brep.solid import BrepSolid

    pin, plate = BRepPrimAPI_MakeCylinder(3.0, 10.0).Solid(), BRepPrimAPI_MakeBox(10.0, 10.0, 10.0).Shape()
    scene = Scene().add("pin", BrepSolid.of(pin, "pin"))
    scene = scene.add("plate", BrepSolid.of(BRepAlgoAPI_Cut(plate, pin).Shape(), "plate"))
    asked = []
    monkeypatch.setattr("clamp3d.output.report.check", lambda *a, **k: asked.append(check(*a, **k)) or asked[-1])
    (row,), wanted = make_report(scene).rows, check(scene)
    assert row.verdict == "contact"
    assert asked[0].work.queries == wanted.work.queries
    assert wanted.work.queries["faces"] == 1
    assert (row.distance.lower, row.distance.upper) == (wanted.pairs[0].distance.lower, wanted.pairs[0].distance.upper)
    assert check(scene, distances=True).work.queries["faces"] > 1


def test_scenes_without_findings_pairs_or_parts(tmp_path):
    assert "No issues found." in report(Scene().add("pin", shapes.cylinder(5.0, 40.0)), tmp_path)[0].read_text()
    assert report(Scene(), tmp_path)[2].read_text().startswith("a,b,verdict,distance_mm")
    grid = Scene()
    for i in range(40):
        grid = grid.add(f"p{i}", shapes.box((1, 1, 1)), translation(2.0 * i, 0, 0))
    found = make_report(grid.add("x", shapes.box((1, 1, 1)), translation(0.5, 0, 0)))
    assert (found.n_pairs, len(found.rows)) == (820, 1)  # of so many pairs only the near ones have a row
    page = report_html(found)
    assert "819 pairs are not listed: clear." in page
    assert "Parts of pairs that are not clear: 2 of 41 parts." in page


def test_equal_reports_are_equal_files(odd_report, odd_page, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert [p.name for p in write_report(odd_report, tmp_path)] == list(FILES)
    assert (tmp_path / "report.html").read_text() == odd_page
    assert "2023-11-14 22:13 UTC" in odd_page


def test_folder_that_cannot_be_written_leaves_nothing(reference_report, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "clamp3d.output.report_page._pictures", lambda *_: {kind: [] for kind in ("overview", "steps", "pairs")}
    )
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "pairs.csv").mkdir()
    with pytest.raises(InputError, match=r"pairs\.csv"):
        write_report(reference_report, tmp_path / "out")
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["pairs.csv"]


def test_command_reports_a_clamp_of_ones_own(tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    text = resources.files("clamp3d.clamp").joinpath("data/reference.toml").read_text()
    text = text.replace('name = "reference"', 'name = "mine"').replace("length = 60.0", "length = 75.0")
    (tmp_path / "mine.toml").write_text(text.replace("hole_diameter = 22.0", "hole_diameter = 21.0"))
    arguments = ("--line", "24", "--jumper", "18", "-o", "out", "--clearance", "2")
    code, out, err = main("report", "mine.toml", *arguments)
    assert code in (0, 1), err
    assert out.split() == [f"out/{name}" for name in FILES]
    data = json.loads((tmp_path / "out" / "report.json").read_text())
    assert data["clamp"] == "mine"
    assert data["passed"] == (code == 0)
    assert data["other_ends"] is not None
    hole = next(p for p in data["pairs"] if (p["a"], p["b"]) == ("P1", "P4"))
    assert hole["distance_mm"] == pytest.approx(0.5, abs=1e-6)


def test_command_says_not_clamped_by_its_exit_code(tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    code, _, err = main("report", "--line", LOOSE["line"], "--jumper", LOOSE["jumper"], "-q", "-o", "out")
    assert (code, err) == (1, "")
    assert "Not passed: not clamped" in (tmp_path / "out" / "report.html").read_text()


def test_command_takes_scenes_and_meshes(tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    hinge = ROOT / "examples" / "hinge"
    assert main("report", hinge / "scene.toml", "-q", "-o", "out")[0] == 1
    data = json.loads((tmp_path / "out" / "report.json").read_text())
    assert {(p["a"], p["b"]) for p in data["pairs"]} == {("leaf-a", "leaf-b"), ("leaf-a", "pin"), ("leaf-b", "pin")}
    assert [m["verdict"] for m in data["motions"]].count("clash") == 1
    assert main("report", hinge / "pin.stl", "-q", "-o", "pin")[0] == 0
    assert "mesh pin.stl of 216 triangles" in (tmp_path / "pin" / "report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "--output"),
        (("-o", "x", "--clearance", "-1"), "clearance"),
        (("-o", "x", "nobody"), "nobody"),
        (("-o", "file/x"), "file"),
        ((str(ROOT / "examples/hinge/scene.toml"), "--method", "chords", "-o", "x"), "go with a clamp"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(arguments, message, tmp_path, monkeypatch, main):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.chdir(tmp_path)
    code, _, err = main("report", *arguments, "-q")
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
