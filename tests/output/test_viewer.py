"""The viewer without a browser: what is sent, where it is served, and that nothing is left behind."""

import itertools
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import clamp3d
from clamp3d.baselines.cas import Cas
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.loader import load_clamp
from clamp3d.errors import Clamp3dError, InputError
from clamp3d.output import viewer_server
from clamp3d.output.viewer import Viewer
from clamp3d.output.viewer_log import CommandLog
from clamp3d.output.viewer_scene import AssemblyScene
from clamp3d.output.viewer_server import LocalServer, RemoteServer


@pytest.fixture(scope="module")
def recorded():
    """All commands of a run, and the run."""
    commands = []
    scene = AssemblyScene(load_clamp(), Cas(), commands.append, mesh_error=0.1)
    before_run = len(commands)
    run = assemble(load_clamp(), Cas(), on_waypoint=scene.show)
    scene.finish(run)
    return commands, run, before_run


def read(url):
    with urllib.request.urlopen(url, timeout=5.0) as answer:
        return answer.read().decode()


def answers(port):
    with socket.socket() as s:
        return s.connect_ex(("127.0.0.1", port)) == 0


def test_parts_are_there_before_the_run_and_each_waypoint_comes_when_it_is_reached(recorded):
    commands, run, before_run = recorded
    early = {c["path"] for c in commands[:before_run] if c["type"] == "set_object"}
    for name in run.poses:
        assert any(path.startswith(f"/clamp3d/cutaway/{name} ") for path in early)
    at = [
        i
        for i, c in enumerate(commands)
        if c["type"] == "set_transform" and c["path"] == "/clamp3d/whole/P2 down splint"
    ]
    sent = [np.reshape(commands[i]["matrix"], (4, 4)).T for i in at]
    assert len(sent) == len(run.path) + 1  # and back to the start at the end
    for T, waypoint in zip(sent, run.path, strict=False):
        np.testing.assert_allclose(T, waypoint.poses["P2"].T(), atol=1e-12)
    assert at[0] > before_run


def test_animation_reaches_every_waypoint_in_turn(recorded):
    commands, run, _ = recorded
    animation = commands[-1]
    assert animation["type"] == "set_animation"
    stops = [c for c in commands if c.get("property") == "userData"][-1]["value"]["stops"]
    clips = {a["path"]: a["clip"] for a in animation["animations"]}
    ends = {clip["tracks"][0]["keys"][-1]["time"] for clip in clips.values()}
    assert len(ends) == 1  # three.js ends each clip by itself
    for part in run.poses:
        clip = next(c for path, c in clips.items() if path.startswith(f"/clamp3d/cutaway/{part} "))
        position, quaternion = ({k["time"]: k["value"] for k in t["keys"]} for t in clip["tracks"])
        for stop, waypoint in zip(stops, run.path, strict=True):
            pose = waypoint.poses[part]
            np.testing.assert_allclose(position[stop["arrive"]], [pose.x, 0.0, -pose.y], atol=1e-12)
            R = rotation_of(quaternion[stop["arrive"]])
            if part != "P5":
                np.testing.assert_allclose(R, pose.T()[:3, :3], atol=1e-12)
            else:
                np.testing.assert_allclose(R[:, 2], [0.0, 0.0, 1.0], atol=1e-12)


def test_nut_turns_as_often_as_the_run_says_and_clockwise_from_above(recorded):
    commands, run, _ = recorded
    clip = next(a["clip"] for a in commands[-1]["animations"] if a["path"].startswith("/clamp3d/whole/P5"))
    rotations = [rotation_of(k["value"]) for k in clip["tracks"][1]["keys"]]
    turned = 0.0
    for a, b in itertools.pairwise(rotations):
        step = a.T @ b
        turned += np.arctan2(step[1, 0], step[0, 0])
    assert turned / (2.0 * np.pi) == pytest.approx(-run.turns, abs=1e-9)


def rotation_of(quaternion):
    x, y, z, w = quaternion
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0)
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat([x, y, z, w]).as_matrix()


def test_contacts_show_as_points_with_normals_and_gaps_as_lines_with_their_value(recorded):
    commands, run, _ = recorded
    group = f"/clamp3d/contacts/{len(run.path)} nut tightened"
    objects = {c["path"] for c in commands if c["type"] == "set_object"}
    touching = [c for c in run.contacts if c.distance <= 1e-6]
    assert len(touching) == 8
    for c in touching:
        assert f"{group}/{c.a}-{c.b}/point" in objects
        assert (f"{group}/{c.a}-{c.b}/normal" in objects) == (c.type != 1)
        T = next(k["matrix"] for k in commands if k["path"] == f"{group}/{c.a}-{c.b}/point" and "matrix" in k)
        np.testing.assert_allclose(np.reshape(T, (4, 4))[3, :3], c.point, atol=1e-9)
    line = next(
        c
        for c in commands
        if c["path"] == f"/clamp3d/gaps/{len(run.path)} nut tightened/splints/line" and c["type"] == "set_object"
    )
    ends = np.frombuffer(
        line["object"]["geometries"][0]["data"]["attributes"]["position"]["array"].data, dtype=np.float32
    ).reshape(-1, 3)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(run.distance, abs=1e-4)


