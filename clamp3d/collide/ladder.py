"""The ladder of fidelity for one pair: boxes, closed forms or hulls, facets, meshes; up while the verdict is open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from clamp3d.collide.body import Body, bodies_bounds, turned
from clamp3d.collide.bounds import Bounds, Thresholds, Verdict
from clamp3d.collide.convex import Rod
from clamp3d.collide.facets import rod_bounds
from clamp3d.collide.model import FINEST, Ledger, Model
from clamp3d.collide.result import PairResult
from clamp3d.collide.trimodel import inside, tri_bounds
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import SolverError

COARSEST = 0.512
"""First chord error (mm) of a pair that climbs to meshes; each further one is a whole power of two finer."""
CONTAINED_ERROR = 0.064
"""Chord error (mm) of the meshes that containment is asked with."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Bounds of a pair in the first part's frame, and what gave them."""

    bounds: Bounds
    rung: str
    method: str


Enough = Callable[[Bounds], bool]


def climb(
    a: Model,
    b: Model,
    T: Array,
    start: Bounds,
    thresholds: Thresholds,
    enough: Enough,
    ledger: Ledger,
    *,
    forms: bool = True,
) -> Answer:
    """Bounds of ``b`` at ``T`` (4, 4) in a's frame, from ``start`` (what the boxes said), until ``enough``.

    Without ``forms`` the closed forms are left out: a caller that asks often may know that they say nothing here.
    """
    found = Answer(start, "boxes", "bounding boxes")
    if enough(start):
        return found
    for rung in (_features, _facets) if forms else (_facets,):
        new = rung(a, b, T, lambda x, known=found.bounds: enough(known.meet(x)), ledger)  # type: ignore[misc]
        if new is not None:
            found = _meet(found, new)
            if enough(found.bounds):
                return found
    error = COARSEST
    while True:
        new = _meshes(a, b, T, error, thresholds, ledger)
        found = _meet(found, new)
        doubt = a.mesh(error).error + b.mesh(error).error
        if enough(found.bounds) or error <= FINEST or doubt <= 1e-9 or not (a.refines or b.refines):
            return found
        # The middle of the bounds guesses how far the nearest threshold is: go there, not step by step.
        middle = 0.5 * (found.bounds.low + found.bounds.high)
        margin = thresholds.margin(middle) if abs(middle) < 1e300 else 0.0
        wanted = min(0.5 * error, max(0.25 * margin, error / 16.0))
        while error > max(wanted, FINEST):
            error = max(0.5 * error, FINEST)


def every_rung(a: Model, b: Model, T: Array, start: Bounds, thresholds: Thresholds, ledger: Ledger) -> Answer:
    """The same from all models at their finest, whatever the first ones say; raises SolverError if they disagree."""
    found = Answer(start, "boxes", "bounding boxes")
    never: Enough = lambda _: False  # noqa: E731
    for new in (
        _features(a, b, T, never, ledger),
        _hulls(a, b, T, never, ledger),
        _facets(a, b, T, never, ledger),
        _meshes(a, b, T, FINEST, thresholds, ledger),
    ):
        if new is not None:
            found = _meet(found, new)
    return found


def contained(a: Model, b: Model, T: Array, thresholds: Thresholds, ledger: Ledger) -> bool:
    """Whether one of two overlapping parts lies wholly in the other, within the contact threshold."""
    for inner, outer, place in ((b, a, T), (a, b, inverse(T))):
        middle, half = inner.bounds.mean(axis=0), 0.5 * (inner.bounds[1] - inner.bounds[0])
        R = place[:3, :3]
        centre, reach = R @ middle + place[:3, 3], abs(R) @ half
        room = outer.bounds
        # The box of the inner one touches the outer's on six sides: one outside by more than its own corners can be
        # is enough to say no, and cheap.
        if (centre + 0.5 * reach < room[0]).any() or (centre - 0.5 * reach > room[1]).any():
            continue
        if ((outer.bounds[1] - outer.bounds[0]).max() * 1.7321 + thresholds.contact) < 2.0 * half.max():
            continue
        ledger.queries["containment"] += 1
        small, large = inner.mesh(CONTAINED_ERROR), outer.mesh(CONTAINED_ERROR)
        if inside(small, large, place, thresholds.contact + small.error + large.error):
            return True
    return False


