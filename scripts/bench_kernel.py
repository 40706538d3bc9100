"""Speed of the contact kernel beside python-fcl, in one run: ``python scripts/bench_kernel.py [--poses N] [--quick]``.

The scene: a 140 degree groove (R 12, 50 long) in a block, a wire of radius 10.5 and length 80, parallel and tilted
poses that are clear of the groove and within a millimetre of it. Peers get their best known set-up: objects built once,
the pose set on one of them, a fresh result object per query (a reused one keeps its old minimum), the native cylinder
for the wire. ``wedges``: one fcl.Convex per degree of the arc in fcl's own AABB tree. ``BVH``: one triangle mesh of the
same chords. ``wedges, culled by hand``: more than the library offers: this script bounds each wedge's distance by the
planes of its chord, and asks them in that order until no other can be nearer.
CPU time of one thread, the least of several runs, so that other load on the machine does not count.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable

import fcl
import numpy as np

from clamp3d.bench.compare.peers.open_cascade import asked, axis, cylinder
from clamp3d.collide.model import ModelCache
from clamp3d.collide.poses import check_poses
from clamp3d.collide.scene import Part, Scene
from clamp3d.core.distance import signed_distance, signed_distances
from clamp3d.core.pieces import groove_pieces
from clamp3d.core.pose import rotation, translation
from clamp3d.core.primitives import Capsule, Cylinder, SweptArc
from clamp3d.core.shapes import cylinder as cylinder_shape
from clamp3d.core.shapes import groove_block
from clamp3d.output.step import solid

GROOVE, WIRE = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
BACK, SIDE = 30.0, 40.0  # the block that peers need in place of unbounded material
CHORDS = 140


def section() -> np.ndarray:
    """Arc points (CHORDS + 1, 2), ends on the lips."""
    phi = np.linspace(-GROOVE.half_angle, GROOVE.half_angle, CHORDS + 1)
    return GROOVE.radius * np.column_stack([np.sin(phi), -np.cos(phi)])


def prism(polygon: np.ndarray) -> tuple[np.ndarray, list[list[int]]]:
    """Vertices (2k, 3) and polygon faces of a convex counter-clockwise polygon over the groove's length."""
    k, half = len(polygon), GROOVE.length / 2
    vertices = np.vstack([np.column_stack([polygon, np.full(k, z)]) for z in (-half, half)])
    faces = [list(range(k))[::-1], list(range(k, 2 * k))]
    faces += [[i, (i + 1) % k, (i + 1) % k + k, i + k] for i in range(k)]
    return vertices, faces


def wedge_polygons() -> list[np.ndarray]:
    """Convex polygons: one below each chord, and the two blocks beside the lips."""
    arc = section()
    x, y = arc[:, 0], arc[:, 1]
    polygons = [np.array([[x[i], -BACK], [x[i + 1], -BACK], [x[i + 1], y[i + 1]], [x[i], y[i]]]) for i in range(CHORDS)]
    polygons.append(np.array([[-SIDE, -BACK], [x[0], -BACK], [x[0], y[0]], [-SIDE, y[0]]]))
    polygons.append(np.array([[x[-1], -BACK], [SIDE, -BACK], [SIDE, y[-1]], [x[-1], y[-1]]]))
    return polygons


def wedges() -> list[fcl.CollisionObject]:
    """Bodies of ``wedge_polygons``."""
    pieces = []
    for polygon in wedge_polygons():
        vertices, faces = prism(polygon)
        flat = np.concatenate([[len(f), *f] for f in faces])
        pieces.append(fcl.CollisionObject(fcl.Convex(vertices, len(faces), flat), fcl.Transform()))
    return pieces


