"""The five relations of Table 3 for a cylinder and a groove in any pose, and how a relative pose is formed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.geometry.pose import Array, check_pose
from clamp3d.geometry.primitives import LARGEST, AnyCylinder, SweptArc, check_shapes
from clamp3d.kernel.arc_and_circle import ArcRelation, check_tolerance
from clamp3d.kernel.distance import Feature, SignedDistance, as_pose, signed_distance

Relation3D: TypeAlias = ArcRelation


@dataclass(frozen=True, slots=True)
class GrooveRelation:
    """Answer of `groove_relation`.

    Attributes
    ----------
    relation : Relation3D
        Column of Table 3, or uncertain.
    contact : SignedDistance
        The distance that it follows from.
    tolerance : float
        The one applied, mm.
    """

    relation: Relation3D
    contact: SignedDistance
    tolerance: float


def groove_relation(groove: SweptArc, cylinder: AnyCylinder, pose: ArrayLike, *, tolerance: float) -> GrooveRelation:
    """Relation of a cylinder to a groove in any pose; the plane case is Table 3.

    A distance within ``tolerance`` mm of zero is a contact, one below an intersection (Eq. 5). A contact is interior if
    the cylinder lies on the hollow side of the surface at the point, exterior otherwise; at a lip or an end edge that
    is the construction of Fig. 6, with the normal in place of the centre. A cylinder that is clear is inside if it has
    a point in common with the groove's hollow, the region between arc and chord over the groove's length (Eq. 3),
    else outside (Eq. 4). The answer is uncertain if the tolerance is below the distance's error bound and the distance
    is so near to zero that this matters.

    Parameters
    ----------
    groove, cylinder : SweptArc, Cylinder or Capsule
        The two shapes.
    pose : array_like (4, 4)
        ``T_groove_cylinder``, mm.
    tolerance : float
        Gaps up to this are contact, mm; >= 0 and less than both radii.

    Returns
    -------
    GrooveRelation
        The relation and the distance behind it.

    Raises
    ------
    InputError
        For a tolerance out of range, or a pose that is not rigid.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.geometry.pose import translation
    >>> from clamp3d.geometry.primitives import Cylinder
    >>> groove, wire = SweptArc(7.0, np.radians(60.0), 50.0), Cylinder(6.935, 80.0)
    >>> groove_relation(groove, wire, translation(0.0, -0.065, 0.0), tolerance=1e-9).relation.value
    'interior contact'
    """
    check_shapes(groove, cylinder)
    tolerance = check_tolerance(tolerance, groove.radius, cylinder.radius)
    contact = signed_distance(groove, cylinder, pose)
    return GrooveRelation(_relation(groove, cylinder, as_pose(pose), contact, tolerance), contact, tolerance)


def _relation(
    groove: SweptArc, cylinder: AnyCylinder, T: Array, contact: SignedDistance, tolerance: float
) -> Relation3D:
    gap, bound = contact.distance, contact.error_bound
    if tolerance < bound and abs(gap) <= tolerance + bound:
        return Relation3D.UNCERTAIN
    if gap < -tolerance:
        return Relation3D.INTERSECT
    if gap <= tolerance:
        return Relation3D.INTERIOR_CONTACT if _hollow_side(contact) else Relation3D.EXTERIOR_CONTACT
    return Relation3D.INSIDE if _reaches_hollow(groove, cylinder, T) else Relation3D.OUTSIDE


def _hollow_side(contact: SignedDistance) -> bool:
    if contact.feature in (Feature.FLAT_M, Feature.FLAT_N, Feature.END_FACE, Feature.END_EDGE_M, Feature.END_EDGE_N):
        return False
    q, n = contact.point_on_groove, contact.normal
    return bool(q[0] * n[0] + q[1] * n[1] < 0.0)


def _reaches_hollow(groove: SweptArc, cylinder: AnyCylinder, T: Array) -> bool:
    """Whether the cylinder meets the hollow, given that it is clear of the material.

    Hollow and material make up the block {y <= h, |z| <= H}, so it meets the one if it meets the other. The kernel
    measures the block as a groove that is too small to matter.
    """
    notch = SweptArc(max(1e-12 * groove.radius, 1.0 / LARGEST), 0.5 * math.pi, groove.length)
    above = T.copy()
    above[1, 3] += groove.radius * math.cos(groove.half_angle)
    return signed_distance(notch, cylinder, above).distance < 0.0


def relative_pose(T_world_a: ArrayLike, T_world_b: ArrayLike) -> Array:
    """Relative pose of two bodies from their world poses: offsets are subtracted before anything is multiplied.

    So a common offset of both bodies costs no more than its own rounding, where the product with an inverse loses
    1e-10 mm at an offset of 1e6 mm.

    Parameters
    ----------
    T_world_a, T_world_b : array_like (4, 4)
        Poses of the two bodies in the world, mm.

    Returns
    -------
    ndarray (4, 4)
        Pose of b in the frame of a.

    Raises
    ------
    InputError
        For a pose that is not rigid.

    Examples
    --------
    >>> from clamp3d.geometry.pose import translation
    >>> from clamp3d.geometry.primitives import Cylinder
    >>> relative_pose(translation(1e6, 0.0, 0.0), translation(1e6 + 0.5, 0.0, 0.0))[:3, 3].tolist()
    [0.5, 0.0, 0.0]
    """
    A, B = check_pose(T_world_a, "T_world_a"), check_pose(T_world_b, "T_world_b")
    T = np.eye(4)
    T[:3, :3] = A[:3, :3].T @ B[:3, :3]
    T[:3, 3] = A[:3, :3].T @ (B[:3, 3] - A[:3, 3])
    return T
