"""Families of meshes: broken ones, and good ones that are hard to read. `MESHES` maps name -> `MeshFamily`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.family import Family
from clamp3d.bench.stress.meshes import faults
from clamp3d.bench.stress.meshes.cases import Fault, MeshCases, make_cases
from clamp3d.bench.stress.meshes.methods import METHODS
from clamp3d.bench.stress.outcome import TOUCHING, Outcome, judge
from clamp3d.bench.stress.poses.truth import EXTENDED_ERROR, truth, truth_50_digits
from clamp3d.bench.stress.worker import Answers


def _millimetre(rng: np.random.Generator) -> float:
    return 1.0


def _any_unit(rng: np.random.Generator) -> float:
    return float(rng.choice([1e-3, 1.0, 1000.0 / 25.4, 1e3]))


class MeshFamily(Family):
    """A kind of fault: ``make`` spoils the mesh of a case, ``unit`` draws the size of its millimetre.

    Every method works in a child process: the libraries under them end it.
    """

    methods = METHODS
    part = 0.01
    truth_error = EXTENDED_ERROR

    def __init__(self, name: str, about: str, make: Fault, unit: Callable[[np.random.Generator], float]) -> None:
        super().__init__(name, about, lambda rng, n: None)
        self._fault, self._unit = make, unit

    def cases(self, n: int, seed: int) -> MeshCases:
        """See `Family`."""
        return make_cases(self.name, seed, n, self._fault, self._unit)

    def truths(self, cases: MeshCases) -> NDArray[Any]:
        """See `Family`."""
        return truth(cases.poses)

    def difference(self, cases: MeshCases, truths: NDArray[Any], i: int) -> float:
        """See `Family`."""
        exact = float(truths[i])
        difference = abs(float(truth_50_digits(cases.poses, i) - exact))
        return max(0.0, difference - 2e-16 * abs(exact)) / float(cases.scene()[i])

    def judge(self, name: str, cases: MeshCases, truths: NDArray[Any], answers: Answers) -> Outcome:
        """See `Family`; a verdict within the method's own bound of touching is not wrong."""
        band = np.maximum(TOUCHING * cases.scene(), np.nan_to_num(answers.bound, nan=0.0))
        measures = self.methods[name][1]().measures
        return judge(self.name, name, cases.scene(), truths, answers, measures, band=band)

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        lines = [
            "import numpy as np",
            "import clamp3d",
            "from clamp3d.bench.stress.registry import FAMILIES",
            f"case = FAMILIES[{self.name!r}].cases({n}, {seed})[{i}]",
            f"# {cases[i].mesh.what}",
            "try:",
            "    mesh = clamp3d.shapes.make_mesh(case.mesh.vertices, case.mesh.faces)",
            '    part = (clamp3d.shapes.MeshShape(mesh, "round"), np.eye(4))',
            '    scene = clamp3d.Scene.of({"part": part, "wire": (case.wire, case.T_mesh_wire)}, clearance=1e4)',
            "    print(clamp3d.check(scene).table())",
            "except clamp3d.InputError as error:",
            '    print("refused:", error)',
        ]
        return "\n".join([*lines, f"# truth: {float(truth_50_digits(cases.poses, i))!r} mm"])


_UNITS = {"mesh: scaled": _any_unit}

MESHES = {name: MeshFamily(name, *made, _UNITS.get(name, _millimetre)) for name, made in faults.MAKERS.items()}
