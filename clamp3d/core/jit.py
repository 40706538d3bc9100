"""How the compiled formulas are built: cached on disk where that is possible, never an error where it is not."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import event

# IEEE arithmetic as written (no re-association), and division by zero gives inf instead of a Python exception.
_OPTIONS: dict[str, Any] = {"fastmath": False, "error_model": "numpy", "nogil": True}

formula = numba.njit(**_OPTIONS)
"""Decorator of a formula: compiled into its callers, not cached by itself."""

inlined = numba.njit(forceinline=True, **_OPTIONS)
"""The same for a small formula: built into each caller, which drops what it does not use."""


def source_stamp() -> str:
    """Hash of all formula sources.

    numba notices a change in the file of a cached function, not in the files of the functions it calls. Entry points
    close over this stamp, which makes it a part of their cache key.
    """
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("kernel*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


class _Notice(event.Listener):
    """One line on stderr when numba begins to compile; what it reads from the cache makes no such event."""

    def __init__(self) -> None:
        self.given = False

    def on_start(self, event: object) -> None:
        if not self.given:
            self.given = True
            text = "clamp3d: compiling the contact kernel, once for this machine (a few seconds) ..."
            print(text, file=sys.stderr, flush=True)

    def on_end(self, event: object) -> None:
        pass


_notice = _Notice()


def entry(function: Callable[..., Any], signature: str) -> Any:
    """Compile an entry point for one signature, from the disk cache if it is there.

    Damaged cache files (cut short by a crash or a full disk) are written anew. Without a writable cache folder
    (read-only installation and home, full disk) the function is compiled in memory.
    """
    with event.install_listener("numba:compile", _notice):
        with suppress(OSError, RuntimeError):  # no place for the cache, or none left
            cached = numba.njit(cache=True, **_OPTIONS)(function)
            try:
                cached.compile(signature)
            except Exception:  # unpickling a damaged file can raise anything
                cached._cache.flush()
                cached.compile(signature)
            cached.disable_compile()
            return cached
        return numba.njit(signature, **_OPTIONS)(function)
