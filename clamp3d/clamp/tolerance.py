"""Monte Carlo over manufacturing tolerances and conductor diameters: how the splint distance scatters.

Every sample draws from a generator of its own, seeded by (seed, index of the sample), and is closed by itself along the
path that `assemble` takes. So its result does not depend on how the samples are spread: over one
process, several, or a Dask cluster. (On processors with other floating point libraries the last digits may differ.)
"""

from __future__ import annotations

import importlib
import math
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, Literal

import numpy as np

from clamp3d.checks import choice, function, instance, number, whole
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.final_state import closed
from clamp3d.clamp.sensitivity import DIMENSIONS, dimension, with_dimensions
from clamp3d.errors import InputError, SolverError, need, without_numbers
from clamp3d.files.child import end_with_parent
from clamp3d.geometry.pose import Array

Distribution = Literal["uniform", "normal"]
Sample = tuple[float | None, str]
"""Splint distance in mm where the clamp holds both wires, and the status in words."""

WIRE_TOLERANCE_PERCENT = 1.0
"""Chosen: conductors are within 1 % of their nominal diameter."""
CHUNK = 50
"""Samples that are solved and sent together: about a second of work."""
# ISO 2768-1:1989, table 1, class m: (nominal sizes up to, permissible deviation either way), mm.
_MEDIUM = ((6.0, 0.1), (30.0, 0.2), (120.0, 0.3), (400.0, 0.5), (1000.0, 0.8), (2000.0, 1.2), (math.inf, 2.0))
UNPROVEN = "not proven"
"""How the status of a sample begins whose answer could not be proven."""
_PATIENCE = 15.0
"""Seconds without an answer after which the workers are counted: a cluster's may be starting anew."""
_SIGMAS = 3.0
"""A tolerance is so many standard deviations of the normal distribution."""
_TOP = 0.5
"""Largest tolerance, as part of the nominal size of a wire: a draw of the normal distribution stays > 0 to 6 sigma."""


@dataclass(frozen=True, slots=True)
class Spec:
    """What is sampled.

    Attributes
    ----------
    clamp : Clamp
        The nominal clamp.
    seed : int
    distribution : str
    tolerance : tuple of float
        Mm either way, for each of `DIMENSIONS`.
    """

    clamp: Clamp
    seed: int
    distribution: Distribution
    tolerance: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class MonteCarlo:
    """Splint distances of n clamps within their tolerances.

    Attributes
    ----------
    spec : Spec
        What was sampled.
    nominal : float or None
        The nominal clamp's distance in mm; None if it does not clamp.
    nominal_status : str
        "clamped", or why not.
    distance : ndarray (n,)
        Mm; NaN where the clamp does not hold both wires.
    status : tuple of str
        "clamped", or why not.
    """

    spec: Spec
    nominal: float | None
    nominal_status: str
    distance: Array
    status: tuple[str, ...]

    @property
    def clamped(self) -> Array:
        """Distances (m,) of the samples that hold both wires, in mm."""
        return np.asarray(self.distance[~np.isnan(self.distance)])

    def reasons(self) -> dict[str, int]:
        """How many samples have no distance, by their reason, most frequent first."""
        count = Counter(s for s, d in zip(self.status, self.distance.tolist(), strict=True) if math.isnan(d))
        return dict(sorted(count.items(), key=lambda item: (-item[1], item[0])))

    @property
    def unproven(self) -> int:
        """How many samples have an answer that could not be proven: whether they clamp is not known."""
        return sum(status.startswith(UNPROVEN) for status in self.status)

    def percentiles(self, at: tuple[float, ...]) -> tuple[float, ...]:
        """Percentiles of the clamped distances in mm; empty where none clamps."""
        return tuple(float(v) for v in np.percentile(self.clamped, at)) if len(self.clamped) else ()


def general_tolerance(size: float) -> float:
    """Deviation either way in mm that ISO 2768-1 class m permits a length of ``size`` mm (0.1 also below its 0.5).

    >>> general_tolerance(23.8), general_tolerance(48.8), general_tolerance(137.0)
    (0.2, 0.3, 0.5)
    """
    return next(deviation for top, deviation in _MEDIUM if abs(size) <= top)


