"""The paper's tables: the connection matrix is measured and echoes nothing, errors are what they say."""

import json

import pytest

from clamp3d.bench import published
from clamp3d.bench.reproduce import reproduce
from clamp3d.bench.reproduce_report import reproduction_to_text
from tests.docs.project import ROOT

# The reference clamp with each arc replaced by chords; computed independently to +-0.002 mm.
EXACT_CHORDS = {1.0: 31.5314, 5.0: 31.564, 10.0: 31.660, 20.0: 32.080, 40.0: 32.647}


@pytest.fixture(scope="module")
def tables():
    return reproduce()


def test_the_bolt_touches_no_splint_and_the_table_says_so(tables):
    rows = {f"{row.a}-{row.b}": row for row in tables.table1}
    assert len(rows) == 21
    assert {pair for pair, row in rows.items() if row.difference} == {"P1-P4", "P2-P4"}
    text = reproduction_to_text(tables).splitlines()
    for pair in ("P1-P4", "P2-P4"):
        assert rows[pair].distance.lower == pytest.approx(1.0, abs=1e-6)
        (line,) = [line for line in text if line.startswith(f"  {pair} ")]
        assert line.split()[1:4] == ["2", "2", "0"]
        assert "does not touch" in line


def test_errors_of_table_4_are_those_that_the_paper_prints(tables):
    printed = {None: 0.100, 1.0: 0.233, 5.0: 0.233, 10.0: 0.233, 20.0: 0.566, 40.0: 1.233}
    for row in tables.table4:
        assert row.published_error == pytest.approx(printed[row.unit_angle_deg], abs=1e-9)
        if row.solver == "stepped":
            assert row.error == pytest.approx(printed[row.unit_angle_deg], abs=2e-3)
    image = [0.904, 2.042, 2.483, 0.820, 0.989]
    assert [abs(v - published.ACTUAL_DISTANCE) for v in published.IMAGE_DISTANCES] == pytest.approx(image)
    text = reproduction_to_text(tables)
    assert all(f"{error:.3f}" in text for error in (*printed.values(), *image))


def test_the_page_has_the_tables_numbers(tables):
    rows = {(row.solver, row.unit_angle_deg): f"{row.distance:.3f}" for row in tables.table4}
    page = (ROOT / "docs" / "reproduction.md").read_text()
    assert f"| arc (CAS) | {rows['stepped', None]} | {published.CAS_DISTANCE:.3f} | {rows['exact', None]} |" in page
    for unit, paper in published.CHORD_DISTANCES.items():
        name = f"chords of {unit:g} degree{'s' * (unit > 1)}"
        assert f"| {name} | {rows['stepped', unit]} | {paper:.3f} | {rows['exact', unit]} |" in page


def test_the_command_matches_the_paper(tables, tmp_path, monkeypatch, main):
    monkeypatch.setattr("clamp3d.bench.reproduce.reproduce", lambda progress: tables)
    path = tmp_path / "r.json"
    code, out, _ = main("reproduce", "--json", path)
    assert code == 0
    assert "DIFFERS" not in out
    data = json.loads(path.read_text())
    rows = {(r["solver"], r["unit_angle_deg"]): r for r in data["table4"]}
    assert rows["stepped", None]["distance_mm"] == pytest.approx(published.CAS_DISTANCE, abs=0.002)
    for unit, distance in published.CHORD_DISTANCES.items():
        assert rows["stepped", unit]["distance_mm"] == pytest.approx(distance, abs=0.002)
        assert rows["stepped", unit]["published_mm"] == distance
        assert rows["exact", unit]["distance_mm"] == pytest.approx(EXACT_CHORDS[unit], abs=0.002)
    assert all(row.contact_queries > row.motion_steps > 0 for row in tables.table5 if row.solver == "stepped")
    for row in data["final_state"]:
        assert row["x"] == pytest.approx(row["published_x"], abs=5e-4)
        assert row["y"] == pytest.approx(row["published_y"], abs=5e-4)
        assert row["angle_deg"] == pytest.approx(row["published_angle_deg"], abs=0.01)
    assert "1/3 mm" in data["plateau"]
