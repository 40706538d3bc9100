"""Before any test: the contact kernel is compiled once, so that no test measures or prints its compilation."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from clamp3d import cli
from clamp3d.kernel import Capsule, Cylinder, SweptArc, groove_pieces, signed_distance, translation

# Drawings and sentences of the documentation are tested too.
sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

# A run that decides about a change repeats the same examples; a run at the desk looks for new ones.
settings.register_profile("ci", derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "default")


def pytest_sessionstart(session):
    groove, wire = SweptArc(7.0, 1.0, 50.0), Cylinder(6.0, 80.0)
    signed_distance(groove, wire, translation(0.0, 3.0, 0.0))
    groove_pieces(groove, Capsule(6.0, 80.0), translation(0.0, 3.0, 0.0))


@pytest.fixture
def main(monkeypatch, capsys):
    """The command line in this process, where a new one would only import everything again: code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["clamp3d", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return stop.value.code, *capsys.readouterr()

    return run
