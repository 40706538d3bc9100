"""What holds for every call of the command line, whatever its input: exit code, one line on stderr, files whole."""

import json
import os
import re
import tempfile
from contextlib import chdir, contextmanager
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests import command

TIMES = int(os.environ.get("CLAMP3D_FUZZ", "0"))
"""How many times as many inputs are drawn, and others each time; 0: the same few every time."""

OLD = b"what was here before\n"
"""Content of an output file that exists before the command."""

# Words of Python's own exceptions: a message that holds them was not written for a user.
_RAW = re.compile(
    r"\[Errno|Traceback|NoneType|object has no attribute|unsupported operand|not subscriptable|not iterable|"
    r"invalid literal|could not convert|could not be broadcast|out of bounds for axis|<class '|positional argument"
)


def examples(count):
    """A decorator: so many inputs."""
    return settings(
        max_examples=count * max(1, TIMES),
        derandomize=not TIMES,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


@contextmanager
def new_folder():
    """An empty current folder, which is gone after."""
    with tempfile.TemporaryDirectory() as name, chdir(name):
        yield Path(name)


def call(arguments):
    """Run ``clamp3d ARGUMENTS`` in this process; its exit code and stdout."""
    code, out, err = command.call(*arguments)
    assert_rules(code, err)
    return code, out


def assert_rules(code, stderr):
    """0, 1 and 3 are answers; 2 is a refusal in one line, and so is 4 where a solver cannot prove its answer."""
    assert code in (0, 1, 2, 3) or (code == 4 and "inside clamp3d" not in stderr), f"exit code {code}: {stderr[-500:]}"
    assert "Traceback (most recent call last)" not in stderr, stderr[-500:]
    # Not splitlines: it also parts at characters that a terminal does not take for a line's end.
    lines = stderr.removesuffix("\n").split("\n")
    errors = [line for line in lines if line.startswith("clamp3d: error: ")]
    if not is_refused(code):
        assert not errors
        return
    assert errors == lines[-1:], f"one line, the last: {stderr[-400:]!r}"
    message = errors[0].removeprefix("clamp3d: error: ")
    assert 10 <= len(message.strip()) <= 1000, message[:200]
    assert not _RAW.search(message), message
    assert message.isprintable(), repr(message)


def is_refused(code):
    """Whether a command ended with a message in place of an answer."""
    return code in (2, 4)


def assert_outputs(code, folder, old, written):
    """Files that were there before (``old``) are untouched or whole, as are those to be ``written``; no others left."""
    for path in {*old, *written}:
        content = path.read_bytes() if path in old or path.is_file() or not is_refused(code) else b"{}"
        if is_refused(code) and content == OLD:
            continue
        assert content.strip(), f"{path.name} is empty"
        if path.suffix == ".json":
            json.loads(content, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert not [p.name for p in Path(folder).iterdir() if p.name.startswith(".") and p.name.count(".") > 1]
