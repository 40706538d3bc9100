"""Runs a method on a family, shape by shape; in a process of its own if the method's libraries may crash."""

from __future__ import annotations

import pickle
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, Protocol, Self, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.errors import Clamp3dError, without_numbers
from clamp3d.files.child import Worker, WorkerEndedError, WorkerTimeoutError
from clamp3d.geometry.pose import Array

_MAX_CRASHES = 5
_START_LIMIT = 120.0  # s
Measures = Literal["depth", "clearance", "verdict"]
"""What a method's answers are good for: signed distances, distances while apart, or their sign alone."""


class Rows:
    """Cases as a dataclass of columns, arrays (n, ...); ``shape`` (n,) is the number of the shapes each is about."""

    __slots__ = ()
    shape: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.shape)

    def take(self, rows: ArrayLike) -> Self:
        """The named cases."""
        i = np.asarray(rows, dtype=np.intp)
        taken: dict[str, Any] = {}
        for f in fields(cast(Any, self)):
            column = getattr(self, f.name)
            if isinstance(column, Rows):
                taken[f.name] = column.take(i)
            elif isinstance(column, np.ndarray):
                taken[f.name] = column[i]
        return cast(Self, replace(cast(Any, self), **taken))


@dataclass(frozen=True, slots=True)
class Measured:
    """Distances (n,) mm and the method's own bound of their errors (n,) mm; NaN where it gives none.

    ``unfit`` (n,) marks cases that the method does not claim to answer, ``why`` says so; their numbers do not count.
    """

    distance: Array
    bound: Array
    unfit: NDArray[np.bool_] | Literal[False] = False
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
    """Answers to n cases: ``distance`` and ``bound`` (n,), NaN where there is none; ``refused``, ``failed``: which.

    ``crashed`` lists the cases that ended the interpreter, ``timeouts`` those that it did not answer in time, ``notes``
    one message per kind of failure. Cases that are not ``tried`` were skipped when the time was over.
    """

    distance: Array
    bound: Array
    refused: NDArray[np.bool_]
    failed: NDArray[np.bool_]
    tried: NDArray[np.bool_]
    seconds: float = 0.0
    crashed: list[int] = field(default_factory=list)
    timeouts: list[int] = field(default_factory=list)
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


_Reply = tuple[NDArray[np.intp], Measured | None, str, float]
"""Rows, the method's answers, or why there is no answer, and the seconds."""


def _measure(method: Method, cases: Any, rows: NDArray[np.intp]) -> _Reply:
    """Measure some rows of one shape; the reason of an InputError begins with 'refused: '."""
    measured, why = None, ""
    start = time.perf_counter()
    try:
        measured = method.measure(cases.take(rows))
    except Clamp3dError as error:
        why = f"refused: {str(error).splitlines()[0]}"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        why = f"{type(error).__name__}: {error} ({place.name})"
    return rows, measured, why, time.perf_counter() - start


def _replies(method: Method, cases: Any, rows: NDArray[np.intp]) -> list[_Reply]:
    """Measure all rows at once, and one by one if that gives no answer."""
    reply = _measure(method, cases, rows)
    if reply[1] is not None or len(rows) == 1:
        return [reply]
    return [_measure(method, cases, rows[k : k + 1]) for k in range(len(rows))]


def _record(answers: Answers, reply: _Reply) -> None:
    rows, measured, why, seconds = reply
    answers.tried[rows] = True
    answers.seconds += seconds
    if measured is None:
        (answers.refused if why.startswith("refused: ") else answers.failed)[rows] = True
        answers.note(without_numbers(why))
        return
    answers.distance[rows] = np.where(measured.unfit, np.nan, measured.distance)
    answers.bound[rows] = measured.bound
    answers.refused[rows] = measured.unfit
    if np.any(measured.unfit):
        answers.note(f"refused: {measured.why}")


def _groups(cases: Any) -> list[NDArray[np.intp]]:
    """Rows of each shape."""
    order = np.argsort(cases.shape, kind="stable")
    cuts = np.flatnonzero(np.diff(cases.shape[order])) + 1
    return np.split(order, cuts)


def run_here(method: Method, cases: Any, time_limit: float | None = None) -> Answers:
    """Run a method on ``cases`` in this process; groups of one shape at a time, singly where a group has no answer."""
    answers = Answers.empty(len(cases))
    groups = _groups(cases)
    if groups:
        _measure(method, cases, groups[0][:1])  # compile and import before the clock runs
    start = time.monotonic()
    for rows in groups:
        if time_limit is not None and time.monotonic() - start > time_limit:
            break
        for reply in _replies(method, cases, rows):
            _record(answers, reply)
    return answers


_PREPARE, _ANSWER = (f"{__name__}:{name}" for name in ("prepare", "answer"))
_held: dict[str, tuple[Method, Any]] = {}
"""In a child: its method and cases."""


def prepare(setup: bytes) -> None:
    """Child: make the method, let it import what it needs by a first call, and keep the cases."""
    make, cases = pickle.loads(setup)
    _held["here"] = make(), cases


def answer(rows: NDArray[np.intp]) -> list[_Reply]:
    """Child: the method's replies to some rows."""
    return _replies(*_held["here"], rows)


def run_isolated(make: Callable[[], Method], cases: Any, *, time_limit: float, case_limit: float = 20.0) -> Answers:
    """Run the method that ``make`` (which must pickle) returns on ``cases``, in a child process that may crash.

    A group on which the child crashes or is silent for ``case_limit`` seconds is tried again case by case; after some
    crashes the rest of the family is skipped. ``time_limit`` seconds are for the whole family.
    """
    answers = Answers.empty(len(cases))
    queue: list[NDArray[np.intp]] = _groups(cases)[::-1]
    end = time.monotonic() + time_limit
    setup, is_ready, crashes = pickle.dumps((make, cases)), False, 0
    with Worker() as worker:
        while queue and time.monotonic() < end and crashes < _MAX_CRASHES:
            try:
                if not is_ready:
                    worker.call(_PREPARE, setup, time_limit=_START_LIMIT)
                    is_ready = True
            except (Clamp3dError, RuntimeError) as error:
                answers.note(f"the method did not start: {error}")
                break
            rows = queue.pop()
            try:
                for reply in worker.call(_ANSWER, rows, time_limit=case_limit):
                    _record(answers, reply)
                continue
            except WorkerTimeoutError:
                lost, why = answers.timeouts, f"no answer within {case_limit:g} s"
            except WorkerEndedError as error:
                lost, why = answers.crashed, f"the interpreter ended with {error.ending}"
            is_ready = False
            if len(rows) > 1:
                queue += [np.array([row]) for row in rows[::-1]]
            else:
                crashes += 1
                answers.tried[rows] = True
                lost.append(int(rows[0]))
                answers.note(why)
    return answers
