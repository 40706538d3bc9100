"""Before any test: the contact kernel is compiled once, so that no test measures or prints its compilation."""

import gc
import hashlib
import os
import re
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from clamp3d import assemble
from clamp3d.kernel import Capsule, Cylinder, SweptArc, groove_pieces, signed_distance, translation
from tests.command import call

# Tests start Python many times: without bytecode each process would compile the package again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# numba reads a kernel from its cache also where a formula in another file has changed: each state has its own cache.
ROOT = Path(__file__).parents[1]
if "PYTEST_XDIST_WORKER" not in os.environ:
    geometry = ROOT / "clamp3d" / "geometry"
    files = [*sorted((ROOT / "clamp3d" / "kernel").glob("*.py")), geometry / "pose.py", geometry / "primitives.py"]
    state = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]
    os.environ["NUMBA_CACHE_DIR"] = str(Path(os.environ.get("NUMBA_CACHE_DIR", ROOT / ".pytest_cache")) / state)

# Drawings and sentences of the documentation are tested too.
sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

# A run that decides about a change repeats the same examples; a run at the desk looks for new ones.
settings.register_profile("ci", derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "default")


SKIPS = os.environ.get("CLAMP3D_SKIPS", "")
"""A file with the reasons for which tests may be skipped, as .ci/run has it; any other skip is then a failure."""


def pytest_sessionstart():
    """Compile the kernel; of several processes the first does it, before it starts the others."""
    groove, wire = SweptArc(7.0, 1.0, 50.0), Cylinder(6.0, 80.0)
    signed_distance(groove, wire, translation(0.0, 3.0, 0.0))
    groove_pieces(groove, Capsule(6.0, 80.0), translation(0.0, 3.0, 0.0))


def listed_reasons():
    """Regular expressions, one for each line of the list that is neither empty nor a comment."""
    lines = Path(SKIPS).read_text("utf-8").splitlines() if SKIPS else [".*"]
    return [line for line in lines if line and not line.startswith("#")]


def without_unlisted_skips(report):
    """The report of a test or a module, failed if it was skipped for a reason that is not listed."""
    if report.skipped and not hasattr(report, "wasxfail") and isinstance(report.longrepr, tuple):
        path, line, said = report.longrepr
        reason = said.removeprefix("Skipped: ")
        if not any(re.fullmatch(listed, reason) for listed in listed_reasons()):
            report.outcome, report.longrepr = "failed", f"{path}:{line}: skipped, and not listed in {SKIPS}: {reason}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    return without_unlisted_skips((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    return without_unlisted_skips((yield))


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What is collected stays to the end: it is not searched for garbage over and over again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


@pytest.fixture(scope="session")
def run():
    """The reference clamp, assembled."""
    return assemble()


@pytest.fixture
def without_pictures(monkeypatch):
    """Pages of reports without their pictures, which take long to draw."""
    monkeypatch.setattr("clamp3d.output.report_page._pictures", lambda *_: {"overview": [], "steps": [], "pairs": []})


@pytest.fixture
def main():
    """The command line in this process: code, stdout, stderr."""
    return call


@pytest.fixture
def whole_main(capfd):
    """``main`` with what libraries write past Python: all that a process would write to its stdout and stderr."""

    def run(*arguments):
        code, *said = call(*arguments)
        return code, *map(str.__add__, said, capfd.readouterr())

    return run
