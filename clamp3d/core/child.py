"""Work in a Python process of its own, for libraries that end their process or cannot be stopped."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable

_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""To start NumPy's threads takes 0.04 s of CPU."""


def run_child(
    module: str,
    *arguments: str,
    time_limit: float,
    watch: Callable[[list[str]], None] = lambda log: None,
) -> tuple[int | None, list[str]]:
    """Run ``python -m module arguments`` for at most ``time_limit`` s; nothing is left behind when it is interrupted.

    Returns its exit code (None: not done in time) and the last lines that it printed, which ``watch`` is told now and
    then. The module's main function calls `end_with_caller`. It computes in one thread.
    """
    # A session of its own keeps Ctrl-C with the caller, who then ends the worker.
    worker = subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)} | _ONE_THREAD,
        start_new_session=True,
    )
    assert worker.stdin is not None
    assert worker.stdout is not None
    log: deque[str] = deque(maxlen=50)
    reader = threading.Thread(target=log.extend, args=(worker.stdout,), daemon=True)
    reader.start()
    deadline = time.monotonic() + time_limit
    code: int | None = None
    try:
        while code is None and time.monotonic() < deadline:
            try:
                code = worker.wait(timeout=min(0.1, max(0.0, deadline - time.monotonic())))
            except subprocess.TimeoutExpired:
                watch(list(log))
    finally:
        worker.kill()
        worker.wait()
        reader.join(timeout=5.0)
        worker.stdin.close()
        worker.stdout.close()
    return code, [line.strip() for line in log if line.strip()]


def end_with_caller() -> None:
    """End this process at once when its caller is gone, that is, when its stdin closes."""
    _end_after(_drained)


def _drained() -> None:
    while os.read(0, 4096):  # sys.stdin has a lock that a waiting thread would keep at exit
        pass


def end_with_parent() -> None:
    """End this process of `multiprocessing` at once when its parent is gone, however that ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        _end_after(parent.join)


def _end_after(wait: Callable[[], object]) -> None:
    def end() -> None:
        wait()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()
