"""The verdict of one pair: its distance refined until it is certain, equal parts in one place, one part in another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.depth import depth_of_pieces
from clamp3d.engine.exact import exact_height
from clamp3d.engine.mesh_distance import is_deep_inside, within
from clamp3d.engine.model import CadModel, Model, box_corners
from clamp3d.engine.refine import refine
from clamp3d.engine.verdict import RESOLUTION, Thresholds, Verdict
from clamp3d.errors import Clamp3dError
from clamp3d.geometry.pose import Array, inverse, to_target


def judge(
    a: Model,
    b: Model,
    T: Array,
    start: Distance,
    thresholds: Thresholds,
    allowance: float | None,
    enough: Enough = lambda _: True,
) -> tuple[Verdict, Distance]:
    """Verdict and distance of ``b`` at ``T`` (4, 4) in a's frame, from ``start`` on, until certain and ``enough``.

    Of an overlap the distance bounds minus the interference, or minus the depth where two convex pieces tell it.
    """
    if a is b and (apart := _moved_by(a, T)) <= thresholds.contact:  # equal shapes share their model
        verdict = Verdict.ALLOWED if allowance == np.inf else Verdict.DUPLICATE
        # Each point of one lies so near to the same point of the other.
        return verdict, replace(start, lower=-np.inf, upper=apart, level="equal shapes", method="equal shapes")

    def certain(distance: Distance) -> bool:
        return enough(distance) and thresholds.verdict(distance, allowance) is not Verdict.UNCERTAIN

    distance = refine(a, b, T, start, certain)
    verdict = thresholds.verdict(distance, allowance)
    shallow = verdict is Verdict.CONTACT and distance.upper < -RESOLUTION
    if shallow or (verdict is Verdict.UNCERTAIN and distance.upper < thresholds.reach):
        exact = depth_of_pieces(a, b, T)  # known, the depth decides; else the interference, which is no more
        if exact is not None:
            distance, verdict = exact, thresholds.verdict(exact, allowance)
    if verdict is Verdict.CLASH:
        verdict = kind_of_overlap(a, b, T, thresholds.contact)
    return verdict, distance


def _moved_by(model: Model, T: Array) -> float:
    """How far (mm) ``T`` (4, 4) moves the points of a part at most."""
    corners = box_corners(model.bounds)
    return float(np.linalg.norm(to_target(T, corners) - corners, axis=1).max())


def kind_of_overlap(a: Model, b: Model, T: Array, contact: float) -> Verdict:
    """Clash, contained, or duplicate where each of two parts lies in the other, all within ``contact`` mm."""
    inside = [_holds(b, a, T, contact), _holds(a, b, inverse(T), contact)]
    if all(inside):
        return Verdict.DUPLICATE
    return Verdict.CONTAINED if any(inside) else Verdict.CLASH


def _holds(inner: Model, outer: Model, T: Array, contact: float) -> bool:
    """Whether all of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer``, within ``contact`` mm."""
    if not (inner.is_simple and outer.is_simple and inner.chords and outer.chords):
        return False
    if not may_hold(inner, outer, T, contact):
        return False
    inner.counters.queries["containment"] += 1
    both_exact = isinstance(inner, CadModel) and isinstance(outer, CadModel)
    for level in (0, -1) if inner.refines or outer.refines else (0,):  # coarse meshes mostly tell that it does not
        try:
            small, large = inner.outer(inner.chords[level]), outer.inner(outer.chords[level])
        except Clamp3dError:  # fine ones of solids from CAD may take too long to make
            continue
        if large is None:  # its walls are thinner than the chord error
            continue
        # Meshes around and inside of drawn solids are off by their chords.
        slack = small.error + large.error + sum(m.chords[level] for m in (inner, outer) if m.bracketed)
        if is_deep_inside(small, large, T, slack):  # finer meshes make no difference
            return True
        if not within(small, large, T, contact + slack):
            return False
    if large is None:
        return False
    return not both_exact or exact_height(small, large, outer, T) <= contact


def may_hold(inner: Model, outer: Model, T: Array, contact: float) -> NDArray[np.bool_]:
    """Whether the boxes of two parts leave open that ``inner``, at ``T`` (..., 4, 4) in outer's frame, lies in it."""
    low, high = outer.bounds
    middle, half = 0.5 * (inner.bounds[0] + inner.bounds[1]), 0.5 * (inner.bounds[1] - inner.bounds[0])
    centre = T[..., :3, :3] @ middle + T[..., :3, 3]
    # It touches each side of its box, so in any direction it reaches to a third of the box's extent below the middle:
    # so far does the mean of the points on the three sides that are furthest along that direction.
    reach = np.abs(T[..., :3, :3]) @ half / 3.0 + contact
    return np.asarray(((centre + reach >= low) & (centre - reach <= high)).all(axis=-1))
