"""Runs CoACD in a process of its own, by `clamp3d.core.child.run_child`.

CoACD ends its process on input it does not like and cannot be stopped once it runs. The caller reads the progress from
its log.
"""

from __future__ import annotations

import json
import time

import numpy as np


def main(source: str, target: str) -> None:
    """Decompose the mesh in ``source`` with the keyword arguments in its note; hulls and seconds go to ``target``."""
    import coacd

    with np.load(source, allow_pickle=False) as file:
        mesh = coacd.Mesh(file["vertices"], file["faces"])
        arguments = json.loads(str(file["arguments"]))
    coacd.set_log_level("info")
    start = time.perf_counter()
    hulls = coacd.run_coacd(mesh, **arguments)
    seconds = time.perf_counter() - start
    arrays = {f"{kind}{i}": array for i, hull in enumerate(hulls) for kind, array in zip("vf", hull, strict=True)}
    np.savez(target, count=np.array(len(hulls)), seconds=np.array(seconds), **arrays)
