"""The documentation site builds without a warning, and names only files that exist."""

import importlib.util
import re

import pytest

import clamp3d
from tests.docs.project import PAGES, ROOT, python

PACKAGE = ROOT / "clamp3d"


@pytest.mark.skipif(importlib.util.find_spec("mkdocstrings") is None, reason="needs the extra docs")
def test_the_site_builds_strictly(tmp_path):
    build = ("-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path)
    done = python(*build, NO_MKDOCS_2_WARNING="1")
    assert done.returncode == 0, done.stdout + done.stderr
    page = (tmp_path / "api" / "clamp3d" / "index.html").read_text(encoding="utf-8")
    for name in ("load", "check", "Scene", "distance", "assemble"):
        assert f'">{name}</span>' in page or f">{name}<" in page


@pytest.mark.parametrize("page", [*PAGES, ROOT / "docs" / "architecture.svg"], ids=lambda page: page.name)
def test_pages_name_files_that_exist(page):
    """``engine/check.py`` is a file of the package, ``tests/...`` and ``scripts/...`` are files of the project."""
    for name in re.findall(r"(?<![\w/.-])(?:[\w-]+/)+[\w-]+\.\w+\b", page.read_text(encoding="utf-8")):
        places = (ROOT / name, PACKAGE / name, ROOT / "docs" / name)
        if name.split("/")[0] in {f.name for folder in (ROOT, PACKAGE, ROOT / "docs") for f in folder.iterdir()}:
            assert any(place.exists() for place in places), name


def test_every_public_shape_is_in_the_reference():
    page = (ROOT / "docs" / "api" / "shapes.md").read_text(encoding="utf-8")
    for name in clamp3d.shapes.__all__:
        assert re.search(rf"[\[ .]{name}\b", page), name


@pytest.mark.parametrize("name", ["pyproject.toml", "CITATION.cff"])
def test_one_version(name):
    assert re.search(rf'^version\W+{re.escape(clamp3d.__version__)}"?$', (ROOT / name).read_text(), re.MULTILINE)
