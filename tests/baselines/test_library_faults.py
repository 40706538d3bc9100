"""Faults of the libraries that this project works around, as they are today.

Each one has two sides: what the project answers in the same place, and what the library answers alone. The second is
written as what would be right and is expected to fail; the day it passes, the library has been mended, this file goes
red, and the guard that its reason names can go. What ends or hangs the interpreter is asked in child processes.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import fcl
import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

import clamp3d
from clamp3d.baselines.decomposition import decompose
from clamp3d.baselines.fcl_shapes import Wire, bvh, convex, distance
from clamp3d.baselines.wedges import prism
from clamp3d.bench.compare.scene import grooved_block
from clamp3d.core import shapes
from clamp3d.core.meshing import mesh
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array, check_pose_array, rotation, translation
from clamp3d.core.primitives import Cylinder, SweptArc
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


def bare_mesh(vertices: Array, faces: Array) -> object:
    model = fcl.BVHModel()
    model.beginModel(len(faces), len(vertices))
    model.addSubModel(vertices, faces)
    model.endModel()
    return model


def bare_distance(a: object, b: object, **request: object) -> float:
    return float(fcl.distance(a, b, fcl.DistanceRequest(**request), fcl.DistanceResult()))


def depths(a: object, b: object, **request: object) -> list[float]:
    result = fcl.CollisionResult()
    fcl.collide(a, b, fcl.CollisionRequest(num_max_contacts=1000, enable_contact=True, **request), result)
    return [contact.penetration_depth for contact in result.contacts]


# --- FCL: meshes ------------------------------------------------------------------------------------------------------


@mended("FCL", "a mesh has no inside (fcl#492)", "contact.fcl_shapes.contained, scene.trimodel.inside")
def test_wire_inside_the_wall_of_a_bare_mesh() -> None:
    wall, wire = at(bare_mesh(*BOX)), at(fcl.Cylinder(2.0, 10.0), translation(11.0, 3.0, 5.0))
    assert bare_distance(wall, wire) < 0.0 or depths(wall, wire)


@mended("FCL", "depth of two meshes is that of some triangles (fcl#491)", "scene.trimodel's booleans")
def test_depth_of_two_bare_meshes() -> None:
    cube = bare_mesh(*_cube(100.0))
    assert max(depths(at(cube), at(cube, translation(99.5, 0.0, 0.0)))) == pytest.approx(0.5, abs=1e-6)


def test_depth_of_two_meshes_in_a_scene_is_the_depth() -> None:
    cube = clamp3d.shapes.MeshShape(clamp3d.shapes.make_mesh(*_cube(100.0)), "off")
    scene = clamp3d.Scene.of({"a": (cube, np.eye(4)), "b": (cube, translation(99.5, 0.0, 0.0))})
    (row,) = clamp3d.check(scene).pairs
    assert row.verdict is clamp3d.Verdict.CLASH
    assert row.distance.lower - 1e-6 <= -0.5 <= row.distance.upper + 1e-6


@mended("FCL", "a signed distance is asked of a mesh and -1 comes back", "contact.fcl_shapes' thinner cores of wires")
def test_signed_distance_of_a_bare_mesh() -> None:
    wire = at(fcl.Cylinder(7.0, 200.0), translation(3.0, 16.98, 0.0))
    assert bare_distance(at(bare_mesh(*BOX)), wire, enable_signed_distance=True) == pytest.approx(-0.02, abs=1e-6)


@mended("FCL", "an open or inside-out 'convex' shape passes", "the checks of contact.fcl_shapes.convex")
@pytest.mark.parametrize("faces", [BOX[1][:2], BOX[1][:, ::-1]])
def test_bare_convex_shape_that_is_none(faces: Array) -> None:
    encoded = np.column_stack([np.full(len(faces), 3), faces]).ravel()
    assert _refused(lambda: bare_distance(at(fcl.Convex(BOX[0], len(faces), encoded)), at(fcl.Sphere(1.0))))


# --- FCL: distances ---------------------------------------------------------------------------------------------------


@mended("FCL", "GST_INDEP's depth of crossed cylinders is worthless", "the default solver in contact.fcl_shapes")
def test_depth_of_crossed_cylinders_by_the_independent_solver() -> None:
    crossed = translation(9.9, 0.0, 0.0) @ rotation([1.0, 0.0, 0.0], math.pi / 2)
    a, b = at(fcl.Cylinder(5.0, 100.0)), at(fcl.Cylinder(5.0, 100.0), crossed)
    (depth,) = depths(a, b, gjk_solver_type=fcl.GJKSolverType.GST_INDEP)
    assert abs(depth) == pytest.approx(0.1, abs=1e-6)


def test_depth_of_crossed_cylinders_in_a_scene() -> None:
    wire = shapes.cylinder(5.0, 100.0)
    crossed = translation(9.9, 0.0, 0.0) @ rotation([1.0, 0.0, 0.0], math.pi / 2)
    (row,) = clamp3d.check(clamp3d.Scene.of({"a": (wire, np.eye(4)), "b": (wire, crossed)})).pairs
    assert row.verdict is clamp3d.Verdict.CLASH
    assert row.distance.lower - 1e-6 <= -0.1 <= row.distance.upper + 1e-6


@mended("FCL", "tolerances are absolute, made for no unit", "UNIT and MIN_SIZE in contact.fcl_shapes")
def test_bare_distance_in_metres() -> None:
    rng, gap, worst = np.random.default_rng(0), 5e-5, 0.0
    for _ in range(1000):
        place, angle = rotation(rng.normal(size=3), rng.uniform(-3.0, 3.0)), rng.uniform(0.1, 1.5)
        other = place @ translation(0.02 + gap, 0.0, 0.0) @ rotation([1.0, 0.0, 0.0], angle)
        other = other @ translation(0.0, 0.0, rng.uniform(-0.05, 0.05))
        found = bare_distance(at(fcl.Cylinder(0.01, 0.2), place), at(fcl.Cylinder(0.01, 0.2), other))
        worst = max(worst, abs(found - gap))
    assert worst < 0.01 * gap


@mended("FCL", "distance() of overlapping shapes is -1 unless the sign is asked for", "contact.fcl_shapes.measure")
def test_bare_distance_of_overlapping_shapes() -> None:
    a, b = at(fcl.Cylinder(7.0, 50.0)), at(fcl.Cylinder(7.0, 50.0), translation(13.9, 0.0, 0.0))
    assert bare_distance(a, b) == pytest.approx(-0.1, abs=1e-6)


@mended("FCL", "a result that is used again keeps its old minimum (fcl#117)", "a new result for each question")
def test_bare_result_used_again() -> None:
    result, ball = fcl.DistanceResult(), fcl.Sphere(1.0)
    for x in (3.0, 10.0):
        fcl.distance(at(ball), at(ball, translation(x, 0.0, 0.0)), fcl.DistanceRequest(), result)
    assert result.min_distance == pytest.approx(8.0)


def test_questions_to_one_shape_do_not_remember_each_other() -> None:
    shape, wire = convex(*BOX), Wire(Cylinder(1.0, 10.0))
    for y, gap in ((12.0, 1.0), (19.0, 8.0)):
        wire.place(translation(0.0, y, 0.0))
        assert distance(shape, wire) == pytest.approx(gap, abs=1e-6)


# --- FCL: values that are none ----------------------------------------------------------------------------------------


@mended("FCL", "a pose that is not a number is 'no collision'", "core.pose.check_pose, check_pose_array")
def test_bare_pose_that_is_no_number() -> None:
    nowhere = at(fcl.Cylinder(7.0, 50.0), np.full((4, 4), np.nan))
    assert _refused(lambda: depths(at(fcl.Cylinder(7.0, 50.0)), nowhere))


@mended("FCL", "a scaled rotation is taken as it is", "core.pose.check_pose, check_pose_array")
def test_bare_pose_that_is_not_rigid() -> None:
    scaled = translation(13.0, 0.0, 0.0) @ np.diag([1.5, 1.5, 1.5, 1.0])
    assert _refused(lambda: bare_distance(at(fcl.Box(10.0, 10.0, 10.0)), at(fcl.Cylinder(7.0, 50.0), scaled)))


@mended("FCL", "a negative radius passes", "the checks of geometry.shapes.Cylinder")
def test_bare_negative_radius() -> None:
    assert _refused(lambda: bare_distance(at(fcl.Box(10.0, 10.0, 10.0)), at(fcl.Cylinder(-7.0, 50.0))))


def test_values_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match=r"radius must be .*> 0.*-7"):
        Cylinder(-7.0, 50.0)
    for pose, rule in ((np.full((4, 4), np.nan), "finite"), (np.diag([1.5, 1.5, 1.5, 1.0]), "rigid")):
        with pytest.raises(InputError, match=rule):
            check_pose_array(pose[None], "wire poses")
        with pytest.raises(InputError, match=rule):
            clamp3d.Scene.of({"wire": (Cylinder(7.0, 50.0), pose)})


# --- FCL: motions -----------------------------------------------------------------------------------------------------


def _sweep(geometry: object, start: Array, end: Array, still: object, T: Array, **request: object) -> bool:
    result, goal = fcl.ContinuousCollisionResult(), fcl.Transform(np.ascontiguousarray(end[:3, :3]), end[:3, 3].copy())
    asked = fcl.ContinuousCollisionRequest(**request)
    fcl.continuousCollide(
        at(geometry, start), goal, at(still, T), fcl.Transform(T[:3, :3], T[:3, 3].copy()), asked, result
    )
    return bool(result.is_collide)


@mended("FCL", "the naive continuous solver takes 10 steps", "geometry.motion and scene.motion")
def test_bare_motion_through_a_thin_plate() -> None:
    ends = translation(0.0, -50.0, 0.0), translation(0.0, 53.7, 0.0)
    naive = fcl.CCDSolverType.CCDC_NAIVE
    assert _sweep(fcl.Sphere(0.1), *ends, fcl.Box(100.0, 1.0, 100.0), np.eye(4), ccd_solver_type=naive)


@mended("python-fcl", "the default continuous motion leaves turning out", "geometry.motion and scene.motion")
def test_bare_motion_that_turns() -> None:
    bar, ball = fcl.Box(20.0, 0.2, 0.2), fcl.Sphere(0.5)
    assert _sweep(bar, np.eye(4), rotation([0.0, 0.0, 1.0], 0.9 * math.pi), ball, translation(0.0, 9.0, 0.0))


def test_motion_through_a_thin_plate_and_a_turn_are_seen() -> None:
    plate, ball = shapes.box([100.0, 1.0, 100.0]), shapes.cylinder(0.1, 0.2)
    scene = clamp3d.Scene.of({"plate": (plate, np.eye(4)), "ball": (ball, translation(0.0, -50.0, 0.0))})
    fly = Motion.translate((0.0, 103.7, 0.0), parts="ball")
    (row,) = clamp3d.check(clamp3d.Scene(scene.parts, motions=(fly,))).motions
    assert row.verdict is clamp3d.Verdict.CLASH
    bar, still = shapes.box([20.0, 0.2, 0.2]), shapes.cylinder(0.5, 0.2)
    scene = clamp3d.Scene.of({"bar": (bar, np.eye(4)), "still": (still, translation(0.0, 9.0, 0.0))})
    turn = Motion.screw((0.0, 0.0, 1.0), parts="bar", angle=0.9 * math.pi)
    (row,) = clamp3d.check(clamp3d.Scene(scene.parts, motions=(turn,))).motions
    assert row.verdict is clamp3d.Verdict.CLASH


# --- trimesh ----------------------------------------------------------------------------------------------------------


@mended("trimesh", "CollisionManager keeps poses in single precision", "FCL's own objects in contact and scene")
def test_collision_manager_of_trimesh_far_from_the_origin() -> None:
    manager, box = trimesh.collision.CollisionManager(), trimesh.creation.box((1.0, 1.0, 1.0))
    manager.add_object("a", box, translation(1e5, 0.0, 0.0))
    manager.add_object("b", box, translation(1e5 + 3.004, 0.0, 0.0))
    assert manager.min_distance_internal() == pytest.approx(2.004, abs=1e-6)


def test_bodies_of_a_scene_far_from_the_origin() -> None:
    box = shapes.box([1.0, 1.0, 1.0])
    places = translation(1e5, 0.0, 0.0), translation(1e5 + 3.004, 0.0, 0.0)
    scene = clamp3d.Scene.of(dict(zip("ab", ((box, T) for T in places), strict=True)), clearance=10.0)
    (row,) = clamp3d.check(scene).pairs
    assert row.distance.value == pytest.approx(2.004, abs=row.distance.uncertainty + 1e-9)


@mended("trimesh", "the volume of a flat mesh divides by zero with a warning", "contact.shells.volume in make_mesh")
def test_volume_of_a_flat_mesh_by_trimesh() -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assert trimesh.Trimesh(BOX[0] * [1.0, 0.0, 1.0], BOX[1], process=False).volume == 0.0
    assert not told


def test_flat_mesh_is_refused() -> None:
    with pytest.raises(InputError, match="encloses no volume"):
        clamp3d.shapes.make_mesh(BOX[0] * [1.0, 0.0, 1.0], BOX[1])


# --- what ends or hangs the interpreter: each in a child --------------------------------------------------------------


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
    "fcl motion": _FCL
    + """
