"""The clamp in its section: ten numbers place the parts, gaps say what may not overlap.

Everything is seen from the up splint (P1 at rest), in the paper's section frame. The state q (10,) holds in mm: the two
wire centres x6, y6, x7, y7; d, how far below P1's origin the down splint's stands when it rests in the saddle's apex
(the bolt draws the saddle, and d is where that is); s = half width * tilt; the shifts b of the bolt in the up splint's
hole, v of the saddle on the bolt and w of the down splint in the saddle, 0 unless the clamp's joints have play; and u,
how high the round back stands over the saddle's arc, 0 unless the saddle's edges lift it off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from clamp3d.baselines.model import ContactModel, check_model
from clamp3d.checks import instance
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.matrix import Pair
from clamp3d.geometry.pose import Array, SectionPose
from clamp3d.kernel.contact_model import GroovePair

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
_FAR = 1e3
"""Gap in mm of a piece that another one stands for."""
Point = Sequence[float]
"""Right and down in a section, mm."""


@dataclass(slots=True)
class _Gap:
    """One of `Gaps`; ``gradient`` has the length 10."""

    pair: Pair
    feature: str
    value: float
    gradient: list[float]
    point: Point
    normal: Point


@dataclass(slots=True)
class _Pieces:
    """Pieces of a contact model in a splint's own axes (right, down): gaps in mm, points, normals and names."""

    value: list[float]
    point: list[Point]
    normal: list[Point]
    feature: list[str]


@dataclass(frozen=True, slots=True)
class _Down:
    """Where P2 stands, seen from P1: place in mm, cosine and sine of its angle, derivatives of its lift by w."""

    x: float
    y: float
    cos: float
    sin: float
    slope: float
    bend: float
    lever: float

    def seen(self, x: float, y: float) -> tuple[float, float]:
        """A point of P1's axes in P2's."""
        dx, dy = x - self.x, y - self.y
        return dx * self.cos - dy * self.sin, dx * self.sin + dy * self.cos

    def turned(self, u: float, v: float) -> tuple[float, float]:
        """A direction of P2's axes in P1's."""
        return u * self.cos + v * self.sin, v * self.cos - u * self.sin

    def point(self, u: float, v: float) -> tuple[float, float]:
        """A point of P2's axes in P1's."""
        x, y = self.turned(u, v)
        return x + self.x, y + self.y

    def gradient(self, by_x: float, by_y: float, by_angle: float) -> list[float]:
        """Derivatives by the state of what changes so with P2's place and angle."""
        by_w = by_x - self.slope * by_y
        return [0.0, 0.0, 0.0, 0.0, by_y, by_angle / self.lever, by_x, by_x, by_w, -by_y]


