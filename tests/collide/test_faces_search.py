"""A search that is taken up again, and a depth found past the deepest of a few points."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from assemblies import ball, box, ring, rod, solid_of

from clamp3d.brep.solid import BrepSolid
from clamp3d.collide.answer import Distance
from clamp3d.collide.faces import FaceModel, faces_distance
from clamp3d.collide.faces_depth import faces_depth
from clamp3d.collide.faces_search import FEW, Search
from clamp3d.core.pose import translation


def model(shape):
    return FaceModel(BrepSolid.of(solid_of(shape), "solid"))


@pytest.mark.parametrize("steps", [(1, 3, 20, 2000), (FEW, 2000), (2000,)])
def test_a_search_in_steps_never_loses_what_it_knows(steps):
    a, b, T = model(ring(5, 1)), model(ball(2)), translation(0.3, -0.2, 0.4)
    search = Search(a, b, T, 0.01, 0.0, 1e-3, 2000)
    found = [search.more(step) for step in steps]
    lower, upper = [x.lower for x in found], [x.upper for x in found]
    assert lower == sorted(lower)
    assert upper == sorted(upper, reverse=True)
    assert search.done
    assert upper[-1] - lower[-1] <= 1e-3
    exact = np.hypot(5 - np.hypot(0.3, 0.2), 0.4) - 3
    assert lower[-1] - 1e-9 <= exact <= upper[-1] + 1e-9
    whole = Search(a, b, T, 0.01, 0.0, 1e-3, 2000).more(2000)
    assert max(lower[-1], whole.lower) <= min(upper[-1], whole.upper)
    assert found[-1].point_a is not None


def test_what_the_other_way_found_takes_no_points_from_the_answer():
    a, b = model(ring(5, 1)), model(ball(2))
    search = Search(a, b, np.eye(4), 0.01, 0.0, 1e-3, 2000)
    first = search.more(FEW)
    again = search.more(2000, upper=first.upper)
    assert again.point_a is not None
    assert search.more(2000, upper=again.upper - 1.0).point_a is None


def test_no_point_is_deeper_than_the_way_that_parts_them_is_long():
    a, b = model(box((0, 0, 0), (10, 10, 10))), model(rod(2, 9.9, 15))
    T = translation(5, 5, 0)
    known = faces_distance(a, b, T, contact=0.01)
    assert isinstance(known, Distance)
    assert known.upper < -0.01
    found = faces_depth(a, b, T, known)
    low, high = found.interference
    assert found.lower <= -0.1 <= found.upper
    assert found.upper - found.lower <= 1.1e-3
    assert low <= 0.1 <= high <= -found.lower + 1e-12
