"""Ways of the six parts among each other: the search's answers against brute force on a lattice."""

import os

import numpy as np
import pytest
from orders import MOVING, has_way, open_bodies, possible, questions

from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.ways import DIRECTIONS, Insertion, out
from clamp3d.engine.model import ModelCache
from clamp3d.errors import SequenceError

COUNT = int(os.environ.get("CLAMP3D_ORDERS", "4"))
"""How many of the 192 questions are put to the search: each takes some seconds."""


@pytest.fixture(scope="module")
def truth():
    yield {question: has_way(*question) for question in questions()}
    open_bodies.cache_clear()  # before Python ends, or the library reports what is left


def test_the_search_finds_a_way_where_there_is_one(truth):
    rng = np.random.default_rng(3)
    chosen = [list(truth)[k] for k in rng.permutation(len(truth))[:COUNT]]
    place = {name: assemble().path[4].T_world(name) for name in PARTS}
    clamp, cache = load_clamp(), ModelCache()
    for part, others in chosen:
        legs = Insertion(clamp, [(part, other) for other in others], place, cache).way_out()
        assert bool(legs) == truth[part, others], (part, others, legs)


def test_orders_that_brute_force_allows(truth):
    """Of 720 orders of the parts one by one those are possible in which every part still has a way."""
    allowed = possible(truth)
    assert len(allowed) == 192
    order = allowed[7]
    assert assemble(sequence=" -> ".join(order)).status == "clamped"
    blocked = ("P4", "P1", "P3", "P7", "P2", "P5")
    assert set(blocked) == set(MOVING)
    assert blocked not in allowed
    with pytest.raises(SequenceError):
        assemble(sequence=" -> ".join(blocked))


def test_parts_come_along_the_axes_of_the_world():
    sides = {"from above": (2, 1), "from below": (2, -1), "from the right": (0, 1), "from the left": (0, -1)}
    sides |= {"from behind": (1, 1), "from the front": (1, -1)}
    assert {name: out(name).tolist() for name in DIRECTIONS} == {
        name: (sign * np.eye(3)[axis]).tolist() for name, (axis, sign) in sides.items()
    }
