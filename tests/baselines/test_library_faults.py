"""Faults of the libraries that this project works around, as they are today.

Each one has two sides: what the project answers in the same place, and what the library answers alone. The second is
written as what would be right and is expected to fail; the day it passes, the library has been mended, this file goes
red, and the guard that its reason names can go. What ends or hangs the interpreter is asked in child processes.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import fcl
import numpy as np
import pytest

from clamp3d.baselines.decomposition import decompose
from clamp3d.baselines.fcl_shapes import bvh, convex
from clamp3d.baselines.wedges import prism
from clamp3d.bench.compare.scene import grooved_block
from clamp3d.core.meshing import mesh
from clamp3d.core.pose import Array, rotation, translation
from clamp3d.core.primitives import SweptArc
from clamp3d.errors import InputError

BOX = prism(np.array([[-20.0, -10.0], [20.0, -10.0], [20.0, 10.0], [-20.0, 10.0]]), -25.0, 25.0)
GROOVE = SweptArc(12.0, math.radians(70.0), 60.0)


def mended(library: str, fault: str, guard: str) -> pytest.MarkDecorator:
    """The mark of a test that says what a library should do and does not."""
    reason = f"{library}: {fault}; when this passes the library has mended it: {guard} can go"
    return pytest.mark.xfail(strict=True, raises=AssertionError, reason=reason)


def at(geometry: object, T: Array | None = None) -> object:
    T = np.eye(4) if T is None else T
    return fcl.CollisionObject(geometry, fcl.Transform(np.ascontiguousarray(T[:3, :3]), T[:3, 3].copy()))


def bare_distance(a: object, b: object, **request: object) -> float:
    return float(fcl.distance(a, b, fcl.DistanceRequest(**request), fcl.DistanceResult()))


def depths(a: object, b: object, **request: object) -> list[float]:
    result = fcl.CollisionResult()
    fcl.collide(a, b, fcl.CollisionRequest(num_max_contacts=1000, enable_contact=True, **request), result)
    return [contact.penetration_depth for contact in result.contacts]


@mended("FCL", "an open or inside-out 'convex' shape passes", "the checks of baselines.fcl_shapes.convex")
@pytest.mark.parametrize("faces", [BOX[1][:2], BOX[1][:, ::-1]])
def test_bare_convex_shape_that_is_none(faces: Array) -> None:
    encoded = np.column_stack([np.full(len(faces), 3), faces]).ravel()
    assert _refused(lambda: bare_distance(at(fcl.Convex(BOX[0], len(faces), encoded)), at(fcl.Sphere(1.0))))


@mended("FCL", "tolerances are absolute, made for no unit", "UNIT and MIN_SIZE in baselines.fcl_shapes")
def test_bare_distance_in_metres() -> None:
    rng, gap, worst = np.random.default_rng(0), 5e-5, 0.0
    for _ in range(1000):
        place, angle = rotation(rng.normal(size=3), rng.uniform(-3.0, 3.0)), rng.uniform(0.1, 1.5)
        other = place @ translation(0.02 + gap, 0.0, 0.0) @ rotation([1.0, 0.0, 0.0], angle)
        other = other @ translation(0.0, 0.0, rng.uniform(-0.05, 0.05))
        found = bare_distance(at(fcl.Cylinder(0.01, 0.2), place), at(fcl.Cylinder(0.01, 0.2), other))
        worst = max(worst, abs(found - gap))
    assert worst < 0.01 * gap


@dataclass(frozen=True)
class Child:
    """How a child ended: ``code`` None if it had to be stopped, ``said`` its lines of JSON."""

    code: int | None
    said: list[object]


_FCL = """
import numpy as np, fcl
def ask(model):
    wire = fcl.CollisionObject(fcl.Cylinder(7.0, 50.0), fcl.Transform())
    return fcl.distance(fcl.CollisionObject(model, fcl.Transform()), wire, fcl.DistanceRequest(), fcl.DistanceResult())
def model(V, F):
    m = fcl.BVHModel()
    m.beginModel(len(F), len(V))
    m.addSubModel(V, F)
    m.endModel()
    return m
print('= "ready"', flush=True)
V = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
"""
_COACD = """
import numpy as np, coacd
coacd.set_log_level("off")
V, F = np.array(VERTICES), np.array(FACES)
def ask(V, F, **more):
    return [hull[0].tolist() for hull in coacd.run_coacd(coacd.Mesh(V, F), **more)]
print('= "ready"', flush=True)
"""
_QUESTIONS = {
    "fcl empty": _FCL + "answer(lambda: ask(fcl.BVHModel()))",
    "fcl index": _FCL + "answer(lambda: ask(model(V, np.array([[0, 1, 2**31 - 1]]))))",
    "fcl touching": _FCL
    + """
V = np.array([[x, y, z] for x in (-20.0, 20.0) for y in (-10.0, 10.0) for z in (-25.0, 25.0)])
F = [[0,1,3],[0,3,2],[4,6,7],[4,7,5],[0,4,5],[0,5,1],[2,3,7],[2,7,6],[0,2,6],[0,6,4],[1,5,7],[1,7,3]]
box = fcl.CollisionObject(fcl.Convex(V, 12, np.column_stack([np.full(12, 3), F]).ravel()), fcl.Transform())
rng = np.random.default_rng(0)
def touch():
    for _ in range(3000):
        r, length, off = rng.uniform(0.5, 30.0), rng.uniform(1.0, 300.0), rng.choice([0.0, 1e-14, 1e-12, 1e-9, 1e-6])
        c, s = np.cos(t := rng.uniform(-3.0, 3.0)), np.sin(t)
        place = fcl.Transform(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
                              np.array([rng.uniform(-18.0, 18.0), 10.0 + r + off * rng.uniform(-1.0, 1.0), 1.0]))
        wire = fcl.CollisionObject(fcl.Cylinder(r, length), place)
        fcl.distance(box, wire, fcl.DistanceRequest(enable_signed_distance=True), fcl.DistanceResult())