_AT_REST = _Down(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def _at_wire(i: int, nx: float, ny: float, gradient: list[float]) -> list[float]:
    """A gradient, with what the place of the wire at the coordinates i, i + 1 changes."""
    gradient[i], gradient[i + 1] = nx, ny
    return gradient


def _collect(rows: list[_Gap]) -> Gaps:
    return Gaps(
        np.array([row.value for row in rows]),
        np.array([row.gradient for row in rows]),
        tuple(row.pair for row in rows),
        tuple(row.feature for row in rows),
        np.array([row.point for row in rows]),
        np.array([row.normal for row in rows]),
    )


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
        down = self._down(q)
        return SectionPose(down.x, down.y, float(q[S]) / self.lever)

    def _down(self, q: Array) -> _Down:
        _, _, _, _, d, scaled, b, v, w, u = q.tolist()
        lift, slope, bend = self.lift(w)
        angle = scaled / self.lever
        x, y = self.bolt_x + b + v + w, d - lift - u
        return _Down(x, y, math.cos(angle), math.sin(angle), slope, bend, self.lever)

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
        return _collect(self._wire(q, self._down(q), wire))

    def gaps(self, q: Array) -> Gaps:
        """All gaps at a state: both wires, faces, stops."""
        down = self._down(q)
        return _collect([*self._wire(q, down, "P6"), *self._wire(q, down, "P7"), *self._stops(q, down)])

    def face_gap(self, q: Array) -> float:
        """The least gap between the inner faces (convex object collision, type 2 of the paper); mm."""
        return min(row.value for row in self._faces(self._down(q)))

    def _wire(self, q: Array, down: _Down, wire: PartName) -> list[_Gap]:
        """Gaps of a wire to both splints and to the shank, which stands between the wires: each keeps to its side."""
        i, rows = 2 * WIRES.index(wire), []
        x, y = q[i : i + 2].tolist()
        up = self._pieces("P1", wire, x, y)
        for gap, point, (nx, ny), feature in zip(up.value, up.point, up.normal, up.feature, strict=True):
            rows.append(_Gap(("P1", wire), feature, gap, _at_wire(i, nx, ny, [0.0] * SIZE), point, (nx, ny)))
        below = self._pieces("P2", wire, *down.seen(x, y), down.cos, down.sin)
        for gap, (pu, pv), (nu, nv), feature in zip(below.value, below.point, below.normal, below.feature, strict=True):
            nx, ny = down.turned(nu, nv)
            gradient = _at_wire(i, nx, ny, down.gradient(-nx, -ny, nv * pu - nu * pv))
            rows.append(_Gap(("P2", wire), feature, gap, gradient, down.point(pu, pv), (nx, ny)))
        side, axis, shank = (-1.0 if wire == "P6" else 1.0), self.bolt_x + float(q[B]), 0.5 * self.clamp.bolt.diameter
        gap, gradient = side * (x - axis) - shank - self.pairs["P1", wire].cylinder.radius, [0.0] * SIZE
        gradient[i], gradient[B] = side, -side
        return [*rows, _Gap(("P4", wire), "shank", gap, gradient, (axis + side * shank, y), (side, 0.0))]

    def _faces(self, down: _Down) -> list[_Gap]:
        """Gaps of the splints' inner faces, which are straight, so least at an end of their overlap."""
        up, face, rows = self.clamp.up_splint, self.clamp.down_splint.face_depth, []
        c, s = down.cos, down.sin
        for side, feature in ((-1.0, "left edge"), (1.0, "right edge")):
            (corner, corner_y), edge = down.point(side * self.lever, face), self.bolt_x + side * 0.5 * up.width
            if side * (corner - edge) <= 0.0:  # P2's corner under P1's face
                gradient = down.gradient(0.0, 1.0, down.x - corner)
                gap, point, normal = corner_y - up.thickness, (corner, up.thickness), (0.0, 1.0)
            else:  # P1's edge over P2's face
                x, y = edge - down.x, up.thickness - down.y
                gradient = down.gradient(s, c, y * s - x * c)
                gap, point, normal = face - (x * s + y * c), (edge, up.thickness), (s, c)
            rows.append(_Gap(("P1", "P2"), feature, gap, gradient, point, normal))
        return rows

    def _stops(self, q: Array, down: _Down) -> list[_Gap]:
        """Gaps of the inner faces, then what ends the down splint's tilt and slide, and carries it (Table 2 of the
        paper): its underside on the saddle's edges, its slot on the shank, the play of hole and washer where there is
        any, and its round back in the saddle's arc."""
        rows, joints, splint = self._faces(down), self.clamp.joints, self.clamp.down_splint
        # Centred, the slot's lower ends meet the shank first.
        depths = (splint.slot_bottom, splint.face_depth) if joints.washer or joints.saddle else (splint.slot_bottom,)
        axis, shank, (play, washer_play) = self.bolt_x + float(q[B]), 0.5 * self.clamp.bolt.diameter, self.play
        for side in (-1.0, 1.0):
            rows.append(self._saddle_edge(q, down, side))
            for depth in depths:
                x, y = down.point(side * 0.5 * splint.slot_width, depth)
                gradient = down.gradient(side, 0.0, side * (y - down.y))
                gradient[B] = 0.0  # bolt and splint shift together
                rows.append(_Gap(("P2", "P4"), "slot", side * (x - axis) - shank, gradient, (x, y), (-side, 0.0)))
            if joints.hole:
                gradient, point = [0.0] * SIZE, (axis + side * shank, 0.5 * self.clamp.up_splint.thickness)
                gradient[B] = -side
                rows.append(_Gap(("P1", "P4"), "hole", play - side * float(q[B]), gradient, point, (-side, 0.0)))
            if joints.washer:
                gradient, point = [0.0] * SIZE, (axis - side * shank, float(q[D]) + splint.back_radius)
                gradient[V] = -side
                rows.append(_Gap(("P3", "P4"), "hole", washer_play - side * float(q[V]), gradient, point, (side, 0.0)))
        return [*rows, self._seat(q, down)]

    def _saddle_edge(self, q: Array, down: _Down, side: float) -> _Gap:
        """The down splint's underside on an edge of the saddle, whose arc's centre is back_clearance above q's d."""
        edge = self.bolt_x + float(q[B] + q[V]) + side * 0.5 * self.clamp.saddle.width
        edge_y = float(q[D]) + self._edge_below
        x, y, c, s = edge - down.x, edge_y - down.y, down.cos, down.sin
        gradient = down.gradient(-s, -c, x * c - y * s)
        gradient[D] += c
        gradient[B] += s
        gradient[V] += s
        gap = x * s + y * c - self.clamp.down_splint.underside_depth
        return _Gap(("P2", "P3"), EDGES, gap, gradient, (edge, edge_y), (s, c))

    def _seat(self, q: Array, down: _Down) -> _Gap:
        """The round back's height over the saddle's arc, square to it."""
        u, upright, gradient = float(q[U]), 1.0 / math.hypot(1.0, down.slope), [0.0] * SIZE
        gradient[W], gradient[U] = -u * down.slope * down.bend * upright**3, upright
        normal, back = (down.slope * upright, upright), self.clamp.down_splint.back_radius
        point = (down.x + back * normal[0], down.y + back * normal[1])
        return _Gap(("P2", "P3"), SEAT, u * upright, gradient, point, normal)

    def wire_curvature(self, q: Array, splint: PartName, wire: PartName, force: Array, h: float) -> Array:
        """Second derivatives (10, 10) by q of ``force`` (k,) times a wire's gaps to a splint.

        The normals turn with the wire's place (u, v) in the splint's own axes: differences over ``h`` mm. How u and v
        follow from q is written out.
        """
        i, down = 2 * WIRES.index(wire), self._down(q) if splint == "P2" else _AT_REST
        turn = np.array([[down.cos, -down.sin], [down.sin, down.cos]])
        u, v = down.seen(float(q[i]), float(q[i + 1]))

        def push(u: float, v: float) -> Array:
            return np.asarray(force @ np.array(self._pieces(splint, wire, u, v, down.cos, down.sin).normal))

        right, left, under, over = (push(u + du, v + dv) for du, dv in ((h, 0.0), (-h, 0.0), (0.0, h), (0.0, -h)))
        turning = np.column_stack([right - left, under - over]) / (2.0 * h)
        by_q, curvature = np.zeros((2, SIZE)), np.zeros((SIZE, SIZE))
        by_q[:, i : i + 2] = turn
        if splint == "P2":
            by_q[:, B : W + 1] = -turn[:, :1]
            by_q[:, [D, U]] = np.column_stack([-turn[:, 1], turn[:, 1]])
            by_q[:, W] += down.slope * turn[:, 1]
            by_q[:, S] = np.array((-v, u)) / self.lever
            along, deep = push(u, v).tolist()
            curvature[S] = (deep * by_q[0] - along * by_q[1]) / self.lever
            curvature += curvature.T
            curvature[S, S] *= 0.5
            curvature[W, W] += down.bend * (along * turn[0, 1] + deep * turn[1, 1])
        return np.asarray(by_q.T @ turning @ by_q + curvature)

    def _pieces(self, splint: PartName, wire: PartName, u: float, v: float, c: float = 1.0, s: float = 0.0) -> _Pieces:
        """The model's pieces for a wire at (u, v) in the splint's own axes (right, down), which is turned by (c, s)."""
        self.queries.contact += 1
        T = np.array([[c, 0.0, s, u], [0.0, 1.0, 0.0, 0.0], [-s, 0.0, c, -v], [0.0, 0.0, 0.0, 1.0]])
        pieces = self.model.pieces(self.pairs[splint, wire], T)
        points, normals = ((array[:, ::2] * _RIGHT_DOWN).tolist() for array in (pieces.point, pieces.normal))
        rows = _Pieces(pieces.distance.tolist(), points, normals, list(pieces.feature))
        self._end_face(rows, splint, wire, u, v)
        return rows

    def _end_face(self, rows: _Pieces, splint: PartName, wire: PartName, u: float, v: float) -> None:
        """A splint's faces end at its outer edge: beside it that is the nearest piece in ``rows``.

        Pieces that are nearer than the edge stand `_FAR` away: the groove's material has no end.
        """
        side = -1.0 if wire == "P6" else 1.0
        if splint == "P1":
            edge, height, looks = self.bolt_x + side * self.bolt_x, self.clamp.up_splint.thickness, 1.0
        else:
            edge, height, looks = side * self.lever, self.clamp.down_splint.face_depth, -1.0
        beyond = side * (u - edge)
        if beyond <= 0.0:
            return
        above = max(looks * (v - height), 0.0)
        away = math.hypot(beyond, above)
        gap, nearest = away - self.pairs[splint, wire].cylinder.radius, rows.value.index(min(rows.value))
        rows.value = [_FAR if value < gap else value for value in rows.value]
        rows.value[nearest], rows.feature[nearest] = gap, EDGE
        rows.point[nearest] = (edge, height if above > 0.0 else v)
        rows.normal[nearest] = (side * beyond / away, looks * above / away)

    @cached_property
    def _edge_below(self) -> float:
        """The saddle's edges below d, mm."""
        saddle = self.clamp.saddle
        return saddle.radius * math.cos(saddle.half_angle) - self.clamp.back_clearance
