"""Each measurement in a process of its own: a crash, a hang or used memory of one method leaves the others alone.

`run_job` starts the process and waits for its answer.
"""

from __future__ import annotations

import pickle
import signal
import tempfile
from pathlib import Path
from typing import Any, Literal

from clamp3d.bench.compare.methods import Method
from clamp3d.core.child import run_child
from clamp3d.errors import Clamp3dError

Kind = Literal["contact", "peer", "assembly", "image"]


class JobError(Exception):
    """Why a job gave no answer, in one line."""


def run_job(kind: Kind, method: str, *, time_limit: float) -> Any:
    """The answer of a job. Raises JobError if it fails, crashes or is not done in ``time_limit`` s."""
    with tempfile.TemporaryDirectory(prefix="clamp3d-") as folder:
        target = Path(folder) / "out.pickle"
        code, said = run_child("clamp3d.bench.compare.jobs", kind, method, str(target), time_limit=time_limit)
        if code is None:
            raise JobError(f"not finished in {time_limit:g} s")
        if not target.exists():
            why = f"crashed ({signal.Signals(-code).name})" if code < 0 else f"ended with exit code {code}"
            raise JobError(f"{why}: {said[-1][:200]}" if said else why)
        answer = pickle.loads(target.read_bytes())
    if isinstance(answer, JobError):
        raise answer
    return answer


def _answer(kind: str, method: str) -> Any:
    if kind == "contact":
        from clamp3d.bench.compare.measure import measure

        return measure(Method.parse(method))
    if kind == "peer":
        from clamp3d.bench.compare.measure import measure
        from clamp3d.bench.compare.peers import load_peer, prepare_peer

        return measure(Method.parse(method), load=load_peer, prepare=prepare_peer)
    from clamp3d.bench.compare import assemblies

    return assemblies.imaged() if kind == "image" else assemblies.assembled(Method.parse(method))


def main(kind: str, method: str, target: str) -> None:
    """Do a job; write its answer, or why there is none."""
    try:
        answer = _answer(kind, method)
    except Clamp3dError as error:
        answer = JobError(str(error))
    done = Path(target + ".part")
    done.write_bytes(pickle.dumps(answer))
    done.rename(target)  # whole or not at all
