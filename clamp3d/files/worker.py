"""Foreign files are read in a process of their own, within limits of memory and time.

A damaged file can end the interpreter, a small archive can unpack to gigabytes. What goes wrong there is one line here.
"""

from __future__ import annotations

import atexit
import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clamp3d.checks import note_read, readable_file, short, shown
from clamp3d.errors import InputError
from clamp3d.files.child import Worker, WorkerEndedError, WorkerTimeoutError

if TYPE_CHECKING:
    from clamp3d.files.bodies import Reading

LIMITS = "CLAMP3D_READ_LIMITS"
"""Environment variable: a factor for the limits of memory and time."""
OUTSIDE = "CLAMP3D_READ_OUTSIDE"
"""Environment variable: "1" allows files to name others outside of their own folder."""
_MEMORY, _PER_BYTE = 2 * 2**30, 60
"""Bytes that reading may take in any case, and for each byte of the file."""
_SECONDS, _PER_MEGABYTE = 60.0, 20.0


@cache
def process() -> Worker:
    """The process in which foreign files are read and Open CASCADE works: the first call starts it."""
    worker = Worker(confined=True)
    atexit.register(worker.close)
    return worker


def _forget() -> None:
    """In a forked process: the worker stays with the process that started it."""
    if process.cache_info().currsize:
        atexit.unregister(process().close)
        process.cache_clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def read_in_process(path: Path, option: Any = None) -> Reading:
    """The bodies of a file, read in the process; ``option`` is its unit, or the joints of a robot.

    Raises InputError if the file cannot be read, also if its reader crashes, or takes too much time or memory, and
    MissingLibraryError if its reader is not installed.
    """
    size = readable_file(path)
    factor = _factor()
    seconds = factor * (_SECONDS + _PER_MEGABYTE * size / 1e6)
    memory = factor * (_MEMORY + _PER_BYTE * size)
    arguments = (path.absolute(), option, os.environ.get(OUTSIDE) == "1")
    try:
        reading: Reading = process().call(
            "clamp3d.files.formats:read_any", *arguments, time_limit=seconds, memory=memory
        )
        note_read(reading.files)
        return reading
    except WorkerTimeoutError:
        problem = f"not read in {seconds:.0f} s; {LIMITS}=4 allows four times as much"
    except MemoryError:
        problem = f"takes more than {memory / 2**30:.1f} GB to read; {LIMITS}=4 allows four times as much"
    except WorkerEndedError as error:
        reason = error.last or "the file is damaged, or uses what the reader does not support"
        problem = f"the reader ended with {error.ending}: {reason}"
    except InputError as error:
        problem = str(error)
    raise InputError(f"{short(path)}: {problem.removeprefix(f'{path.name}: ')}")


def may_read(file: Path, folder: Path) -> bool:
    """Whether a file that another one names may be read: it is in the ``folder``, or the user allows all."""
    return os.environ.get(OUTSIDE) == "1" or file.resolve().is_relative_to(folder.resolve())


def named_file(path: Path, name: str) -> Path:
    """The file beside ``path`` that this file names. Raises InputError unless it may be read."""
    if not may_read(path.parent / name, path.parent):
        raise InputError(f"names {shown(name)}, which is outside of its folder; {OUTSIDE}=1 allows that")
    note_read([path.parent / name])
    return path.parent / name


def _factor() -> float:
    """The user's factor for the limits."""
    text = os.environ.get(LIMITS, "1")
    with suppress(ValueError):
        if 0.0 < (factor := float(text)) < 1e6:
            return factor
    raise InputError(f"{LIMITS} must be a number > 0, got {text!r}")
