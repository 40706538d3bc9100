"""The truth of a motion, found without the kernel: least signed distance of a swept axis, by halving cells.

Definition: ``min over 0 <= s <= 1 and |t| <= length / 2 of sdf(c(s) + t d(s)) - r``. The search in (s, t) knows only
that ``sdf`` has slope 1. It begins at even places, at the instant that a case was built for, and at those that anybody
claims to be lowest. The value is one that the motion takes, so it is never too low; and as it is no higher than at any
instant named by a method or by the construction, a method cannot be lower and right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.motions.cases import Motions, turned
from clamp3d.bench.stress.poses.truth import point_sdf
from clamp3d.core.pose import Array

TRUTH_ERROR = 1e-9
"""Largest error of a truth in parts of the scene."""
_INSTANTS, _PLACES, _KEPT = 65, 33, 150
"""Cells of the first grid; cells of a case that are followed."""
_SMALLEST = 1e-13
"""Width of the last cells, in parts of the size of the shapes."""


@dataclass(frozen=True, slots=True)
class Least:
    """Least signed distance (n,) mm and the ``instant`` (n,) of it."""

    distance: Array
    instant: Array


def truth(cases: Motions, until: Array | None = None, hints: Array | None = None) -> Least:
    """Least signed distances; ``until`` (n,) ends the motions early, ``hints`` (n, k) are instants to look at too."""
    n = len(cases)
    ends = np.ones(n) if until is None else np.asarray(until, float)
    named = np.column_stack([cases.instant, np.full((n, 1), np.nan) if hints is None else hints])
    found = [_least(cases, i, float(ends[i]), named[i]) for i in range(n)]
    return Least(np.array([value for value, _ in found]), np.array([instant for _, instant in found]))


def _least(cases: Motions, i: int, end: float, named: Array) -> tuple[float, float]:
    """Least signed distance of case i until ``end`` and its instant."""
    best, at = np.inf, 0.0
    for instant in named[(named >= 0.0) & (named <= end)]:
        best, at = _descend(cases, i, np.array([instant]), 0.0, (best, at))
    instants = np.linspace(0.0, end, _INSTANTS)
    best, at = _descend(cases, i, instants, float(instants[1]), (best, at))
    return best - float(cases.shapes.r[cases.shape[i]]), at


def _descend(cases: Motions, i: int, instants: Array, wide: float, best: tuple[float, float]) -> tuple[float, float]:
    """The lower of ``best`` (value, instant) and what is found near ``instants`` (m,), each ``wide`` either way."""
    shapes, k = cases.shapes, cases.shape[i]
    half, size, low, high = 0.5 * float(shapes.length[k]), float(shapes.size()[k]), instants.min(), instants.max()
    speed = _speed(cases, i, half)
    instant, place = (q.ravel() for q in np.meshgrid(instants, np.linspace(-half, half, _PLACES), indexing="ij"))
    long, steps = 2.0 * half / (_PLACES - 1), np.array([-1.0, 0.0, 1.0])
    while True:
        value = _sdf(cases, i, instant, place)
        lowest = int(value.argmin())
        best = min(best, (float(value[lowest]), float(instant[lowest])))
        reach = speed * wide + long
        near = np.flatnonzero(value - reach < best[0])
        if reach <= _SMALLEST * size or not len(near):
            return best
        near = near[np.argsort(value[near], kind="stable")[:_KEPT]]
        wide, long = 0.5 * wide, 0.5 * long
        instant = np.clip(instant[near, None, None] + wide * steps[:, None] + 0.0 * steps, low, high).ravel()
        place = np.clip(place[near, None, None] + 0.0 * steps[:, None] + long * steps, -half, half).ravel()
        instant, place = np.unique(np.column_stack([instant, place]), axis=0).T


def _speed(cases: Motions, i: int, half: float) -> float:
    """Largest speed in mm of a point of the axis."""
    axis, vector = np.asarray(cases.take([i]).unit_axis()[0], float), np.asarray(cases.take([i]).vector()[0], float)
    arms = [cases.start[i, :3, 3] + t * cases.start[i, :3, 2] - cases.point[i] for t in (-half, half)]
    far = max(float(np.linalg.norm(np.cross(axis, arm))) for arm in arms)
    return abs(float(cases.angle[i])) * far + float(np.linalg.norm(vector))


def _sdf(cases: Motions, i: int, instant: Array, place: Array) -> NDArray[Any]:
    """Signed distance (m,) of points at ``place`` (m,) mm on the axis at an ``instant`` (m,) from the groove."""
    k, one = cases.shape[i], cases.take([i])
    R, a, H = (float(column[k]) for column in (cases.shapes.R, cases.shapes.half_angle, 0.5 * cases.shapes.L))
    centre, way = cases.start[i, :3, 3], cases.start[i, :3, 2] / np.linalg.norm(cases.start[i, :3, 2])
    points = centre + place[:, None] * way
    if cases.angle[i]:
        points = cases.point[i] + turned(
            points - cases.point[i], np.asarray(one.unit_axis()[0], float), instant * cases.angle[i]
        )
    x, y, z = (points + instant[:, None] * np.asarray(one.vector()[0], float)).T
    return point_sdf(x, y, z, R, R * np.sin(a), -R * np.cos(a), H)
