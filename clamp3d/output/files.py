"""Output files, written whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from clamp3d.checks import is_read, short
from clamp3d.errors import InputError

STDOUT = Path("-")
"""As the path of a file to write: standard output."""


def require_not_read(path: Path) -> None:
    """Raise InputError if the command has read the file: to be called before long work."""
    if is_read(path):
        raise InputError(f"cannot write {short(path)}: it is the input, or belongs to it")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends well, and is removed when not.

    A link stays, its target is written; what is neither a file nor a folder (a device, a pipe) is written into, and
    so is standard output for the path ``-``. Raises InputError if the folder does not exist or cannot be written to,
    or the disk is full.
    """
    require_not_read(path)
    target = Path(os.path.realpath(path))
    special = path == STDOUT or (target.exists() and not target.is_file() and not target.is_dir())
    with ExitStack() as stack:
        try:
            if target.is_dir():
                raise OSError(errno.EISDIR, "it is a folder")
            folder = stack.enter_context(tempfile.TemporaryDirectory()) if special else target.parent
            handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=target.suffix, dir=folder)
            os.close(handle)
            temporary = Path(name)
            stack.callback(temporary.unlink, missing_ok=True)
            yield temporary
            if path == STDOUT:
                sys.stdout.flush()
                sys.stdout.buffer.write(temporary.read_bytes())
                sys.stdout.buffer.flush()
            elif special:
                target.write_bytes(temporary.read_bytes())
            else:
                umask = os.umask(0)
                os.umask(umask)
                temporary.chmod(0o666 & ~umask)
                os.replace(temporary, target)
        except OSError as error:
            if path == STDOUT or isinstance(error, BrokenPipeError):
                raise
            raise InputError(f"cannot write {short(path)}: {error.strerror}") from None


def check_writable(path: Path) -> None:
    """Raise InputError if a file ``path`` cannot be written: to be called before long work."""
    if path.is_dir():
        raise InputError(f"cannot write {short(path)}: it is a folder")
    if path != STDOUT and (not path.exists() or path.is_file()):
        _probe(Path(os.path.realpath(path)).parent, f"cannot write {short(path)}")


def check_folder(folder: Path) -> None:
    """Raise InputError if ``folder`` neither exists nor can be created, or is ``-``: to be called before long work."""
    if folder == STDOUT:
        raise InputError("cannot write into -: it is stdout, not a folder")
    nearest = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if os.path.lexists(parent))
    _probe(nearest, f"cannot write into {short(folder)}")


def _probe(folder: Path, problem: str) -> None:
    """Raise InputError, which begins with ``problem``, if no file can be made in an existing folder."""
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InputError(f"{problem}: {error.strerror}") from None


def write_text(path: Path, text: str) -> None:
    """Write ``text`` as UTF-8, half a character as an escape sequence. Raises InputError if it cannot be written."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")


def json_text(data: Any) -> str:
    """What a JSON file of ``data`` holds; NaN is an error."""
    return json.dumps(data, indent=2, allow_nan=False) + "\n"


def write_files(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write ``files`` (name to content) into ``folder``, created if need be; all or none of them.

    Raises InputError if the folder cannot be written to.
    """
    paths = [folder / name for name in files]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            for path, content in zip(paths, files.values(), strict=True):
                stack.enter_context(whole_file(path)).write_bytes(content)
    except OSError as error:
        raise InputError(f"cannot write into {short(folder)}: {error.strerror}") from None
    return paths


def file_stem(name: str, default: str = "clamp") -> str:
    """A name as a file name: letters, digits, point, dash and underscore; ``default`` if it has none of them.

    >>> file_stem("JB-3 (left/right)")
    'JB-3-left-right'
    """
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.") or default
