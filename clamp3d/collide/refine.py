"""Refine a pair until it is known well enough: boxes, closed forms or hulls, facets, meshes, each only if needed.

This is the one place where pairs of shapes are handed to the methods that measure them.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from clamp3d.brep.surfaces import OTHER
from clamp3d.collide.answer import Distance
from clamp3d.collide.body import ClosedForm, bodies_distance
from clamp3d.collide.broad import Boxes, box_gaps
from clamp3d.collide.convex import Rod
from clamp3d.collide.faces import MOST, faces_distance, flat_where_near
from clamp3d.collide.faces_search import VERDICT_WIDTH
from clamp3d.collide.facets import rod_distance
from clamp3d.collide.meshes import meshes_distance
from clamp3d.collide.model import FINEST, Model
from clamp3d.collide.open_mesh import open_distance
from clamp3d.collide.verdict import Thresholds, Verdict
from clamp3d.core.linear import norm
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import SolverError

COARSEST = 0.512
"""First chord error (mm) of a pair that needs meshes; each further one is a whole power of two finer."""

_FIRST = 2000
"""Pieces looked at before the facets of free-form faces are taken for planes."""
_FACE_WIDTHS = (1e-3, 1e-6)
"""Widths (mm) of the interval that are asked for where a verdict alone is not enough."""

Enough = Callable[[Distance], bool]


def from_boxes(a: Model, b: Model, T: Array) -> Distance:
    """What the boxes of two shapes say, ``b`` at ``T`` (4, 4) in a's frame."""
    pair = Boxes.of(np.array([a.bounds, b.bounds]), np.array([np.eye(4), T]))
    return Distance(float(box_gaps(pair, np.array([[0, 1]]))[0]), level="boxes", method="bounding boxes")


