"""Work in a Python process of its own, for libraries that end their process, cannot be stopped or take all memory.

The caller and the process exchange messages over pipes: MessagePack with arrays as raw bytes, nothing that could be
executed. What a library prints is kept as the log of the process.
"""

from __future__ import annotations

import importlib
import os
import queue
import signal
import struct
import subprocess
import sys
import threading
import traceback
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import msgspec
import numpy as np

from clamp3d import errors
from clamp3d.errors import Clamp3dError

_SIZE = struct.Struct(">Q")
_LARGEST = 2**34
"""Bytes of a message that are read at most."""
_ARRAY = 1
"""Number of MessagePack's extension type that holds an array."""
_OUT_OF_MEMORY = ("bad_alloc", "MemoryError", "Memory allocation")
"""What a process prints that ends for want of memory: C++, Python, OpenBLAS."""
_FORBIDDEN = ("socket.connect", "socket.getaddrinfo", "socket.bind", "subprocess.", "os.system", "os.exec", "os.fork")
_OWN_ERRORS = ("InputError", "MissingLibraryError", "SolverError", "Clamp3dError")
_ERRORS: dict[str, type[Exception]] = {"MemoryError": MemoryError, "OSError": OSError, "RuntimeError": RuntimeError}
_ERRORS |= {name: getattr(errors, name) for name in _OWN_ERRORS}


