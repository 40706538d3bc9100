"""Quantiles against SciPy's."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special

from clamp3d.fit.quantile import fisher, student

FREEDOM = st.one_of(st.integers(1, 60), st.integers(1, 1_000_000))


@settings(deadline=None)
@given(k=st.integers(1, 9), n=FREEDOM, tail=st.floats(1e-6, 0.45))
def test_fisher(k, n, tail):
    # SciPy is asked the lower tail of the reciprocal: 1 - tail would lose digits.
    assert fisher(k, n, tail) == pytest.approx(1.0 / special.fdtri(n, k, tail), rel=1e-8)


@settings(deadline=None)
@given(n=FREEDOM, tail=st.floats(1e-6, 0.45))
def test_student(n, tail):
    assert student(n, tail) == pytest.approx(-special.stdtrit(n, tail), rel=1e-8)
