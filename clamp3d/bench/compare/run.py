"""Every method on the same poses and the same assembly: accuracy, wrong verdicts, set-up, speed, memory."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from clamp3d.bench.compare.assemblies import Assembled, Imaged
from clamp3d.bench.compare.jobs import JobError, Kind, run_job
from clamp3d.bench.compare.measure import Measured
from clamp3d.bench.compare.methods import CLAMP_THRESHOLD, METHODS, Method
from clamp3d.bench.compare.peers import PEER_METHODS, missing_peers
from clamp3d.bench.machine import Machine, machine
from clamp3d.errors import Clamp3dError

CONTACT_LIMIT = 90.0
"""Seconds that one method may take on the poses, its set-up included."""
ROUNDS = 5
"""Processes of each method on the poses, in turn with the others: a machine may be slow for minutes."""
SLOW_SETUP = 3.0
"""CPU seconds of set-up from which a method is measured in one process only."""
ASSEMBLY_LIMIT = 150.0
"""Seconds for one assembly; CoACD alone takes 60 of them on the reference clamp."""

ASSEMBLIES = (
    *(m for m in METHODS if m.family in ("cas", "chords", "wedges")),
    Method("hulls", CLAMP_THRESHOLD),
    *(m for m in METHODS if m.family == "mesh" and (m.setting or 0.0) >= 0.01),
)
"""Finer meshes give the same distance to 1e-3 mm and take a minute."""
LIBRARIES = ("numpy", "numba", "scipy", "python-fcl", "coacd", "trimesh", "manifold3d")
PEER_LIBRARIES = ("coal", "mujoco", "cadquery-ocp-novtk")


@dataclass(frozen=True, slots=True)
class NotMeasured:
    """A method without figures and the ``reason`` in one line."""

    method: str
    setting: float | None
    label: str
    reason: str


@dataclass(frozen=True, slots=True)
class Comparison:
    """All answers; ``peers`` is empty by default. ``seconds`` is the whole time on the clock."""

    machine: Machine
    contact: tuple[Measured | NotMeasured, ...]
    peers: tuple[Measured | NotMeasured, ...]
    assemblies: tuple[Assembled | NotMeasured, ...]
    image: Imaged | NotMeasured
    seconds: float

    @property
    def measured(self) -> tuple[Measured, ...]:
        """Methods with figures on the poses, peers behind."""
        return tuple(row for row in (*self.contact, *self.peers) if isinstance(row, Measured))


def compare(
    *, peers: bool = False, progress: Callable[[int, int, str], None] = lambda done, total, what: None
) -> Comparison:
    """Measure all methods, one process after the other; ``progress`` gets jobs done, jobs in all and the next one.

    Times on the poses are the least of `ROUNDS` processes each; in all some minutes. A method that fails or does not
    end in time becomes a row that says so.
    """
    start = time.monotonic()
    peer_methods = PEER_METHODS if peers else ()
    absent = missing_peers() if peers else {}
    on_poses: list[tuple[Kind, Method]] = [
        *(("contact", method) for method in METHODS),
        *(("peer", method) for method in peer_methods),
    ]
    total = 2 + ROUNDS * len(on_poses) + len(ASSEMBLIES)
    done = 0

    def job(kind: Kind, method: Method, limit: float, what: str) -> Any:
        nonlocal done
        progress(done, total, what)
        done += 1
        try:
            if method.family in absent:
                raise JobError(absent[method.family])
            return run_job(kind, method, time_limit=limit)
        except JobError as error:
            return NotMeasured(method.family, method.setting, method.label, str(error))

    # The first process pays for compiling the kernel on a machine that has not done so.
    job("assembly", Method("cas"), ASSEMBLY_LIMIT, "warming up")
    rounds: list[list[Any]] = [[] for _ in on_poses]
    for k in range(ROUNDS):
        for (kind, method), rows in zip(on_poses, rounds, strict=True):
            if k == 0 or (isinstance(rows[0], Measured) and rows[0].setup < SLOW_SETUP):
                rows.append(job(kind, method, CONTACT_LIMIT, f"{method.label} on known poses"))
            else:
                done += 1
    rows_on_poses = [quickest(rows) for rows in rounds]
    assemblies = tuple(job("assembly", m, ASSEMBLY_LIMIT, f"assembly by {m.label}") for m in ASSEMBLIES)
    image = job("image", Method("image"), ASSEMBLY_LIMIT, "measuring in a picture")
    progress(total, total, "done")
    return Comparison(
        machine((*LIBRARIES, *(PEER_LIBRARIES if peers else ()))),
        tuple(rows_on_poses[: len(METHODS)]),
        tuple(rows_on_poses[len(METHODS) :]),
        assemblies,
        image,
        time.monotonic() - start,
    )


def quickest(rows: Sequence[Measured | NotMeasured]) -> Measured | NotMeasured:
    """The first row with the least of every time of those that have figures."""
    first, *_ = rows
    if not isinstance(first, Measured):
        return first
    some = [row for row in rows if isinstance(row, Measured)]
    times = {name: min(getattr(row, name) for row in some) for name in ("load", "setup", "one", "many")}
    return replace(first, **times)


def exact_distance(comparison: Comparison) -> float:
    """The assembled clamp's splint distance in mm by the exact method. Raises Clamp3dError if that failed."""
    for row in comparison.assemblies:
        if isinstance(row, Assembled) and row.method == "cas":
            return row.distance
    raise Clamp3dError("the assembly by cas gave no distance to compare with")


def pareto(rows: Sequence[Measured]) -> list[Measured]:
    """Those that no other row beats in both worst error and time per single query, the fastest first.

    Methods that only take parallel axes (chords) do not answer the same question and stay out.
    """
    front: list[Measured] = []
    for row in sorted((r for r in rows if r.method != "chords"), key=lambda r: (r.one, r.error)):
        if not front or row.error < front[-1].error:
            front.append(row)
    return front
