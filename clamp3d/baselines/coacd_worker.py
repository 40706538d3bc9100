"""Runs CoACD in a process of its own: ``python -m clamp3d.baselines.coacd_worker IN.npz OUT.npz``.

CoACD ends its process on input it does not like and cannot be stopped once it runs. Its log goes to stdout, where the
caller reads the progress. The process ends itself when its stdin closes, that is, when the caller is gone.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np

from clamp3d.core.child import end_with_caller


def main(source: str, target: str) -> None:
    """Decompose the mesh in ``source`` with the keyword arguments in its note; hulls and seconds go to ``target``."""
    end_with_caller()
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


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
