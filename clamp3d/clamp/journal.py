"""Finished pieces of a long run, kept in a file, so that a run that was stopped goes on where it was.

One JSON value a line: first what is run (another run's file is refused), then the finished pieces in the order in which
they came. A line counts once its newline is on the disk; what a crash left of an unfinished line is cut off.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from clamp3d.errors import InputError


class Journal:
    """The file ``path`` of a run described by ``header``; ``pieces`` are those that were finished before, by key.

    Raises InputError if the file cannot be read or written, or belongs to another run.
    """

    def __init__(self, path: Path, header: dict[str, Any]) -> None:
        self.pieces: dict[int, Any] = {}
        try:
            self._file = open(path, "a+b")  # noqa: SIM115 - held open for the run, closed by __exit__
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror}") from None
        try:
            self._read(path, json.loads(json.dumps(header)))
        except BaseException:
            self._file.close()
            raise

    def _read(self, path: Path, header: dict[str, Any]) -> None:
        self._file.seek(0)
        content = self._file.read()
        whole = content[: content.rfind(b"\n") + 1]
        lines = []
        try:
            lines = [json.loads(line) for line in whole.splitlines()]
            known = lines[0] if lines else None
            self.pieces = {int(key): value for key, value in lines[1:]}
        except (ValueError, TypeError):
            raise InputError(f"{path}: not a file of finished work; give another name or remove it") from None
        if content and not lines and not json.dumps(header).encode().startswith(content):
            raise InputError(f"{path}: not a file of finished work; give another name or remove it")
        if lines and known != header:
            keys = known if isinstance(known, dict) else {}
            other = ", ".join(k for k in header if keys.get(k) != header[k]) or "another version"
            raise InputError(f"{path}: belongs to another run (other {other}); give another name or remove it")
        if len(whole) < len(content):
            self._file.truncate(len(whole))
        if not lines:
            self._write(header)

    def add(self, key: int, piece: Any) -> None:
        """Keep a finished piece."""
        self._write([key, piece])
        self.pieces[key] = piece

    def _write(self, value: Any) -> None:
        self._file.write(json.dumps(value, separators=(",", ":")).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
