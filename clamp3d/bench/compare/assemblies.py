"""The reference clamp assembled by every method, and measured in a picture: Table 4 of the paper, with times."""

from __future__ import annotations

import time
from dataclasses import dataclass

from clamp3d.baselines import Cas
from clamp3d.bench.compare.methods import Method, assembly_model, coacd_seconds, load
from clamp3d.bench.image import MARKING_ERROR, PX_PER_MM, image_study
from clamp3d.bench.picture import find_end_points, picture
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.result import Solver


@dataclass(frozen=True, slots=True)
class Assembled:
    """The reference clamp assembled by a method: Table 4's ``distance`` in mm, CPU seconds, numbers of queries.

    ``setup`` is the time to make the model's pieces, ``seconds`` that of one assembly without it.
    """

    method: str
    setting: float | None
    label: str
    solver: Solver
    status: str
    distance: float
    setup: float
    seconds: float
    contact_queries: int


@dataclass(frozen=True, slots=True)
class Imaged:
    """The assembled clamp measured in a picture: errors of the splint distance in mm against the exact one.

    ``by_hand`` marks ``trials`` times, ``automatic`` once in ``automatic_seconds`` of CPU time.
    """

    trials: int
    marking_error_px: float
    px_per_mm: float
    median_by_hand: float
    worst_by_hand: float
    first_five: tuple[float, ...]
    automatic: float
    automatic_seconds: float


def assembled(method: Method) -> Assembled:
    """Assemble the reference clamp by the exact solver; quick ones several times, the least time counts."""
    clamp = load_clamp("reference")
    load(method)
    assemble(clamp, assembly_model(Method("cas"), clamp))  # compiles and loads what all share
    start = time.process_time()
    model = assembly_model(method, clamp)
    setup = time.process_time() - start + coacd_seconds(model)
    times: list[float] = []
    while not times or (len(times) < 10 and sum(times) < 1.0):
        start = time.process_time()
        run = assemble(clamp, model, solver="exact")
        times.append(time.process_time() - start)
    label = f"{method.label} mm" if method.family == "hulls" else method.label
    queries = run.work.contact_queries
    return Assembled(
        method.family, method.setting, label, "exact", run.status, run.distance, setup, min(times), queries
    )


def imaged() -> Imaged:
    """The paper's third method on the picture of the exact final state."""
    run = assemble(load_clamp("reference"), Cas())
    study = image_study(run)
    shown = picture(run, PX_PER_MM).image
    start = time.process_time()
    find_end_points(shown)
    seconds = time.process_time() - start
    return Imaged(
        len(study.errors),
        MARKING_ERROR,
        PX_PER_MM,
        study.median_error,
        study.worst_error,
        tuple(float(v) for v in study.trials),
        abs(study.automatic.distance - study.exact),
        seconds,
    )
