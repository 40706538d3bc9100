"""Finished pieces of a long run, kept in a file, so that a run that was stopped goes on where it was.

One JSON value a line: first what is run (another run's file is refused), then the finished pieces in the order in which
they came. A line counts once its newline is on the disk; what a crash left of an unfinished line is cut off.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from clamp3d.errors import InputError


def pieces(path: Path, header: dict[str, Any]) -> dict[int, Any]:
    """The pieces that a run described by ``header`` has finished before, by key; the file is ready for more.

    Raises InputError if the file cannot be read or written, or belongs to another run.
    """
    first = _line(header)
    try:
        content = path.read_bytes() if os.path.lexists(path) else b""
        whole = content[: content.rfind(b"\n") + 1]
        lines = [json.loads(line) for line in whole.splitlines()]
        found = {int(key): value for key, value in lines[1:]}
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    except (ValueError, TypeError):
        lines, found = [], {}
    if not lines and not first.startswith(content):
        raise InputError(f"{path}: not a file of finished work; give another name or remove it")
    if lines and lines[0] != (wanted := json.loads(first)):
        known = lines[0] if isinstance(lines[0], dict) else {}
        other = ", ".join(k for k in wanted if known.get(k) != wanted[k]) or "another version"
        raise InputError(f"{path}: belongs to another run (other {other}); give another name or remove it")
    if len(whole) < len(content):
        os.truncate(path, len(whole))
    if not lines:
        add(path, header)
    return found


def add(path: Path, value: Any) -> None:
    """Keep a finished piece, ``[key, piece]``. Raises InputError if the file cannot be written."""
    try:
        with open(path, "ab") as file:
            file.write(_line(value))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from None


def _line(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode() + b"\n"
