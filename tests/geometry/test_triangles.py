"""Nearest points of triangles against trimesh."""

import numpy as np
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from trimesh.triangles import closest_point

from clamp3d.geometry.triangles import closest_points

numbers = st.floats(-10.0, 10.0).map(lambda x: round(x, 3))


@given(hnp.arrays(float, (5, 3, 3), elements=numbers), hnp.arrays(float, (5, 3), elements=numbers))
@settings(deadline=None, max_examples=150)
def test_nearest_points_of_triangles(triangles, points):
    """No further away than trimesh's, and points of the triangles (of no area too)."""
    found = closest_points(triangles, points)
    away = np.linalg.norm(found - points, axis=1)
    with np.errstate(invalid="ignore"):  # trimesh 5.0 divides by areas that are zero
        theirs = np.linalg.norm(closest_point(triangles, points) - points, axis=1)
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    assert (away <= theirs + 1e-9).all()
    small = np.linalg.norm(closest_points(1e-3 * triangles, 1e-3 * points) - 1e-3 * points, axis=1)
    assert np.abs(1e3 * small - away).max() < 1e-9  # sides may be far shorter than a millimetre
    assert np.abs(away - theirs)[area > 1e-2].max(initial=0.0) < 1e-9
    for triangle, point in zip(triangles, found, strict=True):
        shares = scipy.optimize.nnls(np.vstack([triangle.T, np.full(3, 1e3)]), np.append(point, 1e3))
        assert shares[1] < 1e-6
