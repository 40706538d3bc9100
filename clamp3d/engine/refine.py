"""Refine a pair until it is known well enough: boxes, closed forms, meshes, Open CASCADE, each only if needed.

Here pairs of shapes are handed to the methods that measure gaps and interference; depths are in `depth.py`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.broad import Boxes, box_gaps
from clamp3d.engine.closed_form import bodies_distance
from clamp3d.engine.facets import rod_of, rods_distance
from clamp3d.engine.mesh_distance import CUTS, FEW_CUTS, meshes_distance
from clamp3d.engine.model import CAD_CHORDS, QUICK_TRIANGLES, Forms, Model
from clamp3d.engine.open_mesh import open_distance
from clamp3d.errors import Clamp3dError, SolverError
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.geometry.pose import Array, inverse

ACCURACY = 1e-7
"""Width (mm) of the interval at which a distance counts as known; relative to the size where that is more."""

_COINCIDENT = 1e-4
"""Overlap (mm) beyond which there is a common part to ask for; up to it faces coincide, which meshes prove."""

_OPEN = 1.02
"""Ratio of a bound that decides nothing to the closest that it can be at which it is sharpened no further."""


def from_boxes(a: Model, b: Model, T: Array) -> Distance:
    """What the boxes of two shapes say, ``b`` at ``T`` (4, 4) in a's frame."""
    a.counters.queries["boxes"] += 1
    pair = Boxes.of(np.array([a.bounds, b.bounds]), np.array([np.eye(4), T]))
    return boxes_distance(float(box_gaps(pair, np.array([[0, 1]]))[0]))


def boxes_distance(gap: float) -> Distance:
    """The distance of two shapes whose boxes keep ``gap`` mm."""
    return Distance(gap, level="boxes", method="bounding boxes")


