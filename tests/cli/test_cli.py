"""The command line in this process: exit codes, stdout and stderr, files, ``-``, one line for every fault."""

import json
import math
import warnings

import click
import pytest
import trimesh

from clamp3d import cli
from clamp3d.bench import published
from clamp3d.cli.options import Output
from clamp3d.errors import SolverError
from clamp3d.geometry.pose import PoseWarning
from tests.cli.boxes import boxes

NO_NUMBER = "must be a finite number or a fraction like 1/3, got"


@pytest.fixture
def apart(tmp_path):
    """A scene of two boxes that are 10 mm apart."""
    return boxes(tmp_path / "boxes.toml", {"a": 0, "b": 20})


def test_run_prints_the_published_state_and_writes_json(tmp_path, main):
    path = tmp_path / "out.json"
    code, out, err = main("run", "--json", path)
    assert code == 0
    assert "clamped; distance between the splints 31.530 mm, tilt 12.00 deg" in out
    assert "line between the splints" in err
    data = json.loads(path.read_text())
    assert {"clamp", "method", "solver", "distance_mm", "parts", "contacts", "work"} <= set(data)
    for part, (x, y, angle) in published.FINAL_STATE.items():
        section = data["parts"][part]["section"]
        assert (round(section["x"], 3), round(section["y"], 3)) == (x, y)
        assert section["angle_deg"] == pytest.approx(angle, abs=0.01)
        T = data["parts"][part]["T_world"]
        # World: X right, Z up = -y; a counter-clockwise angle turns X towards Z.
        assert (T[0][3], T[2][3]) == pytest.approx((section["x"], -section["y"]))
        assert T[2][0] == pytest.approx(math.sin(math.radians(section["angle_deg"])))
    assert {"a", "b", "type", "relation", "distance_mm", "point"} <= set(data["contacts"][0])
    assert data["work"]["meshes_built"] == 0
    assert list(tmp_path.iterdir()) == [path]


def test_a_clamp_that_does_not_close_is_a_finding_and_quiet_says_nothing_on_stderr(main):
    code, out, err = main("run", "--line", "LJ-16", "--jumper", "LJ-16", "-q")
    assert (code, err) == (1, "")
    assert "not clamped: faces meet" in out


