"""Whether parts meet on the way of an assembly: each stretch of it is a motion of one part in the other's frame."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Waypoint
from clamp3d.clamp.surfaces import TOUCHING
from clamp3d.engine.model import ModelCache
from clamp3d.engine.moving_pair import MovingPair
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import inverse
from clamp3d.geometry.shapes import Solid


def meetings(clamp: Clamp, path: Sequence[Waypoint], pairs: Sequence[Pair], cache: ModelCache) -> dict[Pair, str]:
    """Those of ``pairs`` that touch or overlap anywhere on ``path``, with the step in which each does so first."""
    waiting, solids, met = list(pairs), parts(clamp), {}
    for before, after in itertools.pairwise(path):
        for pair in _meet(solids, before, after, waiting, cache):
            met[pair] = f"{after.step} ({after.label})"
        waiting = [pair for pair in waiting if pair not in met]
    return met


def _meet(
    solids: dict[PartName, Solid], before: Waypoint, after: Waypoint, pairs: Sequence[Pair], cache: ModelCache
) -> Iterator[Pair]:
    """Those of ``pairs`` that meet between two waypoints: each goes by one screw from pose to pose of the other."""
    for a, b in pairs:
        start, end = (inverse(w.poses[a].T()) @ w.poses[b].T() for w in (before, after))
        if np.array_equal(start, end) or _stay_apart(solids, before, after, (a, b)):
            continue
        motion = Motion.to_pose(end).resolved(start)
        way = MovingPair(cache.model(solids[b]), cache.model(solids[a]), motion, start, np.eye(4))
        if way.first_time(TOUCHING) is not None:  # how near they come otherwise does not matter
            yield a, b


def _stay_apart(solids: dict[PartName, Solid], before: Waypoint, after: Waypoint, pair: Pair) -> bool:
    """Whether balls about the parts' origins stay apart in the section."""
    places = [[(w.poses[name].x, w.poses[name].y) for name in pair] for w in (before, after)]
    apart = np.diff(places, axis=1)[:, 0]
    move = apart[1] - apart[0]
    t = np.clip(-(apart[0] @ move) / max(move @ move, 1e-300), 0.0, 1.0)
    return bool(np.hypot(*(apart[0] + t * move)) > sum(_reach(solids[name]) for name in pair) + TOUCHING)


def _reach(solid: Solid) -> float:
    """How far a part's section reaches from its origin at most, mm."""
    axes = np.array([(1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1)])
    return math.sqrt(2.0) * max(body.support(axis) for body in solid.bodies for axis in axes)