class WorkerEndedError(Clamp3dError):
    """The process ended before it answered; ``ending`` says how ("SIGSEGV", "exit code 3").

    ``code`` is the exit code as Popen gives it, ``last`` the last line that the process printed before it ended itself.
    """

    def __init__(self, code: int, log: list[str]) -> None:
        self.code = code
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
    caller, however that ends. Modules of the current folder are not imported in it (Python's ``-P``).

    Parameters
    ----------
    *functions : str
        The functions that it may call, each as ``"package.module:function"``. Arguments and results are what
        MessagePack holds (None, bool, int, float, str, bytes, list, dict) and arrays; a dataclass and a tuple arrive
        as a dict and a list.
    confined : bool
        Whether connections to other machines and further processes are refused in it.

    Examples
    --------
    >>> with Worker("math:hypot") as worker:
    ...     worker.call("math:hypot", 3.0, 4.0, time_limit=60.0)
    5.0
    """

    def __init__(self, *functions: str, confined: bool = False) -> None:
        self._functions = functions
        self._confined = confined
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0
        self._lock = threading.Lock()
        self._lines: deque[str] = deque(maxlen=50)
        self._listener = threading.Thread()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def log(self) -> list[str]:
        """The last lines that the process printed."""
        return [line for line in list(self._lines) if line]

    def call(self, function: str, *arguments: Any, time_limit: float, memory: float | None = None) -> Any:
        """The result of ``function(*arguments)`` in the process.

        Parameters
        ----------
        function : str
            One of the functions that the worker was made for.
        *arguments
            As described for the class.
        time_limit : float
            Seconds after which the process is ended.
        memory : float, optional
            Bytes that this call may take beyond what the process has, where the system can limit that.

        Raises
        ------
        InputError, MissingLibraryError, SolverError, Clamp3dError, OSError
            As the function raised it, with its message.
        MemoryError
            If the call takes more than ``memory``.
        WorkerTimeoutError, WorkerEndedError
            If there is no answer within ``time_limit``, or the process ended by itself.
        RuntimeError
            For any other exception of the function; the message names its type and place.
        """
        if function not in self._functions:
            raise ValueError(f"function must be one of {', '.join(self._functions)}, got {function!r}")
        with self._lock:
            try:
                if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
                    self._start()
                request = {"function": function, "arguments": arguments, "memory": memory}
                answer = self._exchange(_pack(request), time_limit)
            except BaseException:  # also for Ctrl-C: the process may still be at work
                self.close()
                raise
        if answer["error"] is None:
            return answer["result"]
        raise _ERRORS[answer["error"]](answer["message"])

    def close(self) -> None:
        """End the process at once, if there is one."""
        process, self._process = self._process, None
        if process is None or self._owner != os.getpid():  # a forked process leaves it to the one that started it
            return
        process.kill()
        process.wait()
        self._listener.join(timeout=5.0)
        for pipe in (process.stdin, process.stdout, process.stderr):
            with suppress(OSError):  # an unwritten rest of a request
                if pipe is not None:
                    pipe.close()

    def _start(self) -> None:
        self.close()
        self._owner = os.getpid()
        own = str(Path(__file__).parents[2])  # also where that is the current folder, which is "" on the path
        folders = (own if os.path.abspath(folder) == own else folder for folder in sys.path)
        path = os.pathsep.join(folder for folder in folders if os.path.isabs(folder))
        settings = {"OPENBLAS_NUM_THREADS": "1", "CLAMP3D_CONFINED": str(int(self._confined))}
        # A session of its own keeps Ctrl-C with the caller, who then ends the worker.
        process = self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from clamp3d.brep.child import serve; serve()", *self._functions],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": path} | settings,
            start_new_session=True,
        )
        self._lines = deque(maxlen=50)
        self._listener = threading.Thread(target=_keep_lines, args=(process.stderr, self._lines), daemon=True)
        self._listener.start()

    def _exchange(self, request: bytes, time_limit: float) -> dict[str, Any]:
        process = self._process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        expired = threading.Event()

        def end() -> None:
            expired.set()
            process.kill()

        timer = threading.Timer(time_limit, end)
        timer.daemon = True
        timer.start()
        try:
            with suppress(BrokenPipeError):  # it has ended: said below
                _send(process.stdin, request)
            answer = _receive(process.stdout)
        finally:
            timer.cancel()
        if answer is not None:
            reply: dict[str, Any] = _unpack(answer)
            return reply
        code = process.wait()
        if expired.is_set():
            raise WorkerTimeoutError(f"no answer in {time_limit:g} s")
        self._listener.join(timeout=5.0)
        if any(word in line for line in self.log for word in _OUT_OF_MEMORY):
            raise MemoryError
        raise WorkerEndedError(code, self.log)


def serve() -> None:
    """Answer the requests of a `Worker` until it closes the pipe. The functions allowed are in ``sys.argv``."""
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)  # what a library prints goes to the log
    if os.environ["CLAMP3D_CONFINED"] == "1":
        sys.addaudithook(_refuse)
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def receive() -> None:
        while (message := _receive(incoming)) is not None:
            requests.put(message)
        os._exit(1)  # the caller is gone, and a call may still be at work

    threading.Thread(target=receive, daemon=True).start()
    allowed = sys.argv[1:]
    while True:
        request = _unpack(requests.get())
        assert request["function"] in allowed
        _limit(request["memory"])
        _send(outgoing, _answer(request["function"], request["arguments"]))


def _answer(function: str, arguments: list[Any]) -> bytes:
    try:
        module, _, name = function.partition(":")
        return _pack({"error": None, "result": getattr(importlib.import_module(module), name)(*arguments)})
    except Clamp3dError as error:
        kind = next(name for name in _OWN_ERRORS if isinstance(error, getattr(errors, name)))
        message = str(error)
    except MemoryError:
        kind, message = "MemoryError", ""
    except OSError as error:
        kind, message = "OSError", f"{error.filename}: {error.strerror}" if error.filename else str(error)
    except Exception as error:  # a fault of the function: the caller says so
        frame = traceback.extract_tb(error.__traceback__)[-1]
        kind = "RuntimeError"
        message = f"{type(error).__name__}: {error} at {os.path.basename(frame.filename)}:{frame.lineno}"
    return _pack({"error": kind, "message": message})


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
    most = resource.RLIM_INFINITY if memory is None else int(memory) + used
    for kind, value in ((resource.RLIMIT_DATA, most), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        if hard != resource.RLIM_INFINITY:
            value = hard if value == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(kind, (value, hard))


def _send(pipe: IO[bytes], message: bytes) -> None:
    pipe.write(_SIZE.pack(len(message)))
    pipe.write(message)
    pipe.flush()


def _receive(pipe: IO[bytes]) -> bytes | None:
    """The next message of a pipe, or None at its end."""
    head = pipe.read(_SIZE.size)
    if len(head) < _SIZE.size or (size := _SIZE.unpack(head)[0]) > _LARGEST:
        return None
    message = pipe.read(size)
    return message if len(message) == size else None


def _keep_lines(pipe: IO[bytes], lines: deque[str]) -> None:
    with suppress(OSError, ValueError):
        for line in pipe:
            lines.append(line.decode(errors="replace").strip())


def _pack(value: Any) -> bytes:
    return msgspec.msgpack.encode(value, enc_hook=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return msgspec.msgpack.Ext(_ARRAY, msgspec.msgpack.encode((value.dtype.str, value.shape, value.tobytes())))
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be sent to another process")


def _unpack(message: bytes) -> Any:
    return msgspec.msgpack.decode(message, ext_hook=_array)


def _array(_: int, data: memoryview) -> Any:
    kind, shape, values = msgspec.msgpack.decode(data)
    return np.frombuffer(bytearray(values), np.dtype(kind)).reshape(shape)


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
