"""A command line in this process, held to the rules: exit code, one line on stderr, files whole."""

from __future__ import annotations

import io
import json
import re
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.values import Draw, chance

OLD = b"what was here before\n"
"""Content of an output file that exists before the command."""

# Words of Python's own exceptions: a message that holds them was not written for a user.
_RAW = re.compile(
    r"\[Errno|Traceback|NoneType|object has no attribute|unsupported operand|not subscriptable|not iterable|"
    r"invalid literal|could not convert|could not be broadcast|out of bounds for axis|<class '|positional argument"
)
_LONGEST = 1000


class FindingError(Exception):
    """The project answered in a way that is not allowed."""


@dataclass(frozen=True, slots=True)
class Called:
    """What a command line gave."""

    code: int
    stdout: str
    stderr: str

    @property
    def refused(self) -> bool:
        """Whether it ended with a clear line in place of an answer."""
        return self.code in (2, 4)


def call(args: list[str]) -> Called:
    """Run ``clamp3d ARGS`` here. Raises whatever the command lets out, and FindingError for a broken rule."""
    from clamp3d import cli

    kept = sys.argv, sys.stdout, sys.stderr
    out, err = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace")
    sys.argv, sys.stdout, sys.stderr = ["clamp3d", *args], out, err
    code: object = None
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            warnings.simplefilter("ignore", ResourceWarning)
            try:
                cli.main()
            except SystemExit as stop:
                code = stop.code
    finally:
        sys.argv, sys.stdout, sys.stderr = kept
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode("utf-8", "replace"))  # type: ignore[attr-defined]
    if warned:
        place = f"{Path(warned[0].filename).name}:{warned[0].lineno}"
        raise FindingError(f"warning on stderr: {warned[0].category.__name__}: {warned[0].message} at {place}")
    if type(code) is not int:
        raise FindingError(f"exit code is {code!r}")
    return held_to_rules(Called(code, *texts))


def held_to_rules(called: Called) -> Called:
    """``called``; raises FindingError if its exit code or its messages break a rule."""
    proof = called.code == 4 and "inside clamp3d" not in called.stderr
    if called.code not in (0, 1, 2, 3) and not proof:  # 4: a solver that cannot prove its answer may say so
        raise FindingError(f"exit code {called.code}: {called.stderr[-300:]}")
    if "Traceback (most recent call last)" in called.stderr:
        raise FindingError(f"traceback: {called.stderr[-500:]}")
    # Not splitlines: it also parts at characters that a terminal does not take for a line's end.
    lines = called.stderr.removesuffix("\n").split("\n") if called.stderr else []
    errors = [line for line in lines if line.startswith("clamp3d: error: ")]
    if not called.refused:
        if errors:
            raise FindingError(f"exit code {called.code} with an error: {errors[0][:200]}")
        return called
    if len(errors) != 1 or lines[-1] != errors[0]:
        raise FindingError(f"exit code {called.code} needs one line, the last: {called.stderr[-400:]!r}")
    message = errors[0].removeprefix("clamp3d: error: ")
    if len(message) > _LONGEST:
        raise FindingError(f"message of {len(message)} characters: {message[:200]}")
    if len(message.strip()) < 10 or _RAW.search(message):
        raise FindingError(f"message is not for a user: {message[:300]}")
    if any(not c.isprintable() for c in message):
        raise FindingError(f"message holds control characters: {message[:300]!r}")
    return called


def some_old(draw: Draw, paths: list[Path]) -> list[Path]:
    """One in three of ``paths``, made to be there before the command."""
    old = [path for path in paths if chance(draw, 3)]
    for path in old:
        path.write_bytes(OLD)
    return old


def check_outputs(called: Called, folder: Path, old: list[Path], written: list[Path]) -> None:
    """Files that were there before are old or whole and new; nothing temporary is left.

    Raises FindingError otherwise. ``written`` are the files that the command was asked to write.
    """
    for path in old:
        if not path.is_file():
            raise FindingError(f"{path} was there before and is gone")
        if called.refused and path.read_bytes() == OLD:
            continue
        if path.read_bytes() != OLD:
            _whole(path)
    for path in written:
        if not called.refused and not path.is_file():
            raise FindingError(f"exit code {called.code} without {path.name}")
        if path.is_file() and path not in old:
            _whole(path)
    left = [p.name for p in folder.iterdir() if p.name.startswith(".") and p.name.count(".") > 1]
    if left:
        raise FindingError(f"left behind: {left}")


def _whole(path: Path) -> None:
    content = path.read_bytes()
    suffix = path.suffix.lower()
    if not content:
        raise FindingError(f"{path.name} is empty")
    if suffix == ".json":
        try:
            json.loads(content, parse_constant=_no_constant)
        except ValueError as error:
            raise FindingError(f"{path.name}: {error}") from None
    ends = {".html": b"</html>", ".svg": b"</svg>", ".pdf": b"%%EOF", ".png": b"IEND\xaeB`\x82"}
    if suffix in ends and not content.rstrip().endswith(ends[suffix]):
        raise FindingError(f"{path.name} is not whole")


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")
