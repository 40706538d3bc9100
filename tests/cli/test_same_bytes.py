"""The same bytes everywhere: results do not depend on the kernels of BLAS and NumPy, on cores or on threads."""

import ast
import os
import platform
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

PROGRAM = """
import json, os, tempfile
from pathlib import Path
from clamp3d.cli import group

for command in (
    ["run", "--quiet"], ["tolerance", "--n", "2", "--quiet"], ["sweep", "--steps", "3"],
    ["check", "examples/v-block/scene.toml", "--quiet"], ["check", "examples/hinge/scene.toml", "--quiet"],
):
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out.json")
        group.main([*command, "--json", str(out)], standalone_mode=False)
        found = json.loads(out.read_text(encoding="utf-8"))
    found.get("work", {}).pop("seconds", None)
    print("RESULT", json.dumps(found))
"""
FOLDERS = ("core", "brep", "fit", "collide", "baselines", "clamp", "scenefile")
UNORDERED = {"svd", "eigh", "eigvalsh", "eigvals", "eig", "inv", "pinv", "solve", "lstsq", "cholesky", "qr"}
"""Of numpy.linalg; `det` is asked for its sign only, `norm` is a sum of NumPy's own where it has an axis."""


@cache
def results(**environment):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT")]
    assert len(lines) == 5
    return lines


def features(*wanted):
    """Skips where this processor lacks something, or NumPy's BLAS is not OpenBLAS for x86."""
    from numpy._core._multiarray_umath import __cpu_features__ as known

    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]["name"]
    if "openblas" not in blas or platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip(f"NumPy's BLAS is {blas} on {platform.machine()}: nothing to choose")
    if lacking := [name for name in wanted if not known[name]]:
        pytest.skip(f"this processor has no {', '.join(lacking)}")


ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
PLAIN = "X86_V3 X86_V4 AVX512_ICL AVX512_SPR AVX2 FMA3 AVX512F"
"""What NumPy is to do without: its kernels for SSE then."""


@pytest.mark.parametrize(
    ("core", "needed", "others"),
    [
        ("Nehalem", ("AVX2",), {"NPY_DISABLE_CPU_FEATURES": PLAIN}),
        ("Haswell", ("AVX2", "FMA3"), {}),
        ("SkylakeX", ("AVX512F", "AVX512_SKX"), ONE_THREAD),  # its own kernels, where a processor has them
    ],
)
def test_results_do_not_depend_on_the_kernels_of_blas_and_numpy(core, needed, others):
    features(*needed)
    assert results(OPENBLAS_CORETYPE=core, **others) == results()


def test_results_do_not_depend_on_threads():
    from numpy._core._multiarray_umath import __cpu_features__ as known

    # Where the kernels are those of SkylakeX anyway, they are named, as above: that run serves for both.
    own = {"OPENBLAS_CORETYPE": "SkylakeX"} if known.get("AVX512_SKX") else {}
    assert results(**own, **ONE_THREAD) == results()


def test_what_depends_on_the_processor_is_not_called():
    """What the runs above do not reach: products and decompositions by BLAS, NumPy's own approximations (sine, cosine
    and square root are the same on all), and sorts that leave the order of equal values open."""
    root = Path(__file__).parent.parent.parent / "clamp3d"
    found = []
    for path in sorted(path for name in FOLDERS for path in (root / name).glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            product = isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult)
            called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
            flat = called == "np.linalg.norm" and len(node.args) == 1 and not node.keywords
            other = called in {f"np.linalg.{name}" for name in UNORDERED} | {"np.dot", "np.matmul"}
            order = called == "np.argsort" and 'kind="stable"' not in ast.unparse(node).replace("'", '"')
            approximate = called in {
                f"np.{name}" for name in ("tan", "arctan", "arctan2", "arcsin", "arccos", "exp", "log")
            }
            if product or flat or other or order or approximate:
                found.append(f"{path.name}:{node.lineno}: {ast.unparse(node)}")
    assert not found, "not the same bits on every processor (see clamp3d.core.linear): " + "; ".join(found)
