"""Measuring methods, in this process and in their own; verdicts, front, rows for what fails; tables, chart, command."""

import dataclasses
import json
import math
import re
import sys

import pytest
from claims import END, START, assembly_table, comparison_table, update
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from clamp3d import InputError
from clamp3d.bench.compare import run as study
from clamp3d.bench.compare.assemblies import Assembled, Imaged
from clamp3d.bench.compare.chart import save_comparison
from clamp3d.bench.compare.jobs import JobError, run_job
from clamp3d.bench.compare.measure import Band, Measured, measure
from clamp3d.bench.compare.methods import METHODS, Method
from clamp3d.bench.compare.peers import SERIES, load_peer, missing_peers, prepare_peer
from clamp3d.bench.compare.run import LIBRARIES, Comparison, NotMeasured, compare, pareto
from clamp3d.bench.compare.scene import chord_error
from clamp3d.bench.machine import machine
from clamp3d.cli.bench import Compare
from tests.docs.project import ROOT

QUICK = 0.01


def _row(method, one, worst, setting=None):
    bands = tuple(Band(b, 40, 40, 0, 0) for b in (0.02, 1e-4, 1e-6))
    label = Method(method, setting).label
    return Measured(method, setting, label, 1, 420, worst / 2, worst, None, bands, 0.1, 0.01, one, one / 2)


def test_cas_is_exact_to_rounding_and_never_wrong():
    row = measure(Method("cas"), budget=QUICK)
    assert row.poses == 420
    assert row.worst_error < 1e-14
    assert row.depth_error is not None
    assert row.depth_error < 1e-14
    assert [(b.free, b.hits, b.false_hits, b.false_misses) for b in row.bands] == [(40, 40, 0, 0)] * 3
    assert 0.0 < row.many < row.one


@pytest.mark.parametrize("method", [Method("chords", 5.0), Method("wedges", 10.0), Method("mesh", 0.05)])
def test_faceted_methods_err_by_their_chords_and_only_to_the_safe_side(method):
    row = measure(method, budget=QUICK)
    angle = {"chords": 5.0, "wedges": 10.0, "mesh": 10.0}[method.family]
    limit = chord_error(math.radians(angle))
    assert 0.9 * limit < row.worst_error < limit + 1e-6
    nearest = row.bands[-1]
    assert nearest.false_hits == nearest.free  # a chord error from contact all that is free looks like a hit
    assert all(b.false_misses == 0 for b in row.bands)
    assert row.poses == (210 if method.family == "chords" else 420)


points = st.lists(
    st.tuples(st.sampled_from([1.0, 2.0, 3.0, 5.0]), st.sampled_from([1e-9, 1e-3, 0.1, 1.0])), max_size=12
)


@given(points)
def test_front_is_what_nothing_beats(values):
    rows = [_row("mesh", one, worst) for one, worst in values]
    front = {(r.one, r.worst_error) for r in pareto(rows)}
    beaten = {p for p in values if any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in values)}
    assert front == set(values) - beaten
    assert pareto([_row("chords", 1.0, 1.0)]) == []


def test_a_job_answers_as_the_process_itself_would():
    row = run_job("contact", Method("chords", 40.0), time_limit=60.0)
    here = dataclasses.asdict(measure(Method("chords", 40.0), budget=QUICK))
    for name in ("worst_error", "median_error", "depth_error", "pieces", "label"):
        assert getattr(row, name) == here[name]


def test_a_job_that_fails_hangs_or_crashes_says_so(tmp_path, monkeypatch):
    with pytest.raises(JobError, match="unknown method 'fog'"):
        run_job("contact", Method("fog", 1.0), time_limit=60.0)
    with pytest.raises(JobError, match=re.escape("not finished in 0.2 s")):
        run_job("contact", Method("wedges", 1.0), time_limit=0.2)
    script = tmp_path / "python"
    script.write_text("#!/bin/sh\necho 'terminate called' >&2\nkill -SEGV $$\n")
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(script))
    with pytest.raises(JobError, match=re.escape("crashed (SIGSEGV): terminate called")):
        run_job("peer", Method("coal-sector", 1.0), time_limit=30.0)


EXACT = ("open-cascade", "open-cascade-axis", "open-cascade-face")
SHALLOW = ("coal-cylinder", "coal-capsule", "fcl", EXACT[0])
"""Series without a depth."""


@pytest.mark.parametrize("family", SERIES)
def test_every_series_measures_the_same_groove(family):
    if family in missing_peers():
        pytest.skip(f"{family} is not installed")
    method = Method(family) if family in EXACT else Method(family, 5.0)
    row = measure(method, load=load_peer, prepare=prepare_peer, budget=QUICK)
    assert (row.depth_error is None) == (family in SHALLOW)
    if family in EXACT:
        assert row.error < 1e-12
    elif family != "fcl":  # in millimetres, FCL's own tolerance now and then costs a whole millimetre
        assert 0.9 * 0.0114 < row.error < 1.002 * 0.01143  # facets of the groove; the wire has none
    assert row.bands[0].false_misses == 0


