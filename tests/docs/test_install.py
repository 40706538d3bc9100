"""What is declared holds: extras are named where they are needed, and what is missing is said in one line."""

import re
import sys
import tomllib

import pytest

from clamp3d.errors import EXTRAS
from tests.docs.project import ROOT, python

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TOOLS = {"all", "dev", "docs", "peers"}
ORDINARY = {"trimesh", "python-fcl", "coacd", "numpy", "meshcat"}


def names(lines):
    return {re.match(r"[\w-]+", line)[0] for line in lines}


def test_what_every_run_may_use_is_ordinary():
    assert names(PROJECT["dependencies"]) >= ORDINARY
    heavy = {"matplotlib", "scikit-image", "lib3mf", "mpmath", "pandas", "dask", "cadquery-ocp-novtk"}
    assert not names(PROJECT["dependencies"]) & heavy


def test_every_extra_is_known_and_in_all():
    extras = PROJECT["optional-dependencies"]
    assert set(EXTRAS.values()) == set(extras) - TOOLS
    assert extras["all"] == [f"clamp3d[{','.join(sorted(set(EXTRAS.values())))}]"]


def test_readme_names_every_extra_beside_what_needs_it():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = [line.split("|") for line in text.splitlines() if line.startswith("| `")]
    named = {extra for row in rows for extra in re.findall(r"`([\w]+)`", row[1]) if len(row) == 4 and row[2].strip()}
    assert named >= set(PROJECT["optional-dependencies"]) - {"all", "dev", "docs"}


def test_lower_bounds_are_constraints():
    lowest = dict(line.split("==") for line in python(".ci/lowest").stdout.splitlines())
    assert (lowest["trimesh"], lowest["rtree"], lowest["coacd"]) == ("5", "1.4.1", "1.0.10")
    assert names(PROJECT["dependencies"]) <= lowest.keys()


def test_metadata_names_python_and_licence():
    versions = {c.rpartition(" ")[2] for c in PROJECT["classifiers"] if re.fullmatch(r".*:: 3\.\d+", c)}
    workflow = (ROOT / ".github/workflows/test.yml").read_text(encoding="utf-8")
    assert versions == set(re.findall(r"\"(3\.\d+)\"", workflow))
    assert min(versions) == PROJECT["requires-python"].removeprefix(">=")
    assert (PROJECT["license"], PROJECT["license-files"]) == ("MIT", ["LICENSE"])


@pytest.mark.parametrize(
    ("library", "arguments"),
    [
        ("matplotlib", ("report", "-o", "out")),
        ("matplotlib", ("tolerance", "--n", "2", "--plot", "out.png")),
        ("distributed", ("tolerance", "--n", "2", "--scheduler", "x")),
        ("lib3mf", ("export", "-o", "out.3mf")),
        ("mpmath", ("stress", "--n", "1", "--family", "ties")),
        ("skimage", ("reproduce",)),
        ("OCP", ("export", "-o", "out.step")),
    ],
)
def test_a_missing_library_is_one_line_that_works(library, arguments, tmp_path, monkeypatch, main):
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.chdir(tmp_path)
    code, _, err = main(*arguments)
    assert code == 2
    line = err.splitlines()[-1]
    name = "Open CASCADE" if library == "OCP" else library
    assert re.fullmatch(rf"clamp3d: error: .+ needs {name}: pip install 'clamp3d\[{EXTRAS[library]}\]'", line)
    assert list(tmp_path.iterdir()) == []
