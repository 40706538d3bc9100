"""The viewer without a browser: what is sent, where it is served, and that nothing is left behind."""

import base64
import contextlib
import itertools
import json
import re
import signal
import socket
import subprocess
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import requests
import skimage.color
import umsgpack
from scipy.spatial.transform import Rotation

import clamp3d.output.viewer
from clamp3d import InputError, Motion, Scene, measure, shapes, view
from clamp3d.clamp.result import HELD_ON_AXIS
from clamp3d.engine.check import check
from clamp3d.errors import Clamp3dError
from clamp3d.kernel import translation
from clamp3d.output import placed, serving
from clamp3d.output.palette import PART_COLOURS, VERDICT_COLOURS, part_colours
from clamp3d.output.run_report import run_to_text
from clamp3d.output.serving import CommandLog, MeshcatServer, PageServer
from clamp3d.output.viewer import Viewer
from clamp3d.output.viewer_story import ClampStory
from tests.cli.boxes import boxes
from tests.cli.test_faults import COMMAND, INTERRUPTIBLE


def commands_of(viewer):
    return [umsgpack.unpackb(base64.b64decode(message)) for message in viewer._log.messages()]


@pytest.mark.parametrize(("tilt", "printed"), [(-0.0616, "-3.53"), (-1e-9, "0.00")])
def test_text_and_page_print_the_same_tilt_and_no_negative_zero(tilt, printed, run):
    tilted = replace(run, tilt=tilt, path=run.path[:1])  # one stop to measure
    with view(tilted, serve=False, mesh_error=0.5) as viewer:
        assert f"tilt of the down splint {printed}&deg;" in viewer.html()
    assert f" tilt {printed} deg" in run_to_text(tilted)


@pytest.fixture(scope="module")
def recorded(run):
    """The viewer of the reference clamp, and its assembly."""
    viewer = Viewer(ClampStory(run.clamp), mesh_error=0.1)
    for waypoint in run.path:
        viewer.show(waypoint)
    viewer.finish(run)
    return viewer, run


def plate_and_pin():
    """A pin that goes 30 mm down on a plate whose face is 10 mm below it."""
    scene = Scene(name="pin over plate", clearance=0.5)
    scene = scene.add("plate", shapes.box((50.0, 40.0, 4.0)), translation(0.0, 0.0, -2.0))
    scene = scene.add("pin", shapes.cylinder(5.0, 20.0), translation(3.0, 0.0, 20.0))
    return scene.with_motion(Motion.translate((0, 0, -30.0), parts="pin", name="down"))


def read(url, host=None):
    answer = requests.get(url, headers={} if host is None else {"Host": host}, timeout=5.0)
    return answer.status_code, answer.text


@contextlib.contextmanager
def serve(port=None, answer=dict):
    server = PageServer(port=port)
    server.start(lambda: "<div id='meshcat-pane'></div>", CommandLog(), answer)
    try:
        yield server
    finally:
        server.close()


def answers(port):
    with socket.socket() as s:
        return s.connect_ex(("127.0.0.1", port)) == 0


def points_of(commands, command):
    """The points (n, 3) of the first geometry of an object that is sent."""
    uuid = command["object"]["object"]["geometry"]
    (sent,) = (c["geometry"] for c in commands if c["type"] == "set_geometry" and c["path"] == uuid)
    return np.frombuffer(sent["data"]["attributes"]["position"]["array"].data, dtype=np.float32).reshape(-1, 3)


def test_nut_turns_as_often_as_the_assembly_says_and_clockwise_from_above(recorded):
    viewer, assembly = recorded
    *_, command = (c for c in commands_of(viewer) if c["type"] == "set_animation")
    clips = {a["path"]: a["clip"] for a in command["animations"]}
    assert len({clip["tracks"][0]["keys"][-1]["time"] for clip in clips.values()}) == 1  # three.js ends each by itself
    (track,) = (t for t in clips["/clamp3d/parts/P5"]["tracks"] if t["name"] == ".quaternion")
    turned = 0.0
    for a, b in itertools.pairwise(Rotation.from_quat([key["value"] for key in track["keys"]]).as_matrix()):
        step = a.T @ b
        turned += np.arctan2(step[1, 0], step[0, 0])
    assert turned / (2.0 * np.pi) == pytest.approx(-assembly.turns, abs=1e-9)


def test_every_value_at_every_waypoint_is_what_measure_says(recorded):
    viewer, assembly = recorded
    for stop, waypoint in zip(viewer.story["stops"], assembly.path, strict=True):
        measured = measure(assembly.scene_at(waypoint))
        assert {(row["a"], row["b"]) for row in stop["rows"]} == set(measured)
        for row in stop["rows"]:
            d = measured[row["a"], row["b"]]
            assert row["distance_mm"] == pytest.approx(d.upper, abs=1e-9)
            assert row["at_least_mm"] == pytest.approx(d.lower, abs=1e-9)


