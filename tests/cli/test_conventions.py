"""What all commands have in common: exit codes, stdout and stderr, ``-``, closed pipes, text from files."""

import json
import os
import subprocess
import sys
import warnings

import click
import numpy as np
import pytest
import trimesh

from clamp3d import cli
from clamp3d.cli.options import Output, number
from clamp3d.core.pose import PoseWarning
from clamp3d.errors import SolverError

BOX = '[parts.{name}]\nshape = "box"\nsize = [10, 10, 10]\npose = {{ translation = [{x}, 0, 0] }}\n'


def clamp3d(*arguments, **kwargs):
    command = [sys.executable, "-m", "clamp3d", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **kwargs)


def boxes(folder, distance, names=("a", "b")):
    path = folder / "boxes.toml"
    path.write_text("".join(BOX.format(name=json.dumps(name), x=k * distance) for k, name in enumerate(names)))
    return path


def every_command():
    context = click.Context(cli.group)
    return {name: cli.group.get_command(context, name) for name in cli.COMMANDS}


class TestFiles:
    def test_every_file_option_writes_to_stdout_for_a_dash(self):
        options = [
            (name, option)
            for name, command in every_command().items()
            for option in command.params
            if isinstance(option, click.Option) and option.metavar == "FILE"
        ]
        assert len(options) > 10
        assert [(name, option.opts) for name, option in options if not isinstance(option.type, Output)] == []

    @pytest.mark.parametrize(
        "arguments",
        [
            ("run", "--json", "-"),
            ("tolerance", "--n", "2", "--json", "-"),
            ("sweep", "--steps", "4", "--json", "-"),
            ("check", "boxes.toml", "--json", "-"),
            ("fit", "ball.stl", "--json", "-"),
        ],
    )
    def test_json_on_stdout_is_nothing_but_json(self, arguments, tmp_path, monkeypatch, whole_main):
        boxes(tmp_path, 20.0)
        trimesh.creation.icosphere(subdivisions=1).export(tmp_path / "ball.stl")
        before = sorted(tmp_path.iterdir())
        monkeypatch.chdir(tmp_path)
        code, out, err = whole_main(*arguments)
        assert code == 0, err
        assert isinstance(json.loads(out), dict)
        assert len(err.splitlines()) >= 2  # the text for people
        assert sorted(tmp_path.iterdir()) == before

    def test_json_of_a_process_is_nothing_but_json(self, tmp_path):
        done = clamp3d("check", boxes(tmp_path, 20.0), "--json", "-")
        assert done.returncode == 0, done.stderr
        assert isinstance(json.loads(done.stdout), dict)
        assert len(done.stderr.splitlines()) >= 2

    def test_a_page_on_stdout(self, tmp_path, whole_main):
        code, out, _ = whole_main("check", boxes(tmp_path, 20.0), "--html", "-")
        assert code == 0
        assert out.lower().startswith("<!doctype html>")
        assert out.rstrip().endswith("</html>")

    def test_only_one_file_can_be_stdout(self, tmp_path, whole_main):
        code, out, err = whole_main("check", boxes(tmp_path, 20.0), "--html", "-", "--json", "-")
        assert (code, out) == (2, "")
        assert "only one file can be stdout" in err


class TestExitCodes:
    @pytest.mark.parametrize(("distance", "code"), [(20.0, 0), (9.0, 1), (10.0, 0)])
    def test_clean_and_finding(self, distance, code, tmp_path):
        assert clamp3d("check", boxes(tmp_path, distance)).returncode == code

    def test_undecided(self, tmp_path, whole_main):
        """A coarse tube whose facets do not say whether the pin in it, 0.01 mm thinner, touches."""
        tube = trimesh.creation.annulus(5.0, 9.0, 10.0, sections=24)
        tube.export(tmp_path / "tube.stl")
        scene = tmp_path / "fit.toml"
        scene.write_text(
            'contact = 1e-3\n[parts.tube]\nshape = "mesh"\nfile = "tube.stl"\nchord = 0.05\n'
            '[parts.pin]\nshape = "cylinder"\nradius = 4.99\nlength = 20\n'
        )
        code, out, _ = whole_main("check", scene, "--json", "-")
        data = json.loads(out)
        assert [row["verdict"] for row in data["pairs"]] == ["uncertain"]
        assert (code, data["clean"]) == (3, False)
        assert whole_main("report", scene, "--output", tmp_path / "report", "-q")[0] == 3

    def test_a_fault_of_the_program_is_one_line_and_no_finding(self, monkeypatch, main):
        def fail(*args, **kwargs):
            return [][1]

        monkeypatch.setattr("clamp3d.clamp.conductors.catalogue", fail)
        code, out, err = main("conductors")
        assert (code, out) == (4, "")
        assert err.startswith("clamp3d: error: inside clamp3d: IndexError: list index out of range")
        assert len(err.splitlines()) == 1
        monkeypatch.setenv("CLAMP3D_DEBUG", "1")
        code, out, err = main("conductors")
        assert code == 4
        assert "Traceback (most recent call last)" in err

    def test_out_of_memory_is_no_finding(self, monkeypatch, main):
        def fail(*args, **kwargs):
            raise MemoryError

        monkeypatch.setattr("clamp3d.clamp.conductors.catalogue", fail)
        code, out, err = main("conductors")
        assert (code, out, err.count("\n")) == (4, "", 1)
        assert "MemoryError" in err

    def test_a_solver_without_proof(self, monkeypatch, main):
        def fail(*args, **kwargs):
            raise SolverError("optimality is 1e-3")

        monkeypatch.setattr("clamp3d.clamp.conductors.catalogue", fail)
        assert main("conductors") == (4, "", "clamp3d: error: optimality is 1e-3\n")

    def test_interrupted(self, monkeypatch, main):
        def fail(*args, **kwargs):
            raise KeyboardInterrupt

        monkeypatch.setattr("clamp3d.clamp.conductors.catalogue", fail)
        assert main("conductors") == (130, "", "\nclamp3d: interrupted\n")


