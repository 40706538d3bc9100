"""The motions of a scene: least distances and first contacts of all moving parts, motion by motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.broad import Boxes, near_pairs
from clamp3d.collide.depth import is_quick, penetration
from clamp3d.collide.model import Model, Progress
from clamp3d.collide.moving_pair import MovingPair, box_corners, first_time, least_distance
from clamp3d.collide.reasons import failure, undecided
from clamp3d.collide.refine import with_normal
from clamp3d.collide.result import BAD, PairResult
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Verdict
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
    rows: list[PairResult] = []
    keep = None if asked is None else set(asked)
    for motion in scene.motions:
        moving = [scene.index(name) for name in motion.parts]
        resolved = motion.resolved(poses[moving[0]])
        near = [p for p in _near(scene, models, poses, moving, resolved) if keep is None or tuple(sorted(p)) in keep]
        for k, (i, j) in enumerate(near):
            if progress is not None:
                progress(f"motion {motion.name}", k, len(near))
            rows.append(_row(scene, models, poses, resolved, i, j, depths))
        for i in moving:
            poses[i] = resolved.at(1.0, poses[i])
    return tuple(rows)


def _row(
    scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int, depths: bool
) -> PairResult:
    a, b = scene.parts[i].name, scene.parts[j].name
    thresholds, allowance = scene.thresholds, scene.allowance(a, b)
    try:
        pair = MovingPair(models[i], models[j], motion, poses[i], poses[j])
        least, t = least_distance(pair, thresholds, allowance)
        contact_at = first_time(pair, t, thresholds, thresholds.contact) if least.upper <= thresholds.contact else None
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
    scene: Scene, models: list[Model], poses: list[Array], moving: list[int], motion: Motion
) -> list[tuple[int, int]]:
    """Pairs (moving, standing) that come within reach: boxes around the ways against the standing boxes."""
    standing = [i for i in range(len(models)) if i not in moving]
    if not standing:
        return []
    bounds = np.array([models[i].bounds for i in standing])
    still = Boxes.of(bounds, np.array([poses[i] for i in standing]))
    found = []
    t = np.linspace(0.0, 1.0, 33)
    for i in moving:
        points = box_corners(models[i], poses[i])
        way = np.concatenate([to_target(motion.at(s), points) for s in t])
        slack = 0.5 * motion.speed(points) / (len(t) - 1)
        low, high = way.min(axis=0) - slack, way.max(axis=0) + slack
        around = Boxes(
            np.vstack([0.5 * (low + high), still.centre]),
            np.vstack([0.5 * (high - low), still.half]),
            np.concatenate([np.eye(3)[None], still.R]),
        )
        pairs = near_pairs(around, scene.thresholds.reach)
        found += [(i, standing[j - 1]) for a, j in pairs.tolist() if a == 0]
    return found
