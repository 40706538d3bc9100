"""Penetration depth: the length of the shortest translation that separates two bodies, between bounds.

Of two convex pieces it is exact (`convex_depth`). Of other bodies it is at least as deep as a point of one lies inside
the other, and at most as long as a translation after which the bodies are verified to be apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.coaxial import coaxial_distance
from clamp3d.engine.convex import Convex
from clamp3d.engine.convex_depth import convex_depth
from clamp3d.engine.exact import SHARES, attested_overlap, depths_in, exact_distance, exact_overlap, exact_probe
from clamp3d.engine.mesh_distance import FEW_CUTS, are_apart, greatest_overlap
from clamp3d.engine.model import QUICK_TRIANGLES, CadModel, Model
from clamp3d.engine.overlap import Common, common, deepest
from clamp3d.engine.refine import from_boxes, refine
from clamp3d.engine.surface import Surface, rounding_of
from clamp3d.errors import Clamp3dError
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.geometry.pose import Array, to_target

_DIRECTIONS = 4
"""Flat sides of the overlap along which the bodies are moved apart."""
_PARALLEL = 1.0 - 1e-6
"""Cosine of the angle of two directions from which on one of them is tried."""
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
_SHARP, _SHARPER = 1.05, 1.005
"""Ratio of the bound of an interference to the closest that it can be at which it is sharpened no further."""
_STEADY = 10.0
"""Ratio of a way out to what meshes hide from which on finer ones shorten it by no more than a fifth."""
_TIGHT = 1.01
"""Ratio of a way out to the depth of a point at which finer meshes are not tried."""
_ADVANCES = 6
"""How often a way out is shortened by the gap that it leaves: at 45 degrees to the faces each time by two thirds."""
_EXACT_ADVANCES = 1
"""The same of solids from CAD, for each of their meshes: Open CASCADE takes a tenth of a second and more for a gap."""
_EDGE_PAIRS = 5000
"""Pairs of edges near each other beyond which Open CASCADE is not asked for a gap: it takes seconds then."""
_SHORTER = 0.01
"""Share by which a way out must have got shorter to be shortened once more."""
_SHORTENED = 1e-3
"""Ratio of the width of a gap's bounds to a way out at which the gap that it leaves is measured no further."""
_CLOSE = 1.05
"""Ratio of a way out, less what meshes are off by, to the depth of a point at which no shorter one is looked for."""


def _convex_pieces(*models: Model) -> list[Convex] | None:
    """The one exact convex piece that each body is made of; None if one is made of more, has holes, or is not exact."""
    # The facets of a solid from CAD tell that it is not convex, without what a closed form costs.
    if any(isinstance(m, CadModel) and not (m.chords and m.outer(m.chords[0]).is_convex) for m in models):
        return None
    bodies = [m.bodies[0] for m in models if m.bodies and len(m.bodies) == 1]
    exact = all(not (body.bores or body.surface or len(body.outers) > 1) and body.error <= _EXACT for body in bodies)
    return [body.outers[0] for body in bodies] if exact and len(bodies) == len(models) else None


def depth_of_pieces(a: Model, b: Model, T: Array) -> Distance | None:
    """Signed distance of two convex pieces that may overlap, ``b`` at ``T`` (4, 4) in a's frame; None for others."""
    pieces = _convex_pieces(a, b)
    if pieces is None:
        return None
    distance = convex_depth(pieces[0], np.eye(4), pieces[1], T).widened(
        2.0 * _EXACT if isinstance(a, CadModel) or isinstance(b, CadModel) else 0.0
    )
    return replace(distance, level="features") if distance.upper <= 0.0 else None