def test_pages_say_what_the_figures_say(tmp_path):
    data = json.loads((ROOT / "docs" / "compare.json").read_text())
    for page in ("README.md", "docs/methods.md"):
        assert comparison_table(data) in (ROOT / page).read_text(), f"{page}: run scripts/make-figures"
    assert assembly_table(data) in (ROOT / "docs" / "reproduction.md").read_text(), "run scripts/make-figures"
    assert "clamp3d, closed form" in comparison_table(data).splitlines()[2]
    page = tmp_path / "page.md"
    page.write_text(f"before\n{START}\nold\n{END}\nafter\n")
    update(page, comparison_table(data))
    assert page.read_text() == f"before\n{START}\n{comparison_table(data)}\n{END}\nafter\n"
    with pytest.raises(InputError, match="must have the marks"):
        update(ROOT / "LICENSE", "")


def _comparison():
    contact = (
        _row("cas", 2e-6, 3e-15),
        _row("chords", 4e-5, 0.01, 5.0),
        _row("wedges", 1e-4, 0.01, 5.0),
        _row("wedges", 7e-4, 5e-4, 1.0),
        NotMeasured("hulls", 0.01, "hulls 0.01", "not finished in 90 s"),
    )
    peers = (
        _row("coal-capsule", 2e-4, 5e-4, 1.0),
        NotMeasured("mujoco-capsule", 1.0, "mujoco-capsule 1 deg", "not installed: pip install mujoco"),
    )
    exact = Assembled("cas", None, "cas", "exact", "clamped", 31.53, 0.0, 0.05, 864)
    late = NotMeasured("hulls", 2.0, "hulls 2 mm", "not finished in 150 s")
    return Comparison(machine(LIBRARIES), contact, peers, (exact, late), IMAGE, 12.0)


IMAGE = Imaged(10, 4.5, 4.0, 1.08, 7.1, (31.9, 31.1, 31.2, 30.9, 32.1), 0.006, 0.2)


def test_a_picture_as_page_and_as_image(tmp_path):
    save_comparison(_comparison(), tmp_path / "a.html", "clamp3d compare --plot a.html")
    page = (tmp_path / "a.html").read_text()
    assert not re.findall(r"(?:src|href)=[\"']https?:", page)
    assert "not finished in 90 s" in page
    nothing = dataclasses.replace(_comparison(), contact=_comparison().contact[4:], peers=())
    save_comparison(nothing, tmp_path / "b.png", "none measured")
    assert (tmp_path / "b.png").read_bytes()[:4] == b"\x89PNG"


def test_compare_runs_every_job_and_goes_on_after_a_failure(monkeypatch):
    jobs = []

    def answer(kind, method, *, time_limit):
        jobs.append((kind, method.family))
        if kind == "contact" and method.family == "hulls":
            raise JobError("crashed (SIGABRT)")
        if kind in ("contact", "peer"):
            return _row(method.family, 1e-4, 0.1, method.setting)
        if kind == "assembly":
            return _comparison().assemblies[0]
        return IMAGE

    monkeypatch.setattr(study, "run_job", answer)
    monkeypatch.setattr(study, "missing_peers", lambda: {"coal-sector": "not installed: pip install coal"})
    steps = []
    comparison = compare(peers=True, progress=lambda done, total, what: steps.append((done, total)))
    assert [row.label for row in comparison.contact] == [m.label for m in METHODS]
    assert {r.reason for r in comparison.contact if isinstance(r, NotMeasured)} == {"crashed (SIGABRT)"}
    assert {r.method for r in comparison.peers if isinstance(r, NotMeasured)} == {"coal-sector"}
    assert not any(method == "coal-sector" for _, method in jobs)
    assert steps[-1][0] == steps[-1][1]
    assert steps == sorted(steps)
    assert len(comparison.assemblies) == len(study.ASSEMBLIES)
    jobs.clear()
    compare()
    assert not any(kind == "peer" for kind, _ in jobs)


def test_the_command_shows_every_row_and_why_one_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "compare", lambda **_: _comparison())
    arguments = ["--json", str(tmp_path / "a.json"), "--plot", str(tmp_path / "a.svg"), "--peers"]
    result = CliRunner().invoke(Compare, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    for words in ("wedges 5 deg", "hulls 0.01", "not finished in 90 s", "not installed: pip install mujoco", "31.5300"):
        assert words in result.stdout
    data = json.loads((tmp_path / "a.json").read_text())
    assert data["peers"][0]["method"] == "coal-capsule"
    assert data["assembly"][0]["error"] == 0.0
    assert data["assembly"][1]["reason"] == "not finished in 150 s"
    assert (tmp_path / "a.svg").read_text().count("<svg") == 1
