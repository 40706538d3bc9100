"""Groups of findings: one line for one cause, identifiers that stay, baselines and accepted findings."""

import csv
import io
import json
import math
import random
import re
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from clamp3d import Motion, Scene, Verdict, check, shapes, view
from clamp3d.kernel import translation
from clamp3d.output.baseline import compare
from clamp3d.output.groups import grouped
from clamp3d.output.report import make_report
from clamp3d.output.scene_report import check_to_dict, check_to_text
from clamp3d.output.wording import headline
from tests.cli.boxes import boxes


def rail(depths):
    """A rail with nuts that stand ``depths`` mm deep in it."""
    scene = Scene(name="rail").add("rail", shapes.box((200.0, 10.0, 10.0)))
    for k, depth in enumerate(depths):
        scene = scene.add(f"nut_{k}", shapes.box((5.0, 5.0, 10.0)), translation(10.0 * k - 80.0, 0.0, 10.0 - depth))
    return scene


def test_one_cause_is_one_group_and_a_single_fault_comes_first():
    depths = [0.3] * 7 + [0.5] + [0.0] * 4
    result = check(rail(depths))
    groups = [(group.a, group.b, group.verdict.value, len(group.rows)) for group in grouped(result)]
    assert groups == [("rail", "nut_7", "clash", 1), ("rail", "nut", "clash", 7), ("rail", "nut", "contact", 4)]
    assert headline(result).startswith("8 clashes in 2 groups, deepest 0.5")


def test_identifiers_do_not_depend_on_the_order_of_the_file():
    scene = rail([0.3] * 6 + [0.7, 1.0])
    ids = {g.id for g in grouped(check(scene))}
    assert len(ids) == 3
    parts = list(scene.parts)
    random.Random(3).shuffle(parts)
    assert {g.id for g in grouped(check(Scene(tuple(parts))))} == ids
    away = translation(0.3, -70.1, 9.9)
    assert {g.id for g in grouped(check(scene.moved({p.name: away @ p.T_world for p in parts})))} == ids


def test_an_accepted_finding_is_open_again_when_it_gets_deeper_or_alone():
    """Six shallow overlaps are accepted: they, not the deep one that is left when they are mended."""
    accepted = next(g.id for g in grouped(check(rail([0.3] * 6 + [0.7]))) if len(g.rows) == 6)
    for depths in ([0.0] * 6 + [0.7], [0.31] * 6 + [0.7], [0.3] * 5 + [0.9, 0.7]):
        assert accepted not in {g.id for g in grouped(check(rail(depths)))}


def test_a_clash_at_rest_is_not_listed_again_for_a_motion():
    scene = Scene().add("a", shapes.box((10, 10, 10))).add("b", shapes.box((10, 10, 10)), translation(9.0, 0, 0))
    motions = (Motion.translate((-1.0, 0, 0), parts="b", name="in"), Motion.translate((30.0, 0, 0), parts="b"))
    result = check(replace(scene, motions=motions))
    assert len(result.findings) > 1
    (group,) = grouped(result)
    assert (group.motion, len(group.rows)) == (None, 1)
    assert headline(result).startswith("1 clash, deepest 1.000")


def test_text_json_page_and_report_list_the_same_groups():
    scene = rail([0.3, 0.3, 0.3, 0.9])
    result = check(scene)
    ids = [group.id for group in grouped(result)]
    assert len(ids) == 2
    text = check_to_text(result).splitlines()
    assert [line.rpartition("id ")[2] for line in text if "; id " in line] == ids
    assert [group["id"] for group in check_to_dict(result)["groups"]] == ids
    assert [finding.group.id for finding in make_report(scene).findings] == ids
    with view(result, serve=False) as viewer:
        assert list(dict.fromkeys(finding["group"] for finding in viewer.story["findings"])) == ids
        assert "rail and nut clash, 3 times: overlap 0.3" in viewer.html()


def test_a_pin_that_is_too_thick_is_told_by_how_much_not_by_its_way_out():
    """5.03 in a hole of 5, 10 mm long: the way out is along the axis, and says nothing of the fault."""
    scene = Scene().add("ring", shapes.cylinder(8.0, 10.0, bore=5.0)).add("pin", shapes.cylinder(5.03, 30.0))
    result = check(scene)
    said = check_to_text(result)
    assert "1 clash, deepest 0.030000 mm (" in said
    assert re.search(r"  ring and pin clash: interference 0\.030000 mm, apart after a move of up to 1\d\S* mm; ", said)
    (row,) = result.pairs
    assert row.distance.interference == pytest.approx((0.03, 0.03), abs=1e-9)
    assert row.distance.method == "groove kernel; separating move by meshes (FCL)"