def monte_carlo(
    clamp: Clamp,
    *,
    n: int = 1000,
    seed: int = 0,
    tolerance: float | None = None,
    wire_tolerance_percent: float = WIRE_TOLERANCE_PERCENT,
    distribution: Distribution = "uniform",
    processes: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> MonteCarlo:
    """Assemble clamps whose dimensions and wires scatter independently about their nominal sizes.

    Parameters
    ----------
    clamp : Clamp
        The nominal clamp.
    n, seed : int
        Number of clamps, and the seed of their dimensions.
    tolerance : float, optional
        Mm either way for every dimension of the splints; by default ISO 2768-1 m by its size.
    wire_tolerance_percent : float
        Of the wires' diameters, either way.
    distribution : {"uniform", "normal"}
        Within the tolerance, or normal with 3 sigma = tolerance.
    processes : int
        How many share the work.
    scheduler : str, optional
        Address of a Dask cluster that shares the work.
    progress : callable, optional
        Called with the samples done and ``n``.

    Raises
    ------
    InputError
        For settings out of range.
    MissingLibraryError
        For a scheduler without dask.distributed.
    SolverError
        If a worker dies.

    Examples
    --------
    >>> from clamp3d.clamp.loader import load_clamp
    >>> result = monte_carlo(load_clamp(), n=3, tolerance=0.01, wire_tolerance_percent=0.0)
    >>> result.status, bool(abs(result.distance - result.nominal).max() < 0.1)
    (('clamped', 'clamped', 'clamped'), True)
    """
    instance("clamp", clamp, Clamp)
    n, processes, seed = whole("n", n, least=1), whole("processes", processes, least=1), whole("seed", seed, least=0)
    function("progress", progress)
    choice("distribution", distribution, ("uniform", "normal"))
    spec = Spec(clamp, seed, distribution, _tolerances(clamp, tolerance, wire_tolerance_percent))
    nominal, nominal_status = _closed(clamp)
    progress = progress or (lambda done, of: None)
    progress(0, n)
    samples: list[Sample] = []
    for chunk in _solve(spec, [range(k, min(k + CHUNK, n)) for k in range(0, n, CHUNK)], processes, scheduler):
        samples += chunk
        progress(len(samples), n)
    distance = np.array([math.nan if d is None else d for d, _ in samples])
    return MonteCarlo(spec, nominal, nominal_status, distance, tuple(status for _, status in samples))


def sample_dimensions(spec: Spec, index: int) -> dict[str, float]:
    """Dimensions in mm of sample ``index``, drawn from its own generator."""
    rng = np.random.default_rng(np.random.SeedSequence(spec.seed, spawn_key=(index,)))
    count = len(DIMENSIONS)
    unit = rng.uniform(-1.0, 1.0, count) if spec.distribution == "uniform" else rng.standard_normal(count) / _SIGMAS
    return {
        name: dimension(spec.clamp, name) + float(t * u)
        for name, t, u in zip(DIMENSIONS, spec.tolerance, unit, strict=True)
        if t > 0.0
    }


def _tolerances(clamp: Clamp, tolerance: float | None, percent: float) -> tuple[float, ...]:
    """Mm either way for each of `DIMENSIONS`."""
    if tolerance is not None and not 0.0 <= (tolerance := number("tolerance", tolerance)) < 1e5:
        raise InputError(f"tolerance must be >= 0 and < 100000 mm, got {tolerance:g}")
    if not 0.0 <= (percent := number("wire tolerance", percent)) <= 100.0 * _TOP:
        raise InputError(f"wire tolerance must be from 0 to {100.0 * _TOP:g} %, got {percent:g}")
    sizes = {name: dimension(clamp, name) for name in DIMENSIONS}
    general = {name: general_tolerance(size) if tolerance is None else tolerance for name, size in sizes.items()}
    wires = {name: sizes[name] * percent / 100.0 for name in ("line.diameter", "jumper.diameter")}
    return tuple((general | wires).values())


def _chunk(spec: Spec, indices: range) -> list[Sample]:
    return [_sample(spec, index) for index in indices]


def _sample(spec: Spec, index: int) -> Sample:
    try:
        distance, status = _closed(with_dimensions(spec.clamp, sample_dimensions(spec, index)))
    except InputError as error:
        distance, status = None, f"not a clamp: {error}"
    except SolverError as error:
        distance, status = None, f"{UNPROVEN}: {error}"
    return distance, without_numbers(status)


def _closed(clamp: Clamp) -> Sample:
    section, final, status = closed(clamp)
    return (section.splint_distance(final.q) if status.clamped else None), status.text


def _solve(spec: Spec, tasks: list[range], processes: int, scheduler: str | None) -> Iterator[list[Sample]]:
    """Chunks in their order, each as soon as it and all before it are finished."""
    if scheduler is None and processes == 1:
        yield from (_chunk(spec, task) for task in tasks)
        return
    with _cluster(scheduler) if scheduler is not None else _processes(min(processes, len(tasks))) as (pool, workers):
        futures = [pool.submit(_chunk, spec, task) for task in tasks]
        try:
            for future in futures:
                while not wait([future], timeout=_PATIENCE).done:
                    if not workers():
                        raise SolverError("no workers are left")
                yield future.result()
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def _processes(count: int) -> Iterator[tuple[Executor, Callable[[], int]]]:
    with ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_worker) as pool:
        try:
            yield pool, lambda: count  # the pool itself tells of one that died
        except BrokenProcessPool:
            raise SolverError("a worker process died") from None


def _worker() -> None:
    """Ctrl-C goes to all processes of a terminal: the first one stops the work, the others say nothing and end too."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


@contextmanager
def _cluster(scheduler: str) -> Iterator[tuple[Executor, Callable[[], int]]]:
    need("distributed", "a Dask cluster")
    distributed: Any = importlib.import_module("distributed")
    if not scheduler.strip():  # Dask would start a cluster of its own
        raise InputError("scheduler must be an address like tcp://host:8786, got ''")
    # A client that finds no scheduler waits 20 s for it when it is thrown away, and then prints a traceback.
    kind = type("Client", (distributed.Client,), {"__del__": lambda self: None})
    try:
        client = kind(scheduler, timeout="10s", set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"no Dask scheduler at {scheduler!r}: {reason}") from None
    with client:
        try:
            yield client.get_executor(pure=False), lambda: len(client.scheduler_info()["workers"])
        except (distributed.KilledWorker, CancelledError) as error:
            raise SolverError(f"the Dask cluster lost the work: {error}") from None
