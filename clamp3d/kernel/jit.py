"""How the kernels are compiled: by numba, which keeps them in NUMBA_CACHE_DIR or beside the source files.

Importing this module imports numba, which takes 0.2 s of CPU: functions import their kernels when they call them.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event

_F = TypeVar("_F", bound=Callable[..., Any])

# IEEE arithmetic as written (no re-association), and division by zero gives inf instead of a Python exception.
_OPTIONS: dict[str, Any] = {"fastmath": False, "error_model": "numpy", "nogil": True}
# Code with which Python and C would call a function is a fifth of the time to compile. Formulas have none.
_INTERNAL: dict[str, Any] = {**_OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

_FOLDER = Path(__file__).resolve().parent
_SOURCES = (
    *sorted(_FOLDER.glob("*.py")),
    *(_FOLDER.parent / "geometry" / name for name in ("pose.py", "primitives.py")),
)
_CONFIG: Any = numba.config  # its names come from the environment
_NUMBA_FOLDER = _CONFIG.CACHE_DIR
# Named by all sources: numba itself watches only the file that a kernel stands in.
_DIGEST = hashlib.sha256(b"".join(path.read_bytes() for path in _SOURCES)).hexdigest()
_CACHE_FOLDER = str(Path(_NUMBA_FOLDER or _FOLDER / "__pycache__") / f"kernel-{_DIGEST[:16]}")


def formula(function: _F) -> _F:
    """Decorator of a formula that only kernels call: compiled into them. Called from Python it ends the interpreter."""
    compiled: _F = numba.njit(**_INTERNAL)(function)
    return compiled


def inlined(function: _F) -> _F:
    """The same for a small formula: built into each caller."""
    compiled: _F = numba.njit(forceinline=True, **_INTERNAL)(function)
    return compiled


def entry(signature: Any) -> Callable[[_F], _F]:
    """Decorator of a kernel that Python calls with arguments of these types alone.

    It is compiled, or taken from numba's cache, when its module is imported: all kernels of a module at once. Where
    numba finds no folder for its cache, every run compiles them.
    """

    def decorate(function: _F) -> Any:
        notice = _Notice()
        _CONFIG.CACHE_DIR = _CACHE_FOLDER
        with event.install_listener("numba:compile", notice):
            try:
                return numba.njit(signature, cache=True, **_OPTIONS)(function)
            except RuntimeError:  # no folder can be written
                notice.when = " in every run: set NUMBA_CACHE_DIR to a folder that can be written"
                return numba.njit(signature, **_OPTIONS)(function)
            finally:
                _CONFIG.CACHE_DIR = _NUMBA_FOLDER

    return decorate


class _Notice(event.Listener):
    """One line on stderr when numba begins to compile the first kernel."""

    when = ", once for this version"
    is_said = False

    def on_start(self, event: object) -> None:
        if not _Notice.is_said:
            _Notice.is_said = True
            print(f"clamp3d: compiling the contact kernel{self.when} ...", file=sys.stderr, flush=True)

    def on_end(self, event: object) -> None:
        pass
