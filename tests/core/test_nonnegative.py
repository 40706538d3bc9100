"""Non-negative least squares by its conditions and against SciPy."""

import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from clamp3d.core.nonnegative import nnls

numbers = st.floats(-10.0, 10.0).map(lambda x: round(x, 3))


@given(st.data())
@settings(deadline=None, max_examples=300)
def test_its_conditions(data):
    """x >= 0, no way down along a coordinate, and none at all along those that are not 0."""
    shape = data.draw(st.tuples(st.integers(1, 9), st.integers(1, 9)))
    A = data.draw(hnp.arrays(float, shape, elements=numbers))
    b = data.draw(hnp.arrays(float, len(A), elements=numbers))
    x = nnls(A, b)
    slope = A.T @ (b - A @ x)
    allowed = 1e-9 * (1.0 + np.abs(A).sum() * (1.0 + np.abs(b).sum()))
    assert (x >= 0.0).all()
    assert (slope <= allowed).all()
    assert (np.abs(slope[x > 0.0]) <= allowed).all()
    assert np.linalg.norm(A @ x - b) == pytest.approx(scipy.optimize.nnls(A, b)[1], abs=1e-8)


def test_the_same_bits_on_any_blas():
    code = (
        "import numpy as np; from clamp3d.core.nonnegative import nnls; r = np.random.default_rng(3)\n"
        "print(''.join(nnls(r.normal(size=(8, 8)), r.normal(size=8)).tobytes().hex() for _ in range(50)))"
    )
    answers = set()
    for env in ({}, {"OPENBLAS_CORETYPE": "Prescott"}):
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **env}
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
        answers.add(done.stdout)
    assert len(answers) == 1
