"""The compiled kernel's start: cached on disk, announced when it is cold, and never an error without a cache."""

import ctypes
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from clamp3d.core.jit import entry

PACKAGE = Path(__file__).parents[2] / "clamp3d"
CALL = (
    "import time, sys; t = time.process_time(); import numpy as np; from clamp3d.kernel import *;"
    "print(signed_distance(SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0), np.eye(4)).distance);"
    "print(time.process_time() - t)"
)


def run(code: str, folder: Path, **env: str) -> tuple[list[str], str]:
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(folder), **env},
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
        timeout=120,
    )
    return done.stdout.split(), done.stderr


def test_cold_and_warm_start(tmp_path):
    cold, said = run(CALL, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path))
    warm, silent = run(CALL, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path))
    assert cold[0] == warm[0] == "1.5"
    assert said.count("compiling the contact kernel") == 1
    assert silent == ""
    assert float(warm[1]) < 0.5 * float(cold[1])  # seconds of CPU: 0.5 and 4.5 on an idle machine


@pytest.mark.parametrize(
    "damage", [lambda b: b"", lambda b: b[: len(b) // 2], lambda b: b[::-1]], ids=["empty", "cut short", "garbage"]
)
def test_damaged_cache_files_are_written_anew(tmp_path, damage):
    cache = str(tmp_path)
    run(CALL, PACKAGE.parent, CLAMP3D_CACHE=cache)
    files = sorted(tmp_path.glob("kernel-*.o"))
    whole = [file.read_bytes() for file in files]
    assert len(whole) == 2
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    out, said = run(CALL, PACKAGE.parent, CLAMP3D_CACHE=cache)
    assert out[0] == "1.5"
    assert said.count("\n") == 1
    assert "compiling the contact kernel, once for this machine" in said
    assert [len(file.read_bytes()) for file in files] == [len(content) for content in whole]
    assert run(CALL, PACKAGE.parent, CLAMP3D_CACHE=cache)[1] == ""


def test_reading_the_cache_is_not_announced_however_slow_it_is(tmp_path):
    slow = (
        "import time, pathlib; read = pathlib.Path.read_bytes;"
        "pathlib.Path.read_bytes = lambda path: (time.sleep(0.5), read(path))[1];"
    )
    run(CALL, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path))
    assert run(slow + CALL, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path))[1] == ""


def test_a_warm_start_loads_no_compiler(tmp_path):
    run(CALL, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path))
    loaded = "; print(*sorted({'numba', 'scipy'} & set(sys.modules)))"
    assert len(run(CALL + loaded, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path))[0]) == 2


@pytest.mark.parametrize("body", ["sum([x for x in a[0]])", "a[0, 0]"])
def test_an_entry_is_the_function(tmp_path, monkeypatch, body):
    """Whether it is kept as machine code or, as it allocates a list, by numba."""
    monkeypatch.setenv("CLAMP3D_CACHE", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    source = tmp_path / "sums.py"
    source.write_text(
        "def sums(a, b, n, out):\n"
        "    for i in range(out.shape[0]):\n"
        f"        out[i] = b * {body} + a[i, n]\n"
        "    return a.shape[1] > n\n"
    )
    known: dict = {}
    exec(compile(source.read_text(), str(source), "exec"), known)
    a, out = np.arange(12.0).reshape(3, 4), np.empty(3)
    for _ in range(2):
        made = entry(known["sums"], "b1(f8[:,::1],f8,i8,f8[::1])")
        assert made(a, 0.5, 1, out) is True
        first = 3.0 if "sum" in body else 0.0
        assert out.tolist() == [first + 1.0, first + 5.0, first + 9.0]
        assert isinstance(made, ctypes._CFuncPtr) is (body == "a[0, 0]")
        assert made(a, 0.5, 4, np.empty(0)) is False


def test_a_changed_formula_is_compiled_again(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "clamp3d", ignore=shutil.ignore_patterns("__pycache__"))
    cache = str(tmp_path / "cache")
    assert run(CALL, tmp_path, CLAMP3D_CACHE=cache)[0][0] == "1.5"
    formulas = tmp_path / "clamp3d" / "core" / "kernel_distance.py"
    formulas.write_text(formulas.read_text().replace("return (R - r) - ", "return 100.0 + (R - r) - "))
    assert run(CALL, tmp_path, CLAMP3D_CACHE=cache)[0][0] == "101.5"


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX permissions")
def test_no_place_for_a_cache(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "clamp3d", ignore=shutil.ignore_patterns("__pycache__"))
    # A file where the cache folders would be: that stops even root, whom permissions do not.
    (tmp_path / "clamp3d" / "core" / "__pycache__").write_text("")
    (tmp_path / "home").write_text("")
    (tmp_path / "clamp3d").chmod(stat.S_IRUSR | stat.S_IXUSR)
    home = str(tmp_path / "home")
    env = {"HOME": home, "XDG_CACHE_HOME": home, "CLAMP3D_CACHE": "", "PYTHONDONTWRITEBYTECODE": "1"}
    out, said = run(CALL, tmp_path, **env)
    (tmp_path / "clamp3d").chmod(stat.S_IRWXU)
    assert out[0] == "1.5"
    assert said.count("\n") == 1
    assert "compiling the contact kernel, in every run: no cache folder can be written, CLAMP3D_CACHE names one" in said


def test_import_is_light():
    code = (
        "import sys, clamp3d, clamp3d.core.distance, clamp3d.core.pieces, clamp3d.core.relation3d;"
        "print(sorted({'numba', 'scipy', 'trimesh', 'fcl'} & set(sys.modules)))"
    )
    assert run(code, PACKAGE.parent)[0] == ["[]"]
