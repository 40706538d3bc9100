"""A method put to a family, shape by shape; in a process of its own where the method's libraries may end it."""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.core.pose import Array
from clamp3d.errors import Clamp3dError, without_numbers

_MAX_DEATHS = 5
_IMPORTED = ("scipy.optimize", "scipy.spatial", "trimesh", "fcl")
"""Loaded in a child before the clock runs."""

Measures = Literal["depth", "clearance", "verdict"]
"""What a method's answers are good for: signed distances, distances while apart, or their sign alone."""


class Cases(Protocol):
    """Cases of any kind, ``shape`` (n,) the number of the shapes that each is about."""

    @property
    def shape(self) -> NDArray[np.intp]: ...  # noqa: D102

    def __len__(self) -> int: ...

    def take(self, rows: ArrayLike) -> Any:
        """The named cases."""
        ...


@dataclass(frozen=True, slots=True)
class Measured:
    """Distances (n,) mm and the method's own bound of their errors (n,) mm; NaN where it gives none.

    ``unfit`` (n,) marks cases that the method does not claim to answer, ``why`` says so; their numbers do not count.
    """

    distance: Array
    bound: Array
    unfit: NDArray[np.bool_]
    why: str = ""


class Method(Protocol):
    """A contact method: ``measure`` answers cases that share one shape, or raises InputError if it cannot."""

    @property
    def measures(self) -> Measures: ...  # noqa: D102

    def measure(self, cases: Any) -> Measured:
        """Distances of ``cases``, all on the shape of the first."""
        ...


@dataclass
class Answers:
    """What came back: ``distance`` and ``bound`` (n,) NaN where nothing did; ``refused``: said why; ``failed``: raised.

    ``crashed`` lists the cases that ended the interpreter, ``late`` those that it did not answer in time, ``notes`` one
    message per kind of failure; ``left`` cases were not asked any more when the time was over.
    """

    distance: Array
    bound: Array
    refused: NDArray[np.bool_]
    failed: NDArray[np.bool_]
    asked: NDArray[np.bool_]
    seconds: float = 0.0
    crashed: list[int] = field(default_factory=list)
    late: list[int] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @classmethod
    def empty(cls, n: int) -> Answers:
        """No answer yet to n cases."""
        nan, no = np.full(n, np.nan), np.zeros(n, bool)
        return cls(nan, nan.copy(), no, no.copy(), no.copy())

    def note(self, text: str) -> None:
        """Keep a message, each kind once."""
        if text not in self.notes and len(self.notes) < 5:
            self.notes.append(text)


def _groups(cases: Cases) -> list[NDArray[np.intp]]:
    """Rows of each shape."""
    order = np.argsort(cases.shape, kind="stable")
    cuts = np.flatnonzero(np.diff(cases.shape[order])) + 1
    return np.split(order, cuts)


def _measure(asked: Method, cases: Cases, rows: NDArray[np.intp]) -> tuple[Measured | None, str, float]:
    """Answer, or why there is none: 'refused: ...' in the project's own words, or the exception's name."""
    start = time.perf_counter()
    try:
        found: Measured | None = asked.measure(cases.take(rows))
        why = ""
    except Clamp3dError as error:
        found, why = None, f"refused: {str(error).splitlines()[0]}"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        found, why = None, f"{type(error).__name__}: {error} ({place.name})"
    return found, why, time.perf_counter() - start


def _record(answers: Answers, rows: NDArray[np.intp], found: Measured | None, why: str, seconds: float) -> None:
    answers.asked[rows] = True
    answers.seconds += seconds
    if found is not None:
        answers.distance[rows] = np.where(found.unfit, np.nan, found.distance)
        answers.bound[rows] = found.bound
        answers.refused[rows] = found.unfit
        if found.unfit.any():
            answers.note(f"refused: {found.why}")
    elif why.startswith("refused: "):
        answers.refused[rows] = True
        answers.note(without_numbers(why))
    else:
        answers.failed[rows] = True
        answers.note(without_numbers(why))


