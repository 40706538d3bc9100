"""What a command imports: a plain one must answer at once, and libraries that it does not use take their time."""

import os
import subprocess
import sys

import pytest
import trimesh

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


@pytest.mark.parametrize("arguments", [("check", "scene.toml"), ("check", "scene.glb"), ("run", "-q")])
def test_slow_libraries_are_not_imported(arguments, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    meshes = trimesh.Scene()
    for z in (0.0, 0.0205):
        pose = trimesh.transformations.translation_matrix([0.0, 0.0, z])
        meshes.add_geometry(trimesh.creation.cylinder(0.01, 0.02), transform=pose)
    meshes.export(tmp_path / "scene.glb")
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
    assert not modules & SLOW
