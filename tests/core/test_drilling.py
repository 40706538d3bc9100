"""Whether holes leave something of a box, against areas by shapely and points."""

import numpy as np

from clamp3d.core.drilling import leaves_something


def test_nothing_is_refused_of_which_a_point_is_left():
    rng = np.random.default_rng(6)
    gone = 0
    for _ in range(150):
        half = np.array([5.0, *rng.uniform(1.0, 4.0, 2)])
        holes = {a: [(rng.uniform(2.0, 6.0), *rng.uniform(-5.0, 5.0, 2)) for _ in range(3)] for a in "yz"}
        P = rng.uniform(-half, half, (2000, 3))
        into = np.zeros(len(P), dtype=bool)
        for axis, across in (("z", 1), ("y", 2)):
            for r, x, v in holes[axis]:
                into |= (P[:, 0] - x) ** 2 + (P[:, across] - v) ** 2 < r * r
        found = leaves_something(half, holes)
        assert found or into.all()
        gone += not found
    assert gone > 10
