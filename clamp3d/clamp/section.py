"""The clamp in its section: ten numbers place the parts, gaps say what may not overlap.

Everything is seen from the up splint (P1 at rest), in the paper's section frame. The state q (10,) holds in mm: the two
wire centres x6, y6, x7, y7; d, how far below P1's origin the down splint's stands when it rests in the saddle's apex
(the bolt draws the saddle, and d is where that is); s = half width * tilt; the shifts b of the bolt in the up splint's
hole, v of the saddle on the bolt and w of the down splint in the saddle, 0 unless the clamp's joints have play; and u,
how high the round back stands over the saddle's arc, 0 unless the saddle's edges lift it off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from clamp3d.baselines.cas import Cas
from clamp3d.baselines.model import ContactModel, check_model
from clamp3d.checks import instance
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.matrix import Pair
from clamp3d.core.distance import Feature
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array, SectionPose
from clamp3d.core.primitives import LARGEST

SPLINTS: tuple[PartName, PartName] = ("P1", "P2")
WIRES: tuple[PartName, PartName] = ("P6", "P7")
D, S, B, V, W, U = 4, 5, 6, 7, 8, 9
"""Where the distance, the scaled tilt, the shifts of bolt, saddle and down splint, and its height over the saddle's arc
stand in the state q."""
SIZE = 10
"""Coordinates of a state."""

EDGE = "outer edge"
"""Feature of a splint's gap to a wire that has left its face sideways."""
EDGES = "saddle's edge"
"""Feature of the gap between the down splint's underside and the saddle."""
SEAT = "arc"
"""Feature of the gap between the round back and the saddle's arc: the last one of `Section.gaps`."""

_SPARE, _SPARE_OF_LEVER = 10.0, 0.2
"""How much wider than the wires need a clamp stands open, mm, and at most how much of its half width."""
_FAR = 1e3
"""Gap in mm of a piece that another one stands for."""


@dataclass(frozen=True, slots=True)
class Gaps:
    """Values (k,) mm of the gaps at a state, their derivatives (k, 10) by q (dimensionless), and what each one is.

    ``pair`` names the two parts, ``feature`` the piece; ``point`` (k, 2) is on one of them and ``normal`` (k, 2) leads
    from the first to the second, in P1's section frame (right, down).
    """

    value: Array
    gradient: Array
    pair: tuple[Pair, ...]
    feature: tuple[str, ...]
    point: Array
    normal: Array


