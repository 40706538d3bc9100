"""Broken meshes are refused in words or answered rightly; good ones are answered; bare libraries do fail on them."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

from clamp3d.bench.stress.meshes.cases import LEAST
from clamp3d.bench.stress.meshes.family import MESHES, METHODS, MeshFamily
from clamp3d.bench.stress.outcome import Outcome
from clamp3d.bench.stress.worker import run_here, run_isolated
from clamp3d.cli import group
from clamp3d.errors import InputError

ANSWERED = ("mesh: soup", "mesh: turned")
NEVER = ("mesh: open", "mesh: empty")
CASES = {"mesh": 60, "fit": 18, "scene": 8}
REFUSING = 60


def _ask(family: MeshFamily, name: str, n: int, seed: int = 7) -> Outcome:
    cases = family.cases(n, seed)
    return family.judge(name, cases, family.truths(cases), run_here(METHODS[name][1](), cases))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("family", MESHES)
def test_own_methods_are_never_wrong(family: str, name: str) -> None:
    n = REFUSING if family in NEVER else CASES[name]
    found = _ask(MESHES[family], name, n)
    assert (found.asked, found.answered + found.refused) == (n, n)
    assert found.wrong == 0, (found.notes, found.examples)
    assert not found.beyond_bound, found.examples
    if family in ANSWERED:
        assert found.refused == 0, found.notes
    if family in NEVER:
        assert found.answered == 0


def test_bare_libraries_are_found_out() -> None:
    """The suite tells a library that ends the interpreter, and one that is wrong without a word."""
    numbers = MESHES["mesh: bad numbers"]
    cases = numbers.cases(6, 20)
    what = [cases[i].mesh.what for i in range(6)]
    fcl = run_isolated(METHODS["FCL alone"][1], cases, time_limit=60.0)
    assert fcl.crashed == [what.index("a corner far beyond")]
    assert fcl.failed[what.index("a corner negative")]
    assert not fcl.refused.any()
    assert numbers.cases(1, 57)[0].mesh.what == "a coordinate nan"
    coacd = run_isolated(METHODS["CoACD alone"][1], numbers.cases(1, 57), time_limit=60.0)
    assert coacd.crashed == [0]
    opened = _ask(MESHES["mesh: open"], "FCL alone", 60)
    assert opened.false_misses > 0
    assert opened.refused == 0


def test_cases_are_the_same_again_and_away_from_touching() -> None:
    family = MESHES["mesh: turned"]
    once, again = family.cases(8, 3), family.cases(8, 3)
    for i in range(8):
        assert np.array_equal(once[i].mesh.vertices, again[i].mesh.vertices)
        assert np.array_equal(once[i].mesh.faces, again[i].mesh.faces)
        one = once.take([i])[0]
        assert np.array_equal(one.mesh.vertices, once[i].mesh.vertices)
        assert np.array_equal(one.T_mesh_wire, once[i].T_mesh_wire)
    exact = family.truths(once)
    assert (np.abs(exact) >= 0.999 * LEAST * once.poses.shapes.R[:, None]).all()
    assert (np.ptp(exact, axis=1) <= 1e-3 * once.scene()).all()
    assert family.difference(once, exact, 5) == 0.0
    assert not np.array_equal(family.cases(8, 4)[0].T_mesh_wire, once[0].T_mesh_wire)


@pytest.mark.parametrize("family", MESHES)
def test_every_fault_is_what_it_says(family: str) -> None:
    """A mesh that is called good is closed, has one winding and a volume; one that is called broken has a fault."""
    from clamp3d.core.mesh import closed_mesh

    seen = set()
    cases = MESHES[family].cases(60, 11)
    for i in range(60):
        case = cases[i].mesh
        seen.add(case.what)
        try:
            closed_mesh(case.vertices, case.faces)
            fine = True
        except InputError:
            fine = False
        assert fine or case.broken, case.what
        if not case.what.startswith("the body twice"):  # closed twice over: no rule of a mesh is broken
            assert fine != case.broken, case.what
    assert len(seen) >= {"mesh: soup": 2, "mesh: turned": 1}.get(family, 4)


def test_command_prints_a_mesh_case_that_runs(capsys) -> None:
    result = CliRunner().invoke(group, ["stress", "--family", "mesh: soup", "--n", "1000", "--case", "2"])
    assert result.exit_code == 0, result.output
    exec(result.output, {})
    assert "'verdict'" in capsys.readouterr().out
    assert result.output.splitlines()[-1].startswith("# truth: ")
