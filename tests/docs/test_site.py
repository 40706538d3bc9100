"""The documentation site builds without a warning, and names only files that exist."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import clamp3d

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "clamp3d"


@pytest.mark.skipif(importlib.util.find_spec("mkdocstrings") is None, reason="needs the extra docs")
def test_the_site_builds_strictly(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    page = (tmp_path / "api" / "clamp3d" / "index.html").read_text(encoding="utf-8")
    for name in ("load", "check", "Scene", "distance", "assemble"):
        assert f'">{name}</span>' in page or f">{name}<" in page


PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *(ROOT / "docs").glob("*.md"),
    ROOT / "docs" / "architecture.svg",
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_name_files_that_exist(page):
    """``engine/check.py`` is a file of the package, ``tests/...`` and ``scripts/...`` are files of the project."""
    for name in re.findall(r"(?<![\w/.-])(?:[\w-]+/)+[\w-]+\.\w+\b", page.read_text(encoding="utf-8")):
        places = (ROOT / name, PACKAGE / name, ROOT / "docs" / name)
        if name.split("/")[0] in {f.name for folder in (ROOT, PACKAGE, ROOT / "docs") for f in folder.iterdir()}:
            assert any(place.exists() for place in places), name


def test_the_public_names_are_few_and_documented():
    assert len(clamp3d.__all__) <= 45
    for name in clamp3d.__all__:
        assert (getattr(clamp3d, name).__doc__ or "").strip(), name


def test_every_public_shape_is_in_the_reference():
    page = (ROOT / "docs" / "api" / "shapes.md").read_text(encoding="utf-8")
    for name in clamp3d.shapes.__all__:
        assert re.search(rf"[\[ .]{name}\b", page), name


def test_one_version():
    for name in ("pyproject.toml", "CITATION.cff"):
        assert re.search(rf'^version\W+{re.escape(clamp3d.__version__)}"?$', (ROOT / name).read_text(), re.MULTILINE), (
            name
        )


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150