def test_the_table_of_pairs_goes_by_groups():
    """The single fault is first in it too, before deeper overlaps of another kind."""
    result = check(rail([0.32, 0.32, 0.37, 0.9, 0.9, 0.05]))
    pairs = [(row.a, row.b) for group in grouped(result) for row in group.rows]
    table = check_to_text(result).partition("pair ")[2].splitlines()[1 : 1 + len(pairs)]
    assert [line.split("  ")[1] for line in table] == [f"{a} - {b}" for a, b in pairs]
    assert pairs[0] == ("rail", "nut_5")
    assert "clash, 3 times: overlap 0.32 to 0.37 mm; worst" in check_to_text(result)


@pytest.mark.parametrize("n_clashes", [0, 1])
def test_undecided_pairs_are_never_called_clean_or_free_of_clashes(n_clashes):
    result = check(rail([0.3]))
    open_row = replace(result.pairs[0], verdict=Verdict.UNCERTAIN, b="nut_0")
    said = headline(replace(result, pairs=(*result.pairs[:n_clashes], open_row)))
    assert "1 pair undecided" in said
    assert "No clash" not in said
    assert "Clean" not in said


def baseline_of(result, tmp_path):
    last = tmp_path / "last.json"
    last.write_text(json.dumps(check_to_dict(result)))
    return last


def test_what_is_new_changed_and_gone_since_a_baseline(tmp_path):
    same = check(rail([0.3, 0.3, 0.3, 0.9]))
    last = baseline_of(same, tmp_path)
    comparison = compare(same.scene, grouped(same), last, {})
    assert set(comparison.status.values()) == {"same"}
    assert (comparison.open(grouped(same)), comparison.changed, comparison.moved) == ([], {}, {})
    deeper = check(rail([0.4, 0.4, 0.4, 0.0, 0.0]))
    comparison = compare(deeper.scene, grouped(deeper), last, {})
    assert [comparison.status[group.id] for group in grouped(deeper)] == ["changed", "new"]
    assert [old["b"] for old in comparison.gone] == ["nut_3"]
    assert "  new parts: nut_4\n" in check_to_text(deeper, comparison)


def test_one_part_of_many_that_moves_is_named_though_its_verdict_stays(tmp_path):
    """Twelve nuts on a rail, as deep as before; one has gone 0.02 mm along it, and all together 7 mm."""
    scene = rail([0.3] * 12)
    last = baseline_of(check(scene), tmp_path)
    away = translation(7.0, 0.0, 0.0)
    poses = {part.name: away @ part.T_world for part in scene.parts}
    poses["nut_4"] = poses["nut_4"] @ translation(0.02, 0.0, 0.0)
    result = check(scene.moved(poses))
    (group,) = grouped(result)
    comparison = compare(result.scene, [group], last, {})
    assert comparison.status == {group.id: "changed"}
    assert [set(pair) for pair in comparison.changed[group.id]] == [{"rail", "nut_4"}]
    assert comparison.moved == {"nut_4": pytest.approx(0.02, abs=1e-9)}
    said = check_to_text(result, comparison)
    assert "  parts moved: nut_4 by 0.02 mm\n" in said
    assert "; changed: rail and nut_4; id" in said
    assert check_to_dict(result, comparison)["moved_mm"] == comparison.moved


