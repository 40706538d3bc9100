"""Refine a pair until it is known well enough: boxes, closed forms, meshes, Open CASCADE, each only if needed.

This is the one place where pairs of shapes are handed to the methods that measure them.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.broad import Boxes, box_gaps
from clamp3d.engine.closed_form import ClosedForm, bodies_distance
from clamp3d.engine.facets import rod_of, rods_distance
from clamp3d.engine.mesh_distance import meshes_distance
from clamp3d.engine.model import LAST_CHORDS, Model
from clamp3d.engine.open_mesh import open_distance
from clamp3d.errors import SolverError
from clamp3d.files.pairs import TOLERANCE
from clamp3d.geometry.pose import Array, inverse

ACCURACY = 1e-7
"""Width (mm) of the interval at which a distance counts as known; relative to the size where that is more."""

SHARES = (0.04, 0.015)
"""Chords of the border of a common part, of its thickness: the first is quick, the second takes up to seconds."""

Enough = Callable[[Distance], bool]


def from_boxes(a: Model, b: Model, T: Array) -> Distance:
    """What the boxes of two shapes say, ``b`` at ``T`` (4, 4) in a's frame."""
    pair = Boxes.of(np.array([a.bounds, b.bounds]), np.array([np.eye(4), T]))
    return Distance(float(box_gaps(pair, np.array([[0, 1]]))[0]), level="boxes", method="bounding boxes")


def refine(a: Model, b: Model, T: Array, start: Distance, enough: Enough, *, cad_forms: bool = False) -> Distance:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame, from ``start`` (what the boxes said), until ``enough``.

    With ``cad_forms`` the cylinders and holes of two solids from CAD are measured in closed form too, which pays where
    a pair is asked about often.
    """
    distance = start
    if enough(distance):
        return distance
    for level in _levels(a, b, T, cad_forms):
        distance = _agreed(distance, level(partial(_enough_with, distance, enough)))
        if enough(distance):
            break
    return distance


def _enough_with(distance: Distance, enough: Enough, new: Distance) -> bool:
    """Whether a new answer is enough together with the one so far."""
    return enough(distance.meet(new))


def _levels(a: Model, b: Model, T: Array, cad_forms: bool) -> Iterator[Callable[[Enough], Distance]]:
    """The levels that apply to a pair, from cheap to dear."""
    queries = a.counters.queries
    if not (a.closed and b.closed):
        queries["open meshes"] += 1
        yield lambda _: _of_open_meshes(a, b, T)
        return
    both_exact = a.exact is not None and b.exact is not None
    forms = cad_forms or not both_exact
    if forms and a.quick_bodies is not None and b.quick_bodies is not None:
        yield partial(_by_closed_forms, a, b, T, (a.quick_bodies, b.quick_bodies))
    if forms:
        yield from _cylinders_on_facets(a, b, T)
    for chord in _chords(a, b):
        yield partial(_by_meshes, a, b, T, chord)
    if both_exact:
        from clamp3d.engine.exact import exact_distance

        queries["exact"] += 1
        yield lambda _: exact_distance(a, b, T)
        for share in SHARES:
            yield partial(_by_common_part, a, b, T, share)
        for chord in LAST_CHORDS:  # Open CASCADE did not find the common part
            if a.refine_to(chord) | b.refine_to(chord):
                yield partial(_by_meshes, a, b, T, chord)


def _cylinders_on_facets(a: Model, b: Model, T: Array) -> Iterator[Callable[[Enough], Distance]]:
    """Levels for exact cylinders of one part against the facets of the other, where that is a mesh."""
    if _is_round(b) and not a.drawn and a.chords:
        yield lambda _: _on_facets(a, b, T)
    if _is_round(a) and not b.drawn and b.chords:
        yield lambda _: _on_facets(b, a, inverse(T)).moved(T).swapped()


def _is_round(model: Model) -> bool:
    """Whether a cylinder holds each piece of a body."""
    return bool(model.bodies) and all(rod_of(body) is not None for body in model.bodies or ())


def _on_facets(mesh: Model, round_: Model, T: Array) -> Distance:
    mesh.counters.queries["facets"] += 1
    distance = rods_distance(mesh.outer(mesh.chords[-1]), round_.bodies or (), T)
    return distance.labelled("facets", "cylinder on facets (FCL)")


def _by_meshes(a: Model, b: Model, T: Array, chord: float, enough: Enough) -> Distance:
    a.counters.queries["meshes"] += 1
    chord_error = f", chord error {chord:.2g} mm" if a.refines or b.refines else ""
    return meshes_distance(a, b, T, chord, enough).labelled("meshes", f"meshes (FCL){chord_error}")


def _by_common_part(a: Model, b: Model, T: Array, share: float, _: Enough) -> Distance:
    from clamp3d.engine.exact import exact_overlap

    return exact_overlap(a, b, T, share)


def _chords(a: Model, b: Model) -> list[float]:
    """Chord errors of the meshes that two shapes are measured with, from coarse to fine."""
    if not (a.chords and b.chords):
        return []
    every = sorted({*a.chords, *b.chords}, reverse=True)
    coarsest, finest = min(a.chords[0], b.chords[0]), min(a.chords[-1], b.chords[-1])
    return [chord for chord in every if finest <= chord <= coarsest] if a.refines or b.refines else every[:1]


def _agreed(old: Distance, new: Distance) -> Distance:
    """Both answers at once. Raises SolverError if they contradict each other."""
    met = old.meet(new)
    if met.lower > met.upper + 1e-6 + 1e-9 * abs(met.upper):
        raise SolverError(
            f"{new.level} ({new.method}) and {old.level} ({old.method}) disagree: "
            f"[{new.lower:.9g}, {new.upper:.9g}] and [{old.lower:.9g}, {old.upper:.9g}] mm"
        )
    return met.ordered()


def _of_open_meshes(a: Model, b: Model, T: Array) -> Distance:
    names = " and ".join(model.name for model in (a, b) if not model.closed)
    return open_distance(a, b, T).labelled("meshes", f"surfaces (FCL), inside of {names} unknown")


def _by_closed_forms(
    a: Model, b: Model, T: Array, bodies: tuple[tuple[ClosedForm, ...], tuple[ClosedForm, ...]], enough: Enough
) -> Distance:
    """The nearest pair of the bodies of two parts, asked in the order of their boxes' distances."""
    n, forms = len(bodies[0]), [*bodies[0], *bodies[1]]
    if len(forms) == 2:
        a.counters.queries["features"] += 1
        distance = bodies_distance(forms[0], forms[1], T, enough)
        return distance.labelled("features", distance.method)
    boxes = Boxes.of(np.array([form.bounds for form in forms]), np.array([np.eye(4)] * n + [T] * len(bodies[1])))
    rows = np.array(list(itertools.product(range(n), range(n, len(forms)))))
    gaps = box_gaps(boxes, rows) - np.array([forms[i].error + forms[j].error for i, j in rows.tolist()])
    distance = Distance(np.inf, np.inf)
    for k in np.argsort(gaps, kind="stable").tolist():
        if gaps[k] > distance.upper:  # of these and all that follow
            break
        a.counters.queries["features"] += 1
        i, j = rows[k].tolist()
        distance = distance.union(bodies_distance(forms[i], forms[j], T, lambda d: d.upper - d.lower <= 1e-10))
    if distance.lower < -1e-6:
        # Where two pieces of a body meet, neither knows how deep a point lies in both together.
        distance = replace(distance, lower=-np.inf)
    return distance.labelled("features", distance.method)


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
