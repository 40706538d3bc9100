"""What one method is measured for: errors, wrong verdicts near contact, times."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clamp3d.bench.compare.methods import MANY, Method, Prepared, load, prepare
from clamp3d.bench.compare.scene import BANDS, CLEAR, OVERLAP, Poses, known_poses
from clamp3d.geometry.pose import Array

_PASSES = 3
"""Least number of passes over the poses."""
_PART = 1e-3
"""Seconds of a stretch that is timed by itself: now and then one runs undisturbed also where a core is shared."""
_BATCH = 0.05
"""Seconds of a batch."""


@dataclass(frozen=True, slots=True)
class Band:
    """Verdicts up to ``band`` mm from contact: of ``free`` poses ``false_hits``, of ``hits`` ``false_misses``."""

    band: float
    free: int
    hits: int
    false_hits: int
    false_misses: int


@dataclass(frozen=True, slots=True)
class Measured:
    """A method on the poses of `compare.scene`; errors in mm, times in CPU seconds of one core.

    ``median_error`` and ``worst_error`` are of the distance of a wire that is clear, ``depth_error`` is the worst on
    overlaps up to 0.3 mm deep (None: no depth). ``load`` is the import of the libraries, ``setup`` what comes before
    the first pose. ``one`` and ``many`` are seconds per pose over as many clear poses as overlapping ones, each the
    least of repeated passes (`least`): what the method takes where nothing else slows the machine.
    """

    method: str
    setting: float | None
    label: str
    pieces: int
    poses: int
    median_error: float
    worst_error: float
    depth_error: float | None
    bands: tuple[Band, ...]
    load: float
    setup: float
    one: float
    many: float

    @property
    def error(self) -> float:
        """Largest error in mm of the signed distance: of clear poses, and of overlaps where the method has a depth."""
        return max(self.worst_error, self.depth_error or 0.0)


def measure(
    method: Method,
    *,
    load: Callable[[Method], None] = load,
    prepare: Callable[[Method], Prepared] = prepare,
    budget: float = 0.3,
) -> Measured:
    """Measure one method in this process; ``budget`` is about how many seconds the timing of each kind may take."""
    poses = known_poses()
    start = time.process_time()
    load(method)
    load_time = time.process_time() - start
    start = time.process_time()
    ready = prepare(method)
    setup = time.process_time() - start + ready.elsewhere
    if ready.parallel_only:
        poses = poses.select(poses.parallel)
    values = np.array([ready.one(T) for T in poses.T])
    clear, overlap = poses.group == CLEAR, poses.group == OVERLAP
    error = np.abs(poses.error(values))
    half = np.flatnonzero(overlap)
    half = np.concatenate([half, np.flatnonzero(clear)[: len(half)]])
    timed = np.ascontiguousarray(poses.T[half])
    one = least(lambda part: [ready.one(T) for T in part], timed, budget)
    if not np.allclose(ready.many(timed), values[half], rtol=0.0, atol=1e-12 + 0.5 * error.max()):
        raise AssertionError(f"{method.label}: one and many differ")
    times = max(1, min(MANY // len(timed), int(_BATCH / (_seconds(ready.many, timed) + 1e-9))))
    batch = np.tile(timed, (times, 1, 1))
    many = least(ready.many, batch, budget, whole=True)
    return Measured(
        method=method.family,
        setting=method.setting,
        label=method.label,
        pieces=ready.pieces,
        poses=len(poses),
        median_error=float(np.median(error[clear])),
        worst_error=float(error[clear].max()),
        depth_error=float(error[overlap].max()) if ready.depth else None,
        bands=tuple(verdicts(poses, values, band) for band in BANDS),
        load=load_time,
        setup=setup,
        one=one,
        many=many,
    )


def verdicts(poses: Poses, values: Array, band: float) -> Band:
    """Hits and misses of ``values`` (n,) on the poses of a band; touching counts as a hit."""
    chosen = poses.group == f"{band:g}"
    hit, said = poses.distance[chosen] <= 0.0, values[chosen] <= 0.0
    return Band(band, int((~hit).sum()), int(hit.sum()), int((said & ~hit).sum()), int((hit & ~said).sum()))


def least(run: Callable[[Array], object], poses: Array, budget: float, *, whole: bool = False) -> float:
    """Least CPU time per pose in which ``run`` answers ``poses`` (n, 4, 4).

    They are gone through in parts of about a millisecond (``whole``: as they are), again and again for ``budget`` s;
    the least times of the parts are added up. Other work on the machine can only make a part slower, and Python more
    than compiled loops, so neither mean nor median of a pass can be had again.
    """
    times: list[list[float]] = []
    parts = [poses]
    if not whole:
        count = max(1, int(_PART / (_seconds(run, poses[:1]) + 1e-9)))
        parts = [poses[i : i + count] for i in range(0, len(poses), count)]
    end = time.perf_counter() + budget
    while len(times) < _PASSES or time.perf_counter() < end:
        times.append([_seconds(run, part) for part in parts])
    return float(np.min(times, axis=0).sum()) / len(poses)


def _seconds(run: Callable[[Array], object], poses: Array) -> float:
    start = time.process_time()
    run(poses)
    return time.process_time() - start