@pytest.mark.filterwarnings("ignore:zmq.eventloop.ioloop")  # when meshcat is imported
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rum"], "No such command 'rum'. Did you mean 'run'?"),
        (["boxes.toml"], "boxes.toml is no command; to check it: clamp3d check boxes.toml"),
        (["check", "boxes.toml", "--allow", "glue"], "must be one of running, press, thread, duplicate, got 'glue'"),
        *((["check", "boxes.toml", "--allow", rule], f"{NO_NUMBER} ''") for rule in ("a:b=", "press=")),
        (["check", "boxes.toml", "--line", "LJ-500"], "line goes with a clamp"),
        (["check", "boxes.toml", "--pairs", "a"], "must read like P1:P6,P2:P7, got 'a'"),
        (["check", "boxes.toml", "--pairs", "a:leg"], "unknown part 'leg'; available: a, b"),
        (["check", "boxes.toml", "--clearance", "-1"], "clearance must be 0 or > contact"),
        (["check", "none.toml"], "none.toml: no such file"),
        (["sweep", "--yaw-deg", "95"], "yaw must be > 0 and < 90 deg, got 95 deg"),
        (["sweep", "--pitch-deg", "0"], "pitch must be > 0 and < 90 deg, got 0 deg"),
        (["sweep", "--map", "map.bmp"], "the name must end in one of .png, .svg, .pdf"),
        (["run", "nothing"], "unknown clamp 'nothing'; built in: reference"),
        (["run", "--method", "magic"], "'magic' is not one of"),
        (["run", "--unit-angle-deg", "5"], "unit_angle goes with method chords or wedges, got method 'cas'"),
        (["run", "--method", "chords", "--unit-angle-deg", "0"], "unit angle must be between 0 and 180 deg, got 0"),
        (["run", "--step", "-1"], "step must be > 0 mm, got -1"),
        (["run", "--step", "1", "--tilt-step-deg", "0"], "tilt step must be > 0 deg, got 0"),
        (["run", "--solver", "exact", "--step", "1"], "--step and --tilt-step-deg go with --solver stepped"),
        (["run", "--json"], "requires an argument"),
        (["fit", "."], ".: a folder, not one file (.stl, .obj"),
        (["check", "a.urdf", "--joints", "elbow"], "must read like elbow=1.57,slide=20, got 'elbow'"),
        (["check", "a.urdf", "--joints", "a=1,b=2,a=3"], "must give each joint once, got a 2 times"),
        (["view", "boxes.toml", "--overlay", "wedges"], "--overlay goes with a clamp, not with a scene"),
        (["run", "--overlay", "wedges"], "--overlay goes with a page: --view, --html or --url"),
        (["view", "--overlay", "spheres"], "wedges[=UNIT_ANGLE_DEG], hulls[=THRESHOLD_MM]"),
        (["view", "--overlay", "wedges=many"], "UNIT_ANGLE_DEG must be a number"),
        (["view", "--url", "http://127.0.0.1:7000/static/"], "(tcp://HOST:PORT), got 'http://127.0.0.1:7000/static/'"),
        (["view", "--url", "tcp://127.0.0.1:1", "--port", "7000"], "--port and --timeout"),
        (["view", "--html", "x.html", "--open"], "--open"),
        (["view", "--html", "no/such/folder/x.html"], "no/such/folder"),
        (["view", "--draw-error", "-1", "--timeout", "0"], "mesh_error"),
        (["view", "boxes.toml", "--draw-error", "-1", "--html", "x.html"], "mesh_error"),
        (["view", "--clearance", "-1", "--timeout", "0"], "clearance"),
        (["view", "bearing.stpe"], "; did you mean .stp?"),
        (["view", "--host", "203.0.113.7", "--timeout", "0"], "203.0.113.7"),
        (["report"], "--output"),
        (["report", "-q", "-o", "x", "--clearance", "-1"], "clearance"),
        (["report", "-q", "-o", "boxes.toml/x"], "boxes.toml"),
        (["report", "boxes.toml", "-q", "-o", "-"], "cannot write into -: it is stdout, not a folder"),
        (["export", "boxes.toml", "-q", "-f", "stl", "-o", "-"], "cannot write into -: it is stdout, not a folder"),
        (["report", "boxes.toml", "--method", "chords", "-o", "x"], "go with a clamp"),
        (["export", "-q", "-o", "x.stl", "--state", "P9"], "unknown state 'P9'; available: open, P1|P2P3P4P5 (or 1)"),
        *((["run", f"--step={text}"], NO_NUMBER) for text in ("1/0", "", "inf", "1,5", "1_0", "wide")),
        (["run", "--step", "-3/2"], "step must be > 0 mm, got -1.5"),
        (["export", "-f", "dwg", "-o", "x"], "'dwg' is not one of"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, message, main, apart, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = main(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert [*tmp_path.iterdir()] == [apart]


def test_every_file_option_writes_to_stdout_for_a_dash():
    context = click.Context(cli.group)
    options = [option for name in cli.COMMANDS for option in cli.group.get_command(context, name).params]
    files = [option for option in options if isinstance(option, click.Option) and option.metavar == "FILE"]
    assert len(files) > 10
    assert [option.opts for option in files if not isinstance(option.type, Output)] == []


@pytest.mark.parametrize("command", ["tolerance --n 2", "sweep --steps 4", "check boxes.toml", "fit ball.stl"])
def test_json_on_stdout_is_nothing_but_json(command, apart, tmp_path, monkeypatch, whole_main):
    trimesh.creation.icosphere(subdivisions=1).export(tmp_path / "ball.stl")
    before = sorted(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    code, out, err = whole_main(*command.split(), "--json", "-")
    assert code == 0, err
    assert isinstance(json.loads(out), dict)
    assert len(err.splitlines()) >= 2  # the text for people
    assert sorted(tmp_path.iterdir()) == before


def test_only_one_file_can_be_stdout(apart, whole_main):
    code, out, err = whole_main("check", apart, "--html", "-", "--json", "-")
    assert (code, out) == (2, "")
    assert "only one file can be stdout" in err


@pytest.mark.usefixtures("without_pictures")
def test_undecided(tmp_path, whole_main):
    """A coarse tube whose facets do not say whether the pin in it, 0.01 mm thinner, touches."""
    trimesh.creation.annulus(5.0, 9.0, 10.0, sections=24).export(tmp_path / "tube.stl")
    scene = tmp_path / "fit.toml"
    scene.write_text(
        'contact = 1e-3\n[parts.tube]\nshape = "mesh"\nfile = "tube.stl"\nchord = 0.05\n'
        '[parts.pin]\nshape = "cylinder"\nradius = 4.99\nlength = 20\n'
    )
    code, out, _ = whole_main("check", scene, "--json", "-")
    data = json.loads(out)
    assert (code, data["clean"]) == (3, False)
    assert {"headline", "scene", "thresholds", "counts", "findings", "parts", "motions"} <= set(data)
    (row,) = data["pairs"]
    assert {"distance_mm", "at_least_mm", "at_most_mm", "point_a", "normal", "depth_mm", "method"} <= set(row)
    assert row["verdict"] == "uncertain"
    assert whole_main("report", scene, "--output", tmp_path / "report", "-q")[0] == 3


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (IndexError("list index"), 4, "clamp3d: error: inside clamp3d: IndexError: list index at conductors.py:"),
        (MemoryError(), 4, "clamp3d: error: inside clamp3d: MemoryError"),
        (SolverError("optimality is 1e-3"), 4, "clamp3d: error: optimality is 1e-3\n"),
        (KeyboardInterrupt(), 130, "\nclamp3d: interrupted\n"),
    ],
)
def test_a_fault_is_one_line_and_no_finding(error, code, message, monkeypatch, main):
    def fail():
        raise error

    monkeypatch.setattr("clamp3d.clamp.conductors.catalogue", fail)
    status, out, err = main("conductors")
    assert (status, out, err.strip().count("\n")) == (code, "", 0)
    assert err.startswith(message)
    monkeypatch.setenv("CLAMP3D_DEBUG", "1")
    assert ("Traceback (most recent call last)" in main("conductors")[2]) == (code == 4)


def test_control_characters_do_not_reach_the_terminal(tmp_path, whole_main):
    places = {"\x1b[31mred": 0, "bell\x07\u202e": 9}
    code, out, err = whole_main("check", boxes(tmp_path / "boxes.toml", places))
    assert code == 1
    assert "\\x1b[31mred" in out
    assert all(c.isprintable() or c == "\n" for c in out + err)


def test_methods_steps_and_wires_are_those_asked_for(main):
    for arguments, solver, distance in (
        ("--step 1/3", "stepped", 31.530),
        ("--method chords --unit-angle-deg 20", "exact", 32.080),
        ("--line LJ-500", "exact", 27.233),
    ):
        found = json.loads(main("run", "-q", "--no-equilibria", *arguments.split(), "--json", "-")[1])
        assert (found["solver"], round(found["distance_mm"], 3)) == (solver, distance)


def test_conductors_have_the_diameters_of_their_standards(main):
    rows = dict(line.split()[:2] for line in main("conductors")[1].splitlines())
    diameters = {"LJ-16": "5.10", "LJ-120": "14.25", "LJ-500": "29.12", "LJ-630": "32.67", "LGJ-10/2": "4.50"}
    assert diameters.items() <= rows.items()


def test_a_warning_is_one_line_on_stderr(monkeypatch, main):
    """Without the file, the category and the line of source that Python's own form shows."""

    def mended():
        warnings.warn("T_world has rounding errors\nof 1e-6", PoseWarning, stacklevel=2)
        return {}

    monkeypatch.setattr("clamp3d.clamp.conductors.catalogue", mended)
    code, _, err = main("conductors")
    assert (code, err) == (0, "warning: T_world has rounding errors\\nof 1e-6\n")