_RIGHT_DOWN = np.array([1.0, -1.0])
"""Times a part's X and Z: its section coordinates."""
_Named = tuple[Pair, str]
_FACES: tuple[_Named, _Named] = ((("P1", "P2"), "left edge"), (("P1", "P2"), "right edge"))
"""The gaps between the inner faces."""
_FEATURES = {float(feature.value): str(feature) for feature in Feature}
"""Names of what the kernel says is nearest."""


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
    def pairs(self) -> dict[Pair, GroovePair]:
        """The clamp's grooves with what lies in them."""
        return groove_pairs(self.clamp)

    @cached_property
    def lever(self) -> float:
        """Half width of the down splint in mm: it turns the tilt into a length."""
        return self.clamp.down_splint.width / 2

    @cached_property
    def bolt_x(self) -> float:
        """Axis of the up splint's hole from P1's left edge in mm."""
        return self.clamp.up_splint.width / 2

    @cached_property
    def free(self) -> tuple[int, ...]:
        """The coordinates of q that move."""
        joints = self.clamp.joints
        shifts = ((B, joints.hole), (V, joints.washer), (W, joints.saddle))
        return (0, 1, 2, 3, D, S, *(i for i, plays in shifts if plays), U)

    @cached_property
    def play(self) -> tuple[float, float]:
        """How far the bolt may shift in the up splint's hole, and the saddle on the bolt; mm."""
        up, saddle, bolt = self.clamp.up_splint, self.clamp.saddle, self.clamp.bolt
        return 0.5 * (up.hole_diameter - bolt.diameter), 0.5 * (saddle.hole_diameter - bolt.diameter)

    def lift(self, w: float) -> tuple[float, float, float]:
        """How much higher the down splint rests when shifted by ``w`` in the saddle, mm, and its two derivatives.

        The round back rolls in the saddle's arc, and beyond it on a lip.
        """
        aside = abs(w)
        c, r, saddle = self.clamp.back_clearance, self.clamp.down_splint.back_radius, self.clamp.saddle
        to_lip = 0.5 * saddle.width - aside
        if r * aside <= c * to_lip:  # the arc's end, where both centres and the lip are on one line
            rest = math.sqrt(c * c - aside * aside)
            return aside * aside / (c + rest), math.copysign(aside / rest, w), c * c / rest**3
        rest = math.sqrt(max(r * r - to_lip * to_lip, 1e-12 * r * r))
        return rest - self._edge_below, math.copysign(to_lip / rest, w * to_lip), -r * r / rest**3

    def lifted(self, tilt: Array) -> Array:
        """How high (n,) over its arc the centred saddle's edges hold the down splint at a tilt (n,) in rad; mm."""
        half, under = 0.5 * self.clamp.saddle.width, self.clamp.down_splint.underside_depth
        return np.maximum(0.0, (under + half * np.abs(np.sin(tilt))) / np.cos(tilt) - self._edge_below)

    def down_splint(self, q: Array) -> SectionPose:
        """P2 seen from P1."""
        x, y, *_ = self._down(q).tolist()
        return SectionPose(x, y, float(q[S]) / self.lever)

    def _down(self, q: Array) -> Array:
        """x, y, cosine and sine of P2 seen from P1, and the derivatives of its lift by w."""
        _, _, _, _, d, scaled, b, v, w, u = q.tolist()
        lift, slope, bend = self.lift(w)
        angle = scaled / self.lever
        return np.array((self.bolt_x + b + v + w, d - lift - u, math.cos(angle), math.sin(angle), slope, bend))

    @property
    def least_slack(self) -> float:
        """Least difference of a wire's and its groove's radius in mm."""
        return min(abs(p.groove.radius - p.cylinder.radius) for p in self.pairs.values() if p.a != "P3")

    def mouth(self, wire: PartName) -> tuple[float, float]:
        """Where the up splint's groove begins and ends on its inner face, x in mm."""
        pair = self.pairs["P1", wire]
        half = pair.groove.radius * math.sin(pair.groove.half_angle)
        centre = float(pair.T_a_groove[0, 3])
        return centre - half, centre + half

    def reach(self, wire: PartName) -> tuple[float, float]:
        """Between which x a wire's centre is beside the bolt (shank at rest) and touches the up splint; mm."""
        r, bolt = self.pairs["P1", wire].cylinder.radius, self.clamp.bolt.diameter / 2
        if wire == "P6":
            return -r, self.bolt_x - bolt - r
        return self.bolt_x + bolt + r, self.clamp.up_splint.width + r

    def wire_limits(self, q: Array, wire: PartName) -> tuple[tuple[float, float], tuple[float, float]]:
        """Limits of a wire's (x, y) at a state: its mouth, and the bottoms of the two grooves that face each other.

        Parts of finite size are free behind their grooves too; a search must not put the wire there.
        """
        up, down = self.pairs["P1", wire], self.pairs["P2", wire]
        top = -up.T_a_groove[2, 3] - up.groove.radius
        centre = self.down_splint(q).point(down.T_a_groove[0, 3], -down.T_a_groove[2, 3])[1]
        return self.mouth(wire), (float(top), centre + down.groove.radius)

    def splint_distance(self, q: Array) -> float:
        """Height between the inner edges of the splints on the line side (the distance of Table 4); mm."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        return self.down_splint(q).point(-down.width / 2, down.face_depth)[1] - up.thickness

    def escaped(self, q: Array) -> tuple[PartName, ...]:
        """The wires whose centre is beside a splint: nothing leads them back."""
        half, pose = self.clamp.down_splint.width / 2, self.down_splint(q)
        c, s = math.cos(pose.angle), math.sin(pose.angle)
        found = []
        for i, wire in enumerate(WIRES):
            x, y = float(q[2 * i]), float(q[2 * i + 1])
            u = (x - pose.x) * c - (y - pose.y) * s
            if not (0.0 <= x <= self.clamp.up_splint.width and abs(u) <= half):
                found.append(wire)
        return tuple(found)

    def open_state(self, d: float, tilt: float = 0.0) -> Array:
        """State with the down splint at ``d`` and ``tilt``, both wires in the middle between their two arc centres.

        Where that is beside the up splint's mouth, in the bolt, or so deep that the wire would meet an inner face, it
        is put clear.
        """
        q = np.zeros(SIZE)
        q[D], q[S] = d, self.lever * tilt
        pose = self.down_splint(q)
        for i, wire in enumerate(WIRES):
            up, down = self.pairs["P1", wire].T_a_groove, self.pairs["P2", wire].T_a_groove
            q[2 * i : 2 * i + 2] = 0.5 * (np.array([up[0, 3], -up[2, 3]]) + pose.point(down[0, 3], -down[2, 3]))
            for low, high in (self.mouth(wire), self.reach(wire)):
                q[2 * i] = min(max(q[2 * i], low), high)
            r, face = self.pairs["P1", wire].cylinder.radius, self.clamp.down_splint.face_depth
            under = pose.point((q[2 * i] - pose.x) / math.cos(pose.angle), face)[1]
            low, high = self.clamp.up_splint.thickness + r, under - r / math.cos(pose.angle)
            if low <= high:
                q[2 * i + 1] = min(max(q[2 * i + 1], low), high)
        return q

    def open_distance(self) -> float:
        """A distance d at which the clamp stands open: both wires pass between the faces at any tilt; mm."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        thickest = 2.0 * max(self.clamp.line.radius, self.clamp.jumper.radius)
        spare = min(_SPARE, _SPARE_OF_LEVER * self.lever)
        return up.thickness - down.face_depth + thickest + self.lever * math.sin(self.clamp.tilt_stop) + spare

    def wire_gaps(self, q: Array, wire: PartName) -> Gaps:
        """Gaps of one wire to both splints, every piece of the contact model, and to the bolt."""
        return self._gaps(q, (wire,), stops=False)

    def gaps(self, q: Array) -> Gaps:
        """All gaps at a state: both wires, faces, stops."""
        return self._gaps(q, WIRES, stops=True)

    def face_gap(self, q: Array) -> float:
        """The least gap between the inner faces (convex object collision, type 2 of the paper); mm."""
        return float(self._gaps(q, (), stops=True).value[: len(_FACES)].min())

    def _gaps(self, q: Array, wires: tuple[PartName, ...], *, stops: bool) -> Gaps:
        from clamp3d.clamp import kernel_section  # compiled on first use

        q = np.ascontiguousarray(q)
        down = self._down(q)
        px, py, c, s, *_ = down.tolist()
        pieces: list[tuple[int, Array, Array]] = []
        pairs: tuple[Pair, ...] = ()
        features: tuple[str, ...] = ()
        for wire in wires:
            i = 2 * WIRES.index(wire)
            x, y = q[i : i + 2].tolist()
            dx, dy = x - px, y - py
            up, named = self._pieces("P1", wire, x, y)
            below, named_below = self._pieces("P2", wire, dx * c - dy * s, dx * s + dy * c, c, s)
            pieces.append((i, up, below))
            pairs += (("P1", wire),) * len(up) + (("P2", wire),) * len(below) + (("P4", wire),)
            features += (*named, *named_below, "shank")
        if stops:
            stop_pairs, stop_features = self._stops
            pairs, features = pairs + stop_pairs, features + stop_features
        k = len(pairs)
        value, gradient, place = np.empty(k), np.zeros((k, SIZE)), np.empty((k, 4))
        at = 0
        for i, up, below in pieces:
            rows = slice(at, at := at + len(up) + len(below) + 1)
            r = self.pairs["P1", WIRES[i // 2]].cylinder.radius
            bolt = self.bolt_x, 0.5 * self.clamp.bolt.diameter
            kernel_section.wire(q, down, i, *bolt, r, self.lever, up, below, value[rows], gradient[rows], place[rows])
        if stops:
            joints = self.clamp.joints
            walls = 2 if joints.washer or joints.saddle else 1  # centred, the slot's lower ends meet the shank first
            kernel_section.stops(
                q, down, self._sizes, joints.hole, joints.washer, walls, value[at:], gradient[at:], place[at:]
            )
        return Gaps(value, gradient, pairs, features, place[:, :2], place[:, 2:])

    @cached_property
    def _stops(self) -> tuple[tuple[Pair, ...], tuple[str, ...]]:
        """Pairs and features of the gaps that are no wire's."""
        joints = self.clamp.joints
        slot: _Named = (("P2", "P4"), "slot")
        side: list[_Named] = [(("P2", "P3"), EDGES), *[slot] * (2 if joints.washer or joints.saddle else 1)]
        side += [(("P1", "P4"), "hole")] * joints.hole + [(("P3", "P4"), "hole")] * joints.washer
        pairs, features = zip(*_FACES, *side, *side, (("P2", "P3"), SEAT), strict=True)
        return pairs, features

    @cached_property
    def _sizes(self) -> Array:
        """Dimensions in mm as the kernel of the stops takes them."""
        up, down, saddle, bolt = self.clamp.up_splint, self.clamp.down_splint, self.clamp.saddle, self.clamp.bolt
        return np.array(
            (
                *(self.bolt_x, 0.5 * bolt.diameter, self.lever, 0.5 * up.width, up.thickness, down.face_depth),
                *(0.5 * down.slot_width, down.slot_bottom, down.underside_depth),
                *(0.5 * saddle.width, self._edge_below, down.back_radius, *self.play),
            )
        )

    def wire_curvature(self, q: Array, splint: PartName, wire: PartName, force: Array, h: float) -> Array:
        """Second derivatives (10, 10) by q of ``force`` (k,) times a wire's gaps to a splint.

        The normals turn with the wire's place (u, v) in the splint's own axes: differences over ``h`` mm. How u and v
        follow from q is written out.
        """
        i = 2 * WIRES.index(wire)
        px, py, c, s, slope, bend = self._down(q).tolist() if splint == "P2" else (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        turn = np.array([[c, -s], [s, c]])
        u, v = dot(turn, q[i : i + 2] - (px, py)).tolist()

        def push(u: float, v: float) -> Array:
            return np.asarray(dot(force, self._pieces(splint, wire, u, v, c, s)[0][:, 3:5]))

        turning = np.column_stack([push(u + h, v) - push(u - h, v), push(u, v + h) - push(u, v - h)]) / (2.0 * h)
        by_q, found = np.zeros((2, SIZE)), np.zeros((SIZE, SIZE))
        by_q[:, i : i + 2] = turn
        if splint == "P2":
            by_q[:, B : W + 1] = -turn[:, :1]
            by_q[:, [D, U]] = np.column_stack([-turn[:, 1], turn[:, 1]])
            by_q[:, W] += slope * turn[:, 1]
            by_q[:, S] = np.array((-v, u)) / self.lever
            along, deep = push(u, v)
            found[S] = (deep * by_q[0] - along * by_q[1]) / self.lever
            found += found.T
            found[S, S] *= 0.5
            found[W, W] += bend * (along * turn[0, 1] + deep * turn[1, 1])
        return dot(dot(by_q.T, turning), by_q) + found

    @cached_property
    def _grooves(self) -> dict[Pair, tuple[float, ...]]:
        """Of each groove radius, half angle, half length, wire and its half length, centre and sense of the mouth."""
        found: dict[Pair, tuple[float, ...]] = {}
        for (splint, wire), pair in self.pairs.items():
            groove, r, T = pair.groove, pair.cylinder.radius, pair.T_a_groove
            sizes = groove.radius, groove.half_angle, 0.5 * groove.length, r, 0.5 * pair.cylinder.length
            mouth = 1.0 if splint == "P1" else -1.0
            found[splint, wire] = (*sizes, float(T[0, 3]), -float(T[2, 3]), mouth)
        return found

    def _pieces(
        self, splint: PartName, wire: PartName, u: float, v: float, c: float = 1.0, s: float = 0.0
    ) -> tuple[Array, tuple[str, ...]]:
        """The model's pieces for a wire at (u, v) in the splint's own axes (right, down), which is turned by (c, s).

        Gap, point and normal of each (k, 6; the last column is not used), and what it is. The faces end at the splint's
        outer edge: the groove's material has no end.
        """
        pair = self.pairs[splint, wire]
        self.queries.contact += 1
        feature: tuple[str, ...]
        if type(self.model) is Cas and abs(u) + abs(v) < LARGEST:
            from clamp3d.clamp.kernel_section import straight  # compiled on first use

            rows, work = np.empty((3, 6)), np.empty((3, 14))
            straight(*self._grooves[splint, wire], u, v, work, rows)
            feature = tuple([_FEATURES[code] for code in rows[:, 5].tolist()])
        else:
            T = np.array([c, 0.0, s, u, 0.0, 1.0, 0.0, 0.0, -s, 0.0, c, -v, 0.0, 0.0, 0.0, 1.0]).reshape(4, 4)
            found = self.model.pieces(pair, T)
            feature, flat = found.feature, (found.point[:, ::2] * _RIGHT_DOWN, found.normal[:, ::2] * _RIGHT_DOWN)
            rows = np.column_stack([found.distance, *flat, np.zeros(len(feature))])
        half, face, out = (
            (self.bolt_x, self.clamp.up_splint.thickness, 1.0)
            if splint == "P1"
            else (self.lever, self.clamp.down_splint.face_depth, -1.0)
        )
        middle = self.bolt_x if splint == "P1" else 0.0
        side = -1.0 if wire == "P6" else 1.0
        beyond = side * (u - middle) - half
        if beyond <= 0.0:
            return rows, feature
        above = max(out * (v - face), 0.0)
        away = math.hypot(beyond, above)
        gap = away - pair.cylinder.radius
        k = int(np.argmin(rows[:, 0]))
        rows[rows[:, 0] < gap, 0] = _FAR
        rows[k, :5] = gap, middle + side * half, face if above else v, side * beyond / away, out * above / away
        return rows, tuple(EDGE if i == k else name for i, name in enumerate(feature))

    @cached_property
    def _edge_below(self) -> float:
        """The saddle's edges below d, mm."""
        saddle = self.clamp.saddle
        return saddle.radius * math.cos(saddle.half_angle) - self.clamp.back_clearance
