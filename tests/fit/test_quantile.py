"""Quantiles against NumPy's and SciPy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special

from clamp3d.fit.quantile import fisher, quantile, student

FREEDOM = st.one_of(st.integers(1, 60), st.integers(1, 1_000_000))


@given(st.lists(st.floats(-1e6, 1e6) | st.just(np.inf), min_size=1, max_size=30), st.sampled_from([0.1, 0.5, 0.9]))
def test_samples(values, share):
    with np.errstate(invalid="ignore"):  # NumPy's way between two infinities
        expected = np.quantile(values, share)
    assert np.isnan(expected) or quantile(np.array(values), share) == pytest.approx(expected, rel=1e-12, abs=1e-9)


@settings(deadline=None)
@given(k=st.integers(1, 9), n=FREEDOM, tail=st.floats(1e-6, 0.45))
def test_fisher(k, n, tail):
    # SciPy is asked the lower tail of the reciprocal: 1 - tail would lose digits.
    assert fisher(k, n, tail) == pytest.approx(1.0 / special.fdtri(n, k, tail), rel=1e-8)


@settings(deadline=None)
@given(n=FREEDOM, tail=st.floats(1e-6, 0.45))
def test_student(n, tail):
    assert student(n, tail) == pytest.approx(-special.stdtrit(n, tail), rel=1e-8)
