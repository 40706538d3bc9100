"""Lower bounds that hold for a whole stretch of a motion: one part still, the other's pieces swept.

A cylinder is swept into a longer and thicker one: sliding along its own axis costs nothing, so a pin in its bore
keeps its clearance over any stretch. A polyhedron is swept into the hull of its first and last position.
"""

from __future__ import annotations

import numpy as np

from clamp3d.geometry.pose import Array, inverse
from clamp3d.scene.convex import Convex, Rod, convex_bounds, hull
from clamp3d.scene.facets import axis_gap
from clamp3d.scene.model import Model
from clamp3d.scene.solid import Body, bore_rod


def swept_low(a: Model, b: Model, before: Array, middle: Array, after: Array, *, angle: float, reach: float) -> float:
    """Distance (mm) that ``b`` certainly keeps from ``a`` while it goes from ``before`` over ``middle`` to ``after``.

    All three (4, 4) in a's frame, evenly spaced on one screw; ``angle`` (rad) is turned between two of them, by points
    that are ``reach`` mm from the screw's axis at most.
    """
    # Between two of the poses a point strays from the straight line by the sagitta of its arc.
    sag = reach * 2.0 * np.sin(0.25 * min(abs(angle), np.pi)) ** 2 if abs(angle) < np.pi else 2.0 * reach
    there = (before, middle, after)
    back = tuple(inverse(T) for T in there)
    best = np.inf
    for x in a.forms:
        for y in b.forms:
            low = max(_one_way(x, y, there, sag, angle), _bores(y, x, back, sag, angle))
            best = min(best, low - x.error - y.error)
    for still, moving, poses in ((a, b, there), (b, a, back)):
        if still.facets is not None and moving.bodies is not None:
            lows = []
            for body in moving.bodies:
                rods = [piece for piece in body.outers if isinstance(piece, Rod)]
                if not rods:
                    break
                rod = _swept_rod(rods[0], poses, sag, angle)
                lows.append(axis_gap(still.facets, rod, poses[1]) - body.error)
            else:
                best = max(best, min(lows))
    return float(best)


def _one_way(still: Body, moving: Body, poses: tuple[Array, ...], sag: float, angle: float) -> float:
    best = _bores(still, moving, poses, sag, angle)
    for piece in still.outers:
        for other in moving.outers:
            if isinstance(other, Rod):
                swept: Convex = _swept_rod(other, poses, sag, angle)
                best = max(best, convex_bounds(piece, np.eye(4), swept, poses[1]).low)
            else:
                points = np.vstack([other.vertices @ T[:3, :3].T + T[:3, 3] for T in (poses[0], poses[2])])
                if abs(angle) > 0.0:
                    points = np.vstack([points, other.vertices @ poses[1][:3, :3].T + poses[1][:3, 3]])
                best = max(best, convex_bounds(piece, np.eye(4), hull(points), np.eye(4)).low - sag)
    return best


def _bores(still: Body, moving: Body, poses: tuple[Array, ...], sag: float, angle: float) -> float:
    best = -np.inf
    for bore in still.bores:
        for piece in moving.outers:
            if isinstance(piece, Rod):
                best = max(best, bore_rod(bore, _swept_rod(piece, poses, sag, angle), poses[1]).low)
    return best


def _swept_rod(rod: Rod, poses: tuple[Array, ...], sag: float, angle: float) -> Rod:
    """A rod, in its own part's frame at the middle pose, that holds the moving one all the time."""
    ends = rod.T[:3, 3] + np.outer([-0.5 * rod.length, 0.5 * rod.length], rod.T[:3, 2])
    home = inverse(poses[1] @ rod.T)
    local = np.vstack([(ends @ T[:3, :3].T + T[:3, 3]) @ home[:3, :3].T + home[:3, 3] for T in poses])
    tilt = rod.radius * np.sin(min(abs(angle), 0.5 * np.pi))
    low, high = float(local[:, 2].min() - sag - tilt), float(local[:, 2].max() + sag + tilt)
    aside = float(np.hypot(local[:, 0], local[:, 1]).max())
    T = rod.T.copy()
    T[:3, 3] += 0.5 * (low + high) * rod.T[:3, 2]
    return Rod(rod.radius + aside + sag, high - low, T)