def test_every_dot_lies_between_the_nearest_points_of_its_pair(recorded):
    viewer, assembly = recorded
    seen = []
    for command in commands_of(viewer):
        if command["type"] == "set_transform" and command["path"].endswith(("/point", "/point a", "/point b")):
            group, pair = command["path"].split("/")[3:5]
            seen.append(int(group.split()[0]))
            (row,) = (r for r in viewer.story["stops"][seen[-1] - 1]["rows"] if f"{r['a']}-{r['b']}" == pair)
            point = np.reshape(command["matrix"], (4, 4))[3, :3]
            np.testing.assert_allclose(point, np.mean([row["point_a"], row["point_b"]], axis=0), atol=1e-9)
    assert seen.count(len(assembly.path)) == 8


def test_an_arrow_for_each_contact_force_as_long_as_its_part_of_the_bolts(recorded):
    viewer, assembly = recorded
    whole = float(re.search(r"([\d.]+) mm for the whole", viewer.html())[1])
    arrows, commands = {}, commands_of(viewer)
    for c in commands:
        if re.match(f"/clamp3d/forces/{len(assembly.path)} nut tightened/.*/arrow$", c["path"]):
            arrows[c["path"].split("/")[4]] = points_of(commands, c)
    contacts = [force for force in assembly.forces if force.feature != HELD_ON_AXIS]
    assert list(arrows) == [f"{f.a}-{f.b}" for f in contacts]
    pushes = {}
    for force in contacts:
        along = arrows[f"{force.a}-{force.b}"] @ force.direction
        assert along.max() == pytest.approx(force.point @ force.direction, abs=1e-3)
        assert np.ptp(along) == pytest.approx(force.force * whole, rel=2e-3)
        pushes[f"{force.a}-{force.b}"] = np.ptp(along) * force.direction
    # each wire is held by its two arrows alone, and what the nut's pull leaves at the saddle is the whole bolt force
    for wire in ("P6", "P7"):
        np.testing.assert_allclose(pushes[f"P1-{wire}"] + pushes[f"P2-{wire}"], 0.0, atol=1e-2)
    assert np.linalg.norm(pushes["P2-P3"]) == pytest.approx(whole, rel=2e-3)
    assert [(f["a"], f["b"]) for f in viewer.story["forces"]] == [(f.a, f.b) for f in contacts]


def test_scene_with_a_motion_stops_at_first_contact_and_marks_it():
    with view(plate_and_pin(), serve=False) as viewer:
        story = viewer.story
    at_rest, contact, end = story["stops"]
    assert contact["halts"]
    assert contact["mark"] == "first contact"
    t = float(re.search(r"first contact at t = (\d\.\d+)", contact["label"])[1])
    assert t == pytest.approx(10.0 / 30.0, abs=1e-3)  # by hand: 10 mm of 30
    (finding,) = story["findings"]
    assert (finding["stop"], finding["verdict"], {finding["a"], finding["b"]}) == (1, "clash", {"plate", "pin"})
    assert "clash" in story["headline"]
    assert "in motion" in story["headline"]
    low, high = np.array(finding["low"]), np.array(finding["high"])
    assert (low < [3.0, 0.0, 0.0]).all()
    assert (high > [3.0, 0.0, 0.0]).all()
    assert at_rest["low"][2] == pytest.approx(-4.0)
    assert end["high"][2] == pytest.approx(0.0, abs=1e-9)
    quarter = at_rest["leave"] + 0.25 * (contact["arrive"] - at_rest["leave"])
    for time, gap in ((at_rest["leave"], 10.0), (quarter, 7.5)):
        (row,) = viewer.answer({"time": str(time), "a": "pin", "b": "plate"})["rows"]
        assert row["at_most_mm"] == pytest.approx(gap, abs=5e-3)  # contact is a gap of 0.01 mm


def test_the_saved_curve_of_a_finding_holds_its_distance():
    """At every moment the bounds hold the distance calculated by hand, on the time line in the right place."""
    cube = shapes.box((10, 10, 10))
    scene = Scene().add("still", cube).add("slider", cube, translation(30, 0, 0))
    with view(scene.with_motion(Motion.translate((-27.0, 0.0, 0.0), parts="slider")), serve=False) as viewer:
        page = viewer.html()
        (finding,), (rest, first, end) = viewer.story["findings"], viewer.story["stops"]
        (bounds,) = viewer.story["curves"].values()
    seconds = np.array(finding["moments"])
    meeting = (20.0 - 0.01) / 27.0  # contact is a gap of 0.01 mm
    assert page.count("0.7403") >= 2  # in the finding and in the table: never late
    assert "0.7404" not in page
    assert seconds[[0, -1]] == pytest.approx([rest["leave"], end["arrive"]])
    assert 20 <= len(seconds) <= 30
    t = np.interp(seconds, [rest["leave"], first["arrive"], first["leave"], end["arrive"]], [0, meeting, meeting, 1])
    assert first["t"] == pytest.approx(meeting, abs=1e-5)
    np.testing.assert_allclose(bounds, np.column_stack([20.0 - 27.0 * t] * 2), atol=1e-4)


