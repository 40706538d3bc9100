"""Each measurement in a process of its own: a crash, a hang or used memory of one method leaves the others alone.

``python -m clamp3d.bench.compare.jobs KIND METHOD OUT.json`` is the process; `run_job` starts it and waits.
"""

from __future__ import annotations

import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast

from clamp3d.bench.compare.methods import Method
from clamp3d.clamp.result import Solver
from clamp3d.errors import Clamp3dError

Kind = Literal["contact", "peer", "assembly", "image", "complexity"]


@dataclass(frozen=True, slots=True)
class Assembled:
    """The reference clamp assembled by a method: Table 4's ``distance`` in mm, CPU seconds, what was asked and tried.

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
    motion_steps: int


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


class JobError(Exception):
    """Why a job gave no answer, in one line."""


def run_job(kind: Kind, method: str, *, time_limit: float) -> dict[str, Any]:
    """The answer of a job as plain data. Raises JobError if it fails, crashes or is not done in ``time_limit`` s."""
    with tempfile.TemporaryDirectory(prefix="clamp3d-") as folder:
        target = Path(folder) / "out.json"
        worker = subprocess.Popen(
            [sys.executable, "-m", "clamp3d.bench.compare.jobs", kind, method, str(target)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=_environment(),
            start_new_session=True,
        )
        said: list[bytes] = []
        assert worker.stderr is not None
        reader = threading.Thread(target=lambda: said.append(worker.stderr.read()), daemon=True)  # type: ignore[union-attr]
        reader.start()
        try:
            code = worker.wait(timeout=time_limit)
        except subprocess.TimeoutExpired:
            raise JobError(f"not finished in {time_limit:g} s") from None
        finally:
            worker.kill()
            worker.wait()
            reader.join(timeout=5.0)
            for pipe in (worker.stdin, worker.stderr):
                if pipe is not None:
                    pipe.close()
        try:
            answer = json.loads(target.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise JobError(_last_words(code, b"".join(said))) from None
    if "failed" in answer:
        raise JobError(str(answer["failed"]))
    return cast(dict[str, Any], answer)


def assembled(method: Method, *, time_limit: float = 300.0) -> tuple[Assembled, Assembled]:
    """Assemble the reference clamp by both solvers, exact first; quick ones several times, the median counts."""
    from clamp3d.bench.compare.methods import assembly_model, coacd_seconds, load
    from clamp3d.clamp.assemble import assemble
    from clamp3d.clamp.loader import load_clamp

    clamp = load_clamp("reference")
    load(method)
    assemble(clamp, assembly_model(Method("cas"), clamp))  # compiles and loads what all share
    start = time.process_time()
    model = assembly_model(method, clamp, time_limit=time_limit)
    setup = time.process_time() - start + coacd_seconds(model)

    def solved(solver: Solver) -> Assembled:
        times: list[float] = []
        while not times or (len(times) < 5 and sum(times) < 0.5):
            start = time.process_time()
            run = assemble(clamp, model, solver=solver)
            times.append(time.process_time() - start)
        label = f"{method.label} mm" if method.family == "hulls" else method.label
        return Assembled(
            method.family,
            method.setting,
            label,
            solver,
            run.status,
            run.distance,
            setup,
            statistics.median(times),
            run.work.contact_queries,
            run.work.motion_steps,
        )

    return solved("exact"), solved("stepped")


def imaged() -> Imaged:
    """The paper's third method on the picture of the exact final state."""
    from clamp3d.baselines.cas import Cas
    from clamp3d.bench.image import image_study
    from clamp3d.bench.picture import find_end_points, picture
    from clamp3d.clamp.assemble import assemble
    from clamp3d.clamp.loader import load_clamp

    run = assemble(load_clamp("reference"), Cas())
    study = image_study(run)
    shown = picture(run, study.px_per_mm, seed=study.seed).image
    start = time.process_time()
    find_end_points(shown)
    seconds = time.process_time() - start
    return Imaged(
        len(study.errors),
        study.marking_error,
        study.px_per_mm,
        study.median_error,
        study.worst_error,
        tuple(float(v) for v in study.trials),
        abs(study.automatic.distance - study.exact),
        seconds,
    )


def _answer(kind: str, method: str) -> Mapping[str, Any]:
    if kind == "contact":
        from clamp3d.bench.compare.measure import measure

        return asdict(measure(Method.parse(method)))
    if kind == "peer":
        from clamp3d.bench.compare.measure import measure
        from clamp3d.bench.compare.peers import load_peer, prepare_peer

        return asdict(measure(Method.parse(method), load=load_peer, prepare=prepare_peer))
    if kind == "image":
        return asdict(imaged())
    if kind == "complexity":
        from clamp3d.bench.complexity import complexity

        return {"sweeps": [asdict(sweep) for sweep in complexity()]}
    return {"rows": [asdict(row) for row in assembled(Method.parse(method))]}


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def _last_words(code: int, said: bytes) -> str:
    lines = [line.strip() for line in said.decode(errors="replace").splitlines() if line.strip()]
    why = f"crashed ({signal.Signals(-code).name})" if code < 0 else f"ended with exit code {code}"
    return f"{why}: {lines[-1][:200]}" if lines else why


def _end_with_caller() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


def main(kind: str, method: str, target: str) -> None:
    """Do a job, write its answer or why there is none; end at once when the caller is gone (stdin closes)."""
    threading.Thread(target=_end_with_caller, daemon=True).start()
    try:
        answer = _answer(kind, method)
    except Clamp3dError as error:
        answer = {"failed": str(error)}
    Path(target).write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
