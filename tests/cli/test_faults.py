"""What goes wrong around the program: exit codes stay true, files whole, nothing is left behind."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
import trimesh

from tests.cli.boxes import boxes

COMMAND = [sys.executable, "-m", "clamp3d"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}


def _heed_signals():
    """A background job without a terminal hands an ignored Ctrl-C or end of the line down to its children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


INTERRUPTIBLE = PIPES | {"preexec_fn": _heed_signals}
posix = pytest.mark.skipif(os.name != "posix", reason="POSIX signals and file names")


def clamp3d(*arguments, env=None, **kwargs):
    env = ENVIRONMENT | (env or {})
    return subprocess.run([*COMMAND, *arguments], capture_output=True, timeout=120, check=False, env=env, **kwargs)


@pytest.fixture
def scene(tmp_path):
    return boxes(tmp_path / "scene-a.toml", {"Ø→Ω": 0, "b": 20})


def test_help_lists_every_command_and_neither_it_nor_the_kernel_loads_numeric_libraries():
    done = clamp3d()
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"reproduce" in done.stdout
    code = "import sys, clamp3d.cli, clamp3d.kernel.distance, clamp3d.kernel.pieces, clamp3d.kernel.relation\n"
    code += "print({'numba', 'scipy', 'trimesh', 'fcl', 'coacd', 'meshcat'} & {*sys.modules})"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout == b"set()\n"


def test_what_a_library_logs_of_a_damaged_robot_is_not_told(tmp_path):
    pytest.importorskip("yourdfpy")
    (tmp_path / "arm.urdf").write_text("")
    done = clamp3d("check", tmp_path / "arm.urdf")
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1), done.stderr


@pytest.mark.parametrize(
    "env", [{"PYTHONIOENCODING": "latin-1"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}]
)
def test_a_terminal_without_the_letters(scene, env):
    done = clamp3d("check", scene, env=env)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"1 clear" in done.stdout


@posix
def test_a_file_name_that_is_not_utf8(scene, tmp_path, main):
    odd = os.fsencode(tmp_path) + b"/n\xff.toml"
    try:
        os.rename(scene, odd)
    except OSError:
        pytest.skip("this file system wants UTF-8")
    done = clamp3d("check", odd, "--json", "-")
    assert (done.returncode, b"inside clamp3d" in done.stderr) == (0, False)
    assert b"udcff" in done.stdout
    assert main("export", os.fsdecode(odd), "-o", f"{tmp_path}/o\udcff.glb")[::2] == (0, "")
    (manifest,) = tmp_path.glob("*.manifest.json")
    (name,) = json.loads(manifest.read_text())["files"]
    assert name == "o\udcff.glb"


@pytest.mark.parametrize(("value", "command"), [("now", "run"), ("1.5", "conductors"), ("9" * 20, "conductors")])
def test_a_bad_date_is_bad_input(value, command, main, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", value)
    wanted = f"clamp3d: error: SOURCE_DATE_EPOCH must be whole seconds since 1970, got '{value}'\n"
    assert main(command) == (2, "", wanted)


def test_an_empty_date_is_none(main, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "")
    assert main("conductors")[0] == 0


@pytest.mark.parametrize("arguments", [(), ("--json", "-")])
def test_a_reader_that_goes_away_leaves_the_verdict_its_exit_code(arguments, tmp_path):
    boxes(tmp_path / "a.toml", {"a": 0, "b": 9})
    with subprocess.Popen([*COMMAND, "check", "-q", tmp_path / "a.toml", *arguments], **PIPES) as process:
        process.stdout.close()
        assert process.stderr.read() == b"" or arguments
        assert process.wait(120) == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
@pytest.mark.parametrize(
    ("arguments", "stream", "count"),
    [(["--help"], "stdout", 1), (["check", "a.toml"], "stdout", 1), (["check", "none.toml"], "stderr", 0)],
)
def test_a_full_disk_is_one_line_and_bad_input_whatever_the_verdict(arguments, stream, count, tmp_path):
    boxes(tmp_path / "a.toml", {"a": 0, "b": 9})
    with open("/dev/full", "w") as full:
        streams = PIPES | {stream: full}
        done = subprocess.run([*COMMAND, *arguments], **streams, check=False, cwd=tmp_path, env=ENVIRONMENT)
    said = done.stderr or b""
    assert done.returncode == 2
    assert said.count(b"error") == said.count(b"No space left on device") == count


@posix
def test_when_asked_to_end_nothing_is_left(tmp_path):
    """The decomposition of a splint takes tens of seconds in a process of its own."""
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    env = ENVIRONMENT | {"TMPDIR": str(temporary), "CLAMP3D_CACHE": str(tmp_path / "cache")}
    with subprocess.Popen([*COMMAND, "run", "-q", "--method", "hulls"], **PIPES, env=env) as process:
        until(lambda: _children(process.pid))
        workers = _children(process.pid)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=60)
    lines = err.decode().splitlines()
    said = [line for line in lines if line and not line.startswith("clamp3d: compiling")]  # a new cache
    assert (process.returncode, out, said) == (128 + signal.SIGTERM, b"", [])
    assert list(temporary.iterdir()) == []
    until(lambda: not any(alive(worker) for worker in workers))


