"""A folder imports only folders below it; the list is the import-linter contract in pyproject.toml."""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def lint(folder):
    return subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_imports_go_down():
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout


def test_an_import_upwards_is_seen(tmp_path):
    ignored = shutil.ignore_patterns("__pycache__", "data", "templates")
    shutil.copytree(ROOT / "clamp3d", tmp_path / "clamp3d", ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    with open(tmp_path / "clamp3d" / "output" / "files.py", "a", encoding="utf-8") as file:
        file.write("\n\ndef _late():\n    from clamp3d.bench import published\n")
    done = lint(tmp_path)
    assert done.returncode == 1
    assert "clamp3d.output is not allowed to import clamp3d.bench" in done.stdout
