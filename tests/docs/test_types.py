"""A user's script sees the real types: mypy --strict on it reveals them, and no `Any`."""

import re

from tests.docs.project import ROOT, python

SCRIPT = """
import clamp3d
from clamp3d import distance, shapes
result = clamp3d.check(clamp3d.load_scene("scene.toml"))
reveal_type(result)
assembly = clamp3d.assemble("reference", line="LJ-500")
reveal_type(assembly)
clamp3d.export(assembly.scene, "ref.step")
reveal_type(clamp3d.load("reference"))
gap = distance(shapes.box((1.0, 2.0, 3.0)), shapes.cylinder(1.0, 2.0))
reveal_type(gap)
reveal_type(gap.value)
"""
REVEALED = [
    "clamp3d.engine.result.CheckResult",
    "clamp3d.clamp.result.Assembly",
    "clamp3d.clamp.dimensions.Clamp | clamp3d.engine.scene.Scene",
    "clamp3d.engine.answer.Distance",
    "float",
]


def test_mypy_sees_what_a_user_gets(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    cache = f"--cache-dir={ROOT / '.mypy_cache' / 'user'}"
    done = python("-m", "mypy", "--strict", "--config-file=", cache, "script.py", cwd=tmp_path, MYPYPATH="")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.findall(r'note: Revealed type is "(.*)"', done.stdout) == REVEALED


def test_the_import_costs_next_to_nothing():
    heavy = {"numpy", "numba", "scipy", "trimesh", "fcl", "click", "matplotlib", "msgspec", "rich"}
    code = f"import sys, clamp3d; print(sorted({heavy} & set(sys.modules)))"
    assert python("-c", code).stdout == "[]\n"
