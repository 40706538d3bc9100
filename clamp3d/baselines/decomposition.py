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
- ``preprocess_mode`` "on" remeshes: outer faces move by 0.1 mm and more. "auto" leaves a manifold mesh as it is.
- Hull corners are rounded: some 0.005 mm of the part may lie outside its hulls (`Decomposition.uncovered`).
- The answer depends on the orientation of the mesh and a little on the order of its vertices, not on the number of
  cores. That block in 14 chords at 0.0234 (2 mm by ``real_metric``): ten random orders all give 4 hulls, intrusion
  1.131 mm, 1 s; ten random rotations 8 to 24 hulls, 1.59 to 2.64 mm, up to 0.17 mm of the part left out, 2 to 58 s.
  So a coaxial wire with 1.5 mm of clearance is free in the first ten and a clash in the others. ``mesh_hash`` and the
  cache tell meshes by their vertices and faces in their order: turned or reordered it is another mesh.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.baselines import cache as disk
from clamp3d.checks import choice, whole
from clamp3d.core.child import run_child
from clamp3d.core.mesh import Mesh, closed_mesh
from clamp3d.core.pose import Array
from clamp3d.errors import InputError, SolverError

PreprocessMode = Literal["auto", "on", "off"]

_FORMAT = 2  # of the cache files
_COVERED = 1e-6  # mm


@dataclass(frozen=True, slots=True)
class DecompositionParameters:
    """CoACD's own parameters under their own names; see the module for what they do. Raises InputError.

    ``threshold`` in mm with ``real_metric``, else on CoACD's normalised scale (0.01 to 1; its default is 0.05).
    """

    threshold: float = 2.0
    real_metric: bool = True
    preprocess_mode: PreprocessMode = "auto"
    preprocess_resolution: int = 50
    max_convex_hull: int = -1
    resolution: int = 2000
    mcts_nodes: int = 20
    mcts_iterations: int = 150
    mcts_max_depth: int = 3
    pca: bool = False
    merge: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.threshold) and self.threshold > 0.0):
            raise InputError(f"threshold must be > 0, got {self.threshold}")
        if not self.real_metric and self.threshold > 1.0:
            raise InputError(f"threshold must be <= 1 without real_metric, got {self.threshold}")
        choice("preprocess_mode", self.preprocess_mode, get_args(PreprocessMode))
        ranges = {
            "preprocess_resolution": (5, 1000),
            "resolution": (1, 10**6),
            "mcts_nodes": (1, 1000),
            "mcts_iterations": (1, 10**5),
            "mcts_max_depth": (1, 100),
            "seed": (0, 2**32 - 1),
        }
        for name, (low, high) in ranges.items():
            whole(name, getattr(self, name), least=low, most=high)
        if self.max_convex_hull != -1 and self.max_convex_hull < 1:
            raise InputError(f"max_convex_hull must be >= 1, or -1 for no limit, got {self.max_convex_hull}")


@dataclass(frozen=True, slots=True)
class Decomposition:
    """Hulls of a mesh, and everything needed to make them again.

    ``mesh_hash`` is the SHA-256 of the mesh's vertices and faces, ``version`` that of coacd, ``seconds`` the time
    CoACD took when it ran, also where ``cached`` says that this was before. ``coverage`` is the share of the mesh's
    vertices inside the union of the hulls (within 1e-6 mm), ``uncovered`` how far the worst lies outside it, mm: a
    model made of the hulls can miss a hit by that much.
    """

    hulls: tuple[Mesh, ...]
    mesh_hash: str
    parameters: DecompositionParameters
    version: str
    seconds: float
    coverage: float
    uncovered: float
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
    parameters = parameters or DecompositionParameters()
    if not time_limit > 0.0:
        raise InputError(f"time_limit must be > 0 s, got {time_limit}")
    version = metadata.version("coacd")
    mesh_hash = _sha256(solid.vertices.astype("<f8").tobytes(), solid.faces.astype("<i8").tobytes())
    settings = json.dumps({"format": _FORMAT, "coacd": version, **asdict(parameters)}, sort_keys=True)
    key = f"decomposition-{_sha256(mesh_hash.encode(), settings.encode())[:32]}"
    result = _load(key) if cache else None
    cached = result is not None
    if result is None:
        result = _run(solid, parameters, name, time_limit, progress, key if cache else None)
    hulls, seconds = result
    outside = _outside(solid.vertices, hulls)
    return Decomposition(
        hulls=hulls,
        mesh_hash=mesh_hash,
        parameters=parameters,
        version=version,
        seconds=seconds,
        coverage=float((outside <= _COVERED).mean()),
        uncovered=max(0.0, float(outside.max())),
        cached=cached,
    )


def _sha256(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()


def _load(key: str) -> tuple[tuple[Mesh, ...], float] | None:
    arrays = disk.load(key)
    with suppress(KeyError, TypeError, ValueError):
        return None if arrays is None else (_hulls(arrays), float(arrays["seconds"]))
    return None


def _hulls(arrays: Any) -> tuple[Mesh, ...]:
    count = int(arrays["count"])
    if count < 1:
        raise ValueError("no hulls")
    # CoACD 1.0.10 gives the same hulls in another order each time.
    result = sorted(((arrays[f"v{i}"], arrays[f"f{i}"]) for i in range(count)), key=lambda hull: hull[0].tolist())
    return tuple(closed_mesh(vertices, faces, f"hull {i}") for i, (vertices, faces) in enumerate(result))


def _outside(points: Array, hulls: tuple[Mesh, ...]) -> Array:
    """How far each point (n, 3) lies outside the hull that holds it best: greatest plane distance, <= 0 inside."""
    from scipy.spatial import ConvexHull

    best = np.full(len(points), np.inf)
    for hull in hulls:
        planes = ConvexHull(hull.vertices).equations
        best = np.minimum(best, ((points @ planes[:, :3].T) + planes[:, 3]).max(axis=1))
    return best


def _run(
    solid: Mesh,
    parameters: DecompositionParameters,
    name: str,
    time_limit: float,
    progress: bool | None,
    key: str | None,
) -> tuple[tuple[Mesh, ...], float]:
    """Hulls and seconds of a run; its file is kept in the cache under ``key``, if there is one."""
    from rich.console import Console

    console = Console(stderr=True)
    shown = console.is_terminal if progress is None else progress
    with (
        tempfile.TemporaryDirectory(prefix="clamp3d-") as folder,
        console.status(f"CoACD {name}") if shown else nullcontext(),
    ):
        source, target = Path(folder) / "in.npz", Path(folder) / "out.npz"
        arguments = np.array(json.dumps(asdict(parameters)))
        np.savez(source, vertices=solid.vertices, faces=solid.faces, arguments=arguments)
        worker = "clamp3d.baselines.coacd_worker"
        code, said = run_child(worker, str(source), str(target), time_limit=time_limit)
        if code is None:
            raise SolverError(
                f"CoACD did not finish {name} in {time_limit:g} s at threshold {parameters.threshold:g}; "
                "raise time_limit or threshold"
            )
        try:
            with np.load(target, allow_pickle=False) as file:
                result = _hulls(file), float(file["seconds"])
        except (OSError, ValueError, KeyError) as error:
            why = (said or ["nothing"])[-1] if code else str(error)
            raise SolverError(f"CoACD gave no hulls for {name} (exit code {code}): {why}") from None
        if key is not None:
            disk.keep(key, target)
        return result
