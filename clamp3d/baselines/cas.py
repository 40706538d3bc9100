"""Concave Arc Surface contact: the groove as it is, measured by the closed forms of the 3D kernel."""

from __future__ import annotations

import numpy as np

from clamp3d.baselines.model import Pieces, pose_of, poses_of
from clamp3d.geometry.pose import Array
from clamp3d.kernel.contact_model import GroovePair
from clamp3d.kernel.distance import Feature, signed_distances
from clamp3d.kernel.pieces import groove_pieces

_SIDES = slice(0, 3)
"""Rows of `groove_pieces` that a wire through the whole groove can touch; the end faces are behind it."""
_NAMES = tuple(str(feature) for feature in Feature)


class Cas:
    """Arc against cylinder in closed form, for any pose; exact to rounding."""

    name = "cas"
    limits = ()
    meshes_built = 0

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to the arc surface and the two faces beside it, for a wire that passes through; see `ContactModel`."""
        T_a_b = pose_of(pair, T_a_b)
        measured = groove_pieces(pair.groove, pair.cylinder, (pair.T_groove_a @ T_a_b) @ pair.T_b_cylinder)
        R, p = pair.T_groove_a[:3, :3], pair.T_a_groove[:3, 3]
        feature = tuple(_NAMES[code] for code in measured.feature[_SIDES].tolist())
        return Pieces(
            measured.distance[_SIDES], (measured.point_on_groove[_SIDES] @ R) + p, measured.normal[_SIDES] @ R, feature
        )

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Signed distances (n,) for poses (n, 4, 4); see `ContactModel`."""
        poses = (pair.T_groove_a @ poses_of(pair, T_a_b)) @ pair.T_b_cylinder
        return signed_distances(pair.groove, pair.cylinder, np.ascontiguousarray(poses))
