"""A bearing from a CAD library on a shaft with one planted fault, reviewed as somebody else's STEP file."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from tests.command import call

pytest.importorskip("bd_warehouse", reason="bd_warehouse (extra dev) is not installed")
pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")


def bearing(path, radius):
    """The bearing M8-22-7, whose balls overlap both races in its library's model, on a shaft of this radius."""
    from bd_warehouse.bearing import SingleRowDeepGrooveBallBearing
    from build123d import Compound, Cylinder, export_step

    shaft = Cylinder(radius, 30.0)
    shaft.label = "Shaft"
    export_step(Compound(label="bearing", children=[SingleRowDeepGrooveBallBearing("M8-22-7"), shaft]), str(path))
    return path


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """A folder with its shaft 0.03 mm too thick, checked."""
    folder = tmp_path_factory.mktemp("review")
    files = [f"--{kind}={folder / name}" for kind, name in (("json", "a.json"), ("csv", "a.csv"), ("bcf", "a.bcfzip"))]
    code, out, err = call("check", bearing(folder / "bearing.step", 4.03), "-q", *files)
    assert (code, err) == (1, "")
    pattern = r"InnerRace and Shaft clash: interference (.+) to (.+) mm, apart after a move of up to 10\.\d+ mm; "
    shown = re.search(pattern, out)
    assert float(shown[1]) <= 0.03 <= float(shown[2]) < 0.035
    return folder


def test_three_rows_and_the_planted_fault_is_the_first(faulty):
    groups = json.loads((faulty / "a.json").read_text())["groups"]
    rows = [(*sorted((g["a"], g["b"])), g["count"]) for g in groups]
    assert rows[0] == ("InnerRace", "Shaft", 1)
    assert sorted(rows[1:]) == [("InnerRace", "Roller", 12), ("OuterRace", "Roller", 12)]


def test_the_second_review_names_exactly_the_change(faulty, tmp_path, main):
    mended = bearing(tmp_path / "bearing.step", 4.0)
    code, out, _ = main("check", mended, "--baseline", faulty / "a.json", "-q")
    assert code == 0
    assert "1 new, 0 changed, 1 gone, 2 unchanged" in out  # the shaft touches the race now
    assert "  gone: InnerRace and Shaft: clash\n" in out
    assert "new: InnerRace and Shaft touch" in out
    assert "parts moved" not in out


def test_a_rule_by_relation_covers_the_fit_and_nothing_else(faulty, main):
    rules = ("--allow", "thread", "--allow", "press", "--allow", "*Race:Roller*=0.6")
    pairs = ("--pairs", "InnerRace:Shaft,InnerRace:Roller_1,OuterRace:Roller_1")
    code, out, _ = main("check", faulty / "bearing.step", *rules, *pairs, "-q")
    assert code == 0
    assert "  allowed: thread, 1 pair\n" in out
    assert "  allowed: press, 0 pairs\n" in out  # 0.7 % of the radius is no press fit
    assert "  allowed: *Race:Roller* up to 0.6 mm, 2 pairs\n" in out


def test_pandas_and_another_reader_of_bcf_open_the_findings(faulty):
    pandas = pytest.importorskip("pandas", reason="pandas (extra frame) is not installed")
    bcf = pytest.importorskip("bcf.v2.bcfxml", reason="bcf-client (extra dev) is not installed")
    frame = pandas.read_csv(faulty / "a.csv")
    assert frame.groupby("id").size().tolist().count(12) == 2
    assert (frame.at_least_mm <= frame.at_most_mm).all()
    assert (frame.at_most_mm < 0.0).all()
    with bcf.BcfXml.load(faulty / "a.bcfzip") as package:
        assert package.version.version_id == "2.1"
        topics = sorted(package.topics.values(), key=lambda handler: handler.topic.index)
        assert len(topics) == 3
        assert topics[0].topic.title.startswith("InnerRace and Shaft clash: interference 0.0")
        for handler in topics:
            (view,) = handler.viewpoints.values()
            info = view.visualization_info
            named = {part.authoring_tool_id.partition("_")[0] for part in info.components.selection.component}
            assert named == set(handler.topic.title.split(" clash")[0].split(" and "))
            camera = info.perspective_camera
            at, ahead = ([p.x, p.y, p.z] for p in (camera.camera_view_point, camera.camera_direction))
            assert np.linalg.norm(ahead) == pytest.approx(1.0)
            assert np.abs(at).max() < 0.2  # metres
            assert np.dot(ahead, at) < -0.01  # it looks at the bearing, about the origin
            assert view.snapshot.startswith(b"\x89PNG")


def test_a_report_says_what_solids_are_measured_by(faulty):
    from clamp3d import load, shapes
    from clamp3d.output.report import make_report

    scene = load(faulty / "bearing.step").add("ball", shapes.sphere(1.0))
    solids, ball = make_report(replace(scene, parts=scene.parts[-2:])).items("modelled.txt")
    assert solids.startswith("Shaft: solid with the faces of its CAD file")
    assert ball.startswith("ball: drawn with true arcs")
