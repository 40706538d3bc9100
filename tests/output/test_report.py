"""The report: rows against the geometry they describe, files against each other, the page in a browser's terms."""

import base64
import csv
import io
import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import clamp3d
from clamp3d.baselines.cas import Cas
from clamp3d.baselines.chords import Chords
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.connections import CONVEX_PAIRS, PAIRS
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.clamp.verdict import verdict
from clamp3d.core.pose import SectionPose
from clamp3d.errors import InputError
from clamp3d.output.pair_rows import pair_rows
from clamp3d.output.report import report
from clamp3d.output.report_page import FILES, report_csv, report_html, report_to_dict, write_report

LOOSE = {"line": "LGJ-10/2", "jumper": "LJ-150"}


@pytest.fixture(scope="module")
def reference():
    return report(assemble(load_clamp(), Cas()), Cas())


@pytest.fixture(scope="module")
def loose():
    return report(assemble(load_clamp(**LOOSE), Cas()), Cas())


@pytest.fixture(scope="module")
def odd(reference):
    """The report of a clamp whose name is not to be taken for markup."""
    clamp = replace(reference.run.clamp, name="<b>x</b>&", description="<script>alert(1)</script>")
    return replace(reference, run=replace(reference.run, clamp=clamp))


@pytest.fixture(scope="module")
def page(odd):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "1700000000")
        return report_html(odd)


def rows_at(poses, clamp=None, model=None, clearance=5.0):
    clamp = clamp or load_clamp()
    found = pair_rows(clamp, parts(clamp), model or Cas(), poses, clearance=clearance, mesh_error=1e-3)
    return {(row.a, row.b): row for row in found}


@pytest.mark.parametrize(
    ("distance", "bound", "allowed", "expected"),
    [
        (-1e-3, 0.0, True, "clash"),
        (-1e-7, 0.0, False, "contact"),
        (1e-6, 0.0, True, "allowed"),
        (1e-3, 0.0, True, "clearance"),
        (5.0, 0.0, False, "clearance"),
        (5.001, 0.0, False, "clear"),
        (5.001, 0.01, False, "uncertain"),
        (-0.02, 0.03, False, "uncertain"),
        (-0.02, 0.01, False, "clash"),
        (math.inf, 0.0, False, "clear"),
    ],
)
def test_verdicts_follow_the_thresholds(distance, bound, allowed, expected):
    assert verdict(distance, error_bound=bound, contact=1e-6, clearance=5.0, allowed=allowed) == expected


def test_all_pairs_of_the_reference_clamp(reference):
    assert [(row.a, row.b) for row in reference.rows] == list(PAIRS)
    by_verdict = {}
    for row in reference.rows:
        by_verdict.setdefault(row.verdict, set()).add(row.name)
    touching = {"P1-P5", "P1-P6", "P1-P7", "P2-P3", "P2-P6", "P2-P7", "P3-P4", "P4-P5"}
    assert by_verdict["allowed"] == touching
    assert by_verdict["clearance"] == {"P1-P2", "P1-P4", "P2-P4"}
    assert set(by_verdict) == {"allowed", "clearance", "clear"}
    assert reference.passed
    assert reference.findings == ()
    assert {row.name for row in reference.rows if row.severity != "ok"} == {"P1-P2"}  # near, and nothing joins them


@pytest.mark.parametrize("pair", CONVEX_PAIRS)
def test_moving_a_part_by_its_distance_along_the_normal_makes_the_two_touch(reference, pair):
    row = next(r for r in reference.rows if (r.a, r.b) == pair)
    assert np.linalg.norm(row.normal) == pytest.approx(1.0)
    poses = dict(reference.run.poses)
    moved = poses[row.b]
    for share, touches in ((1.001, True), (0.999, False)):
        way = -share * row.distance * row.normal
        poses[row.b] = replace(moved, x=moved.x + way[0], y=moved.y - way[2])
        assert (rows_at(poses)[pair].verdict in ("clash", "contained")) == touches


def test_overlaps_that_nobody_declared_are_clashes(reference):
    poses = dict(reference.run.poses)
    nut = poses["P5"]
    poses["P7"] = SectionPose(nut.x + 20.0, nut.y + 10.0)
    row = rows_at(poses)["P5", "P7"]
    assert (row.verdict, row.severity) == ("clash", "error")
    assert row.distance < 0.0
    poses["P7"] = SectionPose(2.0, 1.0)
    assert rows_at(poses)["P6", "P7"].verdict == "contained"


def test_clamp_that_does_not_close_fails_with_its_reasons(loose):
    assert not loose.passed
    assert loose.findings[0].startswith("not clamped")
    assert any(f.startswith("P1-P2") and "no connection" in f for f in loose.findings)
    assert any(f.startswith("P2-P6") and "does not" in f for f in loose.findings)
    final = loose.steps[-1]
    assert "fully in both grooves" not in final.seat("P6")
    assert final.seat("P7") == "fully in both grooves"


def test_chords_cannot_tell_contact_within_their_error():
    clamp, model = load_clamp(), Chords(math.radians(5.0))
    rows = rows_at(assemble(clamp, model).poses, model=model)
    for pair in (("P1", "P6"), ("P2", "P7")):
        assert (rows[pair].verdict, rows[pair].severity) == ("uncertain", "warning")
        half = math.radians(27.75 if pair[0] == "P1" else 34.37)
        chord = 2.0 * half / math.ceil(2.0 * half / model.unit_angle)
        assert rows[pair].error_bound == pytest.approx(23.8012 * (1.0 - math.cos(chord / 2)), rel=1e-3)


