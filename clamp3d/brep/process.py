"""The process in which foreign files are read and Open CASCADE works: it is started once, and again after a crash."""

from __future__ import annotations

import atexit
from functools import cache

from clamp3d.brep.child import Worker

READ = "clamp3d.brep.formats:read_plain"
"""The function that reads a file."""
_QUESTIONS = (
    "open_cascade:bounds_at",
    "faces:surfaces",
    "tessellation:tessellate",
    "pairs:distance",
    "pairs:common",
    "pairs:depths",
)
"""What Open CASCADE is asked, by module and function of this package."""


@cache
def process() -> Worker:
    """The process of this one; the first call starts it, and it ends with this one."""
    worker = Worker(READ, *(f"clamp3d.brep.{name}" for name in _QUESTIONS), confined=True)
    atexit.register(worker.close)
    return worker
