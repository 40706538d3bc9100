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
from clamp3d.engine.mesh_distance import meshes_distance
from clamp3d.engine.model import CadModel, Forms, Model
from clamp3d.engine.open_mesh import open_distance
from clamp3d.errors import SolverError
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.geometry.pose import Array, inverse

ACCURACY = 1e-7
"""Width (mm) of the interval at which a distance counts as known; relative to the size where that is more."""


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
    if cad_forms or not (isinstance(a, CadModel) and isinstance(b, CadModel)):
        yield from _by_closed_forms(a, b, T, enough)
        if _is_round(b) and not a.bracketed and a.chords:
            yield "facets", rods_distance(a.outer(a.chords[-1]), b.bodies or (), T)
        if _is_round(a) and not b.bracketed and b.chords:
            yield "facets", rods_distance(b.outer(b.chords[-1]), a.bodies or (), inverse(T)).moved(T).swapped()
    if isinstance(a, CadModel) and isinstance(b, CadModel):
        from clamp3d.engine.cad_pair import CadPair

        closed_forms = iter(()) if cad_forms else _by_closed_forms(a, b, T, enough)
        yield from CadPair(a, b, T, enough).levels(closed_forms)
        return
    for chord in _chords(a, b):
        yield "meshes", meshes_distance(a, b, T, chord, enough)


def _is_round(model: Model) -> bool:
    """Whether a cylinder holds each piece of a body."""
    return bool(model.bodies) and all(rod_of(body) is not None for body in model.bodies or ())


def _chords(a: Model, b: Model) -> list[float]:
    """Chord errors of the meshes that two shapes are measured with, from coarse to fine."""
    if not (a.chords and b.chords):
        return []
    every = sorted({*a.chords, *b.chords}, reverse=True)
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


def _by_closed_forms(a: Model, b: Model, T: Array, enough: Enough) -> Iterator[tuple[str, Distance]]:
    """What the closed forms of two parts say, if both have one; they are made when this is asked for."""
    if a.quick_bodies is not None and b.quick_bodies is not None:
        yield "features", _nearest_forms(a.quick_bodies, b.quick_bodies, T, enough)


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
    return distance


def accuracy_for(a: Model, b: Model, accuracy: float = ACCURACY) -> float:
    """``accuracy`` (mm), or what is relative to the size of two shapes or Open CASCADE's, whichever is more."""
    if isinstance(a, CadModel) and isinstance(b, CadModel):
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
