"""Signed gaps of a groove's boundary pieces one by one, for solvers that need each as a smooth constraint."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.geometry.pose import Array, check_pose
from clamp3d.geometry.primitives import AnyCylinder, Capsule, Cylinder, SweptArc, check_shapes
from clamp3d.kernel.distance import RECORD, as_pose, kernel


@dataclass(frozen=True, slots=True)
class GroovePieces:
    """Answer of `groove_pieces`: one row per piece, in the groove's frame, mm.

    Rows: 0 arc surface with its edges, 1 flat face M with its lip, 2 flat face N with its lip, 3 end face -z,
    4 end face +z.

    Attributes
    ----------
    distance : ndarray (5,)
        Signed gaps.
    point_on_groove, normal : ndarray (5, 3)
        Nearest points, and unit vectors from groove to cylinder.
    feature : ndarray (5,)
        Codes of `Feature`.
    gradient : ndarray (5, 6)
        Rate of the gap by the cylinder's twist (3 linear, 3 angular about the groove's origin); with a tilted axis
        inside the material it is the rate at the deepest axis point.
    """

    distance: Array
    point_on_groove: Array
    normal: Array
    feature: NDArray[np.int8]
    gradient: Array


def groove_pieces(groove: SweptArc, cylinder: AnyCylinder, pose: ArrayLike) -> GroovePieces:
    """Signed gap of each closed boundary piece of a groove to a cylinder.

    While the capsule's axis is outside the material, each gap is the plain distance of the axis from the piece less the
    radius, and ``min(distance)`` is ``signed_distance(...).distance``. With the axis inside, the gaps of the pieces it
    came through stay negative and fall further, with normals that lead back out. In between, about a lip, the distance
    of arc and flat face is multiplied by a cosine, from 1 to -1, so it is less than the plain distance; and where the
    axis goes through a flat face, that distance is of the axis' ends and the face's edges, so it may be more.
    Each gap is continuous, and smooth where its nearest point is unique; the one exception is an axis that enters
    through an end face: there the side pieces change sign at once.
    A cylinder along the groove that sticks out of it has its end pieces equal to the nearest side piece: take rows 0
    to 2 alone for such cylinders.

    Parameters
    ----------
    groove, cylinder : SweptArc, Cylinder or Capsule
        The two shapes; of a cylinder the capsule about it is measured, whose gaps are never larger.
    pose : array_like (4, 4)
        ``T_groove_cylinder``, mm.

    Returns
    -------
    GroovePieces
        Gaps, points, normals and rates of the five pieces.

    Raises
    ------
    InputError
        For other shapes, or if ``pose`` is not a finite rigid matrix.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.geometry.pose import translation
    >>> groove, wire = SweptArc(12.0, np.pi / 3, 50.0), Capsule(15.0, 80.0)
    >>> gaps = groove_pieces(groove, wire, translation(0.0, 5.0, 0.0))  # too thick: it rests on the lips
    >>> gaps.distance[:3].round(3).tolist()
    [0.133, 0.133, 0.133]
    """
    if type(groove) is not SweptArc or type(cylinder) not in (Capsule, Cylinder):
        check_shapes(groove, cylinder)
    T = as_pose(pose)
    out = np.empty(5, RECORD)
    half, along = 0.5 * groove.length, 0.5 * cylinder.length
    if not kernel().pieces(T, groove.radius, groove.half_angle, half, cylinder.radius, along, out):
        return groove_pieces(groove, cylinder, check_pose(T))
    return GroovePieces(**{field.name: out[field.name] for field in fields(GroovePieces)})