F = [[0,1,3],[0,3,2],[4,6,7],[4,7,5],[0,4,5],[0,5,1],[2,3,7],[2,7,6],[0,2,6],[0,6,4],[1,5,7],[1,7,3]]
def move():
    wire = fcl.CollisionObject(fcl.Cylinder(1.0, 10.0), fcl.Transform(np.eye(3), np.array([0.0, -50.0, 0.0])))
    still = fcl.CollisionObject(model(V, np.array(F)), fcl.Transform())
    result = fcl.ContinuousCollisionResult()
    goal = fcl.Transform(np.eye(3), np.array([0.0, 50.0, 0.0]))
    fcl.continuousCollide(wire, goal, still, fcl.Transform(), fcl.ContinuousCollisionRequest(), result)
    return bool(result.is_collide)
answer(move)
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
    "meshcat": """
import meshcat
print('= "ready"', flush=True)
viewer = meshcat.Visualizer()
print("=", viewer.window.server_proc.pid, flush=True)
answer(lambda: viewer.close() is None)
answer(lambda: viewer.get_image() is None)
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
def children() -> Iterator[dict[str, Child]]:
    mesh_text = {"VERTICES": BLOCK.vertices, "FACES": BLOCK.faces, "TURNS": np.array(TURNS)}
    code = {name: _ANSWER + text for name, text in _QUESTIONS.items()}
    for word, array in mesh_text.items():
        code = {name: text.replace(word, repr(array.tolist())) for name, text in code.items()}
    with ThreadPoolExecutor(2) as pool:
        limits = [6.0 if name == "meshcat" else 60.0 for name in code]
        found = dict(zip(code, pool.map(_run, code.values(), limits), strict=True))
    yield found
    os.kill(int(str(found["meshcat"].said[1])), signal.SIGTERM)  # the server that meshcat leaves behind


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("fcl empty", marks=mended("FCL", "an empty mesh ends the interpreter", "contact.solid")),
        pytest.param("fcl index", marks=mended("FCL", "so does an index out of range", "contact.solid")),
        pytest.param("fcl touching", marks=mended("FCL", "EPA aborts on touching poses", "fcl_shapes' thinner cores")),
        pytest.param("fcl motion", marks=mended("FCL", "a mesh in a continuous motion ends it", "geometry.motion")),
        pytest.param("coacd nan", marks=mended("CoACD", "a vertex nan ends the interpreter", "contact.solid")),
        pytest.param("coacd empty", marks=mended("CoACD", "so does an empty mesh (CoACD#68)", "contact.solid")),
        pytest.param("coacd index", marks=mended("CoACD", "so does an index out of range", "contact.solid")),
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


@mended("CoACD", "hulls leave corners of the part out", "Decomposition.uncovered")
def test_bare_coacd_covers_the_part(children: dict[str, Child]) -> None:
    for R, parts in zip(TURNS, _turned(children), strict=True):
        planes = [ConvexHull(np.array(part)).equations for part in parts]
        outside = [(BLOCK.vertices @ R.T @ p[:, :3].T + p[:, 3]).max(axis=1) for p in planes]
        assert np.min(outside, axis=0).max() < 1e-6


def _turned(children: dict[str, Child]) -> list[list[list[list[float]]]]:
    return children["coacd"].said[3:]  # type: ignore[return-value]


# --- meshcat ----------------------------------------------------------------------------------------------------------


@mended("meshcat", "a viewer cannot be closed", "the standard library's server in output.serving")
def test_bare_meshcat_closes(children: dict[str, Child]) -> None:
    assert children["meshcat"].said[2] is True


@mended("meshcat", "get_image() without a browser waits for ever", "pictures that do not go through the viewer")
def test_bare_meshcat_picture_without_a_browser(children: dict[str, Child]) -> None:
    assert children["meshcat"].code is not None


def _cube(size: float) -> tuple[Array, Array]:
    half = 0.5 * size
    return prism(np.array([[-half, -half], [half, -half], [half, half], [-half, half]]), -half, half)


def _refused(ask: object) -> bool:
    try:
        ask()  # type: ignore[operator]
    except Exception:
        return True
    return False
