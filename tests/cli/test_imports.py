"""What a command imports: a plain one must answer at once, and libraries that it does not use take their time."""

import os
import subprocess
import sys
from pathlib import Path

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
SLOW = {"matplotlib", "networkx", "numba", "OCP", "rtree", "scipy", "shapely", "skimage", "trimesh"}
PARTS = {"importlib.metadata", "numpy.ma"}
"""Of libraries that are used, what takes longer to load than it is worth."""


@pytest.mark.parametrize("arguments", [("check", "scene.toml"), ("check", "scene.glb"), ("run", "-q")])
def test_slow_libraries_are_not_imported(arguments, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    meshes = trimesh.Scene()
    for z in (0.0, 0.0205):
        pose = trimesh.transformations.translation_matrix([0.0, 0.0, z])
        meshes.add_geometry(trimesh.creation.cylinder(0.01, 0.02), transform=pose)
    meshes.export(tmp_path / "scene.glb")
    found = imported(arguments, tmp_path)
    modules = {name.partition(".")[0] for name in found}
    assert "numpy" in modules
    assert not modules & SLOW
    assert not found & PARTS


@pytest.mark.parametrize("text", [False, True])
def test_fitted_stl_files_are_checked_without_slow_libraries(text, tmp_path):
    """The hinge: its meshes are read, their round surfaces found, and a clash on the way is measured."""
    hinge = Path(__file__).parents[2] / "examples" / "hinge"
    (tmp_path / "scene.toml").write_text((hinge / "scene.toml").read_text())
    for file in hinge.glob("*.stl"):
        made = trimesh.load(file, process=False)
        (tmp_path / file.name).write_bytes(
            trimesh.exchange.stl.export_stl_ascii(made).encode() if text else file.read_bytes()
        )
    found = imported(("check", "scene.toml", "--quiet"), tmp_path, 1)
    assert "clamp3d.fit.fit" in found
    assert {name.partition(".")[0] for name in found} & SLOW <= {"shapely"}
    assert not found & PARTS


def imported(arguments, folder, code=0):
    """Names of the modules that a command of this exit code has imported when it is run again."""
    program = (
        "import atexit, sys; from clamp3d.cli import main\n"
        "atexit.register(lambda: print('MODULES', *sys.modules))\n"
        "main()"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    for _ in range(2):  # the first one may have to compile
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments],
            capture_output=True,
            text=True,
            check=False,
            cwd=folder,
            env=env,
        )
        assert done.returncode == code, done.stderr
    return set(done.stdout.partition("MODULES")[2].split())
