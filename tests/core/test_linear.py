"""Linear algebra in one order: against NumPy's own, and the same bytes under every kernel of OpenBLAS."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from clamp3d.core.linear import dot, eigh, lstsq, norm, svd, to_source, to_target
from clamp3d.core.pose import rotation, translation
from clamp3d.errors import SolverError

ENTRIES = st.floats(-1e3, 1e3).map(lambda x: round(x, 6))
SHAPES = st.tuples(st.integers(1, 8), st.integers(1, 8))
MATRICES = SHAPES.flatmap(lambda shape: arrays(np.float64, shape, elements=ENTRIES))


@given(MATRICES)
@settings(max_examples=200, deadline=None)
def test_singular_values_are_numpys_and_make_the_matrix(A):
    left, sizes, right = svd(A)
    scale = 1e-13 * (1.0 + np.abs(A).max())
    theirs = np.linalg.svd(A, compute_uv=False)
    assert np.abs(sizes[: len(theirs)] - theirs).max() <= scale
    assert (sizes[len(theirs) :] <= scale).all()
    assert (np.diff(sizes) <= 0.0).all()
    assert np.abs((left.T * sizes) @ right - A).max() <= scale
    assert np.abs(right @ right.T - np.eye(len(right))).max() <= 1e-13


@given(MATRICES)
@settings(max_examples=100, deadline=None)
def test_eigenvectors_of_a_symmetric_matrix(A):
    A = A @ A.T - 0.5 * np.diag(np.abs(A).sum(axis=1))
    A = A + A.T
    values, vectors = eigh(A)
    scale = 1e-13 * (1.0 + np.linalg.norm(A))
    assert np.abs(values - np.linalg.eigvalsh(A)).max() <= scale
    assert np.abs(A @ vectors - vectors * values).max() <= scale
    assert np.abs(vectors.T @ vectors - np.eye(len(A))).max() <= 1e-13


@pytest.mark.parametrize(
    ("rows", "columns", "rank"), [(9, 6, 6), (6, 6, 4), (4, 7, 4), (8, 3, 1), (300, 6, 6), (300, 6, 5)]
)
def test_least_squares_are_numpys(rows, columns, rank):
    rng = np.random.default_rng(rows + rank)
    A = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))
    b = rng.normal(size=rows)
    found, counted = lstsq(A, b, 1e-12)
    assert counted == rank
    assert np.allclose(found, np.linalg.lstsq(A, b, rcond=1e-12)[0], rtol=0, atol=1e-11)


def test_columns_that_are_nearly_one_end_the_rotations():
    x = np.linspace(-1.0, 1.0, 81)
    for tilt in (0.0, 1e-16, 1e-12, 1e-8):
        A = np.column_stack([x**0, x, x * (1.0 + tilt * x), x * x, x * x + tilt * x**3])
        left, sizes, right = svd(A)
        assert np.abs((left.T * sizes) @ right - A).max() <= 1e-13
        assert np.abs(sizes - np.linalg.svd(A, compute_uv=False)).max() <= 1e-13


def test_a_singular_value_below_the_least_counts_as_none():
    A, b = np.diag([1.0, 1e-3]), np.array([1.0, 1.0])
    assert lstsq(A, b, 1e-4)[1] == 2
    found, rank = lstsq(A, b, 1e-2)
    assert rank == 1
    assert found.tolist() == [1.0, 0.0]


def test_what_is_not_finite_has_no_singular_values():
    with pytest.raises(SolverError, match="not finite"):
        svd([[1.0, np.nan]])


@pytest.mark.parametrize("rows", [1, 7, 500])
@pytest.mark.parametrize("columns", [1, 3, 40])
def test_products_are_numpys(rows, columns):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(rows, 3)), rng.normal(size=(columns, 3)).T  # one in C order, one not
    assert np.allclose(dot(a, b), a @ b, rtol=0, atol=1e-14)
    assert np.allclose(dot(a, b[:, 0]), a @ b[:, 0], rtol=0, atol=1e-14)
    assert np.allclose(dot(a[0], b), a[0] @ b, rtol=0, atol=1e-14)
    assert np.allclose(dot(a[:, 0], a[:, 1]), a[:, 0] @ a[:, 1], rtol=0, atol=1e-12)
    many = rng.normal(size=(5, 4, 4))
    for other in (many, many[0], many[:, :, 0].T):
        assert np.allclose(dot(many, other), many @ other, rtol=0, atol=1e-13)
    assert np.allclose(dot(many, many[0, 0]), many @ many[0, 0], rtol=0, atol=1e-13)
    assert np.allclose(dot(many[0], many), many[0] @ many, rtol=0, atol=1e-13)
    assert np.isclose(norm(a), np.linalg.norm(a), rtol=1e-15)


def test_points_go_to_the_target_and_back():
    T = translation(1.0, 2.0, 3.0) @ rotation((1.0, 2.0, 3.0), 0.7)
    points = np.random.default_rng(1).normal(size=(200, 3))
    seen = to_target(T, points)
    assert np.allclose(seen, [(T @ [*p, 1.0])[:3] for p in points], rtol=0, atol=1e-14)
    assert np.allclose(to_source(T, seen), points, rtol=0, atol=1e-14)
    assert np.allclose(to_target(T, points[0]), seen[0], rtol=0, atol=1e-15)
