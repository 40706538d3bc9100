"""Open CASCADE in the process for foreign files, which stays alive: a fault in it ends no more than the question.

Each function here calls the one of the same name in `open_cascade`, `faces`, `tessellation` or `pairs`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from clamp3d.brep.child import WorkerEndedError, WorkerTimeoutError
from clamp3d.brep.faces import Surfaces
from clamp3d.brep.pairs import CommonPart
from clamp3d.brep.process import process
from clamp3d.brep.tessellation import Tessellation
from clamp3d.core.pose import Array
from clamp3d.errors import SolverError

_SECONDS = 120.0
"""Time limit of a question; a few hundred milliseconds are usual."""
_COMMON_SECONDS = 5.0
"""Time limit of a common part, which Open CASCADE does not always find between round faces that all but coincide.

Where it does not end, finer meshes decide.
"""


def _ask(name: str, *arguments: Any, seconds: float = _SECONDS) -> Any:
    try:
        return process().call(f"clamp3d.brep.{name}", *arguments, time_limit=seconds)
    except WorkerEndedError as error:
        raise SolverError(f"Open CASCADE ended with {error.ending}") from None
    except WorkerTimeoutError:
        raise SolverError(f"Open CASCADE gave no answer in {seconds:g} s") from None


def tessellate(brep: bytes, chord: float) -> Tessellation:
    """Triangles of a solid, each with its error."""
    return Tessellation(**_ask("tessellation:tessellate", brep, chord))


def surfaces(brep: bytes) -> Surfaces:
    """The surfaces of a solid's faces."""
    return Surfaces(**_ask("faces:surfaces", brep))


def bounds_at(brep: bytes, T: Array) -> Array:
    """Box (2, 3) of a solid placed by ``T`` (4, 4), mm."""
    return np.asarray(_ask("open_cascade:bounds_at", brep, T))


def distance(a: bytes, b: bytes, T: Array) -> tuple[float, Array, Array]:
    """Distance (mm) of two solids and nearest points (3,); 0 where they touch or overlap."""
    gap, p, q = _ask("pairs:distance", a, b, T)
    return gap, p, q


def common(a: bytes, b: bytes, T: Array, share: float) -> CommonPart:
    """The common part of two solids; chords of its border are ``share`` of its thickness."""
    return CommonPart(**_ask("pairs:common", a, b, T, share, seconds=_COMMON_SECONDS))


def depths(brep: bytes, points: Array) -> Array:
    """Signed depth (k,) mm of points (k, 3) in a solid: negative outside."""
    return np.asarray(_ask("pairs:depths", brep, points))
