"""All orders of the six parts, by brute force: on a lattice of offsets, facets' volumes say where two parts overlap.

A way out is straight, or has one bend at a point of the lattice, and ends where the part's box has left all others'. It
is free if no point of the lattice on it overlaps anything. Every way of the lattice is tried, for every part against
every set of others: 6 x 32 questions. Nothing of the search for ways, and nothing of the pair engine, is used.
"""

import itertools
from functools import cache

import manifold3d
import numpy as np

from clamp3d import assemble, load_clamp
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.parts import parts, wire_solid
from clamp3d.shapes import mesh

LATTICE = 5.0
"""Mm between points of the lattice: every part is thicker."""
TOUCHING = 5.0
"""Mm3 that the facets of parts in contact overlap by."""
FAR = 400.0
"""Mm: a way that is longer leads over a wire's end, and wires have none."""
MOVING = ("P1", "P2", "P3", "P4", "P5", "P7")
WAYS = [np.array(v) for v in itertools.product((-1, 0, 1), repeat=3) if sum(map(abs, v)) == 1]


def manifold(solid, T, mesh_error=0.01):
    """A solid's facets at a pose (4, 4) of the world."""
    facets = mesh(solid, mesh_error)
    data = manifold3d.Mesh64(np.array(facets.vertices), np.array(facets.faces, dtype=np.uint64))
    return manifold3d.Manifold(data).transform(T[:3])


@cache
def open_bodies():
    """Parts of the open clamp on the line as manifolds in the world, wires ten times as long as drawn."""
    clamp = load_clamp()
    run = assemble(clamp)
    solids = dict(parts(clamp))
    for name, wire in (("P6", clamp.line), ("P7", clamp.jumper)):
        solids[name] = wire_solid(name, wire.radius, 10.0 * clamp.wire_length)
    return {name: manifold(solids[name], run.path[4].T_world(name)) for name in PARTS}


@cache
def box(name):
    low_high = open_bodies()[name].bounding_box()
    return np.array(low_high[:3]), np.array(low_high[3:])


@cache
def overlap(a, b, offset):
    """Whether part ``a``, moved by so many steps of the lattice, overlaps part ``b``."""
    by = LATTICE * np.array(offset)
    (low, high), (other_low, other_high) = box(a), box(b)
    if ((low + by >= other_high) | (high + by <= other_low)).any():
        return False
    if {a, b} == {"P4", "P5"} and offset[:2] == (0, 0):
        return False  # along its thread
    return (open_bodies()[a].translate(by) ^ open_bodies()[b]).volume() > TOUCHING


def steps_out(part, others, start, way):
    """Steps of the lattice from ``start`` on until the part's box has left all others'; None if that is too far."""
    k = int(np.abs(way).argmax())
    low, high = (end + LATTICE * start for end in box(part))
    across, length = [i for i in range(3) if i != k], 0.0
    for other in others:
        other_low, other_high = box(other)
        if all(low[i] < other_high[i] and high[i] > other_low[i] for i in across):
            length = max(length, float(other_high[k] - low[k] if way[k] > 0 else high[k] - other_low[k]))
    return None if length > FAR else int(np.ceil(length / LATTICE))


def is_free(part, others, start, way, count):
    points = (tuple((start + i * way).tolist()) for i in range(1, count + 1))
    return not any(overlap(part, other, point) for point in points for other in others)


def has_way(part, others):
    """Whether any straight way, or one with one bend, leads a part out from among others."""
    origin = np.zeros(3, dtype=int)
    for first in WAYS:
        count = steps_out(part, others, origin, first)
        if count is not None and is_free(part, others, origin, first, count):
            return True
    for first in WAYS:
        corner = origin
        for _ in range(int(FAR / LATTICE)):
            corner = corner + first
            if any(overlap(part, other, tuple(corner.tolist())) for other in others):
                break
            for then in WAYS:
                if not first @ then:
                    count = steps_out(part, others, corner, then)
                    if count is not None and is_free(part, others, corner, then, count):
                        return True
    return False


def questions():
    """Each part with each set of the others that may be there before it; the power line always is."""
    for part in MOVING:
        rest = [other for other in MOVING if other != part]
        for k in range(len(rest) + 1):
            for others in itertools.combinations(rest, k):
                yield part, ("P6", *others)
