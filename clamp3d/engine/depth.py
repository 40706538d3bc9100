"""Penetration depth: the length of the shortest translation that separates two bodies, between bounds.

Of two convex pieces it is exact (`convex_depth`). Of other bodies it is at least as deep as a point of one lies inside
the other, and at most as long as a translation after which the bodies are verified to be apart.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.convex import Convex
from clamp3d.engine.convex_depth import convex_depth
from clamp3d.engine.mesh_distance import FEW_CUTS, are_apart, rounding_of
from clamp3d.engine.model import Model
from clamp3d.engine.overlap import Common, common, deepest, thickness
from clamp3d.engine.refine import SHARES
from clamp3d.engine.surface import Surface
from clamp3d.errors import Clamp3dError
from clamp3d.geometry.pose import Array, to_target

_DIRECTIONS = 4
"""Flat sides of the overlap along which the bodies are moved apart."""
_SHARES = np.array([0.25, 0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0])
"""Lengths of a translation that are tried, in extents of the overlap: the way back into a hole is about one, and of all
lengths only those that take a pin to within its play of the hole's axis are free.
"""
_HALVINGS = 5
"""Halvings of the step to the first length that parts the bodies: then it is known to 1 % of the extent."""
_EXACT = 1e-9
"""Error (mm) of a closed form up to which it counts as exact: rounding of a CAD file's points."""
LONG = 3.0
"""Ratio of a way out to the interference from which on that is bounded by itself: how far a pin is to be moved out of
its hole says nothing of how much it is too thick.
"""
_SHARE = 0.02
"""Chords of the border of a common part, of its thickness, where no distances are asked for: two digits are certain."""
_SHARP = 1.1
"""Ratio of the bound of an interference to the depth of a point at which it is sharpened no further."""
QUICK_CHORD = 0.005
"""Chord error (mm) for depths of solids from CAD where no distances are asked for: half the usual contact threshold."""
_SMALL = 0.02
"""Ratio of a coarse mesh's error to a depth up to which that is not measured on a finer one, but for `fine`."""
_CLOSE = 1.05
"""Ratio of a way out, less what meshes are off by, to the depth of a point at which no shorter one is looked for."""


def _convex_pieces(*models: Model) -> list[Convex] | None:
    """The one exact convex piece that each body is made of; None if one is made of more, has holes, or is not exact."""
    # The facets of a solid from CAD tell that it is not convex, without what a closed form costs.
    if any(m.exact is not None and not (m.chords and m.outer(m.chords[0]).is_convex) for m in models):
        return None
    bodies = [m.bodies[0] for m in models if m.bodies and len(m.bodies) == 1]
    exact = all(not (body.bores or body.surface or len(body.outers) > 1) and body.error <= _EXACT for body in bodies)
    return [body.outers[0] for body in bodies] if exact and len(bodies) == len(models) else None


def depth_of_pieces(a: Model, b: Model, T: Array) -> Distance | None:
    """Signed distance of two convex pieces that may overlap, ``b`` at ``T`` (4, 4) in a's frame; None for others."""
    pieces = _convex_pieces(a, b)
    if pieces is None:
        return None
    distance = convex_depth(pieces[0], np.eye(4), pieces[1], T).widened(2.0 * _EXACT if a.exact or b.exact else 0.0)
    return distance if distance.upper <= 0.0 else None


def penetration(a: Model, b: Model, T: Array, distance: Distance, *, fine: bool = True) -> Distance:
    """The signed distance of two overlapping bodies with bounds of the depth in place of the interference.

    Parameters
    ----------
    a, b : Model
        The bodies, b placed by ``T`` (4, 4) in a's frame.
    distance : Distance
        What `refine` says of them; returned as it is where they are apart.
    fine : bool
        Measure solids from CAD on their finest meshes; else on those of `QUICK_CHORD`.

    Returns
    -------
    Distance
        ``upper`` is minus a depth that a point has, ``lower`` minus the length of a verified translation, minus
        infinity if none was found; ``normal`` is its direction.
    """
    if distance.lower >= 0.0:
        return distance
    if not (a.is_simple and b.is_simple):
        return distance.of_overlap()
    depth, at_most = max(0.0, -distance.upper), max(0.0, -distance.lower)
    exact = depth_of_pieces(a, b, T)
    if exact is not None:
        upper = max(exact.lower, min(exact.upper, distance.upper))
        return replace(exact, upper=upper, interference=(depth, at_most), level=distance.level)
    meshes = _overlapping_meshes(a, b, T, depth, fine)
    if meshes is None:
        return replace(distance, lower=-np.inf, interference=(depth, at_most))
    if not (a.bracketed or b.bracketed):  # meshes around drawn bodies attest no depth
        depth = max(depth, deepest(*meshes)[0])
    length, direction = _way_out(meshes, depth)
    method = distance.method
    if length > LONG * (depth + meshes.hidden):
        own = _interference(a, b, meshes, fine)
        depth, at_most, method = max(depth, -own.upper), min(at_most, -own.lower), own.method or method
    upper = min(distance.upper, -depth) if depth > 0.0 else distance.upper
    return replace(
        distance,
        lower=min(-length, upper),
        upper=upper,
        interference=(depth, max(depth, min(at_most, length))),  # no point is deeper than the bodies
        normal=direction,
        method=f"{method}; separating move by meshes (FCL)",
    )


