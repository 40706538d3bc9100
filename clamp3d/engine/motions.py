"""Two bodies, one of them moving: first contact and least distance on the whole way."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance
from clamp3d.engine.answer import Distance
from clamp3d.engine.distance import as_bounded
from clamp3d.engine.model import ModelCache
from clamp3d.engine.moving_groove import MovingInGroove
from clamp3d.engine.moving_pair import MovingPair
from clamp3d.engine.refine import measured
from clamp3d.engine.verdict import RESOLUTION
from clamp3d.errors import InputError
from clamp3d.geometry.motion import Motion, scene_pose
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc, place
from clamp3d.geometry.shapes import AnyShape
from clamp3d.kernel.distance import SignedDistance

_STATIONS = 33
"""Times at which it is looked how far a body goes from a bare groove, whose other faces are eight times as far away."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionDistance:
    """Answer of `first_contact` and `min_clearance`.

    Attributes
    ----------
    touches : bool or None
        Whether the bodies come within the margin (0 mm for `min_clearance`) of each other; None where a search ended
        before that was known.
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

    touches: bool | None
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
        Two bodies. A `SweptArc` and a `Cylinder` or `Capsule` are measured by the kernel, other pairs as `distance`
        measures them, to 1e-6 mm. A larger ``distance`` at a contact than ``margin`` means that the search ended
        early: all before is free, and they meet later.
    motion : Motion
        Moves b.
    T_a_b : array_like (4, 4), optional
        Pose of b at t = 0.
    margin : float
        Distance in mm that counts as contact; below 0, a depth, for a groove and a cylinder alone.
    resolution : float, optional
        For groove and cylinder: accuracy of the search in mm, 1e-6 by default.

    Raises
    ------
    InputError
        For anything that is no shape, motion, rigid pose or finite number.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.geometry.pose import translation
    >>> from clamp3d.geometry.primitives import Cylinder, SweptArc
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> hit = first_contact(groove, wire, Motion.translate((0.0, -40.0, 0.0)), translation(0.0, 20.0, 0.0))
    >>> hit.touches, round(hit.t, 12), hit.distance.method
    (True, 0.5375, 'groove kernel')
    """
    margin = place("margin", margin)
    pair = _moving_pair(a, b, motion, T_a_b, resolution)
    if margin < 0.0 and not isinstance(pair, MovingInGroove):
        raise InputError(f"margin must be >= 0 but for a groove and a cylinder, got {margin:g}")
    contact = pair.first_time(margin)
    first = None if contact is None else pair.reached(contact.t, margin)
    if first is not None:
        here = pair.at(first, measured)
        if here.upper <= margin + RESOLUTION:
            return _answer(pair, True, first, here)
    least, t = pair.least_distance()
    if first is not None and least.upper <= margin + RESOLUTION:  # the search ended early, and they meet later
        return _answer(pair, True, first, here)
    return _answer(pair, False if first is None or least.lower > margin else None, t, least)


def min_clearance(
    a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None = None, *, resolution: float | None = None
) -> MotionDistance:
    """Least signed distance of ``b``, moving in the frame of ``a``, on its whole way.

    Parameters and exceptions are those of `first_contact`.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.geometry.pose import translation
    >>> from clamp3d.geometry.primitives import Cylinder, SweptArc
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> least = min_clearance(groove, wire, Motion.translate((2.0, 0.0, 0.0)), translation(-1.0, -1.0, 0.0))
    >>> round(least.distance.value, 12), least.t
    (0.085786437627, 0.0)
    """
    pair = _moving_pair(a, b, motion, T_a_b, resolution)
    least, t = pair.least_distance()
    return _answer(pair, least.upper <= RESOLUTION, t, least)


def _moving_pair(
    a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None, resolution: float | None
) -> MovingPair:
    """The two bodies with the motion as a screw. Raises InputError for anything else."""
    instance("motion", motion, Motion)
    T = np.eye(4) if T_a_b is None else scene_pose(T_a_b, "T_a_b")
    screw = motion.resolved(T)
    if isinstance(a, SweptArc) and isinstance(b, (Cylinder, Capsule)):
        return MovingInGroove(a, b, screw, T, resolution)
    cache, is_bare = ModelCache(), isinstance(a, SweptArc) or isinstance(b, SweptArc)
    way = np.array([screw.at(t, T) for t in np.linspace(0.0, 1.0, _STATIONS if is_bare else 1)])
    still, moving = (cache.model(shape) for shape in as_bounded(a, b, way))
    return MovingPair(moving, still, screw, T, np.eye(4))


def _answer(pair: MovingPair, touches: bool | None, t: float, distance: Distance) -> MotionDistance:
    contact = pair.contact(t) if isinstance(pair, MovingInGroove) else None
    width = max(distance.upper - distance.lower, pair.accuracy)
    distance = _overlap(pair.as_seen(distance, t))
    return MotionDistance(touches, t, distance, pair.motion.at(t, pair.start), width, pair.evaluations, contact)


def _overlap(distance: Distance) -> Distance:
    """Of an overlap without what bounds its deepest point only: that bounds no depth, nor is its normal the way out."""
    return replace(distance.of_overlap(), normal=None) if distance.upper < -RESOLUTION else distance
