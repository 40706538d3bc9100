"""The command line in this process, where a new one would only import everything again."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from unittest import mock

import pytest

from clamp3d import cli


def call(*arguments):
    """Run ``clamp3d ARGUMENTS``: exit code, stdout and stderr."""
    out, err = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace")
    argv = mock.patch.object(sys, "argv", ["clamp3d", *map(str, arguments)])
    with redirect_stdout(out), redirect_stderr(err), argv, pytest.raises(SystemExit) as stop:
        cli.main()
    for stream in (out, err):
        stream.flush()
    return stop.value.code, *(stream.buffer.getvalue().decode("utf-8", "replace") for stream in (out, err))
