"""What goes wrong around the program: exit codes stay true, files whole, nothing is left behind."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

BOX = '[parts.{name}]\nshape = "box"\nsize = [10, 10, 10]\npose = {{ translation = [{x}, 0, 0] }}\n'
MOTION = '[[motions]]\nname = {name}\nparts = ["b"]\ntranslate = [5, 0, 0]\n'
COMMAND = [sys.executable, "-m", "clamp3d"]
posix = pytest.mark.skipif(os.name != "posix", reason="POSIX signals and file names")


def clamp3d(*arguments, env=None, **kwargs):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **(env or {})}
    return subprocess.run([*COMMAND, *arguments], capture_output=True, timeout=120, check=False, env=env, **kwargs)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene-a.toml"
    path.write_text(BOX.format(name='"Ø→Ω"', x=0.0) + BOX.format(name="b", x=20.0), encoding="utf-8")
    return path


def test_what_a_library_logs_of_a_damaged_robot_is_not_told(tmp_path):
    pytest.importorskip("yourdfpy")
    (tmp_path / "arm.urdf").write_text("")
    done = clamp3d("check", tmp_path / "arm.urdf")
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1), done.stderr


class TestText:
    @pytest.mark.parametrize(
        "env", [{"PYTHONIOENCODING": "latin-1"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}]
    )
    def test_a_terminal_without_the_letters(self, scene, env):
        done = clamp3d("check", scene, env=env)
        assert (done.returncode, done.stderr) == (0, b"")
        assert b"1 clear" in done.stdout

    @posix
    def test_a_file_name_that_is_not_utf8(self, scene, tmp_path):
        odd = os.fsencode(tmp_path) + b"/n\xff.toml"
        try:
            os.rename(scene, odd)
        except OSError:
            pytest.skip("this file system wants UTF-8")
        for arguments in (("check", odd), ("check", odd, "--html", "-"), ("check", odd, "--json", "-")):
            done = clamp3d(*arguments)
            assert (done.returncode, b"inside clamp3d" in done.stderr) == (0, False)
            assert b"udcff" in done.stdout
        done = clamp3d("export", odd, "-o", os.fsencode(tmp_path) + b"/o\xff.glb")
        assert done.returncode == 0, done.stderr
        (manifest,) = tmp_path.glob("*.manifest.json")
        (name,) = json.loads(manifest.read_text())["files"]
        assert name == "o\udcff.glb"

    def test_a_motion_cannot_clear_the_screen(self, tmp_path):
        path = tmp_path / "motion.toml"
        name = "\x1b[2J\x1b[H1 clear\u202e"
        boxes = BOX.format(name="a", x=0.0) + BOX.format(name="b", x=9.0)
        path.write_text(boxes + MOTION.format(name=json.dumps(name)), encoding="utf-8")
        done = clamp3d("check", path)
        assert done.returncode == 1
        text = done.stdout.decode()
        assert "\\x1b[2J" in text
        assert all(c.isprintable() or c == "\n" for c in text + done.stderr.decode())


class TestEnvironment:
    @pytest.mark.parametrize("value", ["now", "1.5", "9" * 20])
    @pytest.mark.parametrize("arguments", [("run",), ("conductors",), ("export", "-o", "pin.step")])
    def test_a_bad_date_is_bad_input(self, value, arguments, tmp_path):
        done = clamp3d(*arguments, env={"SOURCE_DATE_EPOCH": value}, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, b"")
        wanted = f"clamp3d: error: SOURCE_DATE_EPOCH must be whole seconds since 1970, got '{value}'\n"
        assert done.stderr.decode() == wanted

    def test_an_empty_date_is_none(self):
        assert clamp3d("run", "-q", env={"SOURCE_DATE_EPOCH": ""}).returncode == 0


@posix
class TestEnd:
    def test_when_asked_to_end_nothing_is_left(self, tmp_path):
        """The decomposition of a splint takes tens of seconds in a process of its own."""
        temporary = tmp_path / "tmp"
        temporary.mkdir()
        env = {"TMPDIR": str(temporary), "CLAMP3D_CACHE": str(tmp_path / "cache")}
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **env}
        with subprocess.Popen(
            [*COMMAND, "run", "-q", "--method", "hulls"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=env
        ) as process:
            _until(lambda: _children(process.pid))
            workers = _children(process.pid)
            process.send_signal(signal.SIGTERM)
            out, err = process.communicate(timeout=60)
        lines = err.decode().splitlines()
        said = [line for line in lines if line and not line.startswith("clamp3d: compiling")]  # a new cache
        assert (process.returncode, out, said) == (128 + signal.SIGTERM, b"", [])
        assert list(temporary.iterdir()) == []
        _until(lambda: not any(_alive(worker) for worker in workers))

    def test_workers_end_with_their_parent(self):
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen(
            [*COMMAND, "tolerance", "-q", "--n", "1000000", "--processes", "2"], stdout=subprocess.DEVNULL, env=env
        ) as process:
            _until(lambda: len(_children(process.pid)) >= 3)  # two workers and multiprocessing's own helper
            workers = _children(process.pid)
            process.kill()
            process.wait(60)
        _until(lambda: not any(_alive(worker) for worker in workers))


def _until(condition):
    for _ in range(1200):
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError("waited for two minutes")


def _children(pid):
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False)
    return [int(line) for line in found.stdout.split()]


def _alive(pid):
    found = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False)
    return found.stdout.strip() not in ("", "Z", "Zs")
