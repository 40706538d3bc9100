"""``clamp3d verify``."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from clamp3d.cli.options import INPUT_FILE, argument, declared, option
from clamp3d.cli.results import COMMAND, VERIFIABLE
from clamp3d.cli.terminal import finish, show
from clamp3d.errors import InputError

_NOT_COMPARED = {COMMAND, "clamp3d", "seconds", "work"}
"""Who computed it, and what it took."""
_SHOWN = 10


@declared("verify")
def command(
    result: Path = argument(metavar="RESULT.json", type=INPUT_FILE),
    tolerance: float = option("Largest difference of a number that passes; 0: the same bits.", default=1e-9),
) -> None:
    """Compute the result in RESULT.json again, and compare every value.

    RESULT.json was written by --json of run, check, fit, sweep or tolerance, whose arguments it holds; files that they
    name are looked for in the current folder. Exit code 1 if a value differs.
    """
    from clamp3d.cli import group

    old = _read(result)
    with tempfile.TemporaryDirectory(prefix="clamp3d-") as folder:
        file = Path(folder) / "again.json"
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            group.main([*old[COMMAND], "--json", str(file)], prog_name="clamp3d", standalone_mode=False)
        new = json.loads(file.read_text(encoding="utf-8"))
    count, largest, where = 0, 0.0, ""
    differing = []
    for path, was, now in _pairs(old, new):
        count += 1
        if isinstance(was, (int, float)) and isinstance(now, (int, float)) and not isinstance(was, bool):
            off = abs(was - now)
            if off > largest:
                largest, where = off, path
            if off <= tolerance:
                continue
        elif was == now:
            continue
        differing.append((path, was, now))
    for path, was, now in differing[:_SHOWN]:
        show(f"{path}: {_short(was)} in the file, {_short(now)} now")
    most = f"; the largest difference of a number is {largest:.1g}, of {where}" if where else ""
    same = "all equal" if not differing and not where else f"{len(differing)} differ by more than {tolerance:g}{most}"
    show(f"{result}: {count} values computed again, {same}")
    finish(finding=bool(differing))


class _Missing:
    def __repr__(self) -> str:
        return "nothing"


def _pairs(old: Any, new: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Values that stand in the same place, one of them `_Missing` where the other has none."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [key for key in {**old, **new} if key not in _NOT_COMPARED]
        items = [(key, old.get(key, _Missing()), new.get(key, _Missing())) for key in keys]
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        items = [(str(i), *both) for i, both in enumerate(zip(old, new, strict=True))]
    else:
        yield path, old, new
        return
    for key, was, now in items:
        yield from _pairs(was, now, f"{path}.{key}" if path else key)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:56]} ..."


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path}: not a JSON file") from None
    command = data.get(COMMAND) if isinstance(data, dict) else None
    if not (isinstance(command, list) and all(isinstance(word, str) for word in command) and command):
        raise InputError(f"{path}: not a result of {', '.join(VERIFIABLE)}: it does not say what was asked")
    if command[0] not in VERIFIABLE:
        raise InputError(f"{path}: asked for {command[0]!r}, must be one of {', '.join(VERIFIABLE)}")
    assert isinstance(data, dict)
    return data
