"""The kernel's answers against the oracle, which knows groove and cylinder by their definition alone."""

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from clamp3d.engine.answer import Distance
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc
from clamp3d.kernel.distance import signed_distance
from clamp3d.testing import assert_distance, common
from tests.kinds import poses

SLOW = settings(
    deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate], suppress_health_check=[HealthCheck.too_slow]
)
GROOVES = st.builds(SweptArc, st.floats(3.0, 15.0), st.floats(0.1, 3.0), st.floats(1.0, 60.0))
SIZES = st.tuples(st.floats(0.5, 14.0), st.floats(0.2, 90.0))


@settings(SLOW, max_examples=40)
@given(GROOVES, SIZES, st.sampled_from([Cylinder, Capsule]), poses(25.0))
def test_apart_it_is_the_distance_and_negative_exactly_in_an_overlap(groove, sizes, kind, T):
    wire = kind(*sizes)
    a = signed_distance(groove, wire, T)
    if a.distance > 0.0:
        d, e = a.distance, a.error_bound
        found = Distance(d - e, d + e, a.point_on_groove, a.point_on_cylinder, a.normal)
        assert_distance(found, groove, wire, T, tolerance=1e-7)
    elif a.distance < -1e-6:
        assert common(groove, wire, T, accuracy=1e-3).lower <= 0.0


@settings(SLOW, max_examples=40)
@given(GROOVES, SIZES, poses(12.0))
def test_a_cylinder_that_shrinks_by_the_inset_comes_free(groove, sizes, T):
    """Radius and both ends shrink alike: by less than the inset it still overlaps, by more it does not."""
    radius, length = sizes
    d = signed_distance(groove, Cylinder(radius, length), T).distance
    left = min(radius, 0.5 * length)
    if not -0.95 * left < d < -1e-3:
        return
    free = Cylinder(radius + d - 1e-6, length + 2.0 * d - 2e-6)
    assert common(groove, free, T).upper >= -1e-9
    caught = Cylinder(radius + 0.98 * d, length + 1.96 * d)
    assert common(groove, caught, T, accuracy=1e-4).lower <= 0.0


@settings(SLOW, max_examples=100)
@given(GROOVES, SIZES, poses(25.0))
def test_error_bounds_are_no_larger_than_the_rounding_they_stand_for(groove, sizes, T):
    """A bound ten times too large would let a wrong formula pass for rounding."""
    unit, lengths = 2.0**-53, np.abs(T[:3, 3]).sum() + sizes[1] + groove.length + groove.radius + sizes[0]
    assert 0.0 < signed_distance(groove, Capsule(*sizes), T).error_bound <= 13.0 * unit * lengths
    assert 0.0 < signed_distance(groove, Cylinder(*sizes), T).error_bound <= 30.0 * unit * lengths