def mesh() -> fcl.CollisionObject:
    """One triangle mesh of all faces of the wedges that are on the outside (the walls between them are left out)."""
    model = fcl.BVHModel()
    triangles = []
    for number, polygon in enumerate(wedge_polygons()):
        vertices, faces = prism(polygon)
        keep = [0, 1, 2, 4] + ([5] if number == CHORDS else []) + ([3] if number == CHORDS + 1 else [])
        for face in (faces[i] for i in keep):
            triangles += [vertices[[face[0], face[i], face[i + 1]]] for i in range(1, len(face) - 1)]
    points = np.array(triangles).reshape(-1, 3)
    model.beginModel(len(triangles), len(points))
    model.addSubModel(points, np.arange(len(points)).reshape(-1, 3))
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def poses(kind: str, count: int, seed: int = 0) -> np.ndarray:
    """Poses of a kind, clear of the groove and within a millimetre of it."""
    rng = np.random.default_rng(seed)
    found = np.empty((0, 4, 4))
    while len(found) < count:
        n = 4 * count
        tilt = np.zeros(n) if kind == "parallel" else rng.uniform(0.001, 0.03, n)
        phi, turn = rng.uniform(0, 2 * np.pi, (2, n))
        T = np.tile(np.eye(4), (n, 1, 1))
        T[:, :3, :3] = [
            (rotation((np.cos(p), np.sin(p), 0.0), t) @ rotation((0, 0, 1), a))[:3, :3]
            for p, t, a in zip(phi, tilt, turn, strict=True)
        ]
        T[:, :3, 3] = rng.uniform((-1.5, -1.5, -10.0), (1.5, 1.0, 10.0), (n, 3))
        d = signed_distances(GROOVE, WIRE, T)
        found = np.concatenate([found, T[(d > 1e-3) & (d < 1.0)]])
    return found[:count]


def least(run: Callable[[], object], units: int, repeats: int) -> float:
    """CPU time of this thread per unit in microseconds: the least of several runs."""
    run()
    best = np.inf
    for _ in range(repeats):
        start = time.thread_time()
        run()
        best = min(best, time.thread_time() - start)
    return best / units * 1e6


class Peers:
    """python-fcl with everything built beforehand; each method answers one pose."""

    def __init__(self) -> None:
        self.wire = fcl.CollisionObject(fcl.Cylinder(WIRE.radius, WIRE.length), fcl.Transform())
        self.pieces, self.mesh = wedges(), mesh()
        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.manager.registerObjects(self.pieces)
        self.manager.setup()
        arc = section()
        middle = 0.5 * (arc[:-1] + arc[1:])
        outward = middle / np.linalg.norm(middle, axis=1)[:, None]
        # A wedge lies behind its chord's line, and behind the plane of the flat faces: two bounds on its distance.
        self.normal = -outward
        self.offset = np.einsum("ij,ij->i", self.normal, middle)
        self.request = fcl.DistanceRequest()

    def place(self, T: np.ndarray) -> None:
        self.wire.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))

    def wedge_order(self, T: np.ndarray) -> float:
        self.place(T)
        ends = T[:2, 3] + np.array([[-0.5], [0.5]]) * WIRE.length * T[:2, 2]
        bound = (ends @ self.normal.T).min(axis=0) - self.offset - WIRE.radius
        order = np.argsort(bound)
        best = np.inf
        for piece in (CHORDS, CHORDS + 1):
            best = min(best, fcl.distance(self.pieces[piece], self.wire, self.request, fcl.DistanceResult()))
        for i in order:
            if bound[i] >= best:
                break
            best = min(best, fcl.distance(self.pieces[i], self.wire, self.request, fcl.DistanceResult()))
        return best

    def wedge_manager(self, T: np.ndarray) -> float:
        self.place(T)
        data = fcl.DistanceData()
        self.manager.distance(self.wire, data, fcl.defaultDistanceCallback)
        return data.result.min_distance

    def bvh(self, T: np.ndarray) -> float:
        self.place(T)
        return fcl.distance(self.mesh, self.wire, self.request, fcl.DistanceResult())


