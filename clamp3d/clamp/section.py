"""The clamp in its section: six numbers place the wires and the down splint, gaps say what may not overlap.

Everything is seen from the up splint (P1 at rest), in the paper's section frame. The state q holds (x6, y6, x7, y7,
d, s) in mm: the two wire centres, the down splint's origin d below P1's along the bolt, and s = half width * tilt.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from clamp3d.baselines.model import ContactModel, check_model
from clamp3d.checks import instance
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array, SectionPose, inverse

SPLINTS: tuple[PartName, PartName] = ("P1", "P2")
WIRES: tuple[PartName, PartName] = ("P6", "P7")
D, S = 4, 5
"""Where the down splint's distance and scaled tilt stand in the state q."""

MOUTH = "mouth"
"""Feature of the gaps that keep a wire in the mouth it was put into."""


_SPARE, _SPARE_OF_LEVER = 10.0, 0.2
"""How much wider than the wires need a clamp stands open, mm, and at most how much of its half width."""


@dataclass(frozen=True, slots=True)
class Gaps:
    """Values (k,) mm of the gaps at a state, their derivatives (k, 6) by q (dimensionless), and what each one is.

    ``pair`` names the two parts, ``feature`` the piece; ``point`` (k, 2) is on the first part in P1's section frame.
    """

    value: Array
    gradient: Array
    pair: tuple[tuple[PartName, PartName], ...]
    feature: tuple[str, ...]
    point: Array


@dataclass
class Queries:
    """How often the contact model was asked about a groove and a wire: C of Table 5."""

    contact: int = 0