answer(touch)
""",
    "coacd nan": _COACD + "V[0, 0] = np.nan\nanswer(lambda: ask(V, F))",
    "coacd empty": _COACD + "answer(lambda: ask(V[:0], F[:0]))",
    "coacd index": _COACD + "F[0, 0] = 2**30\nanswer(lambda: ask(V, F))",
    "coacd": _COACD
    + """
answer(lambda: ask(V, F[:, ::-1]))
answer(lambda: ask(V, F, preprocess_mode="of"))
for R in np.array(TURNS):
    answer(lambda: ask(V @ R.T, F, threshold=0.1))
""",
}
TURNS = [rotation([1.0, 2.0, 3.0], angle)[:3, :3] for angle in (0.0, 0.3, 0.6)]
BLOCK = mesh(grooved_block(GROOVE, width=137.0, depth=30.0), 0.3)
_ANSWER = """
import json
def answer(ask):
    try:
        found = ask()
    except Exception as error:
        found = "refused"
    print("=", json.dumps(found), flush=True)
"""


def _run(code: str, limit: float) -> Child:
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        out, _ = child.communicate(timeout=limit)
        ended: int | None = child.returncode
    except subprocess.TimeoutExpired:
        child.kill()
        out, _ = child.communicate()
        ended = None
    return Child(ended, [json.loads(line[2:]) for line in out.splitlines() if line.startswith("= ")])


@pytest.fixture(scope="module")
def children() -> dict[str, Child]:
    mesh_text = {"VERTICES": BLOCK.vertices, "FACES": BLOCK.faces, "TURNS": np.array(TURNS)}
    code = {name: _ANSWER + text for name, text in _QUESTIONS.items()}
    for word, array in mesh_text.items():
        code = {name: text.replace(word, repr(array.tolist())) for name, text in code.items()}
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(code, pool.map(_run, code.values(), [60.0] * len(code)), strict=True))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("fcl empty", marks=mended("FCL", "an empty mesh ends the interpreter", "core.mesh.closed_mesh")),
        pytest.param("fcl index", marks=mended("FCL", "so does an index out of range", "core.mesh.closed_mesh")),
        pytest.param("fcl touching", marks=mended("FCL", "EPA aborts on touching poses", "fcl_shapes' thinner cores")),
        pytest.param("coacd nan", marks=mended("CoACD", "a vertex nan ends the interpreter", "core.mesh.closed_mesh")),
        pytest.param("coacd empty", marks=mended("CoACD", "so does an empty mesh (CoACD#68)", "core.mesh.closed_mesh")),
        pytest.param("coacd index", marks=mended("CoACD", "so does an index out of range", "core.mesh.closed_mesh")),
    ],
)
def test_interpreter_lives_on(name: str, children: dict[str, Child]) -> None:
    assert children[name].code == 0
    assert len(children[name].said) == 2


def test_children_start(children: dict[str, Child]) -> None:
    assert {child.said[0] for child in children.values()} == {"ready"}


def _bad_meshes() -> dict[str, tuple[Array, Array, str]]:
    V, F = BOX
    nan, index = V.copy(), F.copy()
    nan[3, 1], index[5, 2] = np.nan, 2**31 - 1
    return {
        "empty": (V[:0], F[:0], "must not be empty"),
        "nan": (nan, F, r"vertices must be finite, got nan at \[3, 1\]"),
        "index": (V, index, "face index 2147483647 is out of range"),
        "inverted": (V, F[:, ::-1], "may be inside out"),
    }


@pytest.mark.parametrize("name", _bad_meshes())
@pytest.mark.parametrize("read", [bvh, convex, decompose])
def test_meshes_that_end_a_library_are_refused_before(name: str, read: object) -> None:
    V, F, rule = _bad_meshes()[name]
    with pytest.raises(InputError, match=rule):
        read(V, F)  # type: ignore[operator]


@mended("CoACD", "a mesh that is inside out passes (CoACD#63)", "core.mesh.closed_mesh in decompose")
def test_bare_coacd_inside_out(children: dict[str, Child]) -> None:
    assert children["coacd"].said[1] == "refused"


@mended("CoACD", "an unknown preprocess_mode passes", "the checks of DecompositionParameters")
def test_bare_coacd_unknown_mode(children: dict[str, Child]) -> None:
    assert children["coacd"].said[2] == "refused"


@mended("CoACD", "its answer depends on the orientation of the mesh", "that warning in contact.decomposition")
def test_bare_coacd_turned(children: dict[str, Child]) -> None:
    assert len({len(parts) for parts in _turned(children)}) == 1


def _turned(children: dict[str, Child]) -> list[list[list[list[float]]]]:
    return children["coacd"].said[3:]  # type: ignore[return-value]


def _refused(ask: object) -> bool:
    try:
        ask()  # type: ignore[operator]
    except Exception:
        return True
    return False