def penetration(a: Model, b: Model, T: Array, distance: Distance, *, thorough: bool = False) -> Distance:
    """The signed distance of two overlapping bodies with bounds of the depth in place of the interference.

    Parameters
    ----------
    a, b : Model
        The bodies, b placed by ``T`` (4, 4) in a's frame.
    distance : Distance
        What `refine` says of them; returned as it is where they are apart.
    thorough : bool
        Spend more work on solids from CAD: the finest meshes, and as many exact gaps as for other bodies.

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
    way = None
    for meshes in _overlapping_meshes(a, b, T, thorough):
        new = _way_out(a, b, meshes, depth, thorough)
        way = new if way is None or new.lower > way.lower else way
        depth, is_long = -new.upper, _is_long(way, meshes)
        if -way.lower <= _TIGHT * depth or (not thorough and -way.lower >= _STEADY * meshes.hidden):
            break
    if way is None:
        return replace(distance, lower=-np.inf, interference=(depth, at_most))
    method = distance.method
    if is_long:
        own = _interference(a, b, meshes, depth, thorough)
        depth, at_most, method = max(depth, -own.upper), min(at_most, -own.lower), own.method or method
    upper = min(distance.upper, -depth) if depth > 0.0 else distance.upper
    return replace(
        distance,
        lower=min(way.lower, upper),
        upper=upper,
        interference=(depth, max(depth, min(at_most, -way.lower))),  # no point is deeper than the bodies
        normal=way.normal,
        method=method if method == way.method else f"{method}; separating move by {way.method}",
    )


class _OverlappingMeshes(NamedTuple):
    """Meshes of two bodies, ``b`` placed by ``T`` (4, 4) in a's frame, and their common part.

    ``hidden`` (mm): how much less than theirs the depth of the bodies may be.
    """

    a: Surface
    b: Surface
    T: Array
    shared: Common
    hidden: float


def _overlapping_meshes(a: Model, b: Model, T: Array, thorough: bool) -> Iterator[_OverlappingMeshes]:
    """Meshes of two bodies that overlap, coarse ones of solids from CAD first; none where they are apart."""
    if not (a.chords and b.chords):
        return
    for chord_a, chord_b in _chords(a, b, thorough):
        try:
            outer_a, outer_b = a.outer(chord_a), b.outer(chord_b)
        except Clamp3dError:  # the finest ones may take too long to make
            return
        shared = common(outer_a, outer_b, T)
        hidden = outer_a.error + outer_b.error + chord_a * a.bracketed + chord_b * b.bracketed
        if shared is not None:
            yield _OverlappingMeshes(outer_a, outer_b, T, shared, hidden)
        if hidden <= _EXACT:  # finer ones are the same
            return


def _chords(a: Model, b: Model, thorough: bool) -> Iterator[tuple[float, float]]:
    """Chord errors (mm) of the meshes of two bodies, from coarse to fine."""
    both_exact = isinstance(a, CadModel) and isinstance(b, CadModel)
    if both_exact:
        yield a.chords[0], b.chords[0]
    yield a.fine_chord, b.fine_chord
    if both_exact and thorough:
        yield a.chords[-1], b.chords[-1]


def _way_out(a: Model, b: Model, meshes: _OverlappingMeshes, depth: float, thorough: bool) -> Distance:
    """Minus the length of a translation along ``normal`` that parts two bodies, and minus a depth that a point has."""
    depth = max(depth, _reached(a, b, meshes))
    length, direction = _way_by_meshes(meshes, depth)
    way = Distance(-length, -depth, normal=direction, method="meshes (FCL)")
    is_costly = isinstance(a, CadModel) and isinstance(b, CadModel) and not thorough
    for _ in range(_EXACT_ADVANCES if is_costly else _ADVANCES):
        if _is_long(way, meshes) or -way.lower <= _TIGHT * -way.upper:
            break
        shorter = _shortened(a, b, meshes.T, -way.lower * direction, _EDGE_PAIRS if is_costly else np.inf)
        upper = min(shorter.upper, way.upper)
        # If it is shorter than a point is deep, some of the gap was overlooked.
        if shorter.lower <= way.lower or upper < shorter.lower - 2.0 * TOLERANCE:
            break
        gains_little = shorter.lower - way.lower <= _SHORTER * -way.lower
        way = replace(shorter, upper=max(upper, shorter.lower))
        if gains_little:
            break
    return way


def _reached(a: Model, b: Model, meshes: _OverlappingMeshes) -> float:
    """A depth (mm) that some point has: meshes around drawn bodies attest none, those inside them do."""
    if not (a.bracketed or b.bracketed):
        return deepest(meshes.a, meshes.b, meshes.T, meshes.shared)[0]
    inner_a, inner_b = a.inner(a.chords[-1]), b.inner(b.chords[-1])
    if inner_a is None or inner_b is None:
        return 0.0
    shared = common(inner_a, inner_b, meshes.T)
    return 0.0 if shared is None else deepest(inner_a, inner_b, meshes.T, shared)[0]


def _shortened(a: Model, b: Model, T: Array, way: Array, most: float) -> Distance:
    """Bounds of minus the depth: ``lower`` by a translation that parts the bodies, along ``normal``.

    ``way`` (3,) parts them too. ``most``: pairs of edges that Open CASCADE may look at.
    Lemma: bodies that keep a gap after a translation are also apart after one that is shorter by as much, since no
    point moves by more. The points that are nearest after it are about as deep before.
    """
    moved = T.copy()
    moved[:3, 3] += way
    length = float(np.linalg.norm(way))
    if isinstance(a, CadModel) and isinstance(b, CadModel):
        if a.is_free_form or b.is_free_form:  # of which Open CASCADE may say too large a gap
            return Distance()
        try:
            gap = exact_distance(a, b, moved, most)
        except Clamp3dError:
            return Distance()
    else:
        gap = refine(a, b, moved, from_boxes(a, b, moved), lambda d: d.upper - d.lower <= _SHORTENED * length)
    if not gap.lower > 0.0:  # they touch, or no gap is certain
        return Distance()
    attested = 0.0
    if gap.point_a is not None and gap.point_b is not None:
        points = np.stack([gap.point_a, gap.point_b - way])
        attested = min(0.0, attested_overlap(points, depths_in(a, b, T, points)).upper)
    return Distance(gap.lower - length, attested, normal=way / length, method=gap.method)


def _is_long(way: Distance, meshes: _OverlappingMeshes) -> bool:
    return -way.lower > LONG * (meshes.hidden - way.upper)


def _interference(a: Model, b: Model, meshes: _OverlappingMeshes, depth: float, thorough: bool) -> Distance:
    """Bounds of minus the interference by itself: by Open CASCADE for solids from CAD, else by meshes.

    ``depth`` (mm): that of a point.
    """
    own = Distance()
    if isinstance(a, CadModel) and isinstance(b, CadModel):

        def end(bounds: Distance, closest: Distance) -> bool:
            return bounds.lower >= (_SHARPER if thorough else _SHARP) * closest.lower

        sections = coaxial_distance(a, b, meshes.T, lambda distance: end(distance, Distance(distance.upper)))
        if sections is not None and np.isfinite(sections.lower):
            return sections
        own = exact_overlap(a, b, meshes.T, SHARES[1], end=end, attested=depth)
        if np.isfinite(own.lower):
            return own
        own = exact_probe(a, b, meshes.T)
        if thorough or a.fine_triangles + b.fine_triangles <= QUICK_TRIANGLES:
            *_, meshes = _overlapping_meshes(a, b, meshes.T, thorough)
    most = greatest_overlap(meshes.a, meshes.b, meshes.T, meshes.shared, _is_sharp, FEW_CUTS)
    return replace(own, lower=-most - rounding_of(meshes.a, meshes.b, meshes.T), method="")


def _is_sharp(bound: float, reached: float) -> bool:
    return bound <= _SHARP * reached


def _way_by_meshes(meshes: _OverlappingMeshes, depth: float) -> tuple[float, Array]:
    """Length (mm) and direction (3,) of a translation of ``b`` after which meshes are apart."""
    a, b, T, shared = meshes.a, meshes.b, meshes.T, meshes.shared
    off = a.error + b.error + rounding_of(a, b, T)
    slack = 2.0 * off
    # Where two faces hold a body, as a V does, its way out is between their normals.
    axes = np.vstack([shared.mean_normal(a), shared.directions(_DIRECTIONS), np.eye(3), T[:3, :3].T])
    is_repeated = np.tril(np.abs(axes @ axes.T) > _PARALLEL, -1).any(axis=1)
    directions = np.vstack([(axis, -axis) for axis in axes[~is_repeated]])
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