class _OverlappingMeshes(NamedTuple):
    """Meshes of two bodies, ``b`` placed by ``T`` (4, 4) in a's frame, and their common part."""

    a: Surface
    b: Surface
    T: Array
    shared: Common

    @property
    def hidden(self) -> float:
        """What the meshes' errors may hide of a depth, mm."""
        return self.a.error + self.b.error


def _overlapping_meshes(a: Model, b: Model, T: Array, depth: float, fine: bool) -> _OverlappingMeshes | None:
    """The meshes that an overlap of at least ``depth`` mm is measured on; None if there are none, or they are apart."""
    if not (a.chords and b.chords):
        return None
    outer_a, outer_b = (_depth_mesh(model, depth, fine) for model in (a, b))
    shared = common(outer_a, outer_b, T)
    return None if shared is None else _OverlappingMeshes(outer_a, outer_b, T, shared)


def _interference(a: Model, b: Model, meshes: _OverlappingMeshes, fine: bool) -> Distance:
    """Bounds of minus the interference by itself: by Open CASCADE for solids from CAD, else by the meshes."""
    own = Distance()
    if a.exact is not None and b.exact is not None:
        from clamp3d.engine.exact import exact_overlap

        own = exact_overlap(a, b, meshes.T, SHARES[1] if fine else _SHARE)
    if np.isfinite(own.lower):
        return own
    return replace(own, lower=-meshes.hidden - thickness(*meshes, _is_sharp, FEW_CUTS), method="")


def _is_sharp(bound: float, reached: float) -> bool:
    return bound <= _SHARP * reached


def _depth_mesh(model: Model, depth: float, fine: bool) -> Surface:
    """The mesh that a depth of at least ``depth`` mm is measured on: the coarse one where finer ones take too long."""
    coarse, finest = model.outer(model.chords[0]), model.chords[min(1, len(model.chords) - 1)]
    if model.exact is not None and coarse.error <= (0.0 if fine else _SMALL * depth):
        return coarse
    try:
        return model.outer(finest if fine or model.exact is None else max(finest, QUICK_CHORD))
    except Clamp3dError:
        return coarse


def _way_out(meshes: _OverlappingMeshes, depth: float) -> tuple[float, Array]:
    """Length (mm) and direction (3,) of a translation of ``b`` after which meshes are apart."""
    a, b, T, shared = meshes
    off = a.error + b.error + rounding_of(a, b, T)
    slack = 2.0 * off
    # Where two faces hold a body, as a V does, its way out is between their normals.
    candidates = np.vstack([shared.mean_normal(a), shared.directions(_DIRECTIONS), np.eye(3), T[:3, :3].T])
    directions = np.repeat(candidates, 2, axis=0) * np.tile([[1.0], [-1.0]], (len(candidates), 1))
    # A plane parts them after this length at the latest.
    extents = (a.vertices @ directions.T).max(axis=0) - (to_target(T, b.vertices) @ directions.T).min(axis=0) + off
    best, way = float(extents.min()), directions[extents.argmin()]
    for direction in directions:
        if best <= _CLOSE * depth + slack:
            break
        reach = float(np.ptp(shared.vertices @ direction)) + slack
        lengths = reach * _SHARES
        lengths = np.array([min(depth, reach), *lengths[(lengths > depth) & (lengths < best)]])
        length = _shortest(a, b, T, direction, lengths)
        if length < best:
            best, way = length, direction
    return best, way


def _shortest(a: Surface, b: Surface, T: Array, direction: Array, lengths: Array) -> float:
    """A length (mm) after which ``b`` is apart, after the first of ``lengths`` (k,), or infinite if none of them is."""

    def is_out(length: float) -> bool:
        moved = T.copy()
        moved[:3, 3] += length * direction
        return are_apart(a, b, moved)

    k = next((k for k in range(1, len(lengths)) if is_out(lengths[k])), 0)
    if k == 0:
        return np.inf
    low, high = lengths[k - 1 : k + 1].tolist()
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_out(middle) else (middle, high)
    return float(high)
