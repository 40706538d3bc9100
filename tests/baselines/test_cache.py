"""The cache of decompositions: what is damaged is never an answer and never an error."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from clamp3d.baselines import cache

ARRAYS = {"v0": np.arange(300.0).reshape(100, 3), "seconds": np.array(1.5)}


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.setenv("CLAMP3D_CACHE", str(tmp_path / "cache"))
    np.savez(tmp_path / "made.npz", **ARRAYS)
    cache.keep("key", tmp_path / "made.npz")
    return tmp_path / "cache" / "key.npz"


def same(found):
    return found.keys() == ARRAYS.keys() and all(np.array_equal(found[key], ARRAYS[key]) for key in ARRAYS)


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_damaged_entry_is_none_or_whole(path, data):
    content = bytearray((path.parent.parent / "made.npz").read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
    found = cache.load("key")
    assert found is None or same(found)


def test_an_entry_is_found_again(path):
    assert same(cache.load("key"))
    assert [file.name for file in path.parent.iterdir()] == ["key.npz"]
