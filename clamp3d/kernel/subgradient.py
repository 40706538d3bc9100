"""All rates of the signed distance at a pose where several places are equally near: its generalised gradient.

The generalised gradient of a function that is not smooth is the convex hull of the limits of its gradients at smooth
points nearby [Clarke, Optimization and Nonsmooth Analysis, 1983]. They are collected at poses a little away in many
directions, as in gradient sampling [Burke, Lewis and Overton, SIAM J. Optim. 15, 2005]: so two lips, the ends of a line
of contact and the rim of a face that lies on another one are all found by one rule.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import positive
from clamp3d.geometry.pose import Array, norm, rotation
from clamp3d.geometry.primitives import AnyCylinder, SweptArc, check_shapes
from clamp3d.kernel.distance import Feature, SignedDistance, as_pose, signed_distance, signed_distances

_TOLERANCE = 1e-7
"""Default tolerance in parts of the largest length."""
_SAME = 1e-3
"""Rates that differ by less are one; the angular part in parts of the arm."""


@dataclass(frozen=True, slots=True)
class GeneralisedGradient:
    """Answer of `generalised_gradient`.

    Attributes
    ----------
    rates : ndarray (k, 6)
        Rates of the distance by the cylinder's twist (3 linear, 3 angular about the groove's origin), one for each
        place that is active; every mean of them is a subgradient. Apart, the distance changes at first by the least
        of ``rates @ (v, w)`` in any direction.
    features : tuple of Feature
        What each belongs to.
    points : ndarray (k, 3)
        The nearest points of the groove.
    nearest : SignedDistance
        The answer at the pose itself.
    """

    rates: Array
    features: tuple[Feature, ...]
    points: Array
    nearest: SignedDistance

    @property
    def unique(self) -> bool:
        """Whether there is one rate only: the plain gradient."""
        return len(self.rates) == 1


def generalised_gradient(
    groove: SweptArc, cylinder: AnyCylinder, pose: ArrayLike, *, tolerance: float | None = None
) -> GeneralisedGradient:
    """Generalised gradient of `signed_distance`: the rates of all places that are equally near.

    Parameters
    ----------
    groove, cylinder : SweptArc, Cylinder or Capsule
        The two shapes.
    pose : array_like (4, 4)
        ``T_groove_cylinder``, mm.
    tolerance : float, optional
        Places farther than the nearest one by about this (mm) count too; 1e-7 of the largest length by default. The
        rates of several places are those at poses this far away.

    Returns
    -------
    GeneralisedGradient
        Rates, features and points.

    Raises
    ------
    InputError
        For other shapes, a pose that is not rigid or a tolerance that is not positive.

    Examples
    --------
    >>> from clamp3d.geometry.pose import translation
    >>> from clamp3d.geometry.primitives import Cylinder
    >>> groove, wire = SweptArc(12.0, np.pi / 3, 50.0), Cylinder(14.0, 80.0)
    >>> answer = generalised_gradient(groove, wire, translation(0.0, 5.0, 0.0))  # over both lips
    >>> answer.unique, sorted({str(feature) for feature in answer.features})
    (False, ['corner M', 'corner N', 'lip M', 'lip N'])
    """
    check_shapes(groove, cylinder)
    nearest = signed_distance(groove, cylinder, pose)
    T = as_pose(pose)
    arm = max(groove.radius, 0.5 * groove.length, cylinder.radius, 0.5 * cylinder.length, *np.abs(T[:3, 3]).tolist())
    step = _TOLERANCE * arm if tolerance is None else positive("tolerance", tolerance)
    moved_poses = np.array([_moved(T, v * [*[step] * 3, *[step / arm] * 3]) for v in _directions()])
    near = signed_distances(groove, cylinder, moved_poses, full=True)
    scale = np.array([1.0, 1.0, 1.0, *[arm] * 3])
    kept: list[int] = []
    for k, rate in enumerate(near.gradient / scale):
        if all(np.abs(rate - near.gradient[j] / scale).max() > _SAME for j in kept):
            kept.append(k)
    if len(kept) == 1:
        return GeneralisedGradient(nearest.gradient[None], (nearest.feature,), nearest.point_on_groove[None], nearest)
    return GeneralisedGradient(
        near.gradient[kept], tuple(Feature(int(near.feature[k])) for k in kept), near.point_on_groove[kept], nearest
    )


def _directions() -> Array:
    """Twists (m, 6) in the cube of side 2: along the axes, in their planes, and 200 more, always the same."""
    axes = np.vstack([np.eye(6), -np.eye(6)])
    planes = [a + b for a, b in itertools.combinations(axes, 2) if np.abs(a + b).max() > 0.0]
    return np.vstack([axes, planes, np.random.default_rng(0).uniform(-1.0, 1.0, (200, 6))])


def _moved(T: Array, twist: Array) -> Array:
    """The pose after a small motion in the groove's frame."""
    angle = norm(twist[3:])
    M = rotation(twist[3:], angle) if angle > 0.0 else np.eye(4)
    out = M @ T
    out[:3, 3] += twist[:3]
    return np.asarray(out)