def test_log_keeps_what_a_late_page_needs_and_no_more():
    log = CommandLog()
    for x in range(100):
        log.add({"type": "set_transform", "path": "/a/b", "matrix": [float(x)] * 16})
    log.add({"type": "set_property", "path": "/a/b", "property": "visible", "value": True})
    assert len(log.messages()) == 2
    log.add({"type": "set_object", "path": "/ab", "object": {}})
    log.add({"type": "delete", "path": "/a"})
    assert len(log.messages()) == 1  # /ab is not below /a


def test_second_viewer_takes_the_next_port_and_closing_frees_it():
    with LocalServer() as first:
        with LocalServer() as second:
            assert second.port != first.port
            assert "<canvas" not in read(second.url)
            assert "meshcat-pane" in read(second.url)
        assert not answers(second.port)
        assert answers(first.port)
    assert not answers(first.port)
    assert not [t for t in threading.enumerate() if t.name == "clamp3d viewer"]
    first.close()  # again does nothing


def test_port_that_is_taken_is_an_error_that_says_so():
    with LocalServer() as first, pytest.raises(InputError, match=f"port {first.port}.*leave --port out"):
        LocalServer(port=first.port)


def test_serves_this_machine_only_unless_asked():
    with LocalServer() as server:
        others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
        for address in others:
            with socket.socket() as s:
                assert s.connect_ex((address, server.port)) != 0


def test_other_files_are_not_served():
    with LocalServer() as server:
        for path in ("main.js", "../index.html", "main.min.js/../../package.json", "etc/passwd"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                read(server.url + path)


def test_bad_mesh_error_leaves_no_server():
    with pytest.raises(InputError, match="mesh_error"):
        Viewer(load_clamp(), Cas(), mesh_error=-1.0)
    assert not [t for t in threading.enumerate() if t.name == "clamp3d viewer"]


def test_no_meshcat_server_there_is_told_soon(monkeypatch):
    monkeypatch.setattr(viewer_server, "_PATIENCE", 0.3)
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        url = f"tcp://127.0.0.1:{s.getsockname()[1]}"
        start = time.monotonic()
        with pytest.raises(Clamp3dError, match="no meshcat server answers"):
            RemoteServer(url)
        assert time.monotonic() - start < 3.0
    with pytest.raises(InputError, match=r"tcp://HOST:PORT.*'http://127.0.0.1:7000/static/'"):
        RemoteServer("http://127.0.0.1:7000/static/")


def command_line(*arguments):
    return [sys.executable, "-m", "clamp3d", *arguments]


def test_page_is_one_file_that_names_no_other(tmp_path):
    page = tmp_path / "run.html"
    done = subprocess.run(
        command_line("view", "--html", str(page), "--draw-error", "0.1", "-q"), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(page)]
    text = page.read_text()
    ours = re.sub(r"<script>.*?</script>", "", text, count=1, flags=re.DOTALL)  # without meshcat itself
    assert not re.search(r"""(src|href)=["'](?!data:)""", ours)
    assert "within 0.1 mm" not in ours  # it is said in the picture, from the scene itself
    assert [p.name for p in tmp_path.iterdir()] == ["run.html"]


def test_view_serves_until_interrupted_and_leaves_nothing():
    process = subprocess.Popen(
        command_line("view", "--draw-error", "0.1"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A background job without a terminal hands an ignored Ctrl-C down to its children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        url = process.stdout.readline().strip()
        assert "meshcat-pane" in read(url)
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


def test_run_with_view_prints_its_result_and_ends_after_the_timeout(tmp_path):
    out = tmp_path / "run.json"
    start = time.monotonic()
    done = subprocess.run(
        command_line("run", "--view", "--timeout", "0", "--json", str(out), "--line", "LGJ-10/2", "--jumper", "LJ-150"),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 1  # not clamped
    assert done.stdout.startswith("http://127.0.0.1:")
    assert "not clamped" in done.stdout
    assert json.loads(out.read_text())["status"].startswith("not clamped")
    assert time.monotonic() - start < 60.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["view", "--url", "localhost:6000"], "zmq_url"),
        (["view", "--url", "tcp://127.0.0.1:1", "--port", "7000"], "--port and --timeout"),
        (["view", "--html", "x.html", "--open"], "--open"),
        (["view", "--html", "no/such/folder/x.html"], "no/such/folder"),
        (["view", "--draw-error", "nan", "--timeout", "0"], "mesh_error"),
        (["view", "--clearance", "-1", "--timeout", "0"], "clearance"),
        (["view", "--overlay", "spheres"], "wedges[=UNIT_ANGLE_DEG], hulls[=THRESHOLD_MM]"),
        (["view", "--overlay", "wedges=many"], "UNIT_ANGLE_DEG must be a number"),
        (["view", "--host", "203.0.113.7", "--timeout", "0"], "203.0.113.7"),
    ],
)
def test_bad_options_are_one_line(arguments, message, tmp_path):
    environment = os.environ | {"PYTHONPATH": os.path.dirname(os.path.dirname(clamp3d.__file__))}
    done = subprocess.run(command_line(*arguments), capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
