"""The compiled kernel's start: kept by numba, announced when it is compiled, and never an error without a cache."""

import shutil
from pathlib import Path

import pytest

from tests.docs.project import ROOT, python

PACKAGE = ROOT / "clamp3d"
GAME = """
from clamp3d.kernel.jit import formula

@formula
def play(R, r):
    return R - r
"""
PLAY = """
from clamp3d.kernel.game import play
from clamp3d.kernel.jit import entry

@entry('float64(float64, float64)')
def plays(R, r):
    return play(R, r)
"""


def run(code: str, folder: Path, **env: str) -> tuple[list[str], str]:
    done = python("-c", code, cwd=folder, PYTHONPATH=str(folder), **env)
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


@pytest.fixture
def copied(tmp_path):
    """A copy of the package with a kernel that is quick to compile."""
    shutil.copytree(PACKAGE, tmp_path / "clamp3d", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "clamp3d" / "kernel" / "play.py").write_text(PLAY)
    (tmp_path / "clamp3d" / "kernel" / "game.py").write_text(GAME)
    return tmp_path


CALL = "from clamp3d.kernel.play import plays; print(plays(12.0, 10.5))"


def test_a_kernel_is_compiled_once_and_says_so(copied):
    cache = str(copied / "cache")
    out, said = run(CALL, copied, NUMBA_CACHE_DIR=cache)
    assert (out, said.count("compiling the contact kernel, once for this version")) == (["1.5"], 1)
    assert run(CALL, copied, NUMBA_CACHE_DIR=cache) == (["1.5"], "")
    # A formula of another file than the kernel's own.
    (copied / "clamp3d" / "kernel" / "game.py").write_text(GAME.replace("R - r", "R + r"))
    assert run(CALL, copied, NUMBA_CACHE_DIR=cache)[0] == ["22.5"]


def test_a_kernel_works_without_a_place_for_the_cache(copied):
    # A file where the cache folders would be: that stops even root, whom permissions do not.
    (copied / "clamp3d" / "kernel" / "__pycache__").write_text("")
    (copied / "home").write_text("")
    home = str(copied / "home")
    env = {"HOME": home, "XDG_CACHE_HOME": home, "NUMBA_CACHE_DIR": "", "PYTHONDONTWRITEBYTECODE": "1"}
    out, said = run(CALL, copied, **env)
    assert (out, said.count("\n")) == (["1.5"], 1)
    assert "compiling the contact kernel in every run: set NUMBA_CACHE_DIR to a folder that can be written" in said