def _meet(old: Answer, new: Answer) -> Answer:
    bounds = old.bounds.meet(new.bounds)
    slack = 1e-7 + 1e-9 * abs(bounds.high)
    if bounds.low > bounds.high + slack:
        raise SolverError(
            f"{new.rung} ({new.method}) and {old.rung} ({old.method}) disagree: "
            f"[{new.bounds.low:.9g}, {new.bounds.high:.9g}] and [{old.bounds.low:.9g}, {old.bounds.high:.9g}] mm"
        )
    if bounds.low > bounds.high:
        bounds = Bounds(bounds.high, bounds.low, bounds.point_a, bounds.point_b)
    same = (bounds.low, bounds.high) == (old.bounds.low, old.bounds.high)
    return Answer(bounds, old.rung, old.method) if same else Answer(bounds, new.rung, new.method)


def _features(a: Model, b: Model, T: Array, enough: Enough, ledger: Ledger) -> Answer:
    """Closed forms of both; the convex hull of a part that has none stands in for it."""
    closed = a.bodies is not None and b.bodies is not None
    found, method = None, ""
    single = len(a.forms) == len(b.forms) == 1
    for x in a.forms:
        for y in b.forms:
            ledger.queries["features" if closed else "hulls"] += 1
            new, how = bodies_bounds(x, y, T, enough if single else lambda _: False)
            if found is None or new.high < found.high or (new.high == found.high and new.low < found.low):
                method = how
            found = new if found is None else found.union(new)
    assert found is not None
    return Answer(found, "features" if closed else "hulls", method if closed else f"{method} on hulls")


def _hulls(a: Model, b: Model, T: Array, enough: Enough, ledger: Ledger) -> Answer:
    ledger.queries["hulls"] += 1
    bounds, _ = bodies_bounds(a.hull_body, b.hull_body, T, enough)
    return Answer(bounds, "hulls", "convex hulls (GJK)")


def _facets(a: Model, b: Model, T: Array, enough: Enough, ledger: Ledger) -> Answer | None:
    """Exact cylinders of one part against the mesh of the other, where that comes as a mesh."""
    found = None
    for first, second, place, swapped in ((a, b, T, False), (b, a, inverse(T), True)):
        if first.facets is None or second.bodies is None or not all(_round(body) for body in second.bodies):
            continue
        new = None
        for body in second.bodies:
            ledger.queries["facets"] += 1
            one = rod_bounds(first.facets, body, place)
            new = one if new is None else new.union(one)
        assert new is not None
        new = turned(new, place) if swapped else new
        found = new if found is None else found.meet(new)
        if enough(found):
            break
    return None if found is None else Answer(found, "facets", "cylinder on facets (FCL)")


def _round(body: Body) -> bool:
    return any(isinstance(piece, Rod) for piece in body.outers)


def _meshes(a: Model, b: Model, T: Array, error: float, thresholds: Thresholds, ledger: Ledger) -> Answer:
    ledger.queries["meshes"] += 1
    x, y = a.mesh(error), b.mesh(error)
    bounds = tri_bounds(x, y, T, contact=thresholds.contact)
    doubt = x.error + y.error
    return Answer(bounds, "meshes", f"meshes (FCL), chord error {doubt:.2g} mm" if doubt > 0.0 else "meshes (FCL)")


def as_row(a: str, b: str, verdict: Verdict, answer: Answer, T_a: Array) -> PairResult:
    """The answer as a row, its points in the world."""
    p, q = answer.bounds.point_a, answer.bounds.point_b
    R, t = T_a[:3, :3], T_a[:3, 3]
    return PairResult(
        a,
        b,
        verdict,
        answer.bounds.low,
        answer.bounds.high,
        answer.rung,
        answer.method,
        None if p is None else R @ p + t,
        None if q is None else R @ q + t,
    )


def verdict_of(bounds: Bounds, thresholds: Thresholds, allowance: float | None) -> Verdict:
    """The verdict of a pair whose contact is meant up to ``allowance`` mm of overlap (None: not meant)."""
    plain = thresholds.verdict(bounds)
    if allowance is None or plain is Verdict.CLEAR:
        return plain
    limit = -max(allowance, thresholds.contact)
    if bounds.low >= limit - 1e-6:
        far = bounds.low >= thresholds.reach
        return Verdict.CLEAR if far else Verdict.ALLOWED if bounds.high < thresholds.reach else Verdict.UNCERTAIN
    if bounds.high < limit:
        return Verdict.CLASH
    return Verdict.UNCERTAIN
