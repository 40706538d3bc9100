"""Convex object collision (type 2 of the paper): parts as oriented rectangles and disks in the section."""

from __future__ import annotations

import math
from dataclasses import dataclass

from clamp3d.core.pose import SectionPose


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle in a part's own section coordinates (mm), placed by the part's ``pose``."""

    pose: SectionPose
    left: float
    right: float
    top: float
    bottom: float

    def corners(self) -> list[tuple[float, float]]:
        """The four corners (x, y) in the section."""
        return [self.pose.point(u, v) for u in (self.left, self.right) for v in (self.top, self.bottom)]


def box_box(a: Box, b: Box) -> float:
    """Largest separation along the boxes' axes in mm: <= 0 exactly if they meet, never more than their distance.

    Separating axis theorem; between two corners the true distance is larger.

    >>> box_box(Box(SectionPose(0, 0), -1, 1, -1, 1), Box(SectionPose(5, 0), -1, 1, -1, 1))
    3.0
    """
    best = -math.inf
    for pose in (a.pose, b.pose):
        for angle in (pose.angle, pose.angle + 0.5 * math.pi):
            ax, ay = math.cos(angle), -math.sin(angle)
            pa = [ax * x + ay * y for x, y in a.corners()]
            pb = [ax * x + ay * y for x, y in b.corners()]
            best = max(best, min(pb) - max(pa), min(pa) - max(pb))
    return best


def box_disk(box: Box, centre: SectionPose, radius: float) -> float:
    """Signed distance from a box to a disk of ``radius`` about ``centre`` in mm.

    >>> box_disk(Box(SectionPose(0, 0), -1, 1, -1, 1), SectionPose(4, 5), 2.0)
    3.0
    """
    c, s = math.cos(box.pose.angle), math.sin(box.pose.angle)
    dx, dy = centre.x - box.pose.x, centre.y - box.pose.y
    u, v = dx * c - dy * s, dx * s + dy * c
    outside_u, outside_v = max(box.left - u, u - box.right), max(box.top - v, v - box.bottom)
    if max(outside_u, outside_v) <= 0.0:
        return max(outside_u, outside_v) - radius
    return math.hypot(max(outside_u, 0.0), max(outside_v, 0.0)) - radius
