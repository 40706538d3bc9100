"""Whether parts meet on the way of an assembly: the scene of the clamp checked along straight motions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Waypoint
from clamp3d.clamp.scene import CONTACT
from clamp3d.collide.answer import Distance
from clamp3d.collide.broad import Boxes, box_gaps
from clamp3d.collide.model import Model, ModelCache
from clamp3d.collide.refine import refine
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array, SectionPose, inverse


def meetings(clamp: Clamp, path: Sequence[Waypoint], pairs: Sequence[Pair], cache: ModelCache) -> dict[Pair, str]:
    """Those of ``pairs`` that touch or overlap anywhere on ``path``, with the step in which each does so first."""
    waiting = list(pairs)
    models = {name: cache.model(solid) for name, solid in parts(clamp).items()}
    found: dict[Pair, str] = {}
    for before, after in itertools.pairwise(path):
        for pair in _meet(models, before, after, waiting):
            found[pair] = f"{after.step} ({after.label})"
        waiting = [pair for pair in waiting if pair not in found]
    return found


def _meet(models: dict[PartName, Model], before: Waypoint, after: Waypoint, pairs: Sequence[Pair]) -> Iterator[Pair]:
    """Those of ``pairs`` that meet between two waypoints.

    A pair that is further apart in the middle of a stretch than its parts move on half of it does not meet there;
    what is nearer is asked again on both halves, until the stretch is shorter than `CONTACT`.
    """
    names = list(models)
    bounds = np.array([model.bounds for model in models.values()])
    reach = dict(zip(names, np.linalg.norm(np.abs(bounds).max(axis=1), axis=1).tolist(), strict=True))
    ways = {pair: _way(before, after, pair, reach) for pair in pairs}
    stretches = [(0.0, 1.0, [pair for pair in pairs if ways[pair] > 0.0])]
    while stretches:
        start, end, near = stretches.pop()
        if not near:
            continue
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        poses = _between(before, after, middle)
        boxes = Boxes.of(bounds, np.array([poses[name] for name in names]))
        gaps = box_gaps(boxes, np.array([[names.index(a), names.index(b)] for a, b in near])).tolist()
        nearer = []
        for (a, b), gap in zip(near, gaps, strict=True):
            way = half * ways[a, b]
            limit = way + 2.0 * CONTACT
            if gap > limit:
                continue

            def enough(known: Distance, limit: float = limit) -> bool:
                return known.lower > limit or known.upper <= (limit if known.lower > CONTACT else CONTACT)

            boxed, T = Distance(gap, level="boxes", method="bounding boxes"), dot(inverse(poses[a]), poses[b])
            found = refine(models[a], models[b], T, boxed, Thresholds(CONTACT, limit), enough)
            if found.upper <= CONTACT or (way < CONTACT and found.lower <= limit):
                yield a, b
            elif found.lower <= limit:
                nearer.append((a, b))
        stretches += [(middle, end, nearer), (start, middle, nearer)]


def _way(before: Waypoint, after: Waypoint, pair: Pair, reach: dict[PartName, float]) -> float:
    """The most that any two points of two parts move against each other between two waypoints, mm."""
    (a, b), (c, d) = ((w.poses[pair[0]], w.poses[pair[1]]) for w in (before, after))
    turn = sum(abs(after.poses[n].angle - before.poses[n].angle) * reach[n] for n in pair)
    along = c.along - a.along - d.along + b.along
    return math.hypot(c.x - a.x - d.x + b.x, c.y - a.y - d.y + b.y, along) + turn


def _between(before: Waypoint, after: Waypoint, t: float) -> dict[PartName, Array]:
    """World poses (4, 4) after the fraction ``t`` of the way: straight and even."""
    poses = {}
    for name, p in before.poses.items():
        q = after.poses[name]
        pairs = ((p.x, q.x), (p.y, q.y), (p.angle, q.angle), (p.along, q.along))
        poses[name] = SectionPose(*(u + t * (v - u) for u, v in pairs)).T()
    return poses
