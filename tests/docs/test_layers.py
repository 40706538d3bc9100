"""A folder imports only folders below it; the list is the import-linter contract in pyproject.toml."""

import sys
from pathlib import Path

from tests.docs.project import python


def test_imports_go_down():
    done = python(Path(sys.executable).with_name("lint-imports"), "--no-cache")
    assert done.returncode == 0, done.stdout
    assert "below it in this list KEPT" in done.stdout
