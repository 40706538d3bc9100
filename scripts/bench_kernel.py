"""Speed of the contact kernel, in one run: ``python scripts/bench_kernel.py [--poses N] [--quick]``.

The scene: a 140 degree groove (R 12, 50 long), a wire of radius 10.5 and length 80, parallel and tilted poses that are
clear of the groove and within a millimetre of it. Flat ends are measured beside a capsule and Open CASCADE, verdicts of
many poses beside the batch; other libraries are what ``clamp3d compare --peers`` is for.
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

import numpy as np

from clamp3d.bench.compare.peers.open_cascade import asked, axis, cylinder, together
from clamp3d.engine.model import ModelCache
from clamp3d.engine.poses import check_poses
from clamp3d.engine.scene import Part, Scene
from clamp3d.files.open_cascade import explore
from clamp3d.geometry.pose import rotation, translation
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc
from clamp3d.geometry.shapes import cylinder as cylinder_shape
from clamp3d.geometry.shapes import groove_block
from clamp3d.kernel.distance import signed_distance, signed_distances
from clamp3d.output.step import solid

GROOVE, WIRE = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
BACK, SIDE = 30.0, 40.0  # of the block that Open CASCADE needs in place of unbounded material


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
    # Its faces alone, which takes half as long: of a solid it asks first whether it holds a corner of the other.
    block = together(explore(solid(groove_block(GROOVE, 2.0 * SIDE, BACK)), "FACE"))
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
        by_faces = asked(block, together(explore(cylinder(10.5, length), "FACE")), 0.0, depth=False).one
        few = T[:200]
        runs: list[tuple[Callable[[], object], int]] = [
            (lambda s=flat, T=T: signed_distances(GROOVE, s, T, workers=1), 4000),
            (lambda s=round_, T=T: signed_distances(GROOVE, s, T, workers=1), 4000),
            (lambda s=flat, T=few: [signed_distance(GROOVE, s, P) for P in T], 200),
            (lambda s=round_, T=few: [signed_distance(GROOVE, s, P) for P in T], 200),
            (lambda f=by_axis, T=few: [f(P) for P in T[:10]], 10),
            (lambda f=by_faces, T=few: [f(P) for P in T[:10]], 10),
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
    print(f"Python {platform.python_version()}, {os.cpu_count()} cores; microseconds per pose\n")
    print("| clamp3d | parallel | tilted |\n|---|---|---|")
    kinds = ("parallel", "tilted")
    few = [poses(kind, 100) for kind in kinds]
    calls = [least(lambda f=f: [signed_distance(GROOVE, WIRE, T) for T in f], len(f), repeats) for f in few]
    many = [np.tile(poses(kind, 2000), (options.poses // 2000, 1, 1)) for kind in kinds]
    batches = [least(lambda m=m: signed_distances(GROOVE, WIRE, m, workers=1), len(m), repeats) for m in many]
    print(f"| one call from Python | {calls[0]:.3g} | {calls[1]:.3g} |")
    print(f"| batch of {len(many[0])}, one core | {batches[0]:.3g} | {batches[1]:.3g} |")
    ends(repeats)
    sweep(repeats)
    if not options.quick:
        cold, warm = start_up()
        print(
            f"import and first call in a new process: {cold:.1f} s of CPU compiling, {warm:.2f} s from the disk cache"
        )


if __name__ == "__main__":
    main()
