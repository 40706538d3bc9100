"""What one method is measured for: errors, wrong verdicts near contact, times, memory."""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clamp3d.bench.compare.methods import MANY, Method, Prepared, load, prepare
from clamp3d.bench.compare.scene import BANDS, CLEAR, OVERLAP, Poses, coherent_poses, known_poses
from clamp3d.core.pose import Array

_ARC_PASSES = 9
"""Passes of the arc whose median is what a call of it takes in a process."""


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
    """A method on the poses of `compare.scene`; errors in mm, times in CPU seconds of one core, memory in MB.

    ``median_error`` and ``worst_error`` are of the distance of a wire that is clear, ``depth_error`` is the worst on
    overlaps up to 0.3 mm deep (None: no depth). ``load`` is the import of the libraries, ``setup`` what comes before
    the first pose. ``one`` and ``many`` are CPU seconds per pose of repeated passes over as many clear poses as
    overlapping ones; ``coherent`` is the same on a slow motion, where a solver may start from its last answer;
    ``threaded`` is by the clock, on all cores (None: the method has no threads). As a machine's speed drifts, each is a
    multiple of ``arc``, CPU seconds of a call of the arc, which is timed before every pass. ``memory`` is what the
    process grew by from set-up and queries, ``library_memory`` from the import (None where the system does not tell).
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
    coherent: float
    threaded: float | None
    arc: float
    memory: float | None
    library_memory: float | None

    @property
    def error(self) -> float:
        """Largest error in mm of the signed distance: of clear poses, and of overlaps where the method has a depth."""
        return max(self.worst_error, self.depth_error or 0.0)


def measure(
    method: Method,
    *,
    load: Callable[[Method], None] = load,
    prepare: Callable[[Method], Prepared] = prepare,
    budget: float = 0.6,
) -> Measured:
    """Measure one method in this process; ``budget`` is about how many seconds the timing of each kind may take."""
    poses = known_poses()
    before = resident()
    start = time.process_time()
    load(method)
    load_time, loaded = time.process_time() - start, resident()
    start = time.process_time()
    ready = prepare(method)
    setup = time.process_time() - start + ready.elsewhere
    if ready.parallel_only:
        poses = poses.select(poses.parallel)
    values = np.array([ready.one(T) for T in poses.T])
    grown = resident()  # before the batch, whose poses and answers are the caller's, and before the arc beside it
    clear, overlap = poses.group == CLEAR, poses.group == OVERLAP
    error = np.abs(poses.error(values))
    half = np.flatnonzero(overlap)
    half = np.concatenate([half, np.flatnonzero(clear)[: len(half)]])
    timed = np.ascontiguousarray(poses.T[half])
    beside = arc_beside(timed)
    arc = statistics.median(seconds(beside) for _ in range(_ARC_PASSES)) / len(timed)

    def per_pose(run: Callable[[], object], poses: Array, clock: Callable[[], float] = time.process_time) -> float:
        return arc * repeated(run, beside, budget, clock=clock) * len(timed) / len(poses)

    one = per_pose(lambda: [ready.one(T) for T in timed], timed)
    way = coherent_poses(len(timed), straight=ready.parallel_only)
    coherent = per_pose(lambda: [ready.one(T) for T in way], way)
    if not np.allclose(ready.many(timed), values[half], rtol=0.0, atol=1e-12 + 0.5 * error.max()):
        raise AssertionError(f"{method.label}: one and many differ")
    times = min(MANY, max(len(timed), int(budget / max(one, 1e-9)))) // len(timed) if ready.batched else 1
    batch = np.tile(timed, (times, 1, 1))
    many = per_pose(lambda: ready.many(batch), batch)
    run = ready.threaded
    threaded = None if run is None else per_pose(lambda: run(batch), batch, time.perf_counter)
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
        coherent=coherent,
        threaded=threaded,
        arc=arc,
        memory=None if grown is None or loaded is None else max(0.0, grown - loaded),
        library_memory=None if loaded is None or before is None else max(0.0, loaded - before),
    )


def verdicts(poses: Poses, values: Array, band: float) -> Band:
    """Hits and misses of ``values`` (n,) on the poses of a band; touching counts as a hit."""
    chosen = poses.group == f"{band:g}"
    hit, said = poses.distance[chosen] <= 0.0, values[chosen] <= 0.0
    return Band(band, int((~hit).sum()), int(hit.sum()), int((said & ~hit).sum()), int((hit & ~said).sum()))


def arc_beside(poses: Array) -> Callable[[], object]:
    """Calls of the arc for each of ``poses`` (n, 4, 4): what other times are told beside."""
    arc = prepare(Method("cas")).one
    arc(poses[0])
    return lambda: [arc(T) for T in poses]


def seconds(run: Callable[[], object], clock: Callable[[], float] = time.process_time) -> float:
    """Time of ``run`` by ``clock``."""
    start = clock()
    run()
    return clock() - start


def repeated(
    run: Callable[[], object],
    beside: Callable[[], object],
    budget: float,
    most: int = 15,
    *,
    clock: Callable[[], float] = time.process_time,
) -> float:
    """How many times as long ``run`` takes as what is run before it: the median of at least 3 and at most ``most``.

    Until ``budget`` s by ``clock`` are spent.
    """
    ratios: list[float] = []
    spent = 0.0
    while len(ratios) < 3 or (len(ratios) < most and spent < budget):
        first = seconds(beside, clock)
        own = seconds(run, clock)
        ratios.append(own / first)
        spent += own
    return statistics.median(ratios)


def resident() -> float | None:
    """Memory of this process in MB: resident now (Linux), its peak (macOS), None elsewhere."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3
