"""STEP assemblies written by Open CASCADE itself: the truth that the reader is held to."""

import numpy as np

from tests.cad import Tree, block, cut, random_pose, rod


def plate():
    return cut(block((-20, -10, 0), (20, 10, 5)), rod(3.0, -1, 6, 10, 0))


def pin():
    return rod(2.5, 0, 10)


def nested(rng):
    """A tree of three levels with a pin that is there three times; and name, volume and pose of each solid."""
    tree = Tree()
    root, sub = tree.product("machine"), tree.product("sub, assembly")
    plates, pins = tree.product("plate", plate()), tree.product("pin: 5 x 10", pin())
    a, b, c, d, e = (random_pose(rng) for _ in range(5))
    for parent, child, T in ((root, sub, a), (sub, plates, b), (sub, pins, c), (root, sub, d), (root, pins, e)):
        tree.put(parent, child, T)
    hole, full = 40 * 20 * 5 - np.pi * 9 * 5, np.pi * 2.5**2 * 10
    names = "plate_1", "pin-5-x-10_1", "plate_2", "pin-5-x-10_2", "pin-5-x-10_3"
    return tree, [*zip(names, (hole, full, hole, full, full), (a @ b, a @ c, d @ b, d @ c, e), strict=True)]