def test_a_clean_clamp_has_notes_and_no_findings(recorded):
    """Two holes are wider than the bolt that the matrix says touches them: no issue."""
    page = recorded[0].html()
    assert recorded[0].story["findings"] == []
    assert "Findings, worst and rarest first" not in page
    assert page.count("but does not touch: 1.000 mm apart in the final state") >= 2


def test_clash_at_rest_is_marked_where_it_is():
    box = shapes.box((10.0, 10.0, 10.0))
    scene = Scene().add("a", box).add("b", box, translation(9.0, 1.0, 2.0))
    viewer = Viewer(scene)
    viewer.finish(check(scene, distances=True))
    (finding,) = viewer.story["findings"]
    assert "overlap 1.000" in finding["text"]
    commands = commands_of(viewer)
    box = points_of(commands, next(c for c in commands if c["path"].endswith("a-b/box")))
    margin = 0.01 * 19.0
    np.testing.assert_allclose(box.min(axis=0), np.array([4.0, -4.0, -3.0]) - margin, atol=1e-5)
    np.testing.assert_allclose(box.max(axis=0), np.array([5.0, 5.0, 5.0]) + margin, atol=1e-5)


def test_names_from_a_file_cannot_become_markup():
    scene = Scene(name="<img src=x onerror=alert(1)>").add("<b>a</b>", shapes.box((1, 1, 1)))
    with view(scene.add("</script>", shapes.box((1, 1, 1))), serve=False) as viewer:
        page = viewer.html()
    assert "<img" not in page
    assert "<b>a</b>" not in page
    assert page.count("</script>") == 2


def test_equal_parts_are_meshed_and_written_once(monkeypatch):
    made = []
    monkeypatch.setattr(placed, "mesh", lambda shape, error: made.append(shape) or shapes.mesh(shape, error))
    scene = Scene()
    for k in range(70):
        shape = shapes.cylinder(3, 10) if k % 3 == 0 else shapes.box((5, 5, 5))  # equal, not the same
        scene = scene.add(f"p{k}", shape, translation(20.0 * k, 0, 0))
    with view(scene, serve=False) as viewer:
        sent = [command["type"] for command in commands_of(viewer)]
    assert len(made) == 2
    assert sent.count("set_geometry") == 4  # faces and edges


def test_a_foreign_name_or_another_file_is_refused():
    with serve() as server:
        assert read(server.url + "answer", "evil.example")[0] == 403
        for host in ("evil.example", "evil.example:7000", "localhost.evil.example"):
            assert read(server.url, host)[0] == 403
        for host in ("127.0.0.1", f"localhost:{server.port}", "[::1]"):
            assert "meshcat-pane" in read(server.url, host)[1]
        for path in ("main.js", "../other.html", "etc/passwd"):
            assert read(server.url + path)[0] == 404


def test_second_viewer_takes_the_next_port_and_closing_frees_it():
    with serve() as first:
        with serve() as second:
            assert second.port != first.port
            assert "meshcat-pane" in read(second.url)[1]
        assert not answers(second.port)
        assert answers(first.port)
    assert not answers(first.port)
    assert not [t for t in threading.enumerate() if t.name == "clamp3d viewer"]
    first.close()  # again does nothing


def test_verdicts_are_listed_while_the_check_runs_the_worst_first(monkeypatch):
    monkeypatch.setattr(clamp3d.output.viewer, "_PAUSE", 0.0)
    scene = Scene().add("base", shapes.box((100, 10, 10)))
    for name, x, z in (("touching", 0, 10.0), ("shallow", -30, 9.0), ("deep", 30, 6.0)):
        scene = scene.add(name, shapes.box((10, 10, 10)), translation(x, 0, z))
    viewer, lists = Viewer(scene), []
    result = check(scene, on_row=lambda row: (viewer.show_row(row), lists.append(viewer.story["findings"])))
    names = [[finding["b"] for finding in findings] for findings in lists]
    assert names[-3:] == [["deep", "shallow", "touching"]] * 3
    assert ["at least" in findings[0]["title"] for findings in lists[-3:]] == [True, False, False]
    assert "So far: 2 clashes" in viewer.story["headline"]
    viewer.finish(result)
    assert viewer.story["headline"].startswith("2 clashes")