def test_steps_are_what_a_line_worker_sees(reference):
    steps = reference.steps
    assert [s.label for s in steps] == [w.label for w in reference.run.path]
    first, last = steps[0], steps[-1]
    assert first.parallel
    assert first.opening_line == pytest.approx(first.opening_jumper)
    assert first.seat("P6") == first.seat("P7") == "not in the clamp yet"
    assert steps[2].seat("P6").startswith("in P1's groove")
    assert not last.parallel
    assert last.opening_line == pytest.approx(31.530, abs=5e-4)  # published
    assert last.opening_jumper == pytest.approx(3.05, abs=5e-3)
    assert math.degrees(last.tilt) == pytest.approx(12.0, abs=1e-3)
    assert last.turns == pytest.approx(reference.run.turns)
    assert steps[-2].turns == 0.0
    stages = reference.tightening
    assert stages[-1].turns == pytest.approx(last.turns)
    assert [s.saddle_gap for s in stages] == sorted((s.saddle_gap for s in stages), reverse=True)
    assert stages[-1].saddle_gap == 0.0
    assert np.diff([s.way for s in stages]) == pytest.approx(stages[-1].way / 4)


def test_csv_and_json_tell_the_same(reference):
    data = json.loads(json.dumps(report_to_dict(reference), allow_nan=False))
    lines = list(csv.DictReader(io.StringIO(report_csv(reference))))
    assert len(lines) == len(data["pairs"]) == 21
    for line, pair in zip(lines, data["pairs"], strict=True):
        assert (line["a"], line["b"], line["verdict"]) == (pair["a"], pair["b"], pair["verdict"])
        assert float(line["distance_mm"]) == pair["distance_mm"]
        assert [float(line[f"point_{axis}"]) for axis in "xyz"] == pair["point"]
    assert data["versions"]["clamp3d"] == clamp3d.__version__
    assert data["settings"]["method"] == "cas"


def test_page_holds_everything_itself(reference, page):
    sources = re.findall(r"""(?:src|href)=["']([^"']*)["']""", page)
    assert all(s.startswith(("data:", "#")) for s in sources)
    assert "url(" not in page
    assert "@import" not in page
    pictures = [s.partition("base64,")[2] for s in sources if s.startswith("data:image/svg")]
    assert len(pictures) == 2 + 9  # states, steps, and every pair that touches or is declared to but for the thread
    for picture in pictures:
        root = ElementTree.fromstring(base64.b64decode(picture))
        assert root.tag.endswith("svg")
        assert len(list(root.iter())) > 100
    for row in reference.rows:
        assert page.count(f'id="{row.name}"') == 1
    assert len(re.findall(r'<td style="--c:#[0-9A-F]{6}" class="v-[a-z]+"><a href=', page)) == 21


def test_names_of_a_clamp_are_text_not_markup(page):
    assert "<b>x</b>" not in page
    assert "<script>" not in page
    assert "&lt;b&gt;x&lt;/b&gt;&amp;" in page


def test_equal_reports_are_equal_files(odd, page, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert [p.name for p in write_report(odd, tmp_path)] == list(FILES)
    assert (tmp_path / "report.html").read_text() == page
    assert "2023-11-14 22:13 UTC" in page


def test_folder_that_cannot_be_written_leaves_nothing(reference, tmp_path, monkeypatch):
    monkeypatch.setattr("clamp3d.output.report_page._pictures", lambda *_: dict.fromkeys(["states", "steps"], "data:,"))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "pairs.csv").mkdir()
    with pytest.raises(InputError, match=r"pairs\.csv"):
        write_report(reference, tmp_path / "out")
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["pairs.csv"]


def command_line(*arguments, folder):
    environment = os.environ | {"PYTHONPATH": str(Path(clamp3d.__file__).parents[1])}
    return subprocess.run(
        [sys.executable, "-m", "clamp3d", "report", *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env=environment,
    )


def test_command_reports_a_clamp_of_ones_own(tmp_path):
    text = resources.files("clamp3d.clamp").joinpath("data/reference.toml").read_text()
    text = text.replace('name = "reference"', 'name = "mine"').replace("length = 60.0", "length = 75.0")
    (tmp_path / "mine.toml").write_text(text.replace("hole_diameter = 22.0", "hole_diameter = 21.0"))
    done = command_line("mine.toml", "--line", "24", "--jumper", "18", "-o", "out", "--clearance", "2", folder=tmp_path)
    assert done.returncode in (0, 1), done.stderr
    assert done.stdout.split() == [f"out/{name}" for name in FILES]
    data = json.loads((tmp_path / "out" / "report.json").read_text())
    assert data["clamp"] == "mine"
    assert data["passed"] == (done.returncode == 0)
    hole = next(p for p in data["pairs"] if (p["a"], p["b"]) == ("P1", "P4"))
    assert hole["distance_mm"] == pytest.approx(0.5)
    assert hole["verdict"] == "clearance"


def test_command_says_not_clamped_by_its_exit_code(tmp_path):
    done = command_line("--line", LOOSE["line"], "--jumper", LOOSE["jumper"], "-q", "-o", "out", folder=tmp_path)
    assert done.returncode == 1
    assert [line for line in done.stderr.splitlines() if "compiling" not in line] == []
    assert "Not passed: not clamped" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "--output"),
        (("-o", "x", "--clearance", "-1"), "clearance"),
        (("-o", "x", "--outline-error", "0"), "mesh_error"),
        (("-o", "x", "nobody"), "nobody"),
        (("-o", "file/x"), "file"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(arguments, message, tmp_path):
    (tmp_path / "file").write_text("in the way")
    done = command_line(*arguments, "-q", folder=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
