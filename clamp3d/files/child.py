"""Work in a Python process of its own, for libraries that end their process, cannot be stopped or take all memory.

The caller and the process exchange pickles over pipes. What a library prints is kept as the log of the process.
"""

from __future__ import annotations

import gc
import importlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from clamp3d.errors import Clamp3dError

_OUT_OF_MEMORY = ("bad_alloc", "MemoryError", "Memory allocation")
"""What a process prints that ends for want of memory: C++, Python, OpenBLAS."""
_CPU_SIGNAL = getattr(signal, "SIGPROF", 0)
"""What ends a process that has used its processor time; Windows has none."""
_FORBIDDEN = (
    *("socket.connect", "socket.getaddrinfo", "socket.bind", "socket.sendto", "socket.sendmsg"),
    *("subprocess.", "os.system", "os.exec", "os.fork", "os.posix_spawn", "os.spawn"),
)


class WorkerEndedError(Clamp3dError):
    """The process ended before it answered; ``ending`` says how ("SIGSEGV", "exit code 3").

    ``last`` is the last line that the process printed before it ended itself.
    """

    def __init__(self, code: int, log: list[str]) -> None:
        self.ending = f"exit code {code}"
        if code < 0:
            self.ending = signal.Signals(-code).name if -code in {*signal.Signals} else f"signal {-code}"
        self.last = log[-1] if log and code >= 0 else ""
        super().__init__(f"the process ended with {self.ending}{': ' * bool(self.last)}{self.last}")


class WorkerTimeoutError(Clamp3dError):
    """The process gave no answer in time and was ended."""


