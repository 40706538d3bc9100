"""The process in which foreign files are read and Open CASCADE works: it is started once, and again after a crash."""

from __future__ import annotations

import atexit
from functools import cache

from clamp3d.brep.child import Worker

READ = "clamp3d.brep.formats:read_plain"
"""The function that reads a file."""
OPEN_CASCADE = "clamp3d.brep.open_cascade"
"""The module whose questions the process answers."""
_QUESTIONS = ("tessellate", "surfaces", "distance", "common", "depths", "bounds_at")


@cache
def process() -> Worker:
    """The process of this one; the first call starts it, and it ends with this one."""
    worker = Worker(READ, *(f"{OPEN_CASCADE}:{name}" for name in _QUESTIONS), confined=True)
    atexit.register(worker.close)
    return worker
