"""The paper's tables: the connection matrix is measured and echoes nothing, errors are what they say."""

import json
from dataclasses import replace

import pytest
from click.testing import CliRunner

from clamp3d.bench import published
from clamp3d.bench.reproduce import connection_rows, reproduce
from clamp3d.bench.reproduce_report import reproduction_to_text
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.loader import load_clamp
from clamp3d.cli import group


@pytest.fixture(scope="module")
def tables():
    return reproduce()


def _by_pair(rows):
    return {(row.a, row.b): row for row in rows}


def test_measured_types_do_not_follow_the_declaration():
    clamp = load_clamp()
    connections = {a: dict(row) for a, row in clamp.connections.items()}
    connections["P1"]["P3"] = connections["P2"]["P5"] = 2
    lied = replace(clamp, connections=connections)
    honest, rows = (_by_pair(connection_rows(assemble(c))) for c in (clamp, lied))
    for pair, gap in ((("P1", "P3"), 36.0), (("P2", "P5"), 41.0)):
        assert (rows[pair].declared, rows[pair].measured) == (2, 0)
        assert rows[pair].distance.lower > gap
        assert "declared 2, but does not touch" in rows[pair].difference
    assert {pair: row.measured for pair, row in rows.items()} == {pair: row.measured for pair, row in honest.items()}


def test_the_bolt_touches_no_splint_and_the_table_says_so(tables):
    rows = _by_pair(tables.table1)
    assert len(rows) == 21
    different = {pair for pair, row in rows.items() if row.difference}
    assert different == {("P1", "P4"), ("P2", "P4")}
    text = reproduction_to_text(tables).splitlines()
    for pair in ("P1-P4", "P2-P4"):
        assert rows[tuple(pair.split("-"))].distance.upper > 0.99
        (line,) = [line for line in text if line.startswith(f"  {pair} ")]
        assert line.split()[1:4] == ["2", "2", "0"]
        assert "does not touch" in line
    (gap,) = {rows["P1", "P4"].distance.value}
    assert gap == pytest.approx(1.0, abs=1e-6)


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


def test_the_command_matches_the_paper(tables, tmp_path, monkeypatch):
    monkeypatch.setattr("clamp3d.bench.reproduce.reproduce", lambda progress: tables)
    path = tmp_path / "r.json"
    done = CliRunner().invoke(group, ["reproduce", "--json", str(path)])
    assert done.exit_code == 0, done.output
    assert "DIFFERS" not in done.stdout
    data = json.loads(path.read_text())
    stepped = {r["unit_angle_deg"]: r for r in data["table4"] if r["solver"] == "stepped"}
    assert stepped[None]["distance_mm"] == pytest.approx(published.CAS_DISTANCE, abs=0.002)
    for unit, distance in published.CHORD_DISTANCES.items():
        assert stepped[unit]["distance_mm"] == pytest.approx(distance, abs=0.002)
        assert stepped[unit]["published_mm"] == distance
    assert {r["solver"] for r in data["table4"]} == {"stepped", "exact"}
    for row in data["final_state"]:
        assert row["x"] == pytest.approx(row["published_x"], abs=5e-4)
        assert row["y"] == pytest.approx(row["published_y"], abs=5e-4)
        assert row["angle_deg"] == pytest.approx(row["published_angle_deg"], abs=0.01)
    assert "1/3 mm" in data["plateau"]