class Worker:
    """A Python process that calls functions on request, one at a time, until it is closed.

    It is started by the first call, and again by the next call after it ended or was stopped. It ends with its
    caller, however that ends, and is not for processes that are forked from that. Modules of the current folder are
    not imported in it (Python's ``-P``).

    Parameters
    ----------
    confined : bool
        Whether connections to other machines and further processes are refused in it.

    Attributes
    ----------
    log : deque of str
        The last lines that the process printed.

    Examples
    --------
    >>> with Worker() as worker:
    ...     worker.call("math:hypot", 3.0, 4.0, time_limit=60.0)
    5.0
    """

    def __init__(self, *, confined: bool = False) -> None:
        self._confined = confined
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self.log: deque[str] = deque(maxlen=50)
        self._listener = threading.Thread()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def call(
        self, function: str, *arguments: Any, time_limit: float, cpu: float | None = None, memory: float | None = None
    ) -> Any:
        """The result of ``function(*arguments)`` in the process.

        Parameters
        ----------
        function : str
            The function as ``"package.module:function"``; this process need not import it.
        *arguments
            Whatever pickle holds, as the result.
        time_limit : float
            Seconds after which the process is ended.
        cpu : float, optional
            Processor seconds after which it is ended too, where the system can limit that: however busy the machine is,
            the same calls are answered.
        memory : float, optional
            Bytes that this call may take beyond what the process has, where the system can limit that.

        Raises
        ------
        Clamp3dError, OSError
            As the function raised it, with its message.
        MemoryError
            If the call takes more than ``memory``.
        WorkerTimeoutError, WorkerEndedError
            If there is no answer within ``time_limit`` or ``cpu``, or the process ended by itself.
        RuntimeError
            For any other exception of the function; the message names its type and place.
        """
        with self._lock:
            try:
                if self._process is None or self._process.poll() is not None:
                    self._process = self._start()
                error, result = self._exchange(self._process, (function, arguments, memory, cpu), time_limit)
            except BaseException:  # also for Ctrl-C: the process may still be at work
                self.close()
                raise
        if error is not None:
            raise error
        return result

    def close(self) -> None:
        """End the process at once, if there is one."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        self._listener.join(timeout=5.0)
        for pipe in (process.stdin, process.stdout, process.stderr):
            with suppress(OSError):  # an unwritten rest of a request
                if pipe is not None:
                    pipe.close()

    def _start(self) -> subprocess.Popen[bytes]:
        self.close()
        own = str(Path(__file__).parents[2])  # also where that is the current folder, which is "" on the path
        folders = (own if os.path.abspath(folder) == own else folder for folder in sys.path)
        path = os.pathsep.join(folder for folder in folders if os.path.isabs(folder))
        # A session of its own keeps Ctrl-C with the caller, who then ends the worker.
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"from clamp3d.files.child import serve; serve(confined={self._confined})"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,
        )
        self.log = deque(maxlen=50)
        self._listener = threading.Thread(target=_keep_lines, args=(process.stderr, self.log), daemon=True)
        self._listener.start()
        return process

    def _exchange(self, process: subprocess.Popen[bytes], request: Any, time_limit: float) -> Any:
        """The answer to a request. Raises what `call` says for a process that gives none."""
        assert process.stdin is not None
        assert process.stdout is not None
        deadline = time.monotonic() + time_limit
        timer = threading.Timer(time_limit, process.kill)
        timer.daemon = True
        timer.start()
        try:
            with suppress(BrokenPipeError):  # it has ended: said below
                _send(process.stdin, pickle.dumps(request))
            return pickle.load(process.stdout)
        except (EOFError, pickle.UnpicklingError):
            code = process.wait()
        finally:
            timer.cancel()
        if time.monotonic() >= deadline or code == -_CPU_SIGNAL:
            raise WorkerTimeoutError("no answer in its time")
        self._listener.join(timeout=5.0)
        log = [*self.log]
        if any(word in line for line in log for word in _OUT_OF_MEMORY):
            raise MemoryError
        raise WorkerEndedError(code, log)


def serve(*, confined: bool) -> None:
    """Answer the requests of a `Worker` until it closes the pipe."""
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)  # what a library prints goes to the log
    gc.set_threshold(100_000)  # what libraries load is no garbage
    if confined:
        sys.addaudithook(_refuse)
    requests: queue.SimpleQueue[tuple[str, tuple[Any, ...], float | None, float | None]] = queue.SimpleQueue()

    def receive() -> None:
        with suppress(EOFError, pickle.UnpicklingError):
            while True:
                requests.put(pickle.load(incoming))
        os._exit(1)  # the caller is gone, and a call may still be at work

    threading.Thread(target=receive, daemon=True).start()
    while True:
        function, arguments, memory, cpu = requests.get()
        _limit(memory)
        _limit_cpu(cpu)
        answer = _answer(function, arguments)
        _limit_cpu(None)
        _send(outgoing, answer)


def _answer(function: str, arguments: tuple[Any, ...]) -> bytes:
    """Pickle of an error or None, and of the function's result."""
    error: Exception
    try:
        module, _, name = function.partition(":")
        return pickle.dumps((None, getattr(importlib.import_module(module), name)(*arguments)))
    except (Clamp3dError, MemoryError, OSError) as raised:
        error = raised
    except Exception as raised:  # a fault of the function: the caller says so
        frame = traceback.extract_tb(raised.__traceback__)[-1]
        error = RuntimeError(f"{type(raised).__name__}: {raised} at {os.path.basename(frame.filename)}:{frame.lineno}")
    return pickle.dumps((error, None))


def _refuse(event: str, _: object) -> None:
    """An audit hook that keeps a process to itself."""
    if event.startswith(_FORBIDDEN):
        raise PermissionError(f"{event} is not allowed while a file is read")


def _limit(memory: float | None) -> None:
    """Keep this process from taking ``memory`` bytes more, where the system can, and from leaving a core file."""
    try:
        import resource
    except ImportError:  # Windows: the time limit alone
        return
    used = 0
    with suppress(OSError):
        used = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = hard if memory is None else used + int(memory)
    if 0 <= hard < most:  # infinity is -1, or more than any
        most = hard
    resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _limit_cpu(seconds: float | None) -> None:
    """End this process after so much more processor time, where the system can; None: never."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds or 0.0)


def _send(pipe: IO[bytes], message: bytes) -> None:
    pipe.write(message)
    pipe.flush()


def _keep_lines(pipe: IO[bytes], lines: deque[str]) -> None:
    with suppress(OSError, ValueError):
        for line in pipe:
            if text := line.decode(errors="replace").strip():
                lines.append(text)


def end_with_parent() -> None:
    """End this process of `multiprocessing` at once when its parent is gone, however that ended."""
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()
