"""Two bodies, one of them moving: first contact and least distance on the whole way."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance, positive
from clamp3d.collide.answer import Distance
from clamp3d.collide.closed_form import kernel_distance
from clamp3d.collide.model import ModelCache
from clamp3d.collide.moving_pair import ACCURACY, MovingPair
from clamp3d.collide.refine import measured, with_normal
from clamp3d.collide.verdict import RESOLUTION
from clamp3d.core.distance import SignedDistance, signed_distance
from clamp3d.core.motion import Motion, scene_pose
from clamp3d.core.motion_search import Outcome, first_time, least
from clamp3d.core.pose import Array
from clamp3d.core.primitives import Capsule, Cylinder, SweptArc, place
from clamp3d.core.shapes import AnyShape, as_shape
from clamp3d.errors import InputError

_RELATIVE = 1e-9
"""Accuracy of a search for a groove and a cylinder, relative to their largest size."""


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
        Two bodies. A `SweptArc` and a `Cylinder` or `Capsule` are measured by the kernel, other pairs as `distance`
        measures them, to 1e-6 mm. A larger ``distance`` at the answer than ``margin`` means that the search ended
        early, and only that all before is free.
    motion : Motion
        Moves b.
    T_a_b : array_like (4, 4), optional
        Pose of b at t = 0.
    margin : float
        Distance in mm that counts as contact; below 0, a depth, for a groove and a cylinder alone.
    resolution : float, optional
        For groove and cylinder: accuracy of the search in mm, 1e-9 of the largest size by default.

    Raises
    ------
    InputError
        For anything that is no shape, motion, rigid pose or finite number.

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
    kernel = _kernel_pair(a, b, motion, T_a_b, resolution)
    if kernel is not None:
        return kernel.first_contact(margin)
    if margin < 0.0:
        raise InputError(f"margin must be >= 0 but for a groove and a cylinder, got {margin:g}")
    pair = _moving_pair(a, b, motion, T_a_b)
    t = pair.first_time(margin)
    if t is None:
        least, t = pair.least_distance()
        return _answer(pair, False, t, least)
    here = pair.at(t, measured)
    return _answer(pair, True, t, here)


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
    kernel = _kernel_pair(a, b, motion, T_a_b, resolution)
    if kernel is not None:
        return kernel.least()
    pair = _moving_pair(a, b, motion, T_a_b)
    least, t = pair.least_distance()
    return _answer(pair, least.upper <= RESOLUTION, t, least)


def _start(motion: Motion, T_a_b: ArrayLike | None) -> tuple[Motion, Array]:
    """The motion as a screw, and the pose at its start. Raises InputError for anything else."""
    instance("motion", motion, Motion)
    T = np.eye(4) if T_a_b is None else scene_pose(T_a_b, "T_a_b")
    return motion.resolved(T), T


def _moving_pair(a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None) -> MovingPair:
    screw, T = _start(motion, T_a_b)
    cache = ModelCache()
    return MovingPair(cache.model(as_shape(b)), cache.model(as_shape(a)), screw, T, np.eye(4))


def _kernel_pair(
    a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None, resolution: float | None
) -> _KernelPair | None:
    """A groove and a cylinder, which the kernel measures; None for other bodies."""
    screw, T = _start(motion, T_a_b)
    if not (isinstance(a, SweptArc) and isinstance(b, (Cylinder, Capsule))):
        return None
    size = max(a.radius, a.length, b.radius, b.length)
    accuracy = _RELATIVE * size if resolution is None else positive("resolution", resolution)
    return _KernelPair(a, b, screw, T, accuracy)


@dataclass(frozen=True, slots=True, eq=False)
class _KernelPair:
    """A groove that stands and a cylinder that moves, ``T`` (4, 4) being its pose at the start."""

    groove: SweptArc
    cylinder: Cylinder | Capsule
    motion: Motion
    T: Array
    accuracy: float

    def _at(self, t: float) -> SignedDistance:
        return signed_distance(self.groove, self.cylinder, self.motion.at(t, self.T))

    def _bounds(self, t: float) -> tuple[float, float]:
        contact = self._at(t)
        return contact.distance - contact.error_bound, contact.distance + contact.error_bound

    @property
    def _speed(self) -> float:
        r, half = self.cylinder.radius, 0.5 * self.cylinder.length
        half += r if isinstance(self.cylinder, Capsule) else 0.0
        corners = np.array([(x, y, z) for x in (-r, r) for y in (-r, r) for z in (-half, half)])
        return self.motion.speed(corners @ self.T[:3, :3].T + self.T[:3, 3])

    def first_contact(self, margin: float) -> MotionDistance:
        """The first time at which they come within ``margin`` mm; else the least distance."""
        answer = first_time(self._bounds, self._speed, margin, accuracy=self.accuracy)
        if answer.outcome is Outcome.CLEAR:
            return replace(self.least(), touches=False)
        return self._answer(True, answer.t, self.accuracy, answer.evaluations)

    def least(self) -> MotionDistance:
        """The least distance on the whole way."""
        answer = least(self._bounds, self._speed, accuracy=self.accuracy)
        return self._answer(answer.upper <= 0.0, answer.t, max(0.0, answer.upper - answer.lower), answer.evaluations)

    def _answer(self, touches: bool, t: float, width: float, evaluations: int) -> MotionDistance:
        contact = self._at(t)
        distance = kernel_distance(contact)
        distance = replace(distance, lower=distance.lower - width)
        pose = self.motion.at(t, self.T)
        return MotionDistance(touches, t, _overlap(distance), pose, width, evaluations, contact)


def _answer(pair: MovingPair, touches: bool, t: float, distance: Distance) -> MotionDistance:
    pose = pair.motion.at(t, pair.start)
    width = max(distance.upper - distance.lower, ACCURACY)
    distance = _overlap(with_normal(distance.moved(pose).swapped()))
    return MotionDistance(touches, t, distance, pose, width, pair.evaluations)


def _overlap(distance: Distance) -> Distance:
    """Of an overlap without what bounds its deepest point only: that bounds no depth, nor is its normal the way out."""
    return replace(distance.of_overlap(), normal=None) if distance.upper < -RESOLUTION else distance
