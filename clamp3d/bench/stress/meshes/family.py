"""A family of meshes: how its truths are found, and how methods are put to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from clamp3d.bench.stress.meshes.cases import Fault, MeshCases, make_cases
from clamp3d.bench.stress.meshes.methods import METHODS, method
from clamp3d.bench.stress.outcome import TOUCHING, Outcome, judge
from clamp3d.bench.stress.poses.truth import EXTENDED_ERROR, truth, truth_50_digits
from clamp3d.bench.stress.worker import Answers, run_isolated
from clamp3d.core.pose import Array


def _millimetre(rng: np.random.Generator) -> float:
    return 1.0


@dataclass(frozen=True, slots=True)
class MeshFamily:
    """A kind of fault: ``fault`` makes the mesh of a case, ``unit`` draws the size of its millimetre. See `Family`."""

    name: str
    about: str
    fault: Fault
    unit: Callable[[np.random.Generator], float] = _millimetre
    part: float = 0.01
    truth_error: float = EXTENDED_ERROR

    @property
    def methods(self) -> Mapping[str, str]:
        """See `Family`."""
        return {name: about for name, (about, _) in METHODS.items()}

    def cases(self, n: int, seed: int) -> MeshCases:
        """The n cases for a seed: always the same ones."""
        return make_cases(self.name, seed, n, self.fault, self.unit)

    def run(
        self, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
    ) -> tuple[list[Outcome], float]:
        """See `Family`. Every method works in a child process: the libraries under them end it."""
        cases = self.cases(n, seed)
        exact = truth(cases.poses)
        size = cases.poses.scene()
        worst = 0.0
        for i in np.linspace(0, n - 1, min(check, n)).astype(int):
            difference = abs(float(truth_50_digits(cases.poses, int(i)) - float(exact[i])))
            worst = max(worst, (difference - 2e-16 * abs(float(exact[i]))) / float(size[i]))
        outcomes = []
        for name in methods:
            answers = run_isolated(partial(method, name), cases, time_limit=time_limit)
            outcomes.append(self.judge(name, cases, answers))
        return outcomes, worst

    def judge(self, name: str, cases: MeshCases, answers: Answers) -> Outcome:
        """Count right and wrong; a verdict within the method's own bound of touching is not wrong."""
        size: Array = cases.poses.scene()
        band = np.maximum(TOUCHING * size, np.nan_to_num(answers.bound, nan=0.0))
        return judge(self.name, name, size, truth(cases.poses), answers, method(name).measures, band=band)

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
