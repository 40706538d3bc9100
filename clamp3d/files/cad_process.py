"""Open CASCADE in the process for foreign files, which stays alive: a fault in it ends no more than the question."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from clamp3d.errors import SolverError
from clamp3d.files import faces, open_cascade, pairs, tessellation, turned
from clamp3d.files.child import WorkerEndedError, WorkerTimeoutError
from clamp3d.files.worker import process

_P = ParamSpec("_P")
_R = TypeVar("_R")
_PATIENCE = 60.0 if hasattr(signal, "setitimer") else 3.0
"""Seconds in which a process of a very busy machine gets one second of processor time, where that can be limited."""
_FINE_SECONDS = 20.0
"""Time limit of triangles that are finer than usual: of splines they can take minutes, and others may decide."""
_QUICK_SECONDS, _COMMON_SECONDS = 1.0, 5.0
"""Time limits of a common part, which Open CASCADE does not always find between round faces that all but coincide.

Where it does not end, finer meshes decide.
"""


def _there(function: Callable[_P, _R], seconds: float = 300.0) -> Callable[_P, _R]:
    """The function, answered in the process within so much processor time; a few hundred milliseconds are usual."""

    def call(*arguments: _P.args, **_: _P.kwargs) -> _R:
        name = f"{function.__module__}:{function.__name__}"
        try:
            result: _R = process().call(name, *arguments, time_limit=_PATIENCE * seconds, cpu=seconds)
            return result
        except WorkerEndedError as error:
            raise SolverError(f"Open CASCADE ended with {error.ending}") from None
        except WorkerTimeoutError:
            raise SolverError(f"Open CASCADE gave no answer in {seconds:g} s") from None

    return call


tessellate = _there(tessellation.tessellate)
tessellate_finely = _there(tessellation.tessellate, _FINE_SECONDS)
surfaces = _there(faces.surfaces)
bounds_at = _there(open_cascade.bounds_at)
face_bounds_at = _there(open_cascade.face_bounds_at)
distance = _there(pairs.distance)
common = _there(pairs.common, _COMMON_SECONDS)
quick_common = _there(pairs.common, _QUICK_SECONDS)
depths = _there(pairs.depths)
turned_sections = _there(turned.turned_sections)
