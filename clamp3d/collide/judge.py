"""The verdict of one pair: its distance refined until one is certain, and whether one part lies wholly in the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distance
from clamp3d.collide.batch import Pairs, in_frame_of_first, members, relative
from clamp3d.collide.broad import world_boxes
from clamp3d.collide.depth import is_quick, penetration
from clamp3d.collide.faces import stands_out
from clamp3d.collide.meshes import within
from clamp3d.collide.model import Model
from clamp3d.collide.refine import Enough, refine, with_normal
from clamp3d.collide.verdict import Thresholds, Verdict
from clamp3d.core.linear import norm
from clamp3d.core.pose import Array

_ERROR = 0.064
"""Chord error (mm) of the meshes that containment is asked with."""


def judge(
    a: Model,
    b: Model,
    T: Array,
    start: Distance,
    thresholds: Thresholds,
    allowance: float | None,
    enough: Enough = lambda _: True,
) -> tuple[Verdict, Distance]:
    """Verdict and distance of ``b`` at ``T`` (4, 4) in a's frame, from ``start`` on, until certain and ``enough``."""

    def certain(known: Distance) -> bool:
        return enough(known) and thresholds.verdict(known, allowance) is not Verdict.UNCERTAIN

    found = refine(a, b, T, start, thresholds, certain)
    verdict = thresholds.verdict(found, allowance)
    if verdict is Verdict.UNCERTAIN and found.upper < thresholds.reach and is_quick(a, b):
        # Nothing lies deeper inside than the way out is long.
        deep = penetration(a, b, T, with_normal(found))
        found = replace(found, lower=max(found.lower, deep.lower))
        verdict = thresholds.verdict(found, allowance)
    if verdict is Verdict.CLASH and contained(a, b, in_frame_of_first(T[None]), thresholds).any():
        verdict = Verdict.CONTAINED
    return verdict, found


def contained(a: Model, b: Model, pairs: Pairs, thresholds: Thresholds) -> NDArray[np.bool_]:
    """Whether one of two overlapping parts lies wholly in the other, within the contact threshold; (m,).

    ``pairs`` are the poses of both.
    """
    found = np.zeros(len(pairs[1]), dtype=bool)
    if not (a.closed and b.closed):
        return found
    for inner, outer, (A, column, T, row) in ((b, a, pairs), (a, b, (*pairs[2:], *pairs[:2]))):
        if not _could_hold(inner, outer, thresholds.contact):
            continue
        rows = np.flatnonzero(~found)
        places = relative((A, column[rows], T, row[rows]))
        fits = _fits(inner, outer, places)
        rows, places = rows[fits], places[fits]
        if inner.faces is None or outer.faces is None:
            asked = ~_shows(inner, outer, places, thresholds.contact)
        else:
            faces = inner.faces, outer.faces
            asked = np.array([not stands_out(*faces, P, thresholds.contact) for P in places], dtype=bool)
        a.counters.queries["containment"] += int(asked.sum())
        found[rows[asked]] = [within(inner, outer, P, _ERROR, thresholds.contact) for P in places[asked]]
    return found


def _could_hold(inner: Model, outer: Model, contact: float) -> bool:
    """Whether the sizes of two parts leave open that one holds the other at some pose, as `within` takes it."""
    length, volume = inner.least_size
    extent = np.ptp(outer.bounds, axis=0) + 2.0 * (contact + 4.0 * _ERROR)
    return bool(norm(extent) >= length and extent.prod() >= volume)


def _fits(inner: Model, outer: Model, T: Array) -> NDArray[np.bool_]:
    """Whether the boxes of two parts leave open that one holds the other, (n,): cheap, without a mesh."""
    low, high = outer.bounds
    around = world_boxes(inner.bounds[None], T)
    centre, reach = 0.5 * (around[:3] + around[3:]), 0.25 * (around[3:] - around[:3])
    # The box of the inner one touches the outer's on six sides: one outside by more than its own corners can be is
    # enough to say no.
    return np.asarray(((centre + reach >= low[:, None]) & (centre - reach <= high[:, None])).all(axis=0))


def _shows(inner: Model, outer: Model, T: Array, contact: float) -> NDArray[np.bool_]:
    """Whether one of a few vertices of a part is certainly out of the other by more than ``contact`` mm, (n,)."""
    from clamp3d.collide.poses_kernel import stand_out

    forms = outer.bodies
    if forms is None or len(forms) > 1 or forms[0].surface is not None:
        return np.zeros(len(T), dtype=bool)
    small, found = inner.outer(_ERROR), np.empty(len(T), dtype=np.int64)
    slack = contact + small.error + forms[0].error + (_ERROR if inner.refines else 0.0)
    points = np.vstack([small.shell_points.reshape(-1, 3), small.vertices[:: max(1, len(small.vertices) // 16)]])
    stand_out(T, points, *members(forms[0]), slack, found)
    return np.asarray(found == 1)
