"""CoACD runs apart, within a time limit, once per content; what it cannot take never reaches it."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from clamp3d.baselines import cache
from clamp3d.baselines.decomposition import Decomposition, DecompositionParameters, decompose
from clamp3d.bench.compare.scene import block_pair, grooved_block
from clamp3d.core.meshing import mesh
from clamp3d.core.primitives import Cylinder, SweptArc
from clamp3d.errors import InputError, SolverError

GROOVE = SweptArc(12.0, math.radians(70.0), 60.0)
PAIR = block_pair(GROOVE, Cylinder(10.5, 200.0))
COARSE = DecompositionParameters(threshold=0.05, real_metric=False)


def _extruded(chords: int) -> tuple[np.ndarray, np.ndarray]:
    """The block's mesh with ``chords`` equal chords, its ends triangulated without new corners."""
    error = 24.0 * math.sin(math.radians(70.0) / chords / 2) ** 2
    block = mesh(grooved_block(GROOVE, width=137.0, depth=30.0), error * (1.0 + 1e-9))
    assert len(block.vertices) == 2 * (chords + 5)
    return np.asarray(block.vertices), np.asarray(block.faces)


V, F = _extruded(14)
SMALL = _extruded(4)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CLAMP3D_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def workers(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[str]]:
    """Every process started."""
    started: list[subprocess.Popen[str]] = []
    popen = subprocess.Popen

    def record(*args: object, **kwargs: object) -> subprocess.Popen[str]:
        started.append(popen(*args, **kwargs))  # type: ignore[call-overload]
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", record)
    return started


def _same(a: Decomposition, b: Decomposition) -> bool:
    return len(a.hulls) == len(b.hulls) and all(
        np.array_equal(x.vertices, y.vertices) and np.array_equal(x.faces, y.faces)
        for x, y in zip(a.hulls, b.hulls, strict=True)
    )


def test_hulls_are_cached_by_content(workers: list[subprocess.Popen[str]]) -> None:
    first = decompose(*SMALL, COARSE)
    assert not first.cached
    assert first.seconds > 0.0
    assert first.parameters == COARSE
    assert len(first.mesh_hash) == 64
    second = decompose(SMALL[0].copy(), SMALL[1].astype(np.int32), COARSE)
    assert second.cached
    assert _same(first, second)
    assert second.seconds == first.seconds
    assert len(workers) == 1
    # Another vertex, parameter or order is other content.
    moved = decompose(SMALL[0] + [1e-9, 0.0, 0.0], SMALL[1], COARSE)
    other = decompose(*SMALL, DecompositionParameters(threshold=0.05, real_metric=False, seed=1))
    assert not moved.cached
    assert not other.cached
    assert moved.mesh_hash != first.mesh_hash
    again = decompose(*SMALL, COARSE, cache=False)
    assert not again.cached
    assert _same(first, again)  # one seed, one answer


def test_time_limit_leaves_no_process(workers: list[subprocess.Popen[str]]) -> None:
    with pytest.raises(SolverError, match=r"did not finish P1 in 2 s at threshold 0\.05; raise time_limit or thresh"):
        decompose(*_extruded(28), DecompositionParameters(threshold=0.05), name="P1", time_limit=2.0)
    assert [worker.poll() is not None for worker in workers] == [True]
    assert not cache.cache_dir().exists()


@pytest.mark.parametrize(
    ("vertices", "faces", "rule"),
    [
        (np.full_like(V, np.nan), F, "finite"),
        (V[:0], F[:0], "must have shape"),
        (V, F + 1, "is out of range"),
        (V, F[1:], "watertight"),
        (V, F[:, ::-1], "inside out"),
    ],
)
def test_bad_mesh_never_reaches_coacd(
    vertices: np.ndarray, faces: np.ndarray, rule: str, workers: list[subprocess.Popen[str]]
) -> None:
    with pytest.raises(InputError, match=rule):
        decompose(vertices, faces, COARSE)
    assert workers == []


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"threshold": 0.0}, "threshold must be > 0, got 0"),
        ({"threshold": math.nan}, "threshold must be > 0"),
        ({"threshold": 2.0, "real_metric": False}, "threshold must be <= 1 without real_metric"),
        ({"preprocess_mode": "of"}, "preprocess_mode must be one of auto, on, off, got 'of'"),
        ({"mcts_nodes": 0}, "mcts_nodes must be a whole number from 1 to 1000, got 0"),
        ({"seed": -1}, "seed must be a whole number from 0"),
        ({"max_convex_hull": 0}, "max_convex_hull must be >= 1"),
    ],
)
def test_parameters_are_checked(changes: dict[str, object], rule: str) -> None:
    with pytest.raises(InputError, match=rule):
        DecompositionParameters(**changes)  # type: ignore[arg-type]


def test_coverage_is_that_of_the_hulls() -> None:
    found = decompose(V, F, COARSE)
    # Independent: a point is outside a hull if adding it makes the hull's volume grow.
    grows = [
        min(ConvexHull(np.vstack([hull.vertices, v])).volume - ConvexHull(hull.vertices).volume for hull in found.hulls)
        for v in V
    ]
    assert found.coverage == pytest.approx(np.mean(np.array(grows) < 1e-4), abs=2.0 / len(V))
    assert 0.0 <= found.uncovered < 0.01
    volume = sum(ConvexHull(hull.vertices).volume for hull in found.hulls)
    assert volume > 60.0 * (137.0 * 30.0 - 72.0 * (math.radians(140.0) - math.sin(math.radians(140.0))))