class TestClosedPipe:
    @pytest.mark.parametrize(
        ("arguments", "code"),
        [
            (("run", "-q"), 0),
            (("run", "-q", "--line", "LJ-16", "--jumper", "LJ-16"), 1),
            (("run", "-q", "--json", "-"), 0),
            (("--help",), 0),
        ],
    )
    def test_the_verdict_keeps_its_exit_code(self, arguments, code):
        command = [sys.executable, "-m", "clamp3d", *arguments]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            process.stdout.close()
            assert process.stderr.read() == "" or "--json" in arguments
            assert process.wait(120) == code


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
class TestFullDisk:
    @pytest.mark.parametrize("arguments", [("--help",), ("conductors",), ("check", "boxes.toml")])
    def test_one_line_and_bad_input_whatever_the_verdict(self, arguments, tmp_path):
        boxes(tmp_path, 9.0)
        command = [sys.executable, "-m", "clamp3d", *arguments]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120, check=False, cwd=tmp_path, env=env
            )
        assert done.returncode == 2
        errors = [line for line in done.stderr.splitlines() if "error" in line.lower()]
        assert len(errors) == 1
        assert "No space left on device" in errors[0]
        assert "Traceback" not in done.stderr

    def test_a_full_disk_for_errors_keeps_the_exit_code(self, tmp_path):
        command = [sys.executable, "-m", "clamp3d", "check", "none.toml"]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                command, stdout=subprocess.PIPE, stderr=full, text=True, timeout=120, check=False, cwd=tmp_path, env=env
            )
        assert (done.returncode, done.stdout) == (2, "")


class TestTextFromFiles:
    def test_control_characters_do_not_reach_the_terminal(self, tmp_path, whole_main):
        names = ("\x1b[31mred", "bell\x07\u202e")
        code, out, err = whole_main("check", boxes(tmp_path, 9.0, names))
        assert code == 1
        assert "\\x1b[31mred" in out
        assert all(c.isprintable() or c == "\n" for c in out + err)


class TestNumbers:
    @pytest.mark.parametrize(("text", "value"), [("1/3", 1 / 3), ("0.25", 0.25), (" 2e-3 ", 2e-3), ("-3/2", -1.5)])
    def test_fractions(self, text, value):
        assert number(text) == value

    @pytest.mark.parametrize("text", ["1/0", "x", "", "nan", "inf", "1e400", "1/2/3", "1,5", "1_0"])
    def test_anything_else_is_refused(self, text):
        with pytest.raises(click.BadParameter, match="must be a finite number or a fraction like 1/3, got"):
            number(text)

    def test_a_third_of_a_millimetre_is_the_papers_step(self, main):
        found = json.loads(main("run", "-q", "--step", "1/3", "--json", "-")[1])
        assert found["solver"] == "stepped"
        assert np.round(found["distance_mm"], 3) == 31.530


def test_a_warning_is_one_line_on_stderr(monkeypatch, main):
    """Without the file, the category and the line of source that Python's own form shows."""

    def mended():
        warnings.warn("T_world has rounding errors\nof 1e-6", PoseWarning, stacklevel=2)
        return {}

    monkeypatch.setattr("clamp3d.clamp.conductors.catalogue", mended)
    code, _, err = main("conductors")
    assert (code, err) == (0, "warning: T_world has rounding errors\\nof 1e-6\n")
