"""Whether holes leave something of a box, against areas by shapely and points."""

import numpy as np
import shapely

from clamp3d.core.drilling import leaves_something


def test_holes_along_one_axis_leave_what_shapely_finds():
    rng = np.random.default_rng(5)
    gone = 0
    for _ in range(150):
        half = np.array([5.0, *rng.uniform(1.0, 6.0, 2)])
        circles = [(rng.uniform(2.0, 7.0), *rng.uniform(-5.0, 5.0, 2)) for _ in range(rng.integers(1, 9))]
        discs = shapely.union_all([shapely.Point(x, v).buffer(r, quad_segs=64) for r, x, v in circles])
        left = shapely.box(-5.0, -half[1], 5.0, half[1]).difference(discs).area
        found = leaves_something(half, {"z": circles})
        assert found if left > 0.2 else not found or left > 0.0  # polygons in the circles leave a little more
        gone += not found
    assert 20 < gone < 100


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
