"""Penetration depth: the length of the shortest translation that separates two bodies, between bounds.

Of two convex pieces it is exact (`convex_depth`). Of other bodies it is at least as deep as a point of one lies inside
the other, and at most as long as a translation after which the bodies are verified to be apart.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.convex import Convex
from clamp3d.engine.convex_depth import convex_depth
from clamp3d.engine.mesh_distance import are_apart, rounding_of
from clamp3d.engine.model import Model
from clamp3d.engine.overlap import Common, common, deepest
from clamp3d.engine.surface import Surface
from clamp3d.geometry.pose import Array

_DIRECTIONS = 4
"""Flat sides of the overlap along which the bodies are moved apart."""
_SHARES = np.array([0.25, 0.5, 0.75, 1.0, 2.0, 4.0])
"""Lengths of a translation that are tried, in extents of the overlap: the way back into a hole is longer than one."""
_HALVINGS = 5
"""Halvings of the step to the first length that parts the bodies: then it is known to 1 % of the extent."""
_EXACT = 1e-9
"""Error (mm) of a closed form up to which it counts as exact: rounding of a CAD file's points."""
_CLOSE = 1.05
"""Ratio of a way out, less what meshes are off by, to the depth of a point at which no shorter one is looked for."""


def convex_piece(model: Model) -> Convex | None:
    """The one convex piece that a body is made of; None if it is made of more, has holes, or is not exact."""
    if model.exact is not None and not (model.chords and model.outer(model.chords[0]).is_convex):
        return None  # its facets tell that without what a closed form costs
    if not model.bodies or len(model.bodies) != 1:
        return None
    (body,) = model.bodies
    one = len(body.outers) == 1 and not body.bores and body.surface is None and body.error <= _EXACT
    return body.outers[0] if one else None


def depth_of_pieces(a: Model, b: Model, T: Array) -> Distance | None:
    """Signed distance of two convex pieces that may overlap, ``b`` at ``T`` (4, 4) in a's frame; None for others."""
    x, y = convex_piece(a), convex_piece(b)
    if x is None or y is None:
        return None
    distance = convex_depth(x, np.eye(4), y, T).widened(2.0 * _EXACT if a.exact or b.exact else 0.0)
    return distance if distance.upper <= 0.0 else None


def penetration(a: Model, b: Model, T: Array, distance: Distance) -> Distance:
    """The signed distance of two overlapping bodies with bounds of the depth in place of the interference.

    Parameters
    ----------
    a, b : Model
        The bodies, b placed by ``T`` (4, 4) in a's frame.
    distance : Distance
        What `refine` says of them; returned as it is where they are apart.

    Returns
    -------
    Distance
        ``upper`` is minus a depth that a point has, ``lower`` minus the length of a verified translation, minus
        infinity if none was found; ``normal`` is its direction.
    """
    if distance.lower >= 0.0 or not (a.closed and b.closed):
        return distance if distance.lower >= 0.0 else distance.of_overlap()
    interference = (max(0.0, -distance.upper), max(0.0, -distance.lower))
    exact = depth_of_pieces(a, b, T)
    if exact is not None:
        return replace(exact, upper=max(exact.lower, min(exact.upper, distance.upper)), interference=interference)
    if not (a.chords and b.chords):
        return replace(distance, lower=-np.inf, interference=interference)
    outer_a, outer_b = _outer(a), _outer(b)
    shared = common(outer_a, outer_b, T)
    if shared is None:
        return replace(distance, lower=-np.inf, interference=interference)
    # Meshes around drawn bodies attest no depth.
    attested = 0.0 if a.bracketed or b.bracketed else deepest(outer_a, outer_b, T, shared)[0]
    deep = max(interference[0], attested)
    upper = min(distance.upper, -deep) if deep > 0.0 else distance.upper
    length, direction = _way_out(outer_a, outer_b, T, shared, deep)
    interference = deep, max(deep, min(interference[1], length))  # no point is deeper than the bodies
    lower = min(-length, upper)
    return replace(distance, lower=lower, upper=upper, normal=direction, level="depth", interference=interference)


def _way_out(a: Surface, b: Surface, T: Array, shared: Common, deep: float) -> tuple[float, Array | None]:
    """Length (mm), infinite if unknown, and direction (3,) of a translation of ``b`` after which meshes are apart."""
    best, way = np.inf, None
    slack = 2.0 * (a.error + b.error + rounding_of(a, b, T))
    # Where two faces hold a body, as a V does, its way out is between their normals.
    candidates = np.vstack([shared.mean_normal(a), shared.directions(_DIRECTIONS), np.eye(3), T[:3, :3].T])
    for direction in candidates:
        reach = float(np.ptp(shared.vertices @ direction)) + slack
        low = min(deep, reach)
        for sign in (1.0, -1.0):
            if best <= _CLOSE * deep + slack:
                return best, way
            lengths = low + _SHARES * (reach - low)
            length = _shortest(a, b, T, sign * direction, low, lengths[lengths < best])
            if length < best:
                best, way = length, sign * direction
    return best, way


def _outer(model: Model) -> Surface:
    """The mesh that stands for a body: its second level, which is fine enough for a depth and cheap enough to try."""
    return model.outer(model.chords[min(1, len(model.chords) - 1)])


def _shortest(a: Surface, b: Surface, T: Array, direction: Array, low: float, lengths: Array) -> float:
    """A length (mm) after which ``b`` is apart, at most the first of ``lengths`` (k,) that does, or infinite."""
    high = next((length for length in lengths.tolist() if are_apart(a, b, _moved(T, length * direction))), np.inf)
    if high == np.inf:
        return high
    low = max([low, *lengths[lengths < high].tolist()])
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if are_apart(a, b, _moved(T, middle * direction)):
            high = middle
        else:
            low = middle
    return high


def _moved(T: Array, by: Array) -> Array:
    moved = T.copy()
    moved[:3, 3] += by
    return moved
