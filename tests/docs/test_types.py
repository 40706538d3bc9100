"""A user's script sees the real types: mypy --strict on it reveals them, and no `Any`."""

import re
import subprocess
import sys
import textwrap
from pathlib import Path

import clamp3d

ROOT = Path(clamp3d.__file__).parents[1]

SCRIPT = """
    import sys
    import clamp3d
    result = clamp3d.check(clamp3d.load_scene("scene.toml"))
    reveal_type(result)
    sys.exit(not result.clean)
"""
CAD = """
    import clamp3d
    assembly = clamp3d.assemble("reference", line="LJ-500")
    reveal_type(assembly)
    clamp3d.export(assembly.scene, "ref.step")
    reveal_type(clamp3d.load("reference"))
"""
DISTANCE = """
    from clamp3d import distance, shapes
    gap = distance(shapes.box((1.0, 2.0, 3.0)), shapes.cylinder(1.0, 2.0))
    reveal_type(gap)
    reveal_type(gap.value)
"""
REVEALED = {
    "script": (SCRIPT, ["clamp3d.collide.result.CheckResult"]),
    "cad": (CAD, ["clamp3d.clamp.result.Assembly", "clamp3d.clamp.dimensions.Clamp | clamp3d.collide.scene.Scene"]),
    "distance": (DISTANCE, ["clamp3d.collide.answer.Distance", "float"]),
}


def test_mypy_sees_what_a_user_gets(tmp_path):
    for name, (script, _) in REVEALED.items():
        (tmp_path / f"{name}.py").write_text(textwrap.dedent(script))
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "mypy",
            "--strict",
            "--config-file=",
            f"--cache-dir={ROOT / '.mypy_cache' / 'user'}",
            ".",
        ],
        cwd=tmp_path,
        env={"MYPYPATH": "", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for name, (_, types) in REVEALED.items():
        found = re.findall(rf'{name}\.py:\d+: note: Revealed type is "(.*)"', done.stdout)
        assert found == types


def test_the_import_costs_next_to_nothing():
    heavy = {"numpy", "numba", "scipy", "trimesh", "fcl", "click", "matplotlib", "msgspec", "rich"}
    code = f"import sys, clamp3d; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_every_public_name_is_what_the_stub_says():
    for name in clamp3d.__all__:
        assert getattr(clamp3d, name) is not None
