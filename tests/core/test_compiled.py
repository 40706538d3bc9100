"""The compiled kernel's start: cached on disk, announced when it is cold, and never an error without a cache."""

import ctypes
import importlib.util
import os
import shutil
import stat
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from clamp3d.core import jit

PACKAGE = Path(__file__).parents[2] / "clamp3d"
LOADED = "print(*sorted({'numba', 'scipy'} & set(sys.modules)))"
CALL = (
    "import sys, numpy as np; from clamp3d.kernel import *;"
    f"print(signed_distance(SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0), np.eye(4)).distance); {LOADED}"
)
PLAY = f"import sys, clamp3d.core.play; {LOADED}"


def run(code: str, folder: Path, **env: str) -> tuple[list[str], str]:
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(folder), **env},
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
        timeout=600,
    )
    return done.stdout.split(), done.stderr


FACES = f"import sys, clamp3d.collide.faces_kernel as k; print(bool(k.descend)); {LOADED}"


@pytest.mark.parametrize(("code", "says"), [(CALL, "1.5"), (FACES, "True")])
def test_a_warm_start_of_the_kernel_loads_no_compiler(code, says):
    run(code, PACKAGE.parent)
    assert run(code, PACKAGE.parent) == ([says], "")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("CLAMP3D_CACHE", str(tmp_path))
    jit._say.cache_clear()
    return tmp_path


def sums(folder: Path, body: str) -> object:
    """A small entry point, from the cache or compiled."""
    source = folder / "sums.py"
    text = (
        "def sums(a, b, n, out):\n"
        "    for i in range(out.shape[0]):\n"
        f"        out[i] = b * {body} + a[i, n]\n"
        "    return a.shape[1] > n\n"
    )
    if not source.exists():  # numba's cache knows a file by its time too
        source.write_text(text)
    known: dict = {"__name__": __name__}  # numba imports a function's module before it reads its cache
    exec(compile(source.read_text(), str(source), "exec"), known)
    return jit.entry(known["sums"], "b1(f8[:,::1],f8,i8,f8[::1])")


def check(made, first: float) -> None:
    a, out = np.arange(12.0).reshape(3, 4), np.empty(3)
    assert made(a, 0.5, 1, out) is True
    assert out.tolist() == [first + 1.0, first + 5.0, first + 9.0]
    assert made(a, 0.5, 4, np.empty(0)) is False


def test_an_entry_is_the_function_and_kept_as_machine_code(folder, capsys):
    for said in (1, 0):
        jit._say.cache_clear()
        made = sums(folder, "a[0, 0]")
        check(made, 0.0)
        assert isinstance(made, ctypes._CFuncPtr)
        assert capsys.readouterr().err.count("compiling the contact kernel, once for this machine") == said


def test_a_formula_that_allocates_is_kept_by_numba(tmp_path):
    """In processes of their own: numba cannot pickle a function where it has read others that allocate."""
    code = (
        "from pathlib import Path; from tests.core.test_compiled import check, sums\n"
        f"made = sums(Path({str(tmp_path)!r}), 'sum([x for x in a[0]])'); check(made, 3.0); print(type(made).__name__)"
    )
    first, second = (
        run(code, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path), NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)
    )
    assert first[0] == second[0] == ["CPUDispatcher"]
    assert first[1].count("compiling the contact kernel, once for this machine") == 1
    assert second[1] == ""
    (index,) = tmp_path.rglob("*.nbi")
    index.write_bytes(index.read_bytes()[::-1])
    again = run(code, PACKAGE.parent, CLAMP3D_CACHE=str(tmp_path), NUMBA_CACHE_DIR=str(tmp_path))
    assert (again[0], again[1].count("\n")) == (["CPUDispatcher"], 1)


