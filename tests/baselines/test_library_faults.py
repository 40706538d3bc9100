"""Meshes that end a library under this project, or that it answers without a word, are refused before."""

from __future__ import annotations

import numpy as np
import pytest

from clamp3d.baselines.decomposition import decompose
from clamp3d.baselines.fcl_shapes import bvh, convex
from clamp3d.baselines.wedges import prism
from clamp3d.core.pose import Array
from clamp3d.errors import InputError

BOX = prism(np.array([[-20.0, -10.0], [20.0, -10.0], [20.0, 10.0], [-20.0, 10.0]]), -25.0, 25.0)


def _bad_meshes() -> dict[str, tuple[Array, Array, str]]:
    V, F = BOX
    nan, index = V.copy(), F.copy()
    nan[3, 1], index[5, 2] = np.nan, 2**31 - 1
    return {
        "empty": (V[:0], F[:0], "must not be empty"),
        "nan": (nan, F, r"vertices must be finite, got nan at \[3, 1\]"),
        "index": (V, index, "face index 2147483647 is out of range"),
        "inverted": (V, F[:, ::-1], "may be inside out"),
    }


@pytest.mark.parametrize("name", _bad_meshes())
@pytest.mark.parametrize("read", [bvh, convex, decompose])
def test_meshes_that_end_a_library_are_refused_before(name: str, read: object) -> None:
    V, F, rule = _bad_meshes()[name]
    with pytest.raises(InputError, match=rule):
        read(V, F)  # type: ignore[operator]
