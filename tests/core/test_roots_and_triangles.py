"""Roots and nearest points of triangles against SciPy and trimesh."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from trimesh.triangles import closest_point

from clamp3d.core.roots import root
from clamp3d.core.triangles import closest_points

numbers = st.floats(-10.0, 10.0).map(lambda x: round(x, 3))


@given(hnp.arrays(float, (5, 3, 3), elements=numbers), hnp.arrays(float, (5, 3), elements=numbers))
@settings(deadline=None, max_examples=300)
def test_nearest_points_of_triangles(triangles, points):
    """No further away than trimesh's, and points of the triangles (of no area too)."""
    found = closest_points(triangles, points)
    away = np.linalg.norm(found - points, axis=1)
    with np.errstate(invalid="ignore"):  # trimesh 5.0 divides by areas that are zero
        theirs = np.linalg.norm(closest_point(triangles, points) - points, axis=1)
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    assert (away <= theirs + 1e-9).all()
    assert np.abs(away - theirs)[area > 1e-2].max(initial=0.0) < 1e-9
    for triangle, point in zip(triangles, found, strict=True):
        shares = scipy.optimize.nnls(np.vstack([triangle.T, np.full(3, 1e3)]), np.append(point, 1e3))
        assert shares[1] < 1e-6


@given(st.floats(-3.0, 3.0), st.floats(0.1, 5.0), st.floats(0.1, 5.0), st.sampled_from([1, 3, 5]))
def test_roots(at, below, above, power):
    def function(x):
        return (x - at) ** power + 0.3 * (x - at)

    assert root(function, at - below, at + above) == pytest.approx(at, abs=1e-14)
    assert root(function, at + above, at - below) == pytest.approx(at, abs=1e-14)


def test_a_step_is_bracketed():
    assert root(lambda x: -1.0 if x < 0.3 else 1.0, -0.5, 0.9) == pytest.approx(0.3, abs=1e-15)
    with pytest.raises(ValueError, match="different signs"):
        root(lambda x: 1.0, 0.0, 1.0)
