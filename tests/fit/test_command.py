"""``clamp3d fit`` as a user calls it."""

import json
import re

import trimesh

from tests.fit.fit_shapes import RADIUS, splint


def test_table_json_and_page(tmp_path, main):
    splint(0.05, hole=11.0).export(tmp_path / "part.stl")
    code, out, err = main("fit", tmp_path / "part.stl", "--json", tmp_path / "a.json", "--html", tmp_path / "a.html")
    assert code == 0
    assert re.search(r"^G1 +groove +23\.8012 ", out, re.MULTILINE)
    assert re.search(r"^H1 +through hole +11\.0000 ", out, re.MULTILINE)
    assert "note: STL carries no unit" in err
    data = json.loads((tmp_path / "a.json").read_text())
    assert [round(g["radius_mm"], 4) for g in data["grooves"]] == [RADIUS] * 2
    assert all(g["error_bound_mm"] >= g["fit_error_mm"] > 0.0 for g in data["grooves"])
    page = (tmp_path / "a.html").read_text()
    assert not re.search(r"""(src|href)\s*=|https?://|@import""", page)
    assert page.count("data-feature=") == 3


def test_mesh_without_features_is_an_answer(tmp_path, main):
    trimesh.creation.box([1.0, 2.0, 3.0]).export(tmp_path / "box.ply")
    code, out, _ = main("fit", tmp_path / "box.ply", "--html", tmp_path / "b.html")
    assert (code, "no groove, no cylinder, no hole" in out) == (0, True)
    assert "<tbody>" not in (tmp_path / "b.html").read_text()