@dataclass(frozen=True)
class Section:
    """A clamp whose grooves are measured by ``model``; counts its queries."""

    clamp: Clamp
    model: ContactModel
    queries: Queries = field(default_factory=Queries)

    def __post_init__(self) -> None:
        instance("clamp", self.clamp, Clamp)
        check_model(self.model)

    @cached_property
    def pairs(self) -> dict[tuple[PartName, PartName], GroovePair]:
        """The clamp's grooves with what lies in them."""
        return groove_pairs(self.clamp)

    @property
    def lever(self) -> float:
        """Half width of the down splint in mm: it turns the tilt into a length."""
        return self.clamp.down_splint.width / 2

    @property
    def bolt_x(self) -> float:
        """Bolt axis from P1's left edge in mm."""
        return self.clamp.up_splint.width / 2

    def down_splint(self, q: Array) -> SectionPose:
        """P2 seen from P1."""
        return SectionPose(self.bolt_x, float(q[D]), float(q[S]) / self.lever)

    @property
    def least_slack(self) -> float:
        """Least difference of a wire's and its groove's radius in mm."""
        return min(abs(p.groove.radius - p.cylinder.radius) for p in self.pairs.values() if p.a != "P3")

    def bounds(self) -> list[tuple[float, float]]:
        """Limits of q: each wire stays in the mouth it was put into (a longer way out exists, but no wire takes it)."""
        limits = [(-np.inf, np.inf)] * 6
        for i, wire in enumerate(WIRES):
            pair = self.pairs["P1", wire]
            half_mouth = pair.groove.radius * math.sin(pair.groove.half_angle)
            centre = float(pair.T_a_groove[0, 3])
            limits[2 * i] = (centre - half_mouth, centre + half_mouth)
        return limits

    def wire_limits(self, q: Array, wire: PartName) -> tuple[tuple[float, float], tuple[float, float]]:
        """Limits of a wire's (x, y) at a state: its mouth, and the bottoms of the two grooves that face each other.

        Parts of finite size are free behind their grooves too; a search must not put the wire there.
        """
        i = WIRES.index(wire)
        up, down = self.pairs["P1", wire], self.pairs["P2", wire]
        top = -up.T_a_groove[2, 3] - up.groove.radius
        centre = self.down_splint(q).point(down.T_a_groove[0, 3], -down.T_a_groove[2, 3])[1]
        return self.bounds()[2 * i], (float(top), centre + down.groove.radius)

    def splint_distance(self, q: Array) -> float:
        """Height between the inner edges of the splints on the line side (the distance of Table 4); mm."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        return self.down_splint(q).point(-down.width / 2, down.face_depth)[1] - up.thickness

    def open_state(self, d: float, tilt: float = 0.0) -> Array:
        """State with the down splint at ``d`` and ``tilt``, both wires in the middle between their two arc centres.

        Where that is beside the up splint's mouth, or so deep that the wire would meet an inner face, it is put clear.
        """
        q = np.array([0.0, 0.0, 0.0, 0.0, d, self.lever * tilt])
        pose = self.down_splint(q)
        for i, wire in enumerate(WIRES):
            up, down = self.pairs["P1", wire].T_a_groove, self.pairs["P2", wire].T_a_groove
            q[2 * i : 2 * i + 2] = 0.5 * (np.array([up[0, 3], -up[2, 3]]) + pose.point(down[0, 3], -down[2, 3]))
            q[2 * i] = min(max(q[2 * i], self.bounds()[2 * i][0]), self.bounds()[2 * i][1])
            r, face = self.pairs["P1", wire].cylinder.radius, self.clamp.down_splint.face_depth
            under = pose.point((q[2 * i] - pose.x) / math.cos(pose.angle), face)[1]
            low, high = self.clamp.up_splint.thickness + r, under - r / math.cos(pose.angle)
            if low <= high:
                q[2 * i + 1] = min(max(q[2 * i + 1], low), high)
        return q

    def open_distance(self) -> float:
        """A distance d at which the clamp stands open: both wires pass between the faces at any allowed tilt; mm."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        thickest = 2.0 * max(self.clamp.line.radius, self.clamp.jumper.radius)
        spare = min(_SPARE, _SPARE_OF_LEVER * self.lever)
        return up.thickness - down.face_depth + thickest + self.lever * math.sin(down.max_tilt) + spare

    def wire_gaps(self, q: Array, wire: PartName) -> Gaps:
        """Gaps of one wire to both splints, every piece of the contact model."""
        i = 2 * WIRES.index(wire)
        T_wire = SectionPose(q[i], q[i + 1]).T()
        T_down = self.down_splint(q).T()
        R, p = T_down[:3, :3], T_down[:3, 3]
        up = self.model.pieces(self.pairs["P1", wire], T_wire)
        down = self.model.pieces(self.pairs["P2", wire], inverse(T_down) @ T_wire)
        self.queries.contact += 2
        k, n = len(up.distance), len(up.distance) + len(down.distance)
        normal, arm = down.normal @ R.T, down.point @ R.T
        gradient, point = np.zeros((n, 6)), np.empty((n, 2))
        gradient[:k, i], gradient[:k, i + 1] = up.normal[:, 0], -up.normal[:, 2]
        gradient[k:, i], gradient[k:, i + 1] = normal[:, 0], -normal[:, 2]
        # The gap falls by what the groove's point moves along the normal: P2 moves down by d and turns about -Y.
        gradient[k:, D] = normal[:, 2]
        gradient[k:, S] = (normal[:, 0] * arm[:, 2] - normal[:, 2] * arm[:, 0]) / self.lever
        point[:k, 0], point[:k, 1] = up.point[:, 0], -up.point[:, 2]
        point[k:, 0], point[k:, 1] = arm[:, 0] + p[0], -(arm[:, 2] + p[2])
        pair: tuple[tuple[PartName, PartName], ...] = (("P1", wire),) * k + (("P2", wire),) * (n - k)
        return Gaps(np.concatenate([up.distance, down.distance]), gradient, pair, up.feature + down.feature, point)

    def face_gaps(self, q: Array) -> Gaps:
        """Gaps between the inner faces along the bolt, at both ends of their overlap, and to the tilt limits.

        The splints are taken as their rectangles here (convex object collision, type 2 of the paper). The gap between
        two straight faces is least at an end of their overlap.
        """
        up, down = self.clamp.up_splint, self.clamp.down_splint
        pose, v, half = self.down_splint(q), down.face_depth, down.width / 2
        c, s = math.cos(pose.angle), math.sin(pose.angle)
        value, gradient, point = np.empty(4), np.zeros((4, 6)), np.zeros((4, 2))
        for k, side in enumerate((-1, 1)):
            corner_x = pose.point(side * half, v)[0]
            edge_x = self.bolt_x + side * up.width / 2
            if side * (corner_x - edge_x) <= 0.0:  # P2's corner under P1's face
                u, x = side * half, corner_x
                slope = -u * c - v * s
            else:  # P1's edge over P2's face
                x = edge_x
                u = (x - pose.x - v * s) / c
                slope = -(x - pose.x) / c**2 + v * s / c**2
            y = pose.y - u * s + v * c
            value[k] = y - up.thickness
            gradient[k, D], gradient[k, S] = 1.0, slope / self.lever
            point[k] = (x, up.thickness)
        limit = self.lever * down.max_tilt
        value[2:] = limit - q[S], limit + q[S]
        gradient[2:, S] = -1.0, 1.0
        point[2:] = (pose.x, pose.y + down.back_radius)
        pairs: tuple[tuple[PartName, PartName], ...] = (("P1", "P2"), ("P1", "P2"), ("P2", "P4"), ("P2", "P4"))
        return Gaps(value, gradient, pairs, ("left edge", "right edge", "tilt limit", "tilt limit"), point)

    def mouth_gaps(self, q: Array) -> Gaps:
        """Ways left to each wire's centre before it slips out of the up splint's mouth, to both sides."""
        value, gradient = np.empty(4), np.zeros((4, 6))
        for i, (low, high) in enumerate(self.bounds()[:4:2]):
            value[2 * i : 2 * i + 2] = q[2 * i] - low, high - q[2 * i]
            gradient[2 * i : 2 * i + 2, 2 * i] = 1.0, -1.0
        point = np.repeat(q[:4].reshape(2, 2), 2, axis=0)
        pair: tuple[tuple[PartName, PartName], ...] = (("P1", "P6"), ("P1", "P6"), ("P1", "P7"), ("P1", "P7"))
        return Gaps(value, gradient, pair, (MOUTH,) * 4, point)

    def gaps(self, q: Array) -> Gaps:
        """All gaps at a state: both wires, faces, tilt limits, mouths."""
        return join(self.wire_gaps(q, "P6"), self.wire_gaps(q, "P7"), self.face_gaps(q), self.mouth_gaps(q))


def remembered(function: Callable[[Array], Gaps]) -> Callable[[Array], Gaps]:
    """The function with its last answer kept: solvers ask for values and derivatives one after the other."""
    last: dict[bytes, Gaps] = {}

    def gaps(x: Array) -> Gaps:
        key = x.tobytes()
        if key not in last:
            last.clear()
            last[key] = function(x)
        return last[key]

    return gaps


def join(*parts: Gaps) -> Gaps:
    """One `Gaps` of several."""
    return Gaps(
        np.concatenate([g.value for g in parts]),
        np.concatenate([g.gradient for g in parts]),
        sum((g.pair for g in parts), ()),
        sum((g.feature for g in parts), ()),
        np.concatenate([g.point for g in parts]),
    )
