"""``clamp3d fit`` as a user calls it."""

import json
import re

import pytest
import trimesh
from click.testing import CliRunner
from fit_shapes import RADIUS, splint

from clamp3d.cli.fit import Fit


@pytest.fixture
def part(tmp_path):
    splint(0.05, hole=11.0).export(tmp_path / "part.stl")
    return tmp_path / "part.stl"


def test_table_json_and_page(part, tmp_path):
    out = CliRunner().invoke(Fit, [str(part), "--json", str(tmp_path / "a.json"), "--html", str(tmp_path / "a.html")])
    assert out.exit_code == 0
    assert re.search(r"^G1 +groove +23\.8012 ", out.stdout, re.MULTILINE)
    assert re.search(r"^H1 +through hole +11\.0000 ", out.stdout, re.MULTILINE)
    assert "note: STL carries no unit" in out.stderr
    data = json.loads((tmp_path / "a.json").read_text())
    assert [round(g["radius_mm"], 4) for g in data["grooves"]] == [RADIUS] * 2
    assert all(g["error_bound_mm"] >= g["fit_error_mm"] > 0.0 for g in data["grooves"])
    page = (tmp_path / "a.html").read_text()
    assert not re.search(r"""(src|href)\s*=|https?://|@import""", page)
    assert page.count("data-feature=") == 3


def test_mesh_without_features_is_an_answer(tmp_path):
    trimesh.creation.box([1.0, 2.0, 3.0]).export(tmp_path / "box.ply")
    out = CliRunner().invoke(Fit, [str(tmp_path / "box.ply"), "--html", str(tmp_path / "b.html")])
    assert out.exit_code == 0
    assert "no groove, no cylinder, no hole" in out.stdout
    assert "<tbody>" not in (tmp_path / "b.html").read_text()
