"""What can be wrong with a mesh, one function per family: each draws one of the ways in which it happens."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import NDArray

from clamp3d.bench.stress.family import Makers
from clamp3d.bench.stress.meshes.cases import Faulty
from clamp3d.core.pose import Array, rotation, translation

Faces = NDArray[np.int64]
_HERE = np.eye(4)
MAKERS = Makers("mesh: ")


def _broken(vertices: NDArray[np.float64], faces: NDArray[np.generic], what: str) -> Faulty:
    return Faulty(vertices, faces, _HERE, what, broken=True)


def _good(vertices: NDArray[np.floating], faces: Faces, what: str, T: Array = _HERE) -> Faulty:
    return Faulty(vertices, faces, T, what, broken=False)


def _some(rng: np.random.Generator, n: int, most: int) -> NDArray[np.intp]:
    """1 to ``most`` of n rows."""
    return rng.choice(n, int(rng.integers(1, max(2, min(most, n) + 1))), replace=False)


def _facet(rng: np.random.Generator, V: Array, F: Faces) -> NDArray[np.bool_]:
    """All faces in the plane of a random one."""
    p, q, r = np.moveaxis(V[F], 1, 0)
    normal = np.cross(q - p, r - p)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    k = int(rng.integers(len(F)))
    size = float(np.ptp(V, axis=0).max())
    return np.asarray((normal @ normal[k] > 1.0 - 1e-9) & (np.abs((p - p[k]) @ normal[k]) < 1e-9 * size))


def _far_box(V: Array) -> tuple[Array, Faces]:
    """A second body, below the first and far from any wire."""
    size = float(np.ptp(V, axis=0).max())
    low = np.array([0.0, V[:, 1].min() - 8.0 * size, 0.0])
    box = trimesh.creation.box(bounds=[low, low + size])
    return np.asarray(box.vertices), np.asarray(box.faces, dtype=np.int64)


@MAKERS.family("open")
def opened(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """Faces removed from a block with a groove, or a corner torn off."""
    way = rng.integers(5)
    if way == 0:
        return _broken(V, np.delete(F, _some(rng, len(F), 3), axis=0), "1 to 3 faces removed")
    if way == 1:
        return _broken(V, F[~_facet(rng, V, F)], "a flat side removed")
    if way == 2:
        on_arc = (np.abs(np.hypot(V[:, 0], V[:, 1]) - R) < 1e-6 * R)[F].all(axis=1)
        return _broken(V, F[~on_arc], "the groove's own faces removed")
    if way == 3:
        return _broken(V, F[rng.random(len(F)) < 0.5], "half of the faces removed")
    F = F.copy()
    k = int(rng.integers(len(F)))
    V = np.vstack([V, V[F[k, 0]] + 0.05 * R * rng.normal(size=3)])
    F[k, 0] = len(V) - 1
    return _broken(V, F, "a corner torn off by 5 % of the radius")


@MAKERS.family("inside out")
def inside_out(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """Windings turned: of all faces, of some, of one body of two."""
    way = rng.integers(4)
    if way == 0:
        return _broken(V, F[:, ::-1].copy(), "all faces turned")
    F = F.copy()
    if way == 1:
        rows = _some(rng, len(F), len(F) // 2)
        F[rows] = F[rows][:, ::-1]
        return _broken(V, F, "some faces turned")
    box, faces = _far_box(V)
    first, second = (F[:, ::-1], faces) if way == 2 else (F, faces[:, ::-1])
    what = "two bodies, the " + ("one at the wire" if way == 2 else "other one") + " inside out"
    return _broken(np.vstack([V, box]), np.vstack([first, second + len(V)]), what)


@MAKERS.family("doubled")
def doubled(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """Faces, vertices or the whole body twice."""
    way = rng.integers(6)
    if way == 0:
        return _broken(V, np.vstack([F, F[_some(rng, len(F), len(F))]]), "faces twice")
    if way == 1:
        return _broken(V, np.vstack([F, F[_some(rng, len(F), len(F))][:, ::-1]]), "faces twice, turned")
    if way == 2:
        again = F + len(V) * rng.integers(2, size=F.shape)
        return _good(np.vstack([V, V]), again, "vertices twice")
    if way == 3:
        return _broken(np.vstack([V, V]), np.vstack([F, F + len(V)]), "the body twice")
    if way == 4:
        return _broken(np.vstack([V, V]), np.vstack([F, F[:, ::-1] + len(V)]), "the body twice, once inside out")
    shift = 1e-6 * R * rng.normal(size=3)
    return _broken(np.vstack([V, V + shift]), np.vstack([F, F + len(V)]), "the body twice, 1e-6 of the radius apart")


@MAKERS.family("empty")
def empty(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """No faces, no vertices, or none with an area or a volume."""
    ways: tuple[Callable[[], tuple[Array, Faces, str]], ...] = (
        lambda: (V, F[:0], "no faces"),
        lambda: (V[:0], F, "no vertices"),
        lambda: (V[:0], F[:0], "nothing at all"),
        lambda: (V, np.repeat(F[:, :1], 3, axis=1), "every face a point"),
        lambda: (V, F[:, [0, 1, 1]], "every face an edge"),
        lambda: (V[:1].repeat(len(V), axis=0), F, "all vertices in one place"),
        lambda: (V * [1.0, 0.0, 0.0], F, "all vertices in a line"),
        lambda: (V * [1.0, 0.0, 1.0], F, "all vertices in a plane"),
        lambda: (V, F[:1], "one face"),
    )
    return _broken(*ways[int(rng.integers(len(ways)))]())


@MAKERS.family("bad numbers")
def bad_numbers(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """Coordinates nan or infinite, face indices negative or out of range."""
    V, F = V.copy(), F.copy()
    i, j = int(rng.integers(len(V))), int(rng.integers(3))
    k = int(rng.integers(len(F)))
    way = rng.integers(10)
    if way < 4:
        value = (np.nan, np.inf, -np.inf, 1e300)[way]
        V[i, j] = value
        return _broken(V, F, f"a coordinate {value:g}")
    if way == 4:
        return _broken(np.full_like(V, np.nan), F, "all coordinates nan")
    if way == 5:
        return _broken(np.vstack([V, np.full((1, 3), np.nan)]), F, "a vertex nan that no face uses")
    if way == 6:
        return _broken(V, F + 1, "faces counted from 1")
    bad = (len(V), 2**31 - 1, -1)[way - 7]
    F[k, j] = bad
    return _broken(V, F, f"a corner {'negative' if bad < 0 else 'beyond the vertices' if way == 7 else 'far beyond'}")


@MAKERS.family("soup")
def soup(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """Vertices not merged, as in an STL: a good mesh that must be answered."""
    if rng.random() < 0.5:
        V = V.astype(np.float32)
        what = "every face its own corners, single precision"
    else:
        what = "every face its own corners"
    F = rng.permutation(F)
    return _good(V[F].reshape(-1, 3), np.arange(3 * len(F), dtype=np.int64).reshape(-1, 3), what)


@MAKERS.family("turned")
def turned(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """Random order of vertices and faces, random rotation: must be answered."""
    order = rng.permutation(len(V))
    place = np.argsort(order)
    faces = rng.permutation(place[F])
    roll = (np.arange(3)[None] + rng.integers(3, size=len(F))[:, None]) % 3
    T = translation(*(10.0 * R * rng.normal(size=3))) @ rotation(rng.normal(size=3), rng.uniform(-3.0, 3.0))
    moved = V[order] @ T[:3, :3].T + T[:3, 3]
    return _good(moved, np.take_along_axis(faces, roll, axis=1), "another order, turned", T)


@MAKERS.family("scaled")
def far(rng: np.random.Generator, V: Array, F: Faces, R: float) -> Faulty:
    """Metres, inches, microns, up to 1e6 sizes from the origin: good meshes."""
    away = rng.normal(size=3)
    T = translation(*(R * rng.choice([0.0, 10.0 ** rng.uniform(2.0, 6.0)]) * away / np.linalg.norm(away)))
    return _good(V + T[:3, 3], F, f"at {np.linalg.norm(T[:3, 3]):.1g} mm from the origin", T)
