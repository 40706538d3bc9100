"""Before any test: the contact kernel is compiled once, so that no test measures or prints its compilation."""

import gc
import importlib
import os
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

from clamp3d import cli
from clamp3d.kernel import Capsule, Cylinder, SweptArc, groove_pieces, signed_distance, translation

# Tests start Python hundreds of times: it would compile the package each time where it is told to keep nothing.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Drawings and sentences of the documentation are tested too.
sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

# A run that decides about a change repeats the same examples; a run at the desk looks for new ones.
settings.register_profile("ci", derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "default")


ROOT = Path(cli.__file__).parents[2]


def compiled_on_import():
    """The modules that compile when they are imported; the two that take longest are at the ends."""
    found = [path for path in (ROOT / "clamp3d").rglob("*.py") if "= entry(" in path.read_text("utf-8")]
    found.sort(key=lambda path: ("faces" not in path.name, path.name == "bore_kernel.py", path))
    return [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in found]


def pytest_sessionstart(session):
    worker = getattr(session.config, "workerinput", None)
    if worker is None and session.config.getoption("numprocesses", None):
        return  # the workers run the tests
    if worker is not None:  # minutes where no cache has them: two take them from either end, what no other has begun
        begun = Path(session.config.option.basetemp).parent
        names = compiled_on_import()
        for name in names if worker["workerid"] == "gw0" else reversed(names):
            with suppress(FileExistsError):
                (begun / name).touch(exist_ok=False)
                importlib.import_module(name)
        for name in names:
            importlib.import_module(name)
    groove, wire = SweptArc(7.0, 1.0, 50.0), Cylinder(6.0, 80.0)
    signed_distance(groove, wire, translation(0.0, 3.0, 0.0))
    groove_pieces(groove, Capsule(6.0, 80.0), translation(0.0, 3.0, 0.0))


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What is collected stays to the end: it is not searched for garbage over and over again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def main_in_this_process(monkeypatch, captured):
    """A function that calls the command line: code, stdout, stderr, as ``capsys`` or ``capfd`` has captured them."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["clamp3d", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return stop.value.code, *captured.readouterr()

    return run


@pytest.fixture
def main(monkeypatch, capsys):
    """The command line in this process, where a new one would only import everything again: code, stdout, stderr."""
    return main_in_this_process(monkeypatch, capsys)


@pytest.fixture
def whole_main(monkeypatch, capfd):
    """``main`` with what libraries write past Python: all that a process would write to its stdout and stderr."""
    return main_in_this_process(monkeypatch, capfd)