def ends(repeats: int) -> None:
    """Cylinders, capsules and Open CASCADE at the same poses: (length, tilt, where along the groove, how far about)."""
    rng = np.random.default_rng(2)
    kinds = {
        "no rim nearest: parallel": (80.0, 0.0, 0.0, 0.5),
        "no rim nearest: tilted, reaching out at both ends": (80.0, 0.05, 0.0, 0.5),
        "short, tilted, in the groove": (20.0, 0.1, 0.0, 0.5),
        "short, steep, in overlap": (20.0, 1.0, 0.0, 3.0),
        "end at the groove's end": (80.0, 0.05, 65.0, 0.5),
        "end before the groove's end": (80.0, 0.3, 68.0, 3.0),
    }
    block = solid(groove_block(GROOVE, 2.0 * SIDE, BACK))
    print(
        "\n| flat ends beside a capsule, one core: least, median, greatest of the runs | batch, ns | capsule, ns "
        "| ratio | call, us | capsule, us | ratio | Open CASCADE, us | to a call | to a batch |"
        "\n|---|---|---|---|---|---|---|---|---|---|"
    )
    for name, (length, tilt, at, about) in kinds.items():
        T = np.array([rotation((*rng.normal(size=2), 0.0), rng.uniform(0.0, tilt)) for _ in range(4000)])
        T[:, :3, 3] = rng.normal(size=(4000, 3)) * about + [0.0, 0.0, at]
        flat, round_ = Cylinder(10.5, length), Capsule(10.5, length)
        by_axis = asked(block, axis(length), 10.5, depth=True).one
        by_solid = asked(block, cylinder(10.5, length), 0.0, depth=False).one
        few = T[:200]
        runs: list[tuple[Callable[[], object], int]] = [
            (lambda s=flat, T=T: signed_distances(GROOVE, s, T, workers=1), 4000),
            (lambda s=round_, T=T: signed_distances(GROOVE, s, T, workers=1), 4000),
            (lambda s=flat, T=few: [signed_distance(GROOVE, s, P) for P in T], 200),
            (lambda s=round_, T=few: [signed_distance(GROOVE, s, P) for P in T], 200),
            (lambda f=by_axis, T=few: [f(P) for P in T[:10]], 10),
            (lambda f=by_solid, T=few: [f(P) for P in T[:10]], 10),
        ]
        seen = np.array([[thread_time(run, n) for run, n in runs] for _ in range(3 * repeats)])
        batch, round_batch, call, round_call = (seen[:, k] for k in range(4))
        cad = seen[:, 4:].min(axis=1)
        cells = [1e3 * batch, 1e3 * round_batch, batch / round_batch, call, round_call, call / round_call]
        print(f"| {name} | {' | '.join(map(spread, [*cells, cad, cad / call, cad / batch]))} |", flush=True)


def spread(values: np.ndarray) -> str:
    """Least, median and greatest."""
    return " ".join(f"{x:.3g}" for x in (values.min(), np.median(values), values.max()))


def thread_time(run: Callable[[], object], units: int) -> float:
    """CPU time of this thread per unit in microseconds, with its data in the processor's memory."""
    run()
    start = time.thread_time()
    run()
    return (time.thread_time() - start) / units * 1e6


def sweep(repeats: int) -> None:
    """Verdicts of a wire at 100 000 poses against its groove block, and among 10 000 blocks, beside the batch."""
    scene = Scene(clearance=0.5).add("wire", cylinder_shape(WIRE.radius, WIRE.length))
    block = groove_block(GROOVE, 2.0 * SIDE, BACK)
    parts = [Part(f"b{k}", block, translation(100.0 * k, 0.0, 0.0)) for k in range(10000)]
    T = np.tile(poses("tilted", 2000), (50, 1, 1))
    print("\n| verdicts of 100 000 tilted poses, us a pose | least, median, greatest | of the batch |\n|---|---|---|")
    for count in (1, 10000):
        many = Scene((*scene.parts, *parts[:count]), clearance=0.5)
        cache = ModelCache()
        runs: list[Callable[[], object]] = [
            lambda s=many, c=cache: check_poses(s, "wire", T, cache=c),
            lambda: signed_distances(GROOVE, WIRE, T, workers=1),
        ]
        seen = np.array([[thread_time(run, len(T)) for run in runs] for _ in range(repeats)])
        print(f"| among {count} | {spread(seen[:, 0])} | {spread(seen[:, 0] / seen[:, 1])} |", flush=True)


