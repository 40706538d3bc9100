"""The motions of a scene: least distances and first contacts of all moving parts, motion by motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.broad import Boxes, near_between
from clamp3d.collide.depth import is_quick, penetration
from clamp3d.collide.model import Model, Progress
from clamp3d.collide.moving_pair import box_corners, first_time, least_distance
from clamp3d.collide.open_pair import moving_pair
from clamp3d.collide.reasons import failure, undecided
from clamp3d.collide.refine import with_normal
from clamp3d.collide.result import BAD, PairResult
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import RESOLUTION, Verdict
from clamp3d.collide.where import locator
from clamp3d.core.linear import to_target
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array
from clamp3d.errors import MissingLibraryError


def check_motions(
    scene: Scene,
    models: list[Model],
    asked: list[tuple[int, int]] | None,
    progress: Progress | None = None,
    depths: bool = True,
) -> tuple[PairResult, ...]:
    """Least distance of each moving part from each other part that it comes near, motion by motion.

    Where they clash, ``depths`` asks for the penetration depth at the deepest instant that was found: the least one
    that the motion has.
    Each motion starts where the one before has left the parts. What lies between two instants is bounded too, by the
    speed of the part's fastest point and by swept shapes: no thin part is stepped over.
    """
    poses = [part.T_world.copy() for part in scene.parts]
    boxes = Boxes.of(np.array([model.bounds for model in models]).reshape(-1, 2, 3), np.array(poses).reshape(-1, 4, 4))
    rows: list[PairResult] = []
    keep = None if asked is None else set(asked)
    for motion in scene.motions:
        moving = [scene.index(name) for name in dict.fromkeys(motion.parts)]  # one that is named twice moves once
        resolved = motion.resolved(poses[moving[0]])
        found = _near(scene, models, poses, boxes, moving, resolved)
        near = [p for p in found if keep is None or tuple(sorted(p)) in keep]
        for k, (i, j) in enumerate(near):
            if progress is not None:
                progress(f"motion {motion.name}", k, len(near))
            rows.append(_row(scene, models, poses, resolved, i, j, depths))
        for i in moving:
            poses[i] = resolved.at(1.0, poses[i])
        there = Boxes.of(np.array([models[i].bounds for i in moving]), np.array([poses[i] for i in moving]))
        for old, new in zip(boxes.arrays, there.arrays, strict=True):
            old[moving] = new
    return tuple(rows)


def _row(
    scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int, depths: bool
) -> PairResult:
    a, b = scene.parts[i].name, scene.parts[j].name
    thresholds, allowance = scene.thresholds, scene.allowance(a, b)
    try:
        pair = moving_pair(models[i], models[j], motion, poses[i], poses[j])
        least, t = least_distance(pair, thresholds, allowance)
        meets = least.upper <= thresholds.contact + RESOLUTION  # as the verdict counts it
        contact_at = first_time(pair, t, thresholds, thresholds.contact) if meets else None
        verdict = thresholds.verdict(least, allowance)
        deep = with_normal(least)
        if verdict in BAD:
            if depths and is_quick(pair.a, pair.b):
                deep = penetration(pair.a, pair.b, pair.pose(t), deep)
            deep = replace(deep.of_overlap(), interference=None)  # at another instant they may be deeper
    except MissingLibraryError:
        raise
    except Exception as error:  # one pair that fails is a finding, not the end of all others
        return PairResult(a, b, Verdict.FAILED, Distance(), motion.name, reason=failure(error))
    T = motion.at(t, poses[i])
    row = PairResult(a, b, verdict, deep.moved(T), motion.name, t, contact_at)
    if verdict in BAD:
        return replace(row, locate=locator(pair.a, pair.b, T, pair.pose(t)))
    if verdict is Verdict.UNCERTAIN:
        return replace(row, reason=undecided({a: pair.a, b: pair.b}, least, thresholds, allowance))
    return row


def _near(
    scene: Scene, models: list[Model], poses: list[Array], boxes: Boxes, moving: list[int], motion: Motion
) -> list[tuple[int, int]]:
    """Pairs (moving, standing) that come within reach: boxes around the ways against the standing ``boxes``."""
    stands = np.ones(len(models), dtype=bool)
    stands[moving] = False
    standing = np.flatnonzero(stands)
    if not len(standing):
        return []
    t = np.linspace(0.0, 1.0, 33)
    places = [motion.at(s) for s in t]
    corners = np.empty((len(moving), 2, 3))
    for k, i in enumerate(moving):
        points = box_corners(models[i], poses[i])
        way = np.concatenate([to_target(T, points) for T in places])
        slack = 0.5 * motion.speed(points) / (len(t) - 1)
        corners[k] = way.min(axis=0) - slack, way.max(axis=0) + slack
    low, high = corners[:, 0], corners[:, 1]
    ways = Boxes(0.5 * (low + high), 0.5 * (high - low), np.broadcast_to(np.eye(3), (len(moving), 3, 3)))
    still = Boxes(*(values[standing] for values in boxes.arrays))
    pairs = near_between(ways, still, scene.thresholds.reach)
    return [(moving[k], int(standing[j])) for k, j in pairs.tolist()]
