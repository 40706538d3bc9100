"""The motions of a scene: least distances and first contacts of all moving parts, motion by motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.broad import Boxes, near_between
from clamp3d.engine.depth import depth_of_pieces
from clamp3d.engine.model import Model, Progress, box_corners
from clamp3d.engine.moving_pair import MovingPair
from clamp3d.engine.reasons import failure, undecided
from clamp3d.engine.refine import with_normal
from clamp3d.engine.result import BAD, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import RESOLUTION, Verdict
from clamp3d.engine.where import Locator
from clamp3d.errors import MissingLibraryError
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, to_target

_STATIONS = 33
"""Times at which the box around a way is put together; what lies between is added as the way's speed allows."""


def check_motions(
    scene: Scene, models: list[Model], named: list[tuple[int, int]] | None, progress: Progress
) -> tuple[PairResult, ...]:
    """Least distance of each moving part from each other part that it comes near, motion by motion.

    Each motion starts where the one before has left the parts. What lies between two times is bounded too, by the
    speed of the part's fastest point and by swept shapes: no thin part is stepped over.
    """
    poses = [part.T_world.copy() for part in scene.parts]
    keep = None if named is None else set(named)
    rows: list[PairResult] = []
    for motion in scene.motions:
        moving = [scene.index(name) for name in dict.fromkeys(motion.parts)]  # one that is named twice moves once
        resolved = motion.resolved(poses[moving[0]])
        near = [
            (i, j)
            for i, j in _near(scene, models, poses, moving, resolved)
            if keep is None or (min(i, j), max(i, j)) in keep
        ]
        for k, (i, j) in enumerate(near):
            progress(f"motion {motion.name}", k, len(near))
            rows.append(_row(scene, models, poses, resolved, i, j))
        for i in moving:
            poses[i] = resolved.at(1.0, poses[i])
    return tuple(rows)


def _row(scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int) -> PairResult:
    """The row of a moving part ``i`` and a standing part ``j``."""
    a, b = scene.parts[i].name, scene.parts[j].name
    thresholds, allowance = scene.thresholds, scene.allowance(a, b)
    try:
        pair = MovingPair(models[i], models[j], motion, poses[i], poses[j])
        least, t = pair.least_distance(thresholds, allowance)
        meets = least.upper <= thresholds.contact + RESOLUTION  # as the verdict counts it
        first = pair.first_time(thresholds.contact + RESOLUTION, t) if meets else None
    except MissingLibraryError:
        raise
    except Exception as error:  # one pair that fails is a finding, not the end of all others
        return PairResult(a, b, Verdict.FAILED, Distance(), motion.name, reason=failure(error))
    verdict = thresholds.verdict(least, allowance)
    if verdict is not Verdict.CLASH and least.upper < -RESOLUTION:  # known, the depth decides, as at rest
        depth = depth_of_pieces(pair.a, pair.b, pair.pose(t))
        if depth is not None and thresholds.verdict(depth, allowance) is Verdict.CLASH:
            verdict, least = Verdict.CLASH, replace(depth, lower=-np.inf)
    distance = with_normal(least)
    if verdict in BAD:
        distance = replace(distance.of_overlap(), interference=None)  # at another time they may be deeper
    T = motion.at(t, poses[i])
    row = PairResult(a, b, verdict, distance.moved(T), motion.name, t, *(first or (None, None)))
    if verdict in BAD:
        return replace(row, locator=Locator(pair.a, pair.b, T, pair.pose(t)))
    if verdict is Verdict.UNCERTAIN:
        return replace(row, reason=undecided({a: pair.a, b: pair.b}, least, thresholds, allowance))
    return row


def _near(
    scene: Scene, models: list[Model], poses: list[Array], moving: list[int], motion: Motion
) -> list[tuple[int, int]]:
    """Pairs (moving, standing) that come within reach: boxes around the ways against the standing parts' boxes."""
    standing = [i for i in range(len(models)) if i not in set(moving)]
    if not standing:
        return []
    times = np.linspace(0.0, 1.0, _STATIONS)
    corners = np.empty((len(moving), 2, 3))
    for k, i in enumerate(moving):
        points = to_target(poses[i], box_corners(models[i].bounds))
        way = np.concatenate([to_target(T, points) for T in (motion.at(t) for t in times)])
        slack = 0.5 * motion.speed(points) / (len(times) - 1)
        corners[k] = way.min(axis=0) - slack, way.max(axis=0) + slack
    ways = Boxes.of(corners, np.broadcast_to(np.eye(4), (len(moving), 4, 4)))
    still = Boxes.of(np.array([models[i].bounds for i in standing]), np.array([poses[i] for i in standing]))
    pairs = near_between(ways, still, scene.thresholds.reach)
    return [(moving[k], standing[j]) for k, j in pairs.tolist()]
