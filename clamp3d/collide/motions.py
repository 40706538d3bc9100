"""Two bodies, one of them moving: first contact and least distance on the whole way."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance
from clamp3d.collide.answer import Distance
from clamp3d.collide.body import kernel_distance
from clamp3d.collide.model import ModelCache
from clamp3d.collide.moving_pair import ACCURACY, MovingPair, first_time, least_distance
from clamp3d.collide.open_pair import moving_pair
from clamp3d.collide.refine import measured, with_normal
from clamp3d.collide.verdict import RESOLUTION, Thresholds
from clamp3d.core.distance import SignedDistance
from clamp3d.core.motion import Motion, scene_pose
from clamp3d.core.groove_motion import Search
from clamp3d.core.pose import Array
from clamp3d.core.primitives import Capsule, Cylinder, SweptArc, place
from clamp3d.core.shapes import AnyShape, as_shape
from clamp3d.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class MotionDistance:
    """Answer of `first_contact` and `min_clearance`.

    Attributes
    ----------
    touches : bool
        Whether the bodies come within the margin (0 mm for `min_clearance`) of each other.
    t : float
        Normalised time from 0 to 1: of the first contact, or of the least distance.
    distance : Distance
        The distance at ``t``, points in a's frame; its ``lower`` holds for the whole motion where ``t`` is the time
        of the least distance.
    pose : ndarray (4, 4)
        Pose of b in a's frame at ``t``.
    resolution : float
        No contact deeper than this (mm) was missed before ``t``; no time has a distance lower by more.
    evaluations : int
        How many poses and stretches were looked at.
    contact : SignedDistance or None
        For a groove and a cylinder the kernel's own answer at ``t``, with the feature's name.
    """

    touches: bool
    t: float
    distance: Distance
    pose: Array
    resolution: float
    evaluations: int
    contact: SignedDistance | None = None


def first_contact(
    a: AnyShape,
    b: AnyShape,
    motion: Motion,
    T_a_b: ArrayLike | None = None,
    *,
    margin: float = 0.0,
    resolution: float | None = None,
) -> MotionDistance:
    """First time at which body ``b``, moving in the frame of ``a``, comes within ``margin`` mm of it.

    Branch and bound in the order of time: everything before the answer is proven to be free, so a contact is never
    reported late. If the margin is never reached the answer is the closest approach, with ``touches`` False.

    Parameters
    ----------
    a, b : Solid, MeshShape, Cylinder, Capsule or SweptArc
        Two bodies. For a `SweptArc` and a `Cylinder` or `Capsule` the kernel's search is used, to rounding; where a
        flat end decides, to 1e-9 of the largest size. Any other pair is at most 2e-4 mm further apart than ``margin``
        at the answer; a larger ``distance`` there means that the search ended early, and only that all before is free.
    motion : Motion
        Moves b.
    T_a_b : array_like (4, 4), optional
        Pose of b at t = 0.
    margin : float
        Distance in mm that counts as contact; below 0, a depth, for a groove and a cylinder alone.
    resolution : float, optional
        For groove and cylinder: depth in mm that may be missed, 1e-12 of the largest size by default (1e-9 where a
        flat end decides).

    Raises
    ------
    InputError
        For anything that is no shape, motion, rigid pose or finite number.
    SolverError
        If the search takes too many steps, or the motion goes so far that rounding moves it by more than the bodies.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.core.pose import translation
    >>> from clamp3d.core.primitives import Cylinder, SweptArc
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> hit = first_contact(groove, wire, Motion.translate((0.0, -40.0, 0.0)), translation(0.0, 20.0, 0.0))
    >>> hit.touches, round(hit.t, 12), hit.distance.method
    (True, 0.5375, 'groove kernel')
    """
    margin = place("margin", margin)
    pair = _searched(a, b, motion, T_a_b, resolution)
    if isinstance(pair, Search):
        return _from_kernel(pair, *pair.first_contact(margin))
    if margin < 0.0:
        raise InputError(f"margin must be >= 0 but for a groove and a cylinder, got {margin:g}")
    thresholds = Thresholds(max(margin, 1e-6))
    least, t = least_distance(pair, thresholds, None)
    touches = least.upper <= margin + RESOLUTION
    if touches:
        t = first_time(pair, t, thresholds, margin)
        least = pair.ask(t, measured, thresholds)
    return _from_search(pair, touches, t, least)


def min_clearance(
    a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None = None, *, resolution: float | None = None
) -> MotionDistance:
    """Least signed distance of ``b``, moving in the frame of ``a``, on its whole way.

    Parameters and exceptions are those of `first_contact`.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.core.pose import translation
    >>> from clamp3d.core.primitives import Cylinder, SweptArc
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> least = min_clearance(groove, wire, Motion.translate((2.0, 0.0, 0.0)), translation(-1.0, -1.0, 0.0))
    >>> round(least.distance.value, 12), least.t
    (0.085786437627, 0.0)
    """
    pair = _searched(a, b, motion, T_a_b, resolution)
    if isinstance(pair, Search):
        return _from_kernel(pair, None, *pair.least())
    least, t = least_distance(pair, Thresholds(1e-6), None)
    return _from_search(pair, least.upper <= RESOLUTION, t, least)


def _searched(
    a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None, resolution: float | None
) -> Search | MovingPair:
    instance("motion", motion, Motion)
    T = np.eye(4) if T_a_b is None else scene_pose(T_a_b, "T_a_b")
    motion = motion.resolved(T)
    if isinstance(a, SweptArc) and isinstance(b, (Cylinder, Capsule)):
        return Search(a, b, motion, T, resolution)
    cache = ModelCache()
    return moving_pair(cache.model(as_shape(b)), cache.model(as_shape(a)), motion, T, np.eye(4))


def _from_kernel(search: Search, touches: bool | None, t: float, slack: float) -> MotionDistance:
    contact = search.at(t)
    found = kernel_distance(contact)
    if touches is None:
        touches = found.upper <= 0.0
        found = replace(found, lower=found.lower - slack)
    return MotionDistance(touches, t, _overlap(found), search.pose(t), slack, search.evaluations, contact)


def _from_search(pair: MovingPair, touches: bool, t: float, found: Distance) -> MotionDistance:
    pose = pair.motion.at(t, pair.start)
    width = max(found.upper - found.lower, ACCURACY)
    return MotionDistance(
        touches, t, _overlap(with_normal(found.moved(pose).swapped())), pose, width, sum(pair.counters.queries.values())
    )


def _overlap(found: Distance) -> Distance:
    """Of an overlap without what bounds its deepest point only: that bounds no depth, nor is its normal the way out."""
    return replace(found.of_overlap(), normal=None) if found.upper < -RESOLUTION else found
