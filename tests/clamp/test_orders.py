"""Ways of the six parts among each other: the search's answers against brute force on a lattice."""

import os

import numpy as np

from clamp3d import load_clamp
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.ways import DIRECTIONS, Insertion, out
from clamp3d.engine.model import ModelCache
from tests.clamp.orders import LATTICE, has_way, open_bodies, questions, steps_out

FIRST = (13, 64, 84, 104, 166)
"""Numbers of quick questions: two have no answer, two a straight way, the last one with a bend."""
COUNT = int(os.environ.get("CLAMP3D_ORDERS", len(FIRST)))
"""How many of the 192 questions are put to the search: most others take some seconds."""


def test_the_search_finds_a_way_where_there_is_one(run):
    asked = list(questions())
    place = {name: run.path[4].T_world(name) for name in PARTS}
    clamp, cache, counts = load_clamp(), ModelCache(), []
    for k in [*FIRST, *np.setdiff1d(np.arange(len(asked)), FIRST)][:COUNT]:
        part, others = asked[k]
        legs = Insertion(clamp, [(part, other) for other in others], place, cache).way_out()
        counts.append(len(legs))
        assert bool(legs) == has_way(part, others), (part, others, legs)
        if len(legs) == 1:  # until the boxes are apart, and 20 mm more
            ((origin, length),) = legs
            far = LATTICE * steps_out(part, others, np.zeros(3), out(origin))
            assert -0.1 < far + 20.0 - length < LATTICE + 0.1
    assert counts[: len(FIRST)] == [0, 1, 0, 1, 2][:COUNT]
    open_bodies.cache_clear()  # before Python ends, or the library reports what is left


def test_parts_come_along_the_axes_of_the_world():
    sides = {"from above": (2, 1), "from below": (2, -1), "from the right": (0, 1), "from the left": (0, -1)}
    sides |= {"from behind": (1, 1), "from the front": (1, -1)}
    assert {name: out(name).tolist() for name in DIRECTIONS} == {
        name: (sign * np.eye(3)[axis]).tolist() for name, (axis, sign) in sides.items()
    }