@pytest.mark.parametrize(
    "damage", [lambda b: b"", lambda b: b[: len(b) // 2], lambda b: b[::-1]], ids=["empty", "cut short", "garbage"]
)
def test_damaged_cache_files_are_written_anew(folder, capsys, damage):
    sums(folder, "a[0, 0]")
    (file,) = folder.glob("kernel-*.o")
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    check(sums(folder, "a[0, 0]"), 0.0)
    assert jit._read(file) is not None
    capsys.readouterr()
    jit._say.cache_clear()
    check(sums(folder, "a[0, 0]"), 0.0)
    assert capsys.readouterr().err == ""


def test_reading_the_cache_is_not_announced_however_slow_it_is(folder, capsys, monkeypatch):
    sums(folder, "a[0, 0]")
    capsys.readouterr()
    read = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: (time.sleep(0.5), read(path))[1])
    jit._say.cache_clear()
    check(sums(folder, "a[0, 0]"), 0.0)
    assert capsys.readouterr().err == ""


@pytest.fixture
def copied(tmp_path):
    """A copy of the package with a formula and, in another file, an entry point: quicker to compile than the kernel."""
    shutil.copytree(PACKAGE, tmp_path / "clamp3d", ignore=shutil.ignore_patterns("__pycache__"))
    core = tmp_path / "clamp3d" / "core"
    (core / "spare.py").write_text("SPARE = 0.0\n")
    formula = "@formula\ndef play(R, r):\n    return R - r + SPARE\n"
    imported = "from clamp3d.core.jit import formula\nfrom clamp3d.core.spare import SPARE\n"
    (core / "kernel_play.py").write_text(imported + formula)
    (core / "play.py").write_text(
        "from clamp3d.core.jit import entry\nfrom clamp3d.core.kernel_play import play\n"
        "def plays(R, r):\n    return play(R, r)\n"
        "print(entry(plays, 'f8(f8,f8)')(12.0, 10.5))\n"
    )
    return tmp_path


def test_compiled_once_and_again_when_a_formula_or_a_constant_has_changed(copied):
    cache = str(copied / "cache")
    cold, said = run(PLAY, copied, CLAMP3D_CACHE=cache)
    assert (cold[0], "numba" in cold) == ("1.5", True)
    assert said.count("compiling the contact kernel") == 1
    assert run(PLAY, copied, CLAMP3D_CACHE=cache) == (["1.5"], "")
    formulas = copied / "clamp3d" / "core" / "kernel_play.py"
    formulas.write_text(formulas.read_text().replace("return R", "return 100.0 + R"))
    assert run(PLAY, copied, CLAMP3D_CACHE=cache)[0][0] == "101.5"
    (copied / "clamp3d" / "core" / "spare.py").write_text("SPARE = 50.0\n")
    assert run(PLAY, copied, CLAMP3D_CACHE=cache)[0][0] == "151.5"


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX permissions")
def test_no_place_for_a_cache(copied):
    # A file where the cache folders would be: that stops even root, whom permissions do not.
    (copied / "clamp3d" / "core" / "__pycache__").write_text("")
    (copied / "home").write_text("")
    (copied / "clamp3d").chmod(stat.S_IRUSR | stat.S_IXUSR)
    home = str(copied / "home")
    env = {"HOME": home, "XDG_CACHE_HOME": home, "CLAMP3D_CACHE": "", "PYTHONDONTWRITEBYTECODE": "1"}
    out, said = run(PLAY, copied, **env)
    (copied / "clamp3d").chmod(stat.S_IRWXU)
    assert out[0] == "1.5"
    assert said.count("\n") == 1
    assert "compiling the contact kernel, in every run: no cache folder can be written, CLAMP3D_CACHE names one" in said


def test_import_is_light():
    code = (
        "import sys, clamp3d, clamp3d.core.distance, clamp3d.core.pieces, clamp3d.core.relation3d;"
        "print(sorted({'numba', 'scipy', 'trimesh', 'fcl'} & set(sys.modules)))"
    )
    assert run(code, PACKAGE.parent)[0] == ["[]"]


def test_the_version_of_numba_is_that_of_its_folder(tmp_path):
    """Read without importlib.metadata, which is asked where the folders do not tell it."""
    installed = metadata.version("numba")
    assert jit._numba(Path(importlib.util.find_spec("numba").origin).parents[1]) == installed
    (tmp_path / "numba-1.2.3.dist-info").mkdir()
    assert jit._numba(tmp_path) == "1.2.3"
    (tmp_path / "numba-1.2.4.dist-info").mkdir()
    assert jit._numba(tmp_path) == jit._numba(tmp_path / "none") == installed
