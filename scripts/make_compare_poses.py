"""Make ``clamp3d/study/data/compare_poses.csv``: poses of a wire in a groove with their distances to 25 digits.

``python scripts/make_compare_poses.py`` (minutes). The values come from the search of
``tests/kernel/oracle.py``; the kernel only helps to find poses near contact.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from clamp3d.bench.compare.scene import BANDS, CLEAR, GROOVE, OVERLAP, WIRE, pose
from clamp3d.kernel.distance import signed_distance

ROOT = Path(__file__).resolve().parent.parent
FIELDS = ("lean", "group", "x", "y", "z", "a", "b", "c", "distance")


def load_oracle():
    sys.path.insert(0, str(ROOT))
    from tests.kernel import oracle

    return oracle


def distance(origin, turn) -> float:
    return signed_distance(GROOVE, WIRE, pose(origin, turn)).distance


def candidate(rng, lean):
    """Origin in the middle of the groove and turn, both in short decimals."""
    origin = [float(round(v, 4)) for v in rng.uniform((-1.5, -1.5, -10.0), (1.5, 1.0, 10.0))]
    tilt, phi = rng.uniform(0.001, 0.03) if lean == "tilted" else 0.0, rng.uniform(0.0, 2.0 * np.pi)
    turn = [float(round(v, 6)) for v in (tilt / 2 * np.cos(phi), tilt / 2 * np.sin(phi), rng.uniform(-1.0, 1.0))]
    return origin, turn


def draw(rng, lean, low, high):
    """A pose with a distance from ``low`` to ``high`` mm."""
    while True:
        origin, turn = candidate(rng, lean)
        if low < distance(origin, turn) < high:
            return origin, turn


def near(rng, lean, target):
    """A pose with a distance of about ``target`` mm, moved there along x and y from the middle of the groove."""
    while True:
        origin, turn = candidate(rng, lean)
        start = np.array(origin) * (0.1, 0.1, 1.0)
        way = rng.uniform(-1.1, 1.1)
        step = np.array([np.sin(way), -np.cos(way), 0.0])

        def gap(t, start=start, turn=turn, step=step):
            return distance(start + t * step, turn) - target

        if gap(0.0) > 0.0 > gap(3.0):
            return (start + brentq(gap, 0.0, 3.0, xtol=1e-15, rtol=1e-14) * step).tolist(), turn


def main() -> None:
    oracle = load_oracle()
    rows = []
    for number, lean in enumerate(("parallel", "tilted")):
        rng = np.random.default_rng([7, number])
        poses = [(CLEAR, draw(rng, lean, 1e-3, 1.0)) for _ in range(60)]
        poses += [(OVERLAP, draw(rng, lean, -0.3, -1e-3)) for _ in range(30)]
        for band in BANDS:
            sizes = band * rng.uniform(0.05, 1.0, 40) * np.tile([1.0, -1.0], 20)
            poses += [(f"{band:g}", near(rng, lean, size)) for size in sizes]
        for i, (group, (origin, turn)) in enumerate(poses):
            c, d = oracle.axis_of(pose(origin, turn))
            value = oracle.exact_distance(
                GROOVE.radius, GROOVE.half_angle, GROOVE.length, WIRE.radius, WIRE.length, c, d
            )
            rows.append([lean, group, *(repr(float(v)) for v in (*origin, *turn)), value])
            print(f"\r{lean} {i + 1}/{len(poses)}", end="", file=sys.stderr, flush=True)
    head = "# Groove R 12, 140 deg, 60 long; wire radius 10.5, length 200; see clamp3d/study/compare/scene.py\n"
    text = head + ",".join(FIELDS) + "\n" + "".join(",".join(row) + "\n" for row in rows)
    (ROOT / "clamp3d/study/data/compare_poses.csv").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
