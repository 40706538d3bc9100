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
from clamp3d.clamp.scene import CONTACT, clamp_scene
from clamp3d.collide.check import check
from clamp3d.collide.model import ModelCache
from clamp3d.collide.verdict import Verdict
from clamp3d.core.linear import norm
from clamp3d.core.pose import Array, SectionPose

_MEET = (Verdict.CONTACT, Verdict.CLASH, Verdict.CONTAINED)


def meetings(clamp: Clamp, path: Sequence[Waypoint], pairs: Sequence[Pair], cache: ModelCache) -> dict[Pair, str]:
    """Those of ``pairs`` that touch or overlap anywhere on ``path``, with the step in which each does so first."""
    waiting = list(pairs)
    reach = {name: norm(np.abs(part.bounds).max(axis=0)) for name, part in parts(clamp).items()}
    found: dict[Pair, str] = {}
    for before, after in itertools.pairwise(path):
        for pair in _meet(clamp, before, after, waiting, reach, cache):
            found[pair] = f"{after.step} ({after.label})"
        waiting = [pair for pair in waiting if pair not in found]
    return found


def _meet(
    clamp: Clamp,
    before: Waypoint,
    after: Waypoint,
    pairs: Sequence[Pair],
    reach: dict[PartName, float],
    cache: ModelCache,
) -> Iterator[Pair]:
    """Those of ``pairs`` that meet between two waypoints.

    A pair that is further apart in the middle of a stretch than its parts move on half of it does not meet there;
    what is nearer is asked again on both halves, until the stretch is shorter than `CONTACT`.
    """
    ways = {pair: _way(before, after, pair, reach) for pair in pairs}
    stretches = [(0.0, 1.0, [pair for pair in pairs if ways[pair] > 0.0])]
    while stretches:
        start, end, near = stretches.pop()
        middle, half = 0.5 * (start + end), 0.5 * (end - start)
        nearer = []
        for way in {ways[pair] for pair in near}:
            asked = [pair for pair in near if ways[pair] == way]
            scene = clamp_scene(clamp, _between(before, after, middle), clearance=way * half + 2.0 * CONTACT)
            result = check(scene, pairs=asked, cache=cache)
            for pair in asked:
                verdict = result.verdict(*pair)
                if verdict in _MEET or (verdict is not Verdict.CLEAR and way * half < CONTACT):
                    yield pair
                elif verdict is not Verdict.CLEAR:
                    nearer.append(pair)
        if nearer:
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