@pytest.mark.usefixtures("without_pictures")
def test_commands_compare_with_a_baseline_and_accept(tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    boxes(tmp_path / "boxes.toml", {"a": 0, "b": 9, "c": 30})
    assert main("check", "boxes.toml", "--json", "last.json")[0] == 1
    assert main("check", "boxes.toml", "--baseline", "last.json")[0] == 0
    boxes(tmp_path / "boxes.toml", {"a": 0, "b": 9, "c": 17})
    code, out, _ = main("check", "boxes.toml", "--baseline", "last.json", "--csv", "new.csv")
    assert code == 1
    assert "since the baseline: 1 new, 0 changed, 0 gone, 1 unchanged, 0 accepted" in out
    shutil.copy("last.json", "rolling.json")
    for status in (1, 0):  # the result may take the place of the one that it is compared with
        assert main("check", "boxes.toml", "--baseline", "rolling.json", "--json", "rolling.json")[0] == status
    lines = list(csv.DictReader(io.StringIO((tmp_path / "new.csv").read_text())))
    assert {(line["a"], line["b"], line["status"]) for line in lines} == {("a", "b", "same"), ("b", "c", "new")}
    assert all(float(line["at_least_mm"]) <= float(line["at_most_mm"]) for line in lines if line["at_least_mm"])
    ids = sorted(line["id"] for line in lines)
    assert all(
        re.fullmatch("[a-z2-7]{8}", item) for item in ids
    )  # a spreadsheet makes numbers of 12345678 and 1234e567
    code, out, _ = main("accept", "boxes.toml", *ids, "--why", 'a "press" fit', "--who", "Ada")
    assert (code, out) == (0, "boxes.accepted.toml: 2 accepted\n")
    accepted = tmp_path / "boxes.accepted.toml"
    accepted.write_text(accepted.read_text().rstrip("\n"))
    out = main("accept", "boxes.toml", ids[0], "--why", "again")[1]
    assert out == "boxes.accepted.toml: 0 accepted, 1 already there and left as before\n"
    code, out, _ = main("check", "boxes.toml")
    assert code == 0
    assert out.count("accepted by Ada on 20") == 2
    assert "no finding now" not in out
    main("check", "boxes.toml", "--bcf", "a.bcf")
    with zipfile.ZipFile("a.bcf") as package:
        topics = [package.read(name) for name in package.namelist() if name.endswith("markup.bcf")]
    assert [(b'TopicStatus="Closed"' in topic, b"<Description>accepted by Ada on" in topic) for topic in topics] == [
        (True, True)
    ] * 2
    assert main("report", "boxes.toml", "--output", "report")[0] == 0
    assert (tmp_path / "report/report.html").read_text().count("accepted by Ada on 20") == 2
    assert main("view", "boxes.toml", "--html", "page.html")[0] == 0
    main("accept", "boxes.toml", "deadbeef", "--why", "a slip of the pen \U0001f600 größe \x07")
    assert "note: accepted, and no finding now: deadbeef" in main("check", "boxes.toml")[1]
    boxes(tmp_path / "boxes.toml", {"a": 0, "b": 9, "c": 8})
    assert main("check", "boxes.toml")[0] == 1  # a and c clash too now


def test_folders_whose_names_differ_after_a_point_do_not_share_what_is_accepted(tmp_path, monkeypatch, main):
    for name in ("v1.2", "v1.3"):
        (tmp_path / name).mkdir()
        for part, x in (("a", 0.0), ("b", 9.0)):
            box = trimesh.creation.box((10.0, 10.0, 10.0)).apply_translation((x, 0.0, 0.0))
            box.export(tmp_path / name / f"{part}.stl")
    monkeypatch.chdir(tmp_path / "v1.2")
    identifier = re.search(r"id (\w{8})", main("check", ".")[1])[1]
    for source in ("../v1.2", ".", "../v1.2/"):
        assert main("accept", source, identifier, "--why", "so")[0] == 0
    (tmp_path / "v1.3" / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "v1.3" / "sub")
    assert main("accept", "..", "abcdefgh", "--why", "so")[0] == 0
    assert main("check", "/")[0] == 2  # it has no name
    assert {path.name for path in tmp_path.glob("*.toml")} == {"v1.2.accepted.toml", "v1.3.accepted.toml"}
    assert [main("check", source)[0] for source in ("../../v1.2", "..")] == [0, 1]


BAD_BASELINES = [
    (("parts", "a", "T_world"), [[1.0, 0.0], [0.0, 1.0]]),
    (("parts", "a", "T_world"), [[0.0] * 4] * 4),
    (("parts", "a", "T_world"), [[math.nan] * 4] * 4),
    (("parts", "a", "T_world"), [[1.0, 0.0, 0.0, 1e300], *np.eye(4)[1:].tolist()]),
    (("parts", "a", "T_world"), np.diag([1.0, 1.0, -1.0, 1.0]).tolist()),
    (("parts", "a", "T_world"), None),
    (("pairs", 0, "at_most_mm"), "far"),
    (("pairs", 0, "at_least_mm"), math.nan),
    (("pairs", 0, "verdict"), "fine"),
    (("pairs", 0, "a"), None),
    (("groups", 0, "pairs", 0), ["a"]),
    (("groups", 0, "pairs", 0), ["a", None]),
    (("groups", 0, "motion"), 3),
    (("groups", 0, "motion"), {}),
    (("groups", 0, "at_most_mm"), math.inf),
    (("groups",), None),
]


@pytest.mark.parametrize(("place", "value"), BAD_BASELINES)
def test_a_damaged_baseline_is_refused(place, value, tmp_path, main):
    source, last = boxes(tmp_path / "boxes.toml", {"a": 0, "b": 9}), tmp_path / "last.json"
    assert main("check", source, "--json", last)[0] == 1
    data = json.loads(last.read_text())
    assert main("check", source, "--baseline", last)[0] == 0
    table = data
    for key in place[:-1]:
        table = table[key]
    table[place[-1]] = value
    last.write_text(json.dumps(data))
    wanted = f"clamp3d: error: {last}: not a result of `clamp3d check --json` with groups of findings\n"
    assert main("check", source, "--baseline", last) == (2, "", wanted)


def test_a_3mf_is_the_same_as_the_scene_that_it_is_of(tmp_path, main):
    """Its poses have six digits, which are no moves."""
    pytest.importorskip("lib3mf")
    source, last, made = boxes(tmp_path / "s.toml", {"a": 0, "b": 9}), tmp_path / "s.json", tmp_path / "s.3mf"
    source.write_text(
        source.read_text()
        .replace("[0, 0, 0]", "[31.23456789, 62.3456789, 3], rpy_deg = [10, 20, 30]")
        .replace("[9, 0, 0]", "[39.3456789, 62.1, 3.123456789], rpy_deg = [40, 20, 30]")
    )
    assert main("check", source, "--json", last)[0] == 1
    assert main("export", source, "-o", made)[0] == 0
    code, said, _ = main("check", made, "--baseline", last)
    assert code == 0
    assert "since the baseline: 0 new, 0 changed, 0 gone, 1 unchanged" in said
    assert "moved" not in said


BAD_ACCEPTED = [
    ("a = " + "[" * 3000 + "]" * 3000, "boxes.accepted.toml: not valid TOML: tables or arrays nested too deeply"),
    (
        '[[accept]]\nid = "abcdefgh"\nwhy = "so"',
        "id, who, when and why: accept is not a known key; did you mean accepted?",
    ),
    ('accepted = ["abcdefgh"]', "why: accepted.0: must be a table, got 'abcdefgh'"),
    ('[accepted]\nid = "abcdefgh"', "why: accepted: must be a list, got"),
    ('[[accepted]]\nid = "abcdefgh"', "why: accepted.0.why is missing"),
    ('[[accepted]]\nid = "abcdefgh"\nwhy = " "', "why: accepted.0.why must not be empty, got ' '"),
    ('[[accepted]]\nid = "zzz"\nwhy = "so"', "why: accepted.0.id of a finding must be 8 characters of a-z and 2-7"),
    ('[[accepted]]\nid = 5\nwhy = "so"', "why: accepted.0.id: must be a text, got 5"),
    ('[[accepted]]\nid = "abcdefgh"\nwhy = "so"\nx = 1', "why: accepted.0.x is not a known key"),
]


@pytest.mark.parametrize(
    ("arguments", "files", "message"),
    [
        (("check", "boxes.toml", "--baseline", "none.json"), {}, "none.json: cannot be read: No such file"),
        (("check", "boxes.toml", "--baseline", "old.json"), {"old.json": "{}"}, "not a result of `clamp3d check --"),
        (("check", "boxes.toml", "--baseline", "deep.json"), {"deep.json": "[" * 100_000}, "not a result of `clamp3d"),
        (("check", "boxes.toml"), {"boxes.accepted.toml": "[[accepted]]\nwho = 3"}, "boxes.accepted.toml: must hold"),
        *((("check", "boxes.toml"), {"boxes.accepted.toml": text}, message) for text, message in BAD_ACCEPTED),
        (
            ("accept", "boxes.toml", "xyz", "--why", "so"),
            {},
            "id of a finding must be 8 characters of a-z and 2-7, as check",
        ),
        (
            ("accept", "boxes.toml", "abcdefg1", "--why", "so"),
            {},
            "id of a finding must be 8 characters of a-z and 2-7, as check",
        ),
        (("accept", "boxs.toml", "abcdefgh", "--why", "so"), {}, "boxs.toml: no such file or folder"),
        (("accept", "boxes.toml", "00000000"), {}, "Missing option '--why'"),
        (("accept", "boxes.toml", "00000000", "--why", " "), {}, "the reason (--why) must not be empty, got ' '"),
    ],
)
def test_bad_baselines_and_identifiers_are_one_line(arguments, files, message, tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    boxes(tmp_path / "boxes.toml", {"a": 0, "b": 9})
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    code, out, err = main(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