def until(condition):
    for _ in range(1200):
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError("waited for two minutes")


def _children(pid):
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False)
    return [int(line) for line in found.stdout.split()]


def alive(pid):
    found = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False)
    return found.stdout.strip() not in ("", "Z", "Zs")


@posix
@pytest.mark.parametrize(("name", "said"), [("INT", b"clamp3d: interrupted\n"), ("TERM", b""), ("HUP", b"")])
def test_a_signal_ends_the_program_also_while_a_library_that_ignores_it_is_imported(name, said, tmp_path):
    number = getattr(signal, f"SIG{name}")
    (tmp_path / "stubborn.py").write_text(
        "import time\ntry:\n    print('here', flush=True)\n    time.sleep(60)\nexcept BaseException:\n    pass\n"
    )
    code = "from clamp3d.cli.terminal import end_on_signals; end_on_signals(); import stubborn; print('went on')"
    env = ENVIRONMENT | {"PYTHONPATH": os.pathsep.join([str(tmp_path), ENVIRONMENT["PYTHONPATH"]])}
    with subprocess.Popen([sys.executable, "-c", code], **INTERRUPTIBLE, env=env) as process:
        assert process.stdout.readline() == b"here\n"
        process.send_signal(number)
        assert process.communicate(timeout=60) == (b"", said)
    assert process.returncode == 128 + number


def test_no_file_is_written_over_what_is_read_or_over_another(tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    for name, x in (("a", 0.0), ("b", 5.0)):
        trimesh.creation.box((1.0, 2.0, 3.0)).apply_translation((x, 0.0, 0.0)).export(f"{name}.stl")
    boxes(tmp_path / "scene.toml", {"a": 0, "b": 20})
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for arguments, problem in (
        (("check", "scene.toml", "--json", "./scene.toml"), "cannot write scene.toml: it is the input"),
        (("check", "scene.toml", "--csv", "x", "--json", "./x"), "--json and --csv are one file"),
        (("view", "scene.toml", "--html", "scene.toml"), "it is the input"),
        (("export", ".", "--format", "stl", "--output", "."), "it is the input"),
        (("export", "a.stl", "--output", "a.stl"), "it is the input"),
    ):
        code, _, error = main(*arguments)
        assert (code, problem in error) == (2, True), error
        assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    for _ in range(2):  # results may be written again, also beside the input
        assert main("check", ".", "--json", "result.json", "--quiet")[0] == 0


ROBOT = (
    '<robot name="r"><link name="a"><collision><geometry><mesh filename="a.stl"/></geometry></collision></link></robot>'
)


@posix
@pytest.mark.parametrize(
    ("command", "victim"),
    [
        ("check scene.toml --json a.stl", "a.stl"),
        ("check scene.toml --csv new.csv --json parts/b.stl", "b.stl"),
        ("export scene.toml -o a.stl", "a.stl"),
        ("export scene.toml -f stl -o .", "a.stl"),
        ("view scene.toml --html parts/b.stl", "b.stl"),
        ("check parts --poses poses.csv --json poses.csv", "poses.csv"),
        ("check scene.toml --json scene.accepted.toml", "scene.accepted.toml"),
        ("check a.gltf --json ./gltf_buffer_0.bin", "gltf_buffer_0.bin"),
        ("check r.urdf --json a.stl", "a.stl"),
        ("check /dev/null --json new.json", "unknown clamp or file '/dev/null'"),
    ],
)
def test_no_file_is_written_over_what_the_input_names(command, victim, tmp_path, monkeypatch, main):
    if "urdf" in command:
        pytest.importorskip("yourdfpy")
    monkeypatch.chdir(tmp_path)
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    (tmp_path / "parts").mkdir()
    for name in ("a.stl", "parts/b.stl"):
        box.export(name)
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(box)).items():
        (tmp_path / name.replace("model", "a")).write_bytes(data)
    (tmp_path / "scene.toml").write_text('include = "parts"\n[parts.a]\nfile = "a.stl"\n')
    (tmp_path / "poses.csv").write_text("name,x,y,z,qx,qy,qz,qw\nb,0,0,0,0,0,0,1\n")
    (tmp_path / "r.urdf").write_text(ROBOT)
    (tmp_path / "scene.accepted.toml").write_text("")
    assert main("check", "scene.toml", "--json", "last.json")[0] == 1
    before = {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}
    code, _, error = main(*command.split())
    assert (code, error.count("\n"), victim in error) == (2, 1, True), error
    assert {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")} == before
