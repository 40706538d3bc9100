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
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

from numpy.typing import ArrayLike

from clamp3d.baselines import cache as disk
from clamp3d.errors import InputError, SolverError
from clamp3d.files.child import Worker, WorkerEndedError, WorkerTimeoutError
from clamp3d.geometry.mesh import Mesh, closed_mesh

_RUN = "clamp3d.baselines.coacd_worker:run"


@dataclass(frozen=True, slots=True)
class DecompositionParameters:
    """CoACD's own parameters under their own names; all others are left as CoACD has them. Raises InputError.

    ``threshold`` in mm with ``real_metric``, else on CoACD's normalised scale (0.01 to 1; its default is 0.05).
    """

    threshold: float = 2.0
    real_metric: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.threshold) and self.threshold > 0.0):
            raise InputError(f"threshold must be > 0, got {self.threshold}")
        if not self.real_metric and self.threshold > 1.0:
            raise InputError(f"threshold must be <= 1 without real_metric, got {self.threshold}")


@dataclass(frozen=True, slots=True)
class Decomposition:
    """Hulls of a mesh; ``seconds`` is the time CoACD took, also where ``cached`` says that this was before."""

    hulls: tuple[Mesh, ...]
    seconds: float
    cached: bool


def decompose(
    vertices: ArrayLike,
    faces: ArrayLike,
    parameters: DecompositionParameters | None = None,
    *,
    name: str = "mesh",
    time_limit: float = 300.0,
    progress: bool | None = None,
    cache: bool = True,
) -> Decomposition:
    """Convex hulls that together stand for a closed mesh (vertices (n, 3) mm, faces (m, 3) outward).

    CoACD runs in a process of its own for at most ``time_limit`` s; nothing is left behind when it is interrupted.
    ``progress`` on stderr: None shows it on a terminal. Answers are kept on disk (`clamp3d.baselines.cache`) unless
    ``cache`` is false. Raises InputError for a mesh that is not closed (`closed_mesh`), SolverError if CoACD does not
    finish in time or ends without an answer.
    """
    solid = closed_mesh(vertices, faces, name)
    if not time_limit > 0.0:
        raise InputError(f"time_limit must be > 0 s, got {time_limit}")
    settings = asdict(parameters or DecompositionParameters())
    key = _cache_key(solid, settings)
    if cache and (arrays := disk.load(key)) is not None:
        with suppress(KeyError, TypeError, ValueError):
            return Decomposition(_hulls(arrays), float(arrays["seconds"]), True)
    try:
        with Worker() as worker, _status(name, progress):
            arrays = worker.call(_RUN, solid.vertices, solid.faces, settings, time_limit=time_limit)
        result = Decomposition(_hulls(arrays), float(arrays["seconds"]), False)
    except WorkerTimeoutError:
        raise SolverError(
            f"CoACD did not finish {name} in {time_limit:g} s at threshold {settings['threshold']:g}; "
            "raise time_limit or threshold"
        ) from None
    except (WorkerEndedError, RuntimeError, MemoryError, ValueError) as error:
        raise SolverError(f"CoACD gave no hulls for {name}: {error or 'out of memory'}") from None
    if cache:
        disk.keep(key, arrays)
    return result


def _cache_key(solid: Mesh, settings: dict[str, Any]) -> str:
    """The file's name in the cache, from everything that the hulls depend on."""
    mesh = solid.vertices.astype("<f8").tobytes() + solid.faces.astype("<i8").tobytes()
    about = f"{metadata.version('coacd')} {len(solid.vertices)} {settings}".encode()
    return f"decomposition-{hashlib.sha256(about + mesh).hexdigest()[:32]}"


def _hulls(arrays: Any) -> tuple[Mesh, ...]:
    count = int(arrays["count"])
    if count < 1:
        raise ValueError("no hulls")
    # CoACD 1.0.10 gives the same hulls in another order each time.
    result = sorted(((arrays[f"v{i}"], arrays[f"f{i}"]) for i in range(count)), key=lambda hull: hull[0].tolist())
    return tuple(closed_mesh(vertices, faces, f"hull {i}") for i, (vertices, faces) in enumerate(result))


def _status(name: str, progress: bool | None) -> Any:
    from rich.console import Console

    console = Console(stderr=True)
    is_shown = console.is_terminal if progress is None else progress
    return console.status(f"CoACD {name}") if is_shown else nullcontext()
