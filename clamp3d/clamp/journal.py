"""Finished pieces of a long run, kept in a file, so that a run that was stopped goes on where it was.

One JSON value a line: first what is run (another run's file is refused), then the finished pieces in the order in which
they came. A line counts once its newline is on the disk; what a crash left of an unfinished line is cut off. One
process at a time has the file: a lock that the system gives back when the process ends, however it ends.
"""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

from clamp3d.checks import short
from clamp3d.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


class Journal:
    """The file ``path`` of the run that ``header`` describes, as a context.

    Attributes
    ----------
    pieces : dict of int to JSON value
        What the run has finished before, by key.

    Raises
    ------
    InputError
        If the file cannot be read or written, belongs to another run, or another process has it.
    """

    def __init__(self, path: Path, header: dict[str, Any]) -> None:
        self._path = path
        try:
            self._file = open(path, "a+b")  # noqa: SIM115
        except OSError as error:
            raise InputError(f"cannot write {short(path)}: {error.strerror}") from None
        try:
            self._lock()
            self.pieces = self._read(header)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def add(self, value: Any) -> None:
        """Keep a finished piece, ``[key, piece]``. Raises InputError if the file cannot be written."""
        try:
            self._file.write(_line(value))
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise InputError(f"cannot write {short(self._path)}: {error.strerror}") from None

    def _lock(self) -> None:
        try:
            if fcntl is not None:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            else:
                import msvcrt

                self._file.seek(1 << 40)  # far behind the content, which stays readable
                msvcrt.locking(self._file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        except OSError as error:
            if error.errno not in (errno.EACCES, errno.EAGAIN, errno.EDEADLK):
                return  # a file system without locks
            raise InputError(f"{short(self._path)}: another process is at work on it; give another name") from None

    def _read(self, header: dict[str, Any]) -> dict[int, Any]:
        path, first = short(self._path), _line(header)
        self._file.seek(0)
        content = self._file.read()
        whole = content[: content.rfind(b"\n") + 1]
        try:
            lines = [json.loads(line) for line in whole.splitlines()]
            found = {int(key): value for key, value in lines[1:]}
        except (ValueError, TypeError):
            lines, found = [], {}
        if not lines and not first.startswith(content):
            raise InputError(f"{path}: not a file of finished work; give another name or remove it")
        if lines and lines[0] != (wanted := json.loads(first)):
            known = lines[0] if isinstance(lines[0], dict) else {}
            other = ", ".join(k for k in wanted if known.get(k) != wanted[k]) or "another version"
            raise InputError(f"{path}: belongs to another run (other {other}); give another name or remove it")
        if len(whole) < len(content):
            self._file.truncate(len(whole) if lines else 0)
        if not lines:
            self.add(header)
        return found


def _line(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode() + b"\n"
