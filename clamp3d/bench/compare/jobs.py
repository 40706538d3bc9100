"""Each measurement in a process of its own: a crash, a hang or used memory of one method leaves the others alone."""

from __future__ import annotations

from typing import Any, Literal

from clamp3d.bench.compare.methods import Method
from clamp3d.errors import Clamp3dError
from clamp3d.files.child import Worker, WorkerEndedError, WorkerTimeoutError

Kind = Literal["contact", "peer", "assembly", "image"]


class JobError(Exception):
    """Why a job gave no answer, in one line."""


def run_job(kind: Kind, method: Method, *, time_limit: float) -> Any:
    """The answer of a job. Raises JobError if it fails, crashes or is not done in ``time_limit`` s."""
    try:
        with Worker() as worker:
            return worker.call(_ANSWER, kind, method.family, method.setting, time_limit=time_limit)
    except WorkerTimeoutError:
        raise JobError(f"not finished in {time_limit:g} s") from None
    except WorkerEndedError as error:
        raise JobError(f"crashed ({error.ending}): {worker.log[-1][:200] if worker.log else ''}") from None
    except (Clamp3dError, RuntimeError, MemoryError) as error:
        raise JobError(str(error) or "out of memory") from None


_ANSWER = f"{__name__}:answer"


def answer(kind: str, family: str, setting: float | None) -> Any:
    """Do a job in this process."""
    method = Method(family, setting)
    if kind == "image":
        from clamp3d.bench.compare.assemblies import imaged

        return imaged()
    if kind == "assembly":
        from clamp3d.bench.compare.assemblies import assembled

        return assembled(method)
    from clamp3d.bench.compare.measure import measure
    from clamp3d.bench.compare.peers import load_peer, prepare_peer

    if kind == "peer":
        return measure(method, load=load_peer, prepare=prepare_peer)
    return measure(method)