def refine(
    a: Model,
    b: Model,
    T: Array,
    start: Distance,
    thresholds: Thresholds,
    enough: Enough,
    *,
    forms: bool = True,
    search: bool = True,
) -> Distance:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame, from ``start`` (what the boxes said), until ``enough``.

    Without ``forms`` the closed forms are left out: a caller that asks often may know that they say nothing here.
    Without ``search`` the interference of meshes is not limited from above, which takes the longest.
    """
    found = start
    if enough(found):
        return found
    if not (a.closed and b.closed):
        a.counters.queries["open meshes"] += 1
        open_ = " and ".join(model.name for model in (a, b) if not model.closed)
        method = f"surfaces (FCL), inside of {open_} unknown"
        return _agreed(found, open_distance(a, b, T)).labelled("meshes", method)
    if a.faces is not None and b.faces is not None:
        return _faces(a, b, T, found, thresholds, enough)
    for level in (_features, _facets) if forms and a.simple and b.simple else (_facets,):
        new = level(a, b, T, lambda x, known=found: enough(known.meet(x)))  # type: ignore[misc]
        if new is not None:
            found = _agreed(found, new)
            if enough(found):
                return found
    error = COARSEST
    while True:
        new = _meshes(a, b, T, error, lambda x, known=found: enough(known.meet(x)), search)  # type: ignore[misc]
        found = _agreed(found, new)
        if enough(found) or error <= FINEST or not (a.refines or b.refines):
            return found
        # The middle of the bounds guesses how far the nearest threshold is: go there, not step by step.
        middle = 0.5 * (found.lower + found.upper)
        margin = thresholds.margin(middle) if abs(middle) < 1e300 else 0.0
        wanted = min(0.5 * error, max(0.25 * margin, error / 16.0))
        while error > max(wanted, FINEST):
            error = max(0.5 * error, FINEST)


def _agreed(old: Distance, new: Distance) -> Distance:
    met = old.meet(new)
    if met.lower > met.upper + 1e-7 + 1e-9 * abs(met.upper):
        raise SolverError(
            f"{new.level} ({new.method}) and {old.level} ({old.method}) disagree: "
            f"[{new.lower:.9g}, {new.upper:.9g}] and [{old.lower:.9g}, {old.upper:.9g}] mm"
        )
    return met.ordered()


def _faces(a: Model, b: Model, T: Array, found: Distance, thresholds: Thresholds, enough: Enough) -> Distance:
    """Two solids from CAD by their faces: until the verdict is certain, then until ``enough``."""
    assert a.faces is not None
    assert b.faces is not None
    one, other = a.faces, b.faces
    free = OTHER in one.faces.kind and OTHER in other.faces.kind
    for tol in (None, *_FACE_WIDTHS):
        if tol is not None and found.upper - found.lower <= tol:  # so near the search for a verdict has come already
            continue
        for flat in (False, True) if free and tol is None else (free,):
            if flat and tol is None:
                one, other = flat_where_near(one, other, T, thresholds.reach)
            a.counters.queries["faces"] += 1
            contact, clearance = thresholds.contact, thresholds.clearance
            most = MOST if flat == free else _FIRST
            new = faces_distance(one, other, T, contact=contact, clearance=clearance, tol=tol, most=most)
            found = _agreed(found, new)
            if thresholds.verdict(found) is not Verdict.UNCERTAIN:
                break
        # A search that has not come as far as it was asked to has used up its pieces: to ask for more tells no more.
        wanted = np.inf if thresholds.verdict(found) is not Verdict.UNCERTAIN else VERDICT_WIDTH * thresholds.contact
        if enough(found) or (wanted if tol is None else tol) < found.upper - found.lower < np.inf:
            break
    return found


def _features(a: Model, b: Model, T: Array, enough: Enough) -> Distance:
    """Closed forms of both; the convex hull of a part that has none stands in for it."""
    level = "hulls" if a.bodies is None or b.bodies is None else "features"
    if len(a.forms) == len(b.forms) == 1:
        a.counters.queries[level] += 1
        found = bodies_distance(a.forms[0], b.forms[0], T, enough)
        return found.labelled(level, f"{found.method} on hulls" if level == "hulls" else found.method)
    pairs: list[tuple[float, int, ClosedForm, ClosedForm]] = []
    forms = [*a.forms, *b.forms]
    places = np.where(np.arange(len(forms))[:, None, None] < len(a.forms), np.eye(4), T)
    boxes = Boxes.of(np.array([form.bounds for form in forms]), places)
    both = np.array(list(itertools.product(range(len(a.forms)), range(len(a.forms), len(forms)))))
    for k, ((i, j), gap) in enumerate(zip(both, box_gaps(boxes, both), strict=True)):
        x, y = forms[i], forms[j]
        pairs.append((float(gap) - x.error - y.error, k, x, y))
    found = Distance(np.inf, np.inf)
    for gap, _, x, y in sorted(pairs):
        if gap > found.upper:  # of these and all that follow
            break
        a.counters.queries[level] += 1
        found = found.union(bodies_distance(x, y, T, _known))
    if found.lower < -1e-6:
        # Where two pieces of a body meet, neither knows how deep a point lies in both together.
        found = replace(found, lower=-np.inf)
    return found.labelled(level, f"{found.method} on hulls" if level == "hulls" else found.method)


def _known(distance: Distance) -> bool:
    return distance.upper - distance.lower <= 1e-10


def _facets(a: Model, b: Model, T: Array, enough: Enough) -> Distance | None:
    """Exact cylinders of one part against the mesh of the other, where that comes as a mesh."""
    found = None
    for first, second, place, swapped in ((a, b, T, False), (b, a, inverse(T), True)):
        if first.facets is None or second.bodies is None:
            continue
        if not all(any(isinstance(piece, Rod) for piece in body.outers) for body in second.bodies):
            continue
        new = Distance(np.inf, np.inf)
        for body in second.bodies:
            a.counters.queries["facets"] += 1
            new = new.union(rod_distance(first.facets, body, place))
        new = new.moved(T).swapped() if swapped else new
        found = new if found is None else found.meet(new)
        if enough(found):
            break
    return None if found is None else found.labelled("facets", "cylinder on facets (FCL)")


def _meshes(a: Model, b: Model, T: Array, error: float, enough: Enough, search: bool) -> Distance:
    a.counters.queries["meshes"] += 1
    found = meshes_distance(a, b, T, error, enough, search=search)
    chords = f", chord error {error:.2g} mm" if a.refines or b.refines else ""
    return found.labelled("meshes", f"meshes (FCL){chords}")


ACCURACY = 1e-7
"""Width (mm) of the interval at which a distance counts as known."""


def measured(known: Distance, accuracy: float = ACCURACY) -> bool:
    """Whether a distance is known to ``accuracy`` mm, or certainly an overlap, whose depth meshes do not tell."""
    return known.upper - known.lower <= accuracy or known.upper < -1e-6


def with_normal(found: Distance) -> Distance:
    """``found`` with the normal that its points give, where they are apart."""
    if found.upper - found.lower > 1e-6:
        found = replace(found, unique=None)
    p, q = found.point_a, found.point_b
    if p is None or q is None or not found.upper > 1e-6:
        return found
    size = norm(q - p)
    return replace(found, normal=(q - p) / size) if size > 1e-6 else found
