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
from clamp3d.engine.motions import first_contact
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
        motion = Motion.to_pose(end)
        way = MovingPair(cache.model(solids[b]), cache.model(solids[a]), motion.resolved(start), start, np.eye(4))
        near = way.first_time(TOUCHING) is not None  # how near they come otherwise does not matter
        if near and first_contact(solids[a], solids[b], motion, start, margin=TOUCHING).touches is not False:
            yield a, b


def _stay_apart(solids: dict[PartName, Solid], before: Waypoint, after: Waypoint, pair: Pair) -> bool:
    """Whether balls about the parts' origins stay apart, or the parts pass each other along the wires."""
    (a, c), (b, d) = ((before.poses[name], after.poses[name]) for name in pair)
    reach = sum(_reach(solids[name]) for name in pair)
    return _least_distance((b.x - a.x, b.y - a.y), (d.x - c.x, d.y - c.y)) > reach + TOUCHING


def _reach(solid: Solid) -> float:
    """How far a part's section reaches from its origin at most, mm."""
    corners = [
        body.support(np.array(v)) for body in solid.bodies for v in ((1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1))
    ]
    return math.sqrt(2.0) * max(corners)


def _least_distance(start: tuple[float, float], end: tuple[float, float]) -> float:
    """Of the origin from the segment between two points, mm."""
    (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    t = min(max(-(x * dx + y * dy) / max(dx * dx + dy * dy, 1e-300), 0.0), 1.0)
    return math.hypot(x + t * dx, y + t * dy)
