"""CoACD in a process of its own: it ends its process on input it does not like and cannot be stopped once it runs."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray


def run(vertices: NDArray[Any], faces: NDArray[Any], parameters: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """Decompose a mesh: vertices and faces of hull i as ``v<i>``, ``f<i>``, their ``count``, and the ``seconds``."""
    import coacd

    start = time.perf_counter()
    hulls = coacd.run_coacd(coacd.Mesh(vertices, faces), **parameters)
    seconds = time.perf_counter() - start
    arrays = {f"{kind}{i}": array for i, hull in enumerate(hulls) for kind, array in zip("vf", hull, strict=True)}
    return arrays | {"count": np.array(len(hulls)), "seconds": np.array(seconds)}
