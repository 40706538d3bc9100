"""Small linear algebra against LAPACK, SciPy and trimesh; roots against brentq."""

import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from trimesh.triangles import closest_point

from clamp3d.core import small
from clamp3d.core.roots import root
from clamp3d.core.triangles import closest_points

numbers = st.floats(-10.0, 10.0).map(lambda x: round(x, 3))


def matrices():
    return st.tuples(st.integers(1, 9), st.integers(1, 9)).flatmap(
        lambda shape: hnp.arrays(float, shape, elements=numbers)
    )


def vector(n):
    return hnp.arrays(float, n, elements=numbers)


@given(st.data())
@settings(deadline=None)
def test_products(data):
    i, j, k, n = (data.draw(st.integers(1, 6)) for _ in range(4))
    A = data.draw(hnp.arrays(float, data.draw(st.sampled_from([(i, j), (n, i, j), (1, i, j)])), elements=numbers))
    B = data.draw(hnp.arrays(float, data.draw(st.sampled_from([(j, k), (n, j, k)])), elements=numbers))
    np.testing.assert_allclose(small.product(A, B), A @ B, atol=1e-12)


def test_products_that_do_not_fit():
    with pytest.raises(ValueError, match="cannot multiply"):
        small.product(np.eye(3), np.eye(4))


@given(matrices())
@settings(deadline=None)
def test_singular_values(A):
    U, sizes, rows = small.svd(A)
    np.testing.assert_allclose(U @ rows, A, atol=1e-11)
    np.testing.assert_allclose(rows @ rows.T, np.eye(A.shape[1]), atol=1e-12)
    wanted = np.zeros(A.shape[1])
    wanted[: min(A.shape)] = np.linalg.svd(A, compute_uv=False)
    np.testing.assert_allclose(sizes, wanted, atol=1e-12 * (1.0 + wanted[0]))


@given(st.data())
@settings(deadline=None)
def test_least_squares(data):
    A = data.draw(matrices())
    b = data.draw(vector(len(A)))
    np.testing.assert_allclose(small.lstsq(A, b, 1e-9), np.linalg.lstsq(A, b, rcond=1e-9)[0], atol=1e-5, rtol=1e-6)


@given(st.data())
@settings(deadline=None, max_examples=400)
def test_non_negative_least_squares(data):
    """By its conditions: x >= 0, no way down along a coordinate, and none at all along those that are not 0."""
    A = data.draw(matrices())
    b = data.draw(vector(len(A)))
    x = small.nnls(A, b)
    slope = A.T @ (b - A @ x)
    allowed = 1e-9 * (1.0 + np.abs(A).sum() * (1.0 + np.abs(b).sum()))
    assert (x >= 0.0).all()
    assert (slope <= allowed).all()
    assert (np.abs(slope[x > 0.0]) <= allowed).all()
    assert np.linalg.norm(A @ x - b) == pytest.approx(scipy.optimize.nnls(A, b)[1], abs=1e-8)


@given(st.integers(1, 9).flatmap(lambda n: hnp.arrays(float, (n, n), elements=numbers)))
@settings(deadline=None)
def test_eigenvalues(A):
    S = A + A.T
    values, axes = small.eigh(S)
    np.testing.assert_allclose(np.sort(values), np.linalg.eigvalsh(S), atol=1e-11)
    np.testing.assert_allclose(axes * values @ axes.T, S, atol=1e-11)
    np.testing.assert_allclose(axes.T @ axes, np.eye(len(S)), atol=1e-12)


@given(hnp.arrays(float, (5, 3, 3), elements=numbers), hnp.arrays(float, (5, 3), elements=numbers))
@settings(deadline=None, max_examples=300)
def test_nearest_points_of_triangles(triangles, points):
    """No further away than trimesh's, and points of the triangles (of no area too)."""
    found = closest_points(triangles, points)
    away = np.linalg.norm(found - points, axis=1)
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


def test_the_same_bits_on_any_blas():
    code = (
        "import numpy as np; from clamp3d.core import small; r = np.random.default_rng(3); h = ''\n"
        "for _ in range(50):\n"
        "    A = r.normal(size=(8, 8)); b = r.normal(size=8)\n"
        "    for x in (small.nnls(A, b), small.lstsq(A, b), small.product(A, A), small.eigh(A + A.T)[1]):\n"
        "        h += x.tobytes().hex()\n"
        "print(h)"
    )
    answers = set()
    for env in ({}, {"OPENBLAS_NUM_THREADS": "1"}, {"OPENBLAS_CORETYPE": "Prescott"}):
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **env}
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
        answers.add(done.stdout)
    assert len(answers) == 1