# Dichromats as Machado, Oliveira and Fernandes (2009) simulate them, severity 1, on linear RGB.
DICHROMATS = {
    "protanope": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranope": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanope": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def lab(colour, matrix):
    """CIE L*a*b* of "#RRGGBB" as somebody sees it."""
    xyz = skimage.color.rgb2xyz(np.array([*bytes.fromhex(colour[1:])]) / 255.0)
    to_xyz, to_rgb = skimage.color.colorconv.xyz_from_rgb, skimage.color.colorconv.rgb_from_xyz
    return skimage.color.xyz2lab(to_xyz @ np.clip(matrix @ to_rgb @ xyz, 0.0, 1.0))


@pytest.mark.parametrize("eyes", DICHROMATS)
def test_colours_of_verdicts_differ_for_colour_blind_readers(eyes):
    """Clash, contact, gap and clear by at least 25 in L*a*b* (one is just seen), and no part looks like a clash."""
    seen = {name: lab(VERDICT_COLOURS[name], DICHROMATS[eyes]) for name in ("clash", "contact", "clearance", "clear")}
    for a, b in itertools.combinations(seen, 2):
        assert np.linalg.norm(seen[a] - seen[b]) > 25, (a, b)
    parts = [lab(colour, DICHROMATS[eyes]) for colour in part_colours([f"part {k}" for k in range(8)]).values()]
    assert min(np.linalg.norm(part - seen["clash"]) for part in parts) > 15
    clamps = [lab(PART_COLOURS[name], DICHROMATS[eyes]) for name in ("P1", "P2", "P3", "P6", "P7")]
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(clamps, 2)) > 8


def test_port_that_is_taken_is_an_error_that_says_so():
    with serve() as first, pytest.raises(InputError, match=f"port {first.port}.*leave --port out"):
        PageServer(port=first.port)
    with pytest.raises(InputError, match="mesh_error"):
        view(plate_and_pin(), mesh_error=-1.0, port=first.port)
    PageServer(port=first.port).close()  # neither holds it any more


def test_a_bad_question_is_answered_with_what_is_wrong():
    with view(plate_and_pin()) as viewer:
        for query, message in (("time=soon", "soon"), ("time=1&a=pin&b=bolt", "bolt"), ("", "None")):
            code, said = read(f"{viewer.url}answer?{query}")
            assert (code, message in json.loads(said)["error"]) == (400, True)


def test_without_a_meshcat_server_there_is_an_error(monkeypatch):
    monkeypatch.setattr(serving, "_TIMEOUT", 0.3)
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        url = f"tcp://127.0.0.1:{s.getsockname()[1]}"
        with pytest.raises(Clamp3dError, match="no meshcat server answers"):
            MeshcatServer(url)


def test_view_serves_until_interrupted_and_leaves_nothing(tmp_path):
    scene = boxes(tmp_path / "boxes.toml", {"a": 0, "b": 20})
    process = subprocess.Popen([*COMMAND, "view", scene], **INTERRUPTIBLE, text=True)
    try:
        url = process.stdout.readline().strip()
        assert "meshcat-pane" in read(url)[1]
        for line in process.stderr:
            if "until Ctrl-C" in line:
                break
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        assert not children.exists() or children.read_text() == ""  # nothing that could be left over
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30.0) == 0
        assert "Traceback" not in process.stderr.read()
    finally:
        process.kill()
        process.communicate()
    assert not answers(int(re.search(r":(\d+)/", url)[1]))


def test_run_with_view_prints_its_result_and_ends_after_the_timeout(tmp_path, main):
    out = tmp_path / "run.json"
    wires = ("--line", "LGJ-10/2", "--jumper", "LJ-150")
    code, said, _ = main("run", "--view", "--timeout", "0", "--json", out, *wires)
    assert code == 1  # not clamped
    assert said.startswith("http://127.0.0.1:")
    assert "not clamped" in said
    assert json.loads(out.read_text())["status"].startswith("not clamped")
    assert not answers(int(re.search(r":(\d+)/", said)[1]))


def test_a_blocked_sequence_is_shown_on_one_page(tmp_path, main):
    page = tmp_path / "page.html"
    order = "P1|P2P3P4P5 -> P7 -> P5|P3P4"
    code, out, _ = main("run", "--view", "--timeout", "0", "--html", page, "--sequence", order)
    assert code == 1
    said, *shown = out.splitlines()
    assert said.startswith("not assembled: sequence step 3, P5|P3P4")
    assert sum(line.startswith("http://") for line in shown) == 1
    assert "P3 from below" in page.read_text()
