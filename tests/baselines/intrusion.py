"""How far hulls reach into a groove."""

import numpy as np
from scipy.spatial import ConvexHull

from clamp3d.baselines.decomposition import Decomposition
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import inverse


def intrusion(decomposition: Decomposition, pair: GroovePair) -> float:
    """How far in mm the hulls reach into the groove: its radius less that of the thickest coaxial wire that is free.

    Exact for the hulls: the distance of the groove's axis, without end, from each hull's outline seen along it.
    """
    T = inverse(pair.T_a_groove)
    free = np.inf
    for hull in decomposition.hulls:
        seen = (hull.vertices @ T[:3, :3].T + T[:3, 3])[:, :2]
        outline = seen[ConvexHull(seen).vertices]
        along = np.roll(outline, -1, axis=0) - outline
        t = np.clip(-(outline * along).sum(1) / (along**2).sum(1), 0.0, 1.0)
        nearest = float(np.linalg.norm(outline + t[:, None] * along, axis=1).min())
        inside = bool((along[:, 0] * outline[:, 1] - along[:, 1] * outline[:, 0] <= 0.0).all())
        free = min(free, 0.0 if inside else nearest)
    return pair.groove.radius - free
