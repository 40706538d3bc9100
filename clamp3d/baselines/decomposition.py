"""Convex decomposition of a mesh by CoACD (Wei et al. 2022, doi:10.1145/3528223.3530103), checked, timed and cached.

What its settings do, as measured with coacd 1.0.14:

- ``real_metric``: ``threshold`` is a length in the mesh's unit, here mm. CoACD turns it into 1.6 threshold / (largest
  extent) of its own normalised scale; without it ``threshold`` is on that scale and its meaning changes with the part.
- ``threshold`` bounds a concavity that is sampled, not the intrusion into a groove; the intrusion follows it roughly.
  The splints of the reference clamp (mesh error 0.01): 2.0 mm: 13 and 20 hulls, intrusion 0.7 to 1.1 mm, 20 s each;
  1.0 mm: 68 and 49 hulls, 0.3 to 0.6 mm, 50 s each.
- On its own scale, a block 137 x 30 x 60 with a 140 degree groove of radius 12 in 28 chords (extruded by trimesh):
  0.05: 2 hulls, intrusion 2.17 mm; 0.02: 4 hulls, 0.556 mm; 0.01: 60 to 108 hulls, 0.18 mm, as the last digits of the
  corners happen to be. Other tessellations give 4 to 6 hulls and 0.4 to 1.0 mm at 0.02, 13 to 165 hulls at 0.01.
- Hull corners are rounded: some 0.005 mm of the part may lie outside its hulls.
- The answer depends on the orientation of the mesh and a little on the order of its vertices, not on the number of
  cores. That block in 14 chords at 0.0234 (2 mm by ``real_metric``): ten random orders all give 4 hulls, intrusion
  1.131 mm, 1 s; ten random rotations 8 to 24 hulls, 1.59 to 2.64 mm, up to 0.17 mm of the part left out, 2 to 58 s.
  So a coaxial wire with 1.5 mm of clearance is free in the first ten and a clash in the others. The
  cache tells meshes by their vertices and faces in their order: turned or reordered it is another mesh.
"""

from __future__ import annotations

import hashlib
import math
import os
import time
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import ArrayLike

from clamp3d.errors import InputError, SolverError
from clamp3d.files.child import Worker, WorkerEndedError, WorkerTimeoutError
from clamp3d.geometry.mesh import Mesh, closed_mesh
from clamp3d.geometry.pose import Array

_RUN = f"{__name__}:run_coacd"
NORMALISED = 1.6
"""Largest extent to which CoACD brings a mesh; the thresholds of its papers and examples are on that scale."""


def check_threshold(threshold: float) -> float:
    """The concavity in mm that CoACD may leave. Raises InputError unless it is > 0 and finite."""
    if not (math.isfinite(threshold) and threshold > 0.0):
        raise InputError(f"threshold must be > 0, got {threshold}")
    return threshold


@dataclass(frozen=True, slots=True)
class Decomposition:
    """Corners (n, 3) of each hull, mm; ``seconds`` is CoACD's time, also where ``cached`` says that this was before."""

    hulls: tuple[Array, ...]
    seconds: float
    cached: bool


def decompose(
    vertices: ArrayLike,
    faces: ArrayLike,
    threshold: float,
    *,
    name: str = "mesh",
    time_limit: float = 300.0,
    progress: bool | None = None,
) -> Decomposition:
    """Convex hulls that together stand for a closed mesh (vertices (n, 3) mm, faces (m, 3) outward).

    CoACD runs in a process of its own for at most ``time_limit`` s: it ends its process on input that it does not like
    and cannot be stopped once it runs. ``progress`` on stderr: None shows it on a terminal. Answers are kept on disk
    (`cache_dir`). Raises InputError for a mesh that is not closed (`closed_mesh`), SolverError if CoACD does not finish
    in time or ends without an answer.
    """
    solid = closed_mesh(vertices, faces, name)
    if not time_limit > 0.0:
        raise InputError(f"time_limit must be > 0 s, got {time_limit}")
    settings = {"threshold": check_threshold(threshold), "real_metric": True, "seed": 0}
    kept = _cache_file(solid, settings)
    with suppress(Exception):  # no file; a damaged one can raise anything
        return _decomposition(dict(np.load(kept, allow_pickle=False)), True)
    try:
        with Worker() as worker, _status(name, progress):
            arrays = worker.call(_RUN, solid.vertices, solid.faces, settings, time_limit=time_limit)
    except WorkerTimeoutError:
        raise SolverError(
            f"CoACD did not finish {name} in {time_limit:g} s at threshold {threshold:g}; raise time_limit or threshold"
        ) from None
    except (WorkerEndedError, RuntimeError, MemoryError) as error:
        raise SolverError(f"CoACD gave no hulls for {name}: {error or 'out of memory'}") from None
    with suppress(OSError):  # a cache that cannot be written is no error
        kept.parent.mkdir(parents=True, exist_ok=True)
        part = kept.with_suffix(f".{os.getpid()}.npz")
        np.savez(part, allow_pickle=False, **arrays)
        part.replace(kept)
    return _decomposition(arrays, False)


def run_coacd(vertices: Array, faces: Any, parameters: dict[str, Any]) -> dict[str, Any]:
    """CoACD itself, in the process: corners of all hulls one after the other, the ``counts`` of each, the seconds."""
    import coacd

    start = time.perf_counter()
    hulls = [np.asarray(corners) for corners, _ in coacd.run_coacd(coacd.Mesh(vertices, faces), **parameters)]
    hulls.sort(key=lambda corners: corners.tolist())  # CoACD 1.0.10 gives them in another order each time
    counts = [len(corners) for corners in hulls]
    return {"points": np.concatenate(hulls), "counts": counts, "seconds": time.perf_counter() - start}


def _decomposition(arrays: dict[str, Any], cached: bool) -> Decomposition:
    hulls = np.split(arrays["points"], np.cumsum(arrays["counts"])[:-1])
    return Decomposition(tuple(hulls), float(arrays["seconds"]), cached)


def cache_dir() -> Path:
    """Folder of the cache: $CLAMP3D_CACHE, else the platform's place for caches ($XDG_CACHE_HOME/clamp3d on Linux)."""
    own = os.environ.get("CLAMP3D_CACHE")
    return Path(own).expanduser() if own else platformdirs.user_cache_path("clamp3d", appauthor=False)


def _cache_file(solid: Mesh, settings: dict[str, Any]) -> Path:
    """The file in the cache, named after everything that the hulls depend on."""
    mesh = solid.vertices.astype("<f8").tobytes() + solid.faces.astype("<i8").tobytes()
    about = f"hulls {metadata.version('coacd')} {len(solid.vertices)} {settings}".encode()
    return cache_dir() / f"decomposition-{hashlib.sha256(about + mesh).hexdigest()[:32]}.npz"


def _status(name: str, progress: bool | None) -> Any:
    from rich.console import Console

    console = Console(stderr=True)
    is_shown = console.is_terminal if progress is None else progress
    return console.status(f"CoACD {name}") if is_shown else nullcontext()
