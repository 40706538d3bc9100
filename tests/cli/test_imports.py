"""What a command imports: a plain one must answer at once, and libraries that it does not use take their time."""

import os
import subprocess
import sys

import pytest

SCENE = """
[parts.a]
shape = "box"
size = [10, 10, 10]
[parts.b]
shape = "cylinder"
radius = 4
length = 10
pose = { translation = [20, 0, 0], rpy_deg = [0, 90, 10] }
"""
SLOW = {"igl", "matplotlib", "networkx", "numba", "OCP", "scipy", "shapely", "skimage", "trimesh"}


@pytest.mark.parametrize(("arguments", "needed"), [(("check", "scene.toml"), set()), (("run", "-q"), set())])
def test_slow_libraries_are_not_imported(arguments, needed, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    code = (
        "import atexit, sys; from clamp3d.cli import main\n"
        "atexit.register(lambda: print('MODULES', *sys.modules))\n"
        "main()"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    for _ in range(2):  # the first one may have to compile
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True, cwd=tmp_path, env=env
        )
    modules = {name.partition(".")[0] for name in done.stdout.partition("MODULES")[2].split()}
    assert "numpy" in modules
    assert modules & SLOW == needed
