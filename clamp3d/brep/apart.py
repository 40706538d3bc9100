"""Foreign files read in a process of their own, with limits: ``python -m clamp3d.brep.apart FILE OUT NAME MEMORY``.

A damaged STEP file can end the interpreter, and a small archive can unpack to gigabytes. The process is a copy of this
one under the command line, else started afresh, and gives its reading back as a file of plain arrays.
"""

from __future__ import annotations

import gc
import importlib
import importlib.util
import json
import math
import os
import signal
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from clamp3d.brep.bodies import Reading, restore, save
from clamp3d.checks import readable_file
from clamp3d.core.child import end_with_caller, run_child
from clamp3d.errors import Clamp3dError, InputError, MissingLibraryError

READERS = {
    ".step": ("clamp3d.brep.step_file", "read_step", "OCP", "STEP needs Open CASCADE: pip install 'clamp3d[step]'"),
    ".stp": ("clamp3d.brep.step_file", "read_step", "OCP", "STEP needs Open CASCADE: pip install 'clamp3d[step]'"),
    ".3mf": ("clamp3d.brep.threemf_file", "read_3mf", "lib3mf", "3MF needs lib3mf: pip install 'clamp3d[3mf]'"),
}
"""Module and function that read each format, the library they need, and what to say without it."""
_MEMORY, _PER_BYTE = 2 * 2**30, 60
"""Bytes that a reader may take in any case, and for each byte of the file."""
_SECONDS, _PER_MEGABYTE = 60.0, 20.0
LIMITS = "CLAMP3D_READ_LIMITS"
"""Environment variable: a factor for the limits of memory and time."""


def read_apart(path: Path) -> Reading:
    """The bodies of a file of one of the `READERS`, read in another process.

    Raises InputError if the file cannot be read, also if its reader crashes, takes too long or too much memory, and
    MissingLibraryError without the library for it.
    """
    size = readable_file(path)
    _, _, library, advice = READERS[path.suffix.lower()]
    if not _installed(library):
        raise MissingLibraryError(advice)
    factor = _factor()
    seconds = factor * (_SECONDS + _PER_MEGABYTE * size / 1e6)
    memory = factor * (_MEMORY + _PER_BYTE * size)

    with tempfile.TemporaryDirectory(prefix="clamp3d-") as folder:
        out = Path(folder) / "bodies"
        arguments = (str(path.absolute()), str(out), str(path), str(int(memory)))
        code, said = run_child("clamp3d.brep.apart", *arguments, time_limit=seconds, copy=True)
        told = Path(f"{out}.json")
        if told.exists():
            raise InputError(json.loads(told.read_text())["error"])
        if code == 0:
            return restore(out)
    if code is None:
        raise InputError(f"{path}: not read in {seconds:.0f} s; {LIMITS}=4 allows four times as much")
    if any(word in line for line in said for word in ("bad_alloc", "MemoryError")):
        raise _too_large(path, memory)
    raise InputError(f"{path}: the reader ended with {_ending(code)}: the file is damaged, or uses what the reader does not support")


def _installed(library: str) -> bool:
    try:
        return importlib.util.find_spec(library) is not None
    except ValueError:
        return False


def _factor() -> float:
    given = os.environ.get(LIMITS, "1")
    try:
        factor = float(given)
    except ValueError:
        factor = math.nan
    if not 0.0 < factor < 1e6:
        raise InputError(f"{LIMITS} must be a number > 0, got {given!r}")
    return factor


def _too_large(path: str | Path, memory: float) -> InputError:
    return InputError(f"{path}: takes more than {memory / 2**30:.1f} GB to read; {LIMITS}=4 allows four times as much")


def _ending(code: int) -> str:
    try:
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"
    except ValueError:
        return f"signal {-code}"


def _limit(memory: int) -> None:
    """Keep this process from taking ``memory`` bytes more, where the system can, and from leaving a core file."""
    try:
        import resource
    except ImportError:  # Windows: the time limit alone
        return
    with suppress(OSError):  # what it has from the process that it is a copy of
        memory += int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    for kind, most in (("RLIMIT_DATA", memory), ("RLIMIT_CORE", 0)):
        _, hard = resource.getrlimit(getattr(resource, kind))
        resource.setrlimit(getattr(resource, kind), (most if hard < 0 else min(most, hard), hard))


def main(source: str, target: str, name: str, memory: str) -> None:
    """Read ``source``; write its bodies to ``target``, or one line about ``name`` beside it."""
    end_with_caller()
    _limit(int(memory))
    gc.disable()  # it lives for one file
    if hasattr(sys, "setdlopenflags"):
        sys.setdlopenflags(os.RTLD_LAZY)  # of the functions of a large library few are called: 5 % of its loading
    path = Path(source)
    module, function, _, _ = READERS[path.suffix.lower()]
    error: Exception
    try:
        read: Callable[[Path], Reading] = getattr(importlib.import_module(module), function)
        save(read(path), Path(target))
        return
    except MemoryError:
        error = _too_large(name, float(memory))
    except (Clamp3dError, OSError) as told:
        error = told
    Path(f"{target}.json").write_text(json.dumps({"error": str(error).replace(source, name)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
    os._exit(0)