def run_here(asked: Method, cases: Cases, time_limit: float | None = None) -> Answers:
    """Put ``cases`` to a method in this process; groups of one shape at a time, singly where a group has no answer."""
    answers = Answers.empty(len(cases))
    groups = _groups(cases)
    if groups:
        _measure(asked, cases, groups[0][:1])  # compile and import before the clock runs
    start = time.monotonic()
    for rows in groups:
        if time_limit is not None and time.monotonic() - start > time_limit:
            break
        for part in _parts(asked, cases, rows):
            _record(answers, *part)
    return answers


def _parts(
    asked: Method, cases: Cases, rows: NDArray[np.intp]
) -> Iterator[tuple[NDArray[np.intp], Measured | None, str, float]]:
    found, why, seconds = _measure(asked, cases, rows)
    if found is not None or len(rows) == 1:
        yield rows, found, why, seconds
        return
    for row in rows:
        yield np.array([row]), *_measure(asked, cases, np.array([row]))


def _serve(pipe: Connection, make: Callable[[], Method], cases: Cases) -> None:
    """Child: answer the rows that are sent, until the parent closes the pipe."""
    asked = make()
    for name in _IMPORTED:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    pipe.send("ready")
    try:
        while True:
            pipe.send(list(_parts(asked, cases, pipe.recv())))
    except (EOFError, BrokenPipeError, KeyboardInterrupt):  # the parent has no more questions
        return


def run_isolated(make: Callable[[], Method], cases: Cases, *, time_limit: float, case_limit: float = 20.0) -> Answers:
    """Put ``cases`` to the method that ``make`` (which must pickle) returns, in a child process that may die.

    A group on which the child dies or is silent for ``case_limit`` seconds is asked again case by case; after
    some deaths the family is left. ``time_limit`` seconds are for the whole family.
    """
    answers = Answers.empty(len(cases))
    queue: list[NDArray[np.intp]] = _groups(cases)[::-1]
    end = time.monotonic() + time_limit
    child: Any = None
    pipe: Any = None
    deaths = 0
    context = multiprocessing.get_context("spawn")
    try:
        while queue and time.monotonic() < end and deaths < _MAX_DEATHS:
            if child is None:
                pipe, other = context.Pipe()
                child = context.Process(target=_serve, args=(other, make, cases), daemon=True)
                child.start()
                other.close()
                if not pipe.poll(120.0):
                    answers.note("refused: the method did not start within 120 s")
                    break
                try:
                    pipe.recv()
                except EOFError:
                    answers.note(f"the interpreter ended with {_code(child)} at start")
                    break
            rows = queue.pop()
            try:
                pipe.send(rows)
                in_time = pipe.poll(case_limit)
                parts = pipe.recv() if in_time else None
            except (EOFError, BrokenPipeError, ConnectionResetError):
                in_time, parts = True, None
            if parts is not None:
                for part in parts:
                    _record(answers, *part)
                continue
            deaths += 1
            if len(rows) > 1:
                queue += [np.array([row]) for row in rows[::-1]]
                deaths -= 1  # counted when the case itself is found
            else:
                answers.asked[rows] = True
                (answers.crashed if in_time else answers.late).append(int(rows[0]))
                answers.note(
                    f"the interpreter ended with {_code(child)}" if in_time else f"no answer within {case_limit:g} s"
                )
            _end(child, pipe)
            child = None
    finally:
        if child is not None:
            _end(child, pipe)
    return answers


def _code(child: Any) -> str:
    """How a child ended, in words."""
    child.join(5.0)
    code: int | None = child.exitcode
    return signal.Signals(-code).name if code is not None and code < 0 else f"exit code {code}"


def _end(child: Any, pipe: Any) -> None:
    pipe.close()
    if child.is_alive():
        child.kill()
    child.join()
