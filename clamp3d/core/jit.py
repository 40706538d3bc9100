"""How the compiled formulas are built: cached on disk where that is possible, never an error where it is not."""

from __future__ import annotations

import hashlib
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

# IEEE arithmetic as written (no re-association), and division by zero gives inf instead of a Python exception.
_OPTIONS: dict[str, Any] = {"fastmath": False, "error_model": "numpy", "nogil": True}

formula = numba.njit(**_OPTIONS)
"""Decorator of a formula: compiled into its callers, not cached by itself."""

inlined = numba.njit(forceinline=True, **_OPTIONS)
"""The same for a small formula: built into each caller, which drops what it does not use."""

NOTICE_AFTER = 1.0
"""Seconds after which a build that is still running is announced on stderr."""

_announced = False


def source_stamp() -> str:
    """Hash of all formula sources.

    numba notices a change in the file of a cached function, not in the files of the functions it calls. Entry points
    close over this stamp, which makes it a part of their cache key.
    """
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("kernel*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _announce() -> None:
    global _announced
    if not _announced:
        _announced = True
        text = "clamp3d: compiling the contact kernel, once for this machine (a few seconds) ..."
        print(text, file=sys.stderr, flush=True)


def entry(function: Callable[..., Any], signature: str) -> Any:
    """Compile an entry point for one signature, from the disk cache if it is there.

    Without a writable cache folder (read-only installation and home, full disk) it is compiled in memory.
    """
    timer = threading.Timer(NOTICE_AFTER, _announce)
    timer.daemon = True
    timer.start()
    try:
        return numba.njit(signature, cache=True, **_OPTIONS)(function)
    except (OSError, RuntimeError):
        return numba.njit(signature, **_OPTIONS)(function)
    finally:
        timer.cancel()