def refine(a: Model, b: Model, T: Array, start: Distance, enough: Enough, *, cad_forms: bool = False) -> Distance:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame, from ``start`` (what the boxes said), until ``enough``.

    With ``cad_forms`` the cylinders and holes of two solids from CAD are measured in closed form first, which pays
    where a pair is asked about often.
    """
    distance = start
    if enough(distance):
        return distance

    def is_enough(answer: Distance) -> bool:
        return enough(distance.meet(answer))

    for level, answer in _levels(a, b, T, is_enough, cad_forms):
        a.counters.queries[level] += 1
        distance = _agreed(distance, replace(answer, level=level))
        if enough(distance):
            break
    return distance


def _levels(a: Model, b: Model, T: Array, enough: Enough, cad_forms: bool) -> Iterator[tuple[str, Distance]]:
    """What the levels that apply to a pair say, from cheap to expensive; each is measured when it is asked for."""
    if not (a.is_simple and b.is_simple):
        yield "meshes", open_distance(a, b, T)
        return
    if cad_forms or a.exact is None or b.exact is None:
        yield from _by_closed_forms(a.quick_bodies, b.quick_bodies, T, enough)
        if _is_round(b) and not a.bracketed and a.chords:
            yield "facets", rods_distance(a.outer(a.chords[-1]), b.bodies or (), T)
        if _is_round(a) and not b.bracketed and b.chords:
            yield "facets", rods_distance(b.outer(b.chords[-1]), a.bodies or (), inverse(T)).moved(T).swapped()
    if a.exact is not None and b.exact is not None:
        yield from _levels_of_cad(a, b, T, enough, cad_forms)
        return
    for chord in _chords(a, b):
        yield "meshes", meshes_distance(a, b, T, chord, enough)


def _levels_of_cad(a: Model, b: Model, T: Array, enough: Enough, cad_forms: bool) -> Iterator[tuple[str, Distance]]:
    """What meshes and Open CASCADE say of two solids from CAD: coarse meshes, points, and then what takes longer."""
    from clamp3d.engine.exact import exact_distance, exact_probe

    chords = [chord for chord in a.chords if chord in b.chords]
    for chord in chords[:1]:
        yield "meshes", _by_meshes(a, b, T, chord, enough)
    probe = exact_probe(a, b, T)
    yield "exact", probe
    attested, finer = -probe.upper, chords[1:]
    is_small = bool(finer) and a.fine_triangles + b.fine_triangles <= QUICK_TRIANGLES
    distance = exact_distance(a, b, T)
    unproven = replace(distance, lower=-np.inf)
    # A point that lies in both solids contradicts what Open CASCADE says of them now and then.
    distance = unproven if distance.lower > probe.upper else distance
    # Of free-form faces it may take a gap for the least of several: meshes must not contradict that.
    is_doubtful = bool(chords) and np.isfinite(distance.lower) and (a.is_free_form or b.is_free_form)
    yield "exact", unproven if is_doubtful else distance
    if is_doubtful or (attested <= _COINCIDENT and is_small):
        meshes = _by_meshes(a, b, T, finer.pop() if is_small else max(a.fine_chord, b.fine_chord), enough)
        yield "meshes", meshes
        if is_doubtful and distance.lower <= meshes.upper:
            yield "exact", distance
    is_found = False
    for overlap in _common_parts(a, b, T, enough, attested, quick=True):
        yield "exact", overlap
        is_found = is_found or bool(np.isfinite(overlap.lower))
    if not cad_forms:
        yield from _by_closed_forms(a.quick_bodies, b.quick_bodies, T, enough)
    if finer and is_small:
        yield "meshes", _by_meshes(a, b, T, finer.pop(), enough)
    if not is_found:
        for overlap in _common_parts(a, b, T, enough, attested, quick=False):
            yield "exact", overlap
    if finer:
        yield "meshes", _by_meshes(a, b, T, finer.pop(), enough)
    if CAD_CHORDS[-1] not in chords:  # Open CASCADE did not find the common part
        yield "meshes", _by_meshes(a, b, T, CAD_CHORDS[-1], enough, thorough=True)


def _common_parts(a: Model, b: Model, T: Array, enough: Enough, attested: float, *, quick: bool) -> Iterator[Distance]:
    """What the common part says, from coarse samples to fine ones, which take longer: none after one that fails.

    ``quick``: the first, which makes it, within a second, not in five. ``attested``: how deep (mm) a point lies.
    """
    from clamp3d.engine.exact import SHARES, exact_overlap

    def end(bounds: Distance, closest: Distance) -> bool:
        if enough(closest):
            return enough(bounds)
        return share != SHARES[-1] or bounds.lower >= _OPEN * closest.lower  # finer samples may decide it

    for share in SHARES:
        overlap = exact_overlap(a, b, T, share, end=end, quick=quick and share == SHARES[0], attested=attested)
        yield overlap
        if np.isinf(overlap.lower):
            break


def _by_meshes(a: Model, b: Model, T: Array, chord: float, enough: Enough, *, thorough: bool = False) -> Distance:
    """What meshes say of two solids from CAD; nothing where they take too long to make."""
    try:
        return meshes_distance(a, b, T, chord, enough, thorough=thorough, cuts=CUTS if thorough else FEW_CUTS)
    except Clamp3dError:
        return Distance(method="without fine meshes")


def _is_round(model: Model) -> bool:
    """Whether a cylinder holds each piece of a body."""
    return bool(model.bodies) and all(rod_of(body) is not None for body in model.bodies or ())


def _chords(a: Model, b: Model) -> list[float]:
    """Chord errors of the meshes that two shapes are measured with, from coarse to fine."""
    if not (a.chords and b.chords):
        return []
    every = sorted({*a.chords, *b.chords}, reverse=True)
    if not (a.refines or b.refines):
        return every[:1]
    coarsest, finest = min(a.chords[0], b.chords[0]), min(a.chords[-1], b.chords[-1])
    fixed = max((model.outer(coarsest).error for model in (a, b) if not model.refines), default=0.0)
    chords = [chord for chord in every if finest <= chord <= coarsest]
    # Where the triangles of one are given, meshes of the other that are much finer than their error say no more.
    return chords[: 1 + next((k for k, chord in enumerate(chords) if chord <= fixed), len(chords))]


def _agreed(old: Distance, new: Distance) -> Distance:
    """Both answers at once. Raises SolverError if they contradict each other."""
    met = old.meet(new)
    if met.lower > met.upper + 1e-6 + 1e-9 * abs(met.upper):
        raise SolverError(
            f"{new.level} ({new.method}) and {old.level} ({old.method}) disagree: "
            f"[{new.lower:.9g}, {new.upper:.9g}] and [{old.lower:.9g}, {old.upper:.9g}] mm"
        )
    return replace(met, lower=min(met.lower, met.upper), upper=max(met.lower, met.upper))


def _by_closed_forms(a: Forms | None, b: Forms | None, T: Array, enough: Enough) -> Iterator[tuple[str, Distance]]:
    """What the closed forms of two parts say, if both have one."""
    if a is not None and b is not None:
        yield "features", _nearest_forms(a, b, T, enough)


def _nearest_forms(a: Forms, b: Forms, T: Array, enough: Enough) -> Distance:
    """The nearest pair of the bodies of two parts, asked in the order of their boxes' distances."""
    if len(a) == len(b) == 1:
        return bodies_distance(a[0], b[0], T, enough)
    boxes = Boxes.of(np.array([form.bounds for form in (*a, *b)]), np.array([np.eye(4)] * len(a) + [T] * len(b)))
    rows = np.array(list(itertools.product(range(len(a)), range(len(a), len(a) + len(b)))))
    pairs = list(itertools.product(a, b))
    gaps = box_gaps(boxes, rows) - np.array([x.error + y.error for x, y in pairs])
    distance = Distance(np.inf, np.inf)
    for k in np.argsort(gaps, kind="stable").tolist():
        if gaps[k] > distance.upper:  # of these and all that follow
            break
        x, y = pairs[k]
        distance = distance.union(bodies_distance(x, y, T, lambda d: d.upper - d.lower <= 1e-10))
    # Where two pieces of a body meet, neither knows how deep a point lies in both together.
    return replace(distance, lower=-np.inf) if distance.lower < -1e-6 else distance


def accuracy_for(a: Model, b: Model, accuracy: float = ACCURACY) -> float:
    """``accuracy`` (mm), or what is relative to the size of two shapes or Open CASCADE's, whichever is more."""
    if a.exact is not None and b.exact is not None:
        accuracy = max(accuracy, 2.1 * TOLERANCE)
    return max(accuracy, ACCURACY * 1e-3 * float(max(np.abs(a.bounds).max(), np.abs(b.bounds).max())))


def measured(distance: Distance, accuracy: float = ACCURACY) -> bool:
    """Whether a distance is known to ``accuracy`` mm, or certainly an overlap, whose depth is another question."""
    return distance.upper - distance.lower <= accuracy or distance.upper < -1e-6


def with_normal(distance: Distance) -> Distance:
    """The same with the normal that its points give, where the bodies are apart."""
    if distance.upper - distance.lower > 1e-6:
        distance = replace(distance, unique=None)
    p, q = distance.point_a, distance.point_b
    if p is None or q is None or not distance.upper > 1e-6:
        return distance
    size = float(np.linalg.norm(q - p))
    return replace(distance, normal=(q - p) / size) if size > 1e-6 else distance
