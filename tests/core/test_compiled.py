"""The compiled kernel's start: cached on disk, announced when it is cold, and never an error without a cache."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

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
    cold, said = run(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=str(tmp_path))
    warm, silent = run(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=str(tmp_path))
    assert cold[0] == warm[0] == "1.5"
    assert said.count("compiling the contact kernel") == 1
    assert silent == ""
    assert float(warm[1]) < 0.5 * float(cold[1])  # seconds of CPU: 0.5 and 4.5 on an idle machine


@pytest.mark.parametrize(
    "damage", [lambda b: b"", lambda b: b[: len(b) // 2], lambda b: b[::-1]], ids=["empty", "cut short", "garbage"]
)
def test_damaged_cache_files_are_written_anew(tmp_path, damage):
    cache = str(tmp_path)
    run(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=cache)
    index, data = sorted(tmp_path.rglob("*.nbi"))[0], sorted(tmp_path.rglob("*.nbc"))[-1]  # of two functions
    for file in (index, data):
        file.write_bytes(damage(file.read_bytes()))
    out, said = run(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=cache)
    assert out[0] == "1.5"
    assert said.count("\n") == 1
    assert "compiling the contact kernel" in said
    assert run(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=cache)[1] == ""


def test_reading_the_cache_is_not_announced_however_slow_it_is(tmp_path):
    slow = (
        "import time, pickle; load = pickle.loads; pickle.loads = lambda *a, **k: (time.sleep(1.2), load(*a, **k))[1];"
    )
    run(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=str(tmp_path))
    assert run(slow + CALL, PACKAGE.parent, NUMBA_CACHE_DIR=str(tmp_path))[1] == ""


def test_a_changed_formula_is_compiled_again(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "clamp3d", ignore=shutil.ignore_patterns("__pycache__"))
    cache = str(tmp_path / "cache")
    assert run(CALL, tmp_path, NUMBA_CACHE_DIR=cache)[0][0] == "1.5"
    formulas = tmp_path / "clamp3d" / "core" / "kernel_distance.py"
    formulas.write_text(formulas.read_text().replace("return (R - r) - ", "return 100.0 + (R - r) - "))
    assert run(CALL, tmp_path, NUMBA_CACHE_DIR=cache)[0][0] == "101.5"


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX permissions")
def test_no_place_for_a_cache(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "clamp3d", ignore=shutil.ignore_patterns("__pycache__"))
    # A file where the cache folders would be: that stops even root, whom permissions do not.
    (tmp_path / "clamp3d" / "core" / "__pycache__").write_text("")
    (tmp_path / "home").write_text("")
    (tmp_path / "clamp3d").chmod(stat.S_IRUSR | stat.S_IXUSR)
    home = str(tmp_path / "home")
    out, _ = run(CALL, tmp_path, HOME=home, XDG_CACHE_HOME=home, PYTHONDONTWRITEBYTECODE="1")
    (tmp_path / "clamp3d").chmod(stat.S_IRWXU)
    assert out[0] == "1.5"


def test_import_is_light():
    code = (
        "import sys, clamp3d, clamp3d.core.distance, clamp3d.core.pieces, clamp3d.core.relation3d;"
        "print(sorted({'numba', 'scipy', 'trimesh', 'fcl'} & set(sys.modules)))"
    )
    assert run(code, PACKAGE.parent)[0] == ["[]"]
