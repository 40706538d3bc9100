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

from clamp3d.baselines.model import ContactModel, Pieces, check_model
from clamp3d.checks import instance
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.matrix import Pair
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array, SectionPose

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


_Rows = tuple[Array, Array, Array, tuple[Pair, ...], tuple[str, ...], Array, Array]
"""Values, gradients, derivatives (k, 3) by the down splint's x, y and angle, pairs, features, points, normals."""
_Row = tuple[float, tuple[float, ...], tuple[float, float, float], Pair, str, tuple[float, float], tuple[float, float]]
_NONE = (0.0, 0.0, 0.0)
_RIGHT_DOWN = np.array([1.0, -1.0])
"""Times a part's X and Z: its section coordinates."""


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
        return SectionPose(*self._down(q))

    def _down(self, q: Array) -> tuple[float, float, float]:
        b, v, w = q[B : W + 1].tolist()
        return self.bolt_x + b + v + w, float(q[D]) - self.lift(w)[0] - float(q[U]), float(q[S]) / self.lever

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
        return self._moved(q, [self._wire_rows(q, wire, self._down(q))])

    def gaps(self, q: Array) -> Gaps:
        """All gaps at a state: both wires, faces, stops."""
        down = self._down(q)
        wires = [self._wire_rows(q, wire, down) for wire in WIRES]
        return self._moved(q, [*wires, self._face_rows(down), self._stop_rows(q, down)])

    def _moved(self, q: Array, rows: list[_Rows]) -> Gaps:
        """Rows joined, with what moves the down splint written out in the state's coordinates."""
        values, gradients, by, pairs, features, points, normals = zip(*rows, strict=True)
        gradient = np.concatenate(gradients) + np.concatenate(by) @ self._down_by(float(q[W]))
        point, normal = np.concatenate(points), np.concatenate(normals)
        return Gaps(np.concatenate(values), gradient, sum(pairs, ()), sum(features, ()), point, normal)

    def _down_by(self, w: float) -> Array:
        """Derivatives (3, 10) of the down splint's x, y and angle by q."""
        found = np.zeros((3, SIZE))
        found[0, B : W + 1] = found[1, D] = 1.0
        found[1, W], found[1, U], found[2, S] = -self.lift(w)[1], -1.0, 1.0 / self.lever
        return found

    def _wire_rows(self, q: Array, wire: PartName, pose: tuple[float, float, float]) -> _Rows:
        i = 2 * WIRES.index(wire)
        x, y = q[i : i + 2].tolist()
        px, py, angle = pose
        c, s = math.cos(angle), math.sin(angle)
        dx, dy = x - px, y - py
        up = self._pieces("P1", wire, x, y)
        down = self._pieces("P2", wire, dx * c - dy * s, dx * s + dy * c, c, s)
        k, n = len(up.distance), len(up.distance) + len(down.distance)
        value, by, point = np.empty(n + 1), np.zeros((n + 1, 3)), np.empty((n + 1, 2))
        gradient = np.zeros((n + 1, SIZE))
        value[:k], value[k:n] = up.distance, down.distance
        gradient[:k, i : i + 2] = up.normal[:, ::2] * _RIGHT_DOWN
        point[:k] = up.point[:, ::2] * _RIGHT_DOWN
        # Of the down splint's normals and points the section components in its own axes (right, down), then in P1's.
        normal, arm = down.normal[:, ::2] * _RIGHT_DOWN, down.point[:, ::2] * _RIGHT_DOWN
        turn = np.array([[c, -s], [s, c]])
        gradient[k:n, i : i + 2] = normal @ turn
        by[k:n, :2] = -gradient[k:n, i : i + 2]
        by[k:n, 2] = normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]
        point[k:n] = arm @ turn + (px, py)
        # The shank stands between the wires: each keeps to its side.
        side = -1.0 if wire == "P6" else 1.0
        bolt, r = self.clamp.bolt.diameter / 2, self.pairs["P1", wire].cylinder.radius
        axis = self.bolt_x + float(q[B])
        value[n], point[n] = side * (x - axis) - bolt - r, (axis + side * bolt, y)
        gradient[n, i], gradient[n, B] = side, -side
        pair: tuple[Pair, ...] = (("P1", wire),) * k + (("P2", wire),) * (n - k) + (("P4", wire),)
        return value, gradient, by, pair, (*up.feature, *down.feature, "shank"), point, gradient[:, i : i + 2].copy()

    def wire_curvature(self, q: Array, splint: PartName, wire: PartName, force: Array, h: float) -> Array:
        """Second derivatives (10, 10) by q of ``force`` (k,) times a wire's gaps to a splint.

        The normals turn with the wire's place (u, v) in the splint's own axes: differences over ``h`` mm. How u and v
        follow from q is written out.
        """
        i = 2 * WIRES.index(wire)
        px, py, angle = self._down(q) if splint == "P2" else (0.0, 0.0, 0.0)
        c, s = math.cos(angle), math.sin(angle)
        turn = np.array([[c, -s], [s, c]])
        u, v = (turn @ (q[i : i + 2] - (px, py))).tolist()

        def push(u: float, v: float) -> Array:
            return np.asarray(force @ self._pieces(splint, wire, u, v, c, s).normal[:, ::2] * _RIGHT_DOWN)

        turning = np.column_stack([push(u + h, v) - push(u - h, v), push(u, v + h) - push(u, v - h)]) / (2.0 * h)
        by_q, found = np.zeros((2, SIZE)), np.zeros((SIZE, SIZE))
        by_q[:, i : i + 2] = turn
        if splint == "P2":
            by_q += np.column_stack([-turn, (-v, u)]) @ self._down_by(float(q[W]))
            along, deep = push(u, v)
            found[S] = (deep * by_q[0] - along * by_q[1]) / self.lever
            found += found.T
            found[S, S] *= 0.5
            found[W, W] += self.lift(float(q[W]))[2] * (along * turn[0, 1] + deep * turn[1, 1])
        return by_q.T @ turning @ by_q + found

    def _pieces(self, splint: PartName, wire: PartName, u: float, v: float, c: float = 1.0, s: float = 0.0) -> Pieces:
        """The model's pieces for a wire at (u, v) in the splint's own axes (right, down), which is turned by (c, s).

        The faces end at the splint's outer edge: the groove's material has no end.
        """
        pair = self.pairs[splint, wire]
        self.queries.contact += 1
        found = self.model.pieces(
            pair, np.array([c, 0.0, s, u, 0.0, 1.0, 0.0, 0.0, -s, 0.0, c, -v, 0.0, 0.0, 0.0, 1.0]).reshape(4, 4)
        )
        half, face, out = (
            (self.bolt_x, self.clamp.up_splint.thickness, 1.0)
            if splint == "P1"
            else (self.lever, self.clamp.down_splint.face_depth, -1.0)
        )
        middle = self.bolt_x if splint == "P1" else 0.0
        side = -1.0 if wire == "P6" else 1.0
        beyond = side * (u - middle) - half
        if beyond <= 0.0:
            return found
        above = max(out * (v - face), 0.0)
        gap = math.hypot(beyond, above)
        distance, point, normal = found.distance.copy(), found.point.copy(), found.normal.copy()
        k = int(np.argmin(distance))
        distance[distance < gap - pair.cylinder.radius] = _FAR
        distance[k] = gap - pair.cylinder.radius
        point[k] = (middle + side * half, 0.0, -face if above else -v)
        normal[k] = (side * beyond / gap, 0.0, -out * above / gap)
        feature = tuple(EDGE if i == k else name for i, name in enumerate(found.feature))
        return Pieces(distance, point, normal, feature)

    def face_gap(self, q: Array) -> float:
        """The least gap between the inner faces, at an end of their overlap; mm.

        The splints are taken as their rectangles here (convex object collision, type 2 of the paper). The gap between
        two straight faces is least at an end of their overlap.
        """
        return float(self._face_rows(self._down(q))[0].min())

    def _face_rows(self, pose: tuple[float, float, float]) -> _Rows:
        up, down = self.clamp.up_splint, self.clamp.down_splint
        v, half = down.face_depth, self.lever
        px, py, angle = pose
        c, s = math.cos(angle), math.sin(angle)
        value, by, point, normal = [], [], [], []
        for side in (-1.0, 1.0):
            u = side * half
            corner_x, edge_x = px + u * c + v * s, self.bolt_x + side * up.width / 2
            if side * (corner_x - edge_x) <= 0.0:  # P2's corner under P1's face
                value.append(py - u * s + v * c - up.thickness)
                by.append((0.0, 1.0, px - corner_x))
                point.append((corner_x, up.thickness))
                normal.append((0.0, 1.0))
            else:  # P1's edge over P2's face
                x, y = edge_x - px, up.thickness - py
                value.append(v - (x * s + y * c))
                by.append((s, c, y * s - x * c))
                point.append((edge_x, up.thickness))
                normal.append((s, c))
        return (
            np.array(value),
            np.zeros((2, SIZE)),
            np.array(by),
            (("P1", "P2"),) * 2,
            ("left edge", "right edge"),
            np.array(point),
            np.array(normal),
        )

    def _stop_rows(self, q: Array, pose: tuple[float, float, float]) -> _Rows:
        """What ends the down splint's tilt and slide, and carries it.

        Its underside on the saddle's edges, its slot on the shank (Table 2 of the paper), the joints' play, and its
        round back in the saddle's arc.
        """
        clamp, down, saddle, joints = self.clamp, self.clamp.down_splint, self.clamp.saddle, self.clamp.joints
        r = clamp.bolt.diameter / 2
        (px, py, angle), (b, v, w, u) = pose, q[B:].tolist()
        c, s = math.cos(angle), math.sin(angle)
        axis, half = self.bolt_x + b, down.slot_width / 2
        hole, washer = self.play
        # The centre of the saddle's arc stands back_clearance above the state's d.
        edge_y = float(q[D]) + self._edge_below
        rows: list[_Row] = []
        # Centred, the slot's lower ends meet the shank first.
        walls = (self._slot_bottom, down.face_depth) if joints.washer or joints.saddle else (self._slot_bottom,)
        for side in (-1.0, 1.0):
            edge_x = axis + v + side * saddle.width / 2
            x, y = edge_x - px, edge_y - py
            own = (c, 0.0, s, s, 0.0, 0.0)
            by = (-s, -c, x * c - y * s)
            gap = x * s + y * c - down.underside_depth
            rows.append((gap, own, by, ("P2", "P3"), EDGES, (edge_x, edge_y), (s, c)))
            for end in walls:
                x, y = px + side * half * c + end * s, py - side * half * s + end * c
                gap = side * (x - axis) - r
                by = (side, 0.0, side * (y - py))
                rows.append((gap, (0.0, 0.0, -side, 0.0, 0.0, 0.0), by, ("P2", "P4"), "slot", (x, y), (-side, 0.0)))
            if joints.hole:
                at, own = (axis + side * r, 0.5 * clamp.up_splint.thickness), (0.0, 0.0, -side, 0.0, 0.0, 0.0)
                rows.append((hole - side * b, own, _NONE, ("P1", "P4"), "hole", at, (-side, 0.0)))
            if joints.washer:
                at, own = (axis - side * r, float(q[D]) + down.back_radius), (0.0, 0.0, 0.0, -side, 0.0, 0.0)
                rows.append((washer - side * v, own, _NONE, ("P3", "P4"), "hole", at, (side, 0.0)))
        # The height over the arc, square to it.
        _, slope, bend = self.lift(w)
        upright = 1.0 / math.hypot(1.0, slope)
        nx, own = slope * upright, (0.0, 0.0, 0.0, 0.0, -u * slope * bend * upright**3, upright)
        at = px + down.back_radius * nx, py + down.back_radius * upright
        rows.append((u * upright, own, _NONE, ("P2", "P3"), SEAT, at, (nx, upright)))
        value, own_rows, by_rows, pairs, names, points, normals = zip(*rows, strict=True)
        gradient = np.zeros((len(rows), SIZE))
        gradient[:, D:] = own_rows
        return np.array(value), gradient, np.array(by_rows), pairs, names, np.array(points), np.array(normals)

    @cached_property
    def _slot_bottom(self) -> float:
        return self.clamp.down_splint.slot_bottom

    @cached_property
    def _edge_below(self) -> float:
        """The saddle's edges below d, mm."""
        saddle = self.clamp.saddle
        return saddle.radius * math.cos(saddle.half_angle) - self.clamp.back_clearance
