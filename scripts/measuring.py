"""CPU time of calls and of whole programs, for the scripts that measure."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]


class Run(NamedTuple):
    """One run of a program; the exit code is -9 where it ran into the time limit."""

    code: int
    output: str
    seconds: float


def run_python(*command: object, limit: float = 3600.0) -> Run:
    """Run Python as it runs an installed package: with its bytecode kept. ``limit`` is in seconds."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    words = ["timeout", "--signal=KILL", str(limit), sys.executable, *map(str, command)]
    with tempfile.TemporaryFile("w+") as output:
        before = cpu_seconds()
        done = subprocess.run(
            words, env=environment | {"PYTHONPATH": str(ROOT)}, stdout=output, stderr=subprocess.DEVNULL, check=False
        )
        seconds = cpu_seconds() - before
        output.seek(0)
        return Run(done.returncode, output.read(), seconds)


def cpu_seconds() -> float:
    """CPU time of this process and of those that it started and that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def cpu_of(call: Callable[[], object]) -> float:
    """CPU seconds of one call."""
    before = cpu_seconds()
    call()
    return cpu_seconds() - before


def spread(values: Iterable[float]) -> str:
    """Least, median and greatest, to three digits."""
    ordered = sorted(values)
    return " / ".join(f"{x:.3g}" for x in (ordered[0], statistics.median(ordered), ordered[-1]))
