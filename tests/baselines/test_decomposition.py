"""CoACD runs apart, within a time limit, once per content; what it cannot take never reaches it."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from clamp3d.baselines import Hulls
from clamp3d.baselines.decomposition import cache_dir, decompose
from clamp3d.bench.compare.scene import grooved_block
from clamp3d.errors import SolverError
from clamp3d.shapes import SweptArc, mesh
from tests.refusals import refusals

BLOCK = grooved_block(SweptArc(12.0, math.radians(70.0), 60.0), width=137.0, depth=30.0)
COARSE = 0.05 * 137.0 / 1.6


def _meshed(chords):
    """The block's mesh with ``chords`` equal chords."""
    found = mesh(BLOCK, 24.0 * math.sin(math.radians(70.0) / chords / 2) ** 2 * (1.0 + 1e-9))
    return np.asarray(found.vertices), np.asarray(found.faces)


V, F = _meshed(4)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("CLAMP3D_CACHE", str(tmp_path / "cache"))


def _same(a, b):
    return len(a.hulls) == len(b.hulls) and all(map(np.array_equal, a.hulls, b.hulls))


def test_hulls_are_cached_by_content():
    first = decompose(V, F, COARSE)
    assert not first.cached
    assert first.seconds > 0.0
    second = decompose(V.copy(), F.astype(np.int32), COARSE)
    assert (second.cached, second.seconds) == (True, first.seconds)
    assert _same(first, second)
    # Another vertex or parameter is other content.
    assert not decompose(V + np.array([1e-9, 0.0, 0.0]), F, COARSE).cached
    assert not decompose(V, F, COARSE + 0.01).cached
    for kept in cache_dir().iterdir():  # a damaged file is no answer
        kept.write_bytes(kept.read_bytes()[:-200])
    again = decompose(V, F, COARSE)
    assert not again.cached
    assert _same(first, again)  # one seed, one answer
    # The hulls hold the whole block, but for what CoACD rounds off its corners, and fill more than it.
    planes = [ConvexHull(hull).equations for hull in first.hulls]
    outside = np.min([(V @ p[:, :3].T + p[:, 3]).max(axis=1) for p in planes], axis=0)
    assert outside.max() < 0.01
    assert sum(ConvexHull(hull).volume for hull in first.hulls) > 60.0 * (
        137.0 * 30.0 - 72.0 * (math.radians(140.0) - math.sin(math.radians(140.0)))
    )


def test_a_time_limit_ends_the_process():
    with pytest.raises(SolverError, match=r"did not finish P1 in 0.5 s at threshold 0\.05; raise time_limit or thresh"):
        decompose(*_meshed(28), 0.05, name="P1", time_limit=0.5)
    assert not cache_dir().exists()


def test_a_process_that_fails_is_said(monkeypatch):
    monkeypatch.setattr("clamp3d.baselines.decomposition._RUN", "os:abort")  # which takes no arguments
    with pytest.raises(SolverError, match="CoACD gave no hulls for P1: TypeError"):
        decompose(V, F, COARSE, name="P1")
    assert not cache_dir().exists()


test_bad_meshes_and_parameters_are_refused = refusals(
    (lambda: decompose(np.full_like(V, np.nan), F, COARSE), "finite"),
    (lambda: decompose(V, F[1:], COARSE), "watertight"),
    (lambda: decompose(V, F, 0.0), "threshold must be > 0, got 0"),
    (lambda: decompose(V, F, math.nan), "threshold must be > 0"),
    (lambda: Hulls({}, 0.0), "threshold must be > 0, got 0"),
)
