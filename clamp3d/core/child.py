"""Work in a Python process of its own, for libraries that end their process or cannot be stopped."""

from __future__ import annotations

import faulthandler
import importlib
import os
import select
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable

_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""To start NumPy's threads takes 0.04 s of CPU."""
_owned = False


def run_child(
    module: str,
    *arguments: str,
    time_limit: float,
    watch: Callable[[list[str]], None] = lambda log: None,
    copy: bool = False,
) -> tuple[int | None, list[str]]:
    """Run ``python -m module arguments`` for at most ``time_limit`` s; nothing is left behind when it is interrupted.

    Returns its exit code (None: not done in time) and the last lines that it printed, which ``watch`` is told now and
    then. The module's main function calls `end_with_caller`. It computes in one thread. With ``copy`` its function
    ``main(*arguments)`` is called in a copy of this process, where `can_copy` allows it: nothing is imported twice.
    """
    # A session of its own keeps Ctrl-C with the caller, who then ends the worker.
    worker = (
        Copy(module, arguments)
        if copy and can_copy()
        else subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)} | _ONE_THREAD,
            start_new_session=True,
        )
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


def own_process() -> None:
    """Say that this process is the program's own from its first line on, as the command line's is."""
    global _owned
    _owned = True
    for name, value in _ONE_THREAD.items():
        os.environ.setdefault(name, value)


def can_copy() -> bool:
    """Whether this process may be forked: on Linux, where it is our own and has one thread.

    In a program of somebody else's a library can hold locks and devices (CUDA, ROS) that do not outlive a fork.
    """
    return _owned and sys.platform == "linux" and len(os.listdir("/proc/self/task")) == 1


class Copy:
    """A copy of this process that calls a module's main function; what is asked of a `subprocess.Popen`."""

    def __init__(self, module: str, arguments: tuple[str, ...]) -> None:
        (heard, tells), (hears, told) = os.pipe(), os.pipe()
        self._pid = os.fork()
        self._code: int | None = None
        if self._pid == 0:
            code = 1
            try:
                faulthandler.disable()  # its report would be the caller's
                os.setsid()
                for given, number in ((heard, 0), (told, 1), (told, 2)):
                    os.dup2(given, number)
                os.close(tells)
                importlib.import_module(module).main(*arguments)
                code = 0
            except BaseException:  # whatever it is, the caller's own work must not go on here
                os.write(2, traceback.format_exc().encode())
            finally:
                os._exit(code)
        os.close(heard)
        os.close(told)
        self.stdin, self.stdout = os.fdopen(tells, "w"), os.fdopen(hears, errors="replace")
        self._watched = os.pidfd_open(self._pid)

    def wait(self, timeout: float | None = None) -> int:
        """Its exit code, or minus the signal that ended it. Raises TimeoutExpired after ``timeout`` s."""
        if self._code is None:
            if not select.select([self._watched], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("", timeout or 0.0)
            self._code = os.waitstatus_to_exitcode(os.waitpid(self._pid, 0)[1])
            os.close(self._watched)
        return self._code

    def kill(self) -> None:
        """End it at once."""
        if self._code is None:
            os.kill(self._pid, signal.SIGKILL)


def end_with_caller() -> None:
    """End this process at once when its caller is gone, that is, when its stdin closes."""
    _end_after(_drained)


def _drained() -> None:
    while os.read(0, 4096):  # sys.stdin has a lock that a waiting thread would keep at exit
        pass


def end_with_parent() -> None:
    """End this process of `multiprocessing` at once when its parent is gone, however that ended."""
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is not None:
        _end_after(parent.join)


def _end_after(wait: Callable[[], object]) -> None:
    def end() -> None:
        wait()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()