def start_up() -> tuple[float, float]:
    """CPU seconds of import and first call in a new process: nothing compiled yet, and from the disk cache."""
    import tempfile

    code = (
        "import time; t = time.process_time(); import numpy as np; from clamp3d.kernel import *;"
        "signed_distance(SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0), np.eye(4)); print(time.process_time() - t)"
    )
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "NUMBA_CACHE_DIR": folder, "PYTHONPATH": os.pathsep.join(sys.path)}
        times = [
            float(subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True).stdout)
            for _ in range(2)
        ]
    return times[0], times[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=1_000_000, help="poses per batch")
    parser.add_argument("--quick", action="store_true", help="fewer repeats, no start-up times")
    options = parser.parse_args()
    repeats = 3 if options.quick else 9
    peers = Peers()
    print(f"Python {platform.python_version()}, python-fcl, {os.cpu_count()} cores; microseconds per pose\n")
    print("| what | parallel | tilted | largest error, mm |")
    print("|---|---|---|---|")
    table: dict[str, list[float]] = {}
    errors: dict[str, float] = {}
    for kind in ("parallel", "tilted"):
        few = poses(kind, 100)
        exact = signed_distances(GROOVE, WIRE, few)
        single = {
            "clamp3d, one call": lambda T: signed_distance(GROOVE, WIRE, T).distance,
            "clamp3d, groove_pieces": lambda T: groove_pieces(GROOVE, WIRE, T).distance.min(),
            "wedges, culled by hand": peers.wedge_order,
            "python-fcl wedges": peers.wedge_manager,
            "python-fcl BVH": peers.bvh,
        }
        for name, run in single.items():
            values = np.array([run(T) for T in few])
            errors[name] = max(errors.get(name, 0.0), float(np.abs(values - exact).max()))
            table.setdefault(name, []).append(least(lambda r=run, f=few: [r(T) for T in f], len(few), repeats))
        many = np.tile(poses(kind, 2000), (options.poses // 2000, 1, 1))
        name = f"clamp3d, batch of {len(many)}, one core"
        errors[name] = 0.0
        run_batch = lambda m=many: signed_distances(GROOVE, WIRE, m, workers=1)  # noqa: E731
        table.setdefault(name, []).append(least(run_batch, len(many), repeats))
    for name, (parallel, tilted) in table.items():
        print(f"| {name} | {parallel:.3g} | {tilted:.3g} | {errors[name]:.2g} |")
    names = list(table)
    print()
    for i, kind in enumerate(("parallel", "tilted")):
        best = min(table[name][i] for name in names if name.startswith("python-fcl"))
        print(
            f"{kind}: {best / table['clamp3d, one call'][i]:.0f} times faster than the best of python-fcl one by one, "
            f"{best / table[names[-1]][i]:.0f} times in a batch on one core; than the wedges culled by hand "
            f"{table['wedges, culled by hand'][i] / table['clamp3d, one call'][i]:.0f} and "
            f"{table['wedges, culled by hand'][i] / table[names[-1]][i]:.0f} times"
        )
    ends(repeats)
    sweep(repeats)
    if not options.quick:
        cold, warm = start_up()
        print(
            f"import and first call in a new process: {cold:.1f} s of CPU compiling, {warm:.2f} s from the disk cache"
        )


if __name__ == "__main__":
    main()
