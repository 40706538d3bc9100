"""Seeded inputs put to the project one by one, in a child process that may hang or die without ending the count."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import sys
import tempfile
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

CASE_LIMIT = 300.0
"""Seconds after which one input counts as hanging, on however busy a machine."""
_START_LIMIT = 300.0
_MEMORY = 6 << 30  # bytes of address space: what asks for more is a finding, not the end of the machine


class FindingError(Exception):
    """The project answered in a way that is not allowed."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of an input: 'answered', 'refused', or 'failed'; ``input`` and ``note`` tell a reader which and why."""

    status: str
    input: str
    note: str = ""


Kind = Callable[[np.random.Generator, Path], tuple[str, Callable[[], bool]]]
"""Makes one input in a folder of its own: its description, and a call that is True if answered, False if refused."""


@dataclass
class Tally:
    """Counts of one kind of input."""

    kind: str
    seed: int
    n: int = 0
    answered: int = 0
    refused: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    failures: list[tuple[int, str, str]] = field(default_factory=list)
    messages: Counter[str] = field(default_factory=Counter)


def kinds() -> dict[str, Kind]:
    """All kinds of input by name."""
    from tests.fuzz import api_calls, clamp_files, command_lines, mesh_files, scene_files

    return {
        "clamp files": clamp_files.make,
        "scene files": scene_files.make,
        "API calls": api_calls.make,
        "mesh files": mesh_files.make,
        "command lines": command_lines.make,
        "own test": _own_test,
    }


def _own_test(rng: np.random.Generator, folder: Path) -> tuple[str, Callable[[], bool]]:
    """What `run` is there for: inputs that answer, refuse, raise, end the interpreter, or hang."""
    calls: dict[str, Callable[[], Any]] = {
        "answers": lambda: True,
        "refuses": lambda: False,
        "raises": lambda: [][0],
        "dies": os.abort,
        "hangs": lambda: time.sleep(600),
    }
    way = list(calls)[int(rng.integers(5))]
    return way, calls[way]


def generator(kind: str, seed: int, index: int) -> np.random.Generator:
    """The random numbers of one input."""
    return np.random.default_rng((seed, zlib.crc32(kind.encode()), index))


def one(kind: str, seed: int, index: int, *, trace: bool = False) -> Answer:
    """Make input ``index`` of a kind and put it to the project, in this process."""
    rng = generator(kind, seed, index)
    text = "(not made)"
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, _inside(Path(folder)) as place:
        try:
            text, call = kinds()[kind](rng, place)
            answered = call()
        except FindingError as finding:
            return Answer("failed", text, str(finding))
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            if trace:
                traceback.print_exc()
            return Answer("failed", text, _where(error))
        return Answer("answered" if answered else "refused", text)


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[Path]:
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield Path()
    finally:
        os.chdir(before)
        for path in folder.rglob("*"):  # a folder without write permission could not be removed
            if path.is_dir() and not path.is_symlink():
                path.chmod(0o700)


def _where(error: BaseException) -> str:
    """The exception with the last line of the project that it came through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if f"{os.sep}clamp3d{os.sep}" in f.filename and "site-packages" not in f.filename]
    place = f" at {Path(ours[-1].filename).name}:{ours[-1].lineno} ({ours[-1].name})" if ours else ""
    return f"{type(error).__name__}: {str(error)[:300]}{place}"


def _serve(pipe: Any, kind: str, seed: int) -> None:
    """Child: answer one index after another until told to stop."""
    sys.stdin = open(os.devnull)  # noqa: SIM115
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    from clamp3d.core.distance import kernel

    kernel()
    pipe.send("ready")
    with contextlib.suppress(EOFError, BrokenPipeError):
        while (rows := pipe.recv()) is not None:
            for index in rows:
                start = time.perf_counter()
                answer = one(kind, seed, index)
                pipe.send((index, answer, time.perf_counter() - start))


def run(
    kind: str,
    n: int,
    seed: int,
    *,
    first: int = 0,
    limit: float = CASE_LIMIT,
    progress: Callable[[int], None] = lambda done: None,
) -> Tally:
    """Put inputs ``first`` to ``first + n - 1`` of a kind to the project; none can end this process."""
    tally = Tally(kind, seed)
    context = multiprocessing.get_context("spawn")
    child = pipe = None
    start = time.perf_counter()
    todo = list(range(first, first + n))[::-1]
    try:
        while todo:
            if child is None:
                pipe, other = context.Pipe()
                child = context.Process(target=_serve, args=(other, kind, seed), daemon=True)
                child.start()
                other.close()
                if not pipe.poll(_START_LIMIT) or pipe.recv() != "ready":
                    raise RuntimeError(f"the child did not start within {_START_LIMIT:g} s")
            batch = [todo.pop() for _ in range(min(64, len(todo)))]
            pipe.send(batch)
            asked = list(batch)
            while asked:
                try:
                    in_time = pipe.poll(limit)
                    index, answer, seconds = pipe.recv() if in_time else (asked[0], None, limit)
                except (EOFError, ConnectionResetError):
                    child.join(5.0)
                    index, seconds = asked[0], 0.0
                    answer = Answer("failed", "", f"the interpreter ended with code {child.exitcode}")
                    in_time = False
                if answer is None:
                    answer = Answer("failed", "", f"no answer within {limit:g} s")
                asked.remove(index)
                tally.n += 1
                tally.slowest = max(tally.slowest, seconds)
                if answer.status == "failed":
                    tally.failures.append((index, answer.input, answer.note))
                    tally.messages[answer.note] += 1
                else:
                    setattr(tally, answer.status, getattr(tally, answer.status) + 1)
                if not in_time:
                    todo += asked[::-1]
                    child.kill()
                    child.join()
                    child = None
                    break
            progress(tally.n)
        if child is not None:
            pipe.send(None)
            child.join(10.0)
    finally:
        if child is not None and child.is_alive():
            child.kill()
            child.join()
    tally.seconds = time.perf_counter() - start
    return tally
