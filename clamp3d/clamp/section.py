"""The clamp in its section: ten numbers place the parts, gaps say what may not overlap.

Everything is seen from the up splint (P1 at rest), in the paper's section frame. The state q (10,) holds in mm: the two
wire centres x6, y6, x7, y7; d, how far below P1's origin the down splint's stands when it rests in the saddle's apex
(the bolt draws the saddle, and d is where that is); s = half width * tilt; the shifts b of the bolt in the up splint's
hole, v of the saddle on the bolt and w of the down splint in the saddle, 0 unless the clamp's joints have play; and u,
how high the down splint stands over the saddle's apex.

In every gap a part with a surface meets one with a round (a wire, the round back) or a corner. So all gaps have one
formula for their derivatives: by the velocities of both parts at the contact, and by the gap's curvature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clamp3d.baselines.model import ContactModel, check_model
from clamp3d.checks import instance
from clamp3d.clamp.dimensions import PARTS, Clamp, Pair, PartName
from clamp3d.clamp.parts import groove_pairs
from clamp3d.geometry.pose import Array, SectionPose

_INDEX = {name: i for i, name in enumerate(PARTS)}
SPLINTS: tuple[PartName, PartName] = ("P1", "P2")
WIRES: tuple[PartName, PartName] = ("P6", "P7")
D, S, B, V, W, U = 4, 5, 6, 7, 8, 9
"""Where the distance, the scaled tilt, the shifts of bolt, saddle and down splint, and its height over the saddle's
apex stand in the state q."""
SIZE = 10
"""Coordinates of a state."""
HELD = (0, 1, 2, 3, D, S, U)
"""Coordinates that move while the down splint is closed by hand: what play the joints have the nut takes up."""

EDGE = "outer edge"
"""Feature of a splint's gap to a wire that has left its face sideways."""
EDGES = "saddle's edge"
"""Feature of the gap between the down splint's underside and the saddle."""

_SPARE, _SPARE_OF_LEVER = 10.0, 0.2
"""How much wider than the wires need a clamp stands open, mm, and at most how much of its half width."""
_ADVANCES = 100  # chosen: one is enough but where the round back stands beside the saddle's middle
_FAR = 1e3
"""Gap in mm of a piece that another one stands for: it is never near."""
_FULL = 1e-9
"""Clearance in parts of the groove's radius below which a wire fills it: there is no round to roll in."""
Point = Sequence[float]
"""Right and down in a section, mm."""


@dataclass(frozen=True, slots=True)
class Gaps:
    """The gaps at a state, row by row.

    Attributes
    ----------
    value : ndarray (k,)
        Mm.
    gradient : ndarray (k, 10)
        Derivatives by q.
    pair, feature : tuple
        The two parts, and the piece that is nearest.
    point, normal : ndarray (k, 2)
        On one of the parts, and from the first part to the second; P1's section frame (right, down).
    rows : list of Gap
        The same one by one, with what `Section.hessian` needs.
    """

    value: Array
    gradient: Array
    pair: tuple[Pair, ...]
    feature: tuple[str, ...]
    point: Array
    normal: Array
    rows: list[Gap]


@dataclass(slots=True)
class Gap:
    """The gap from the ``surface`` of a part to another one's ``round``, or corner.

    ``normal`` leads from surface to round, which is about ``centre``, and ``curvature`` (1/mm) is the gap's second
    derivative by motion of the round along the surface.
    """

    surface: PartName
    round: PartName
    feature: str
    value: float
    point: Point
    normal: Point
    centre: Point
    curvature: float = 0.0

    @classmethod
    def flat(cls, parts: Pair, feature: str, origin: Point, normal: Point, centre: Point, radius: float = 0.0) -> Gap:
        """The gap of a straight surface through ``origin`` to a corner, or to a round of ``radius`` mm."""
        height = (centre[0] - origin[0]) * normal[0] + (centre[1] - origin[1]) * normal[1]
        foot = (centre[0] - height * normal[0], centre[1] - height * normal[1])
        return cls(*parts, feature, height - radius, foot, normal, centre)


_AT_REST = SectionPose(0.0, 0.0)


class Section:
    """A clamp whose grooves are measured by ``model``.

    Attributes
    ----------
    queries : int
        How often the model was asked about a groove and a wire: C of Table 5.
    pairs : dict of GroovePair
        The clamp's grooves with what lies in them.
    lever : float
        Half width of the down splint in mm: it turns the tilt into a length.
    bolt_x : float
        Axis of the up splint's hole from P1's left edge in mm.
    free : tuple of int
        The coordinates of q that move.
    least_slack : float
        Least difference of a wire's and its groove's radius in mm.
    """

    def __init__(self, clamp: Clamp, model: ContactModel) -> None:
        instance("clamp", clamp, Clamp)
        check_model(model)
        self.clamp, self.model, self.queries = clamp, model, 0
        self.pairs = groove_pairs(clamp)
        self.lever, self.bolt_x = clamp.down_splint.width / 2, clamp.up_splint.width / 2
        shifts = ((B, clamp.joints.hole), (V, clamp.joints.washer), (W, clamp.joints.saddle))
        self.free = (0, 1, 2, 3, D, S, *(i for i, plays in shifts if plays), U)
        self.least_slack = min(abs(p.groove.radius - p.cylinder.radius) for p in self.pairs.values() if p.a != "P3")
        self._twists = self._part_twists()

    def _part_twists(self) -> Array:
        """How the parts (7,) move right and down (mm) and turn (rad) with q and the turns of both wires over their
        radius: (7, 3, 12)."""
        twist = np.zeros((len(PARTS), 3, SIZE + len(WIRES)))
        for i, wire in enumerate(WIRES):
            part = _INDEX[wire]
            twist[part, [0, 1], [2 * i, 2 * i + 1]] = 1.0
            twist[part, 2, SIZE + i] = 1.0 / self.pairs["P1", wire].cylinder.radius
        for name, shifts in (("P4", [B]), ("P3", [B, V]), ("P2", [B, V, W])):
            twist[_INDEX[name], 0, shifts] = 1.0
        twist[1:3, 1, D] = 1.0
        twist[1, [1, 2], [U, S]] = -1.0, 1.0 / self.lever
        return twist

    def down_splint(self, q: Array) -> SectionPose:
        """P2 seen from P1."""
        shifts, (d, s, u) = q[[B, V, W]].sum(), q[[D, S, U]].tolist()
        return SectionPose(self.bolt_x + float(shifts), d - u, s / self.lever)

    def poses(self, q: Array, saddle_d: float | None = None) -> dict[PartName, SectionPose]:
        """Section poses of all parts with the line at rest; ``saddle_d`` is where the saddle stands if not under P2."""
        clamp, down = self.clamp, self.down_splint(q)
        x, y = -float(q[0]), -float(q[1])
        saddle_y = y + (float(q[D]) if saddle_d is None else saddle_d) - clamp.back_clearance
        bolt_y = saddle_y + clamp.saddle.radius + clamp.saddle.apex_thickness - clamp.bolt.shank_length
        bolt_x = x + self.bolt_x + float(q[B])
        return {
            "P1": SectionPose(x, y),
            "P2": SectionPose(x + down.x, y + down.y, down.angle),
            "P3": SectionPose(bolt_x + float(q[V]), saddle_y),
            "P4": SectionPose(bolt_x, bolt_y),
            "P5": SectionPose(bolt_x, y - clamp.nut.height),
            "P6": SectionPose(0.0, 0.0),
            "P7": SectionPose(x + float(q[2]), y + float(q[3])),
        }

    def state(self, poses: Mapping[PartName, SectionPose]) -> Array:
        """The state (10,) of splints and wires at section poses; the saddle counts as under the down splint."""
        q, up, down = np.zeros(SIZE), poses["P1"], poses["P2"]
        for i, wire in enumerate(WIRES):
            q[2 * i : 2 * i + 2] = poses[wire].x - up.x, poses[wire].y - up.y
        q[D], q[S], q[W] = down.y - up.y, self.lever * (down.angle - up.angle), down.x - up.x - self.bolt_x
        return q

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

    def arc_centres(self, q: Array, wire: PartName) -> tuple[Array, Array]:
        """Centres (2,) of the wire's arcs in the up and the down splint, mm."""
        up, down = self.pairs["P1", wire].T_a_groove, self.pairs["P2", wire].T_a_groove
        return np.array([up[0, 3], -up[2, 3]]), np.array(self.down_splint(q).point(down[0, 3], -down[2, 3]))

    def splint_distance(self, q: Array) -> float:
        """Height between the inner edges of the splints on the line side (the distance of Table 4); mm."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        return self.down_splint(q).point(-down.width / 2, down.face_depth)[1] - up.thickness

    def escaped(self, q: Array) -> tuple[PartName, ...]:
        """The wires whose centre is beside a splint: nothing leads them back."""
        down, places = self.down_splint(q), zip(WIRES, q[:4].reshape(2, 2).tolist(), strict=True)
        width = self.clamp.up_splint.width
        return tuple(
            wire for wire, (x, y) in places if not (0.0 <= x <= width and abs(down.local(x, y)[0]) <= self.lever)
        )

    def open_state(self, d: float, tilt: float = 0.0) -> Array:
        """State with the down splint at ``d`` and ``tilt``, both wires in the middle between their two arc centres.

        Where that is beside the up splint's mouth, in the bolt, or so deep that the wire would meet an inner face, it
        is put clear.
        """
        q = np.zeros(SIZE)
        q[D], q[S] = d, self.lever * tilt
        down = self.down_splint(q)
        for i, wire in enumerate(WIRES):
            q[2 * i : 2 * i + 2] = 0.5 * np.add(*self.arc_centres(q, wire))
            for low, high in (self.mouth(wire), self.reach(wire)):
                q[2 * i] = min(max(q[2 * i], low), high)
            r, face = self.pairs["P1", wire].cylinder.radius, self.clamp.down_splint.face_depth
            under = down.y + (face - (q[2 * i] - down.x) * math.sin(down.angle)) / math.cos(down.angle)
            low, high = self.clamp.up_splint.thickness + r, under - r / math.cos(down.angle)
            if low <= high:
                q[2 * i + 1] = min(max(q[2 * i + 1], low), high)
        return q

    def open_distance(self) -> float:
        """A distance d at which the clamp stands open: both wires pass between the faces at any tilt; mm."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        thickest = 2.0 * max(self.clamp.line.radius, self.clamp.jumper.radius)
        spare = min(_SPARE, _SPARE_OF_LEVER * self.lever)
        return up.thickness - down.face_depth + thickest + self.lever * math.sin(self.clamp.tilt_stop) + spare

    def gaps(self, q: Array) -> Gaps:
        """All gaps at a state: both wires, inner faces, stops, and the round back in the saddle."""
        down = self.down_splint(q)
        stops = [*self._faces(down), *self._stops(q, down), *self._groove("P3", "P2", q, down)]
        return self._collect(q, [*self._wire("P6", q, down), *self._wire("P7", q, down), *stops])

    def wire_gaps(self, q: Array, wire: PartName) -> Gaps:
        """Gaps of one wire to both splints, every piece of the contact model, and to the bolt."""
        return self._collect(q, self._wire(wire, q, self.down_splint(q)))

    def face_gap(self, q: Array) -> float:
        """The least gap between the inner faces (convex object collision, type 2 of the paper); mm."""
        return min(row.value for row in self._faces(self.down_splint(q)))

    def seated(self, q: Array) -> Array:
        """The state with the saddle drawn up to the round back, as the contact model sees them."""
        q = q.copy()
        for _ in range(_ADVANCES):
            gap = min(row.value for row in self._groove("P3", "P2", q, self.down_splint(q)))
            if abs(gap) <= 1e-12 * self.clamp.saddle.radius:
                break
            q[[D, U]] -= gap
        return q

    def work(self, q: Array, pair: Sequence[Pair], point: Array, push: Array) -> Array:
        """Work (k, 12) of ``push`` (k, 2) on the second part of each pair at ``point`` (k, 2), and of its reaction on
        the first, for unit changes of q and of the turns of both wires over their radius."""
        origin, down = np.zeros((len(PARTS), 2)), self.down_splint(q)
        origin[1], origin[5], origin[6] = (down.x, down.y), q[:2], q[2:4]
        part = [_INDEX[names[side]] for side in (0, 1) for names in pair]
        wrench = np.empty((len(part), 3))
        wrench[:, :2] = np.concatenate([-push, push])
        arm = np.concatenate([point, point]) - origin[part]
        wrench[:, 2] = wrench[:, 0] * arm[:, 1] - wrench[:, 1] * arm[:, 0]
        done = (wrench[:, None] @ self._twists[part])[:, 0]
        return np.asarray(done[: len(pair)] + done[len(pair) :])

    def hessian(self, q: Array, gaps: Gaps, force: Array) -> Array:
        """Second derivatives (10, 10) of ``force`` (k,) times the gaps by q.

        A round that moves along a surface changes the gap by its curvature, and where the down splint turns, the arm
        from its origin turns with it, or the surface's normal.
        """
        down, total = self.down_splint(q), np.zeros((SIZE, SIZE))
        twists = self._twists[:, :, :SIZE]
        turn = twists[1, 2]

        def velocity(part: PartName, at: Point) -> Array:
            right, below = np.subtract(at, (down.x, down.y)) if part == "P2" else (0.0, 0.0)
            return np.asarray(twists[_INDEX[part], :2] + np.outer((below, -right), turn))

        for k in np.flatnonzero(force):
            row = gaps.rows[k]
            x, y = row.normal
            move = velocity(row.round, row.centre)
            along = np.array([-y, x]) @ (move - velocity(row.surface, row.centre))
            own = row.curvature * np.outer(along, along)
            if "P2" in (row.surface, row.round):
                own -= ((x, y) @ np.subtract(row.centre, (down.x, down.y))) * np.outer(turn, turn)
            if row.surface == "P2":
                right, below = move - twists[1, :2]
                cross = np.outer(turn, x * below - y * right)
                own -= cross + cross.T
            total += force[k] * own
        return np.asarray(total)

    def _collect(self, q: Array, rows: list[Gap]) -> Gaps:
        pair = tuple((r.surface, r.round) if r.surface < r.round else (r.round, r.surface) for r in rows)
        point, normal = np.array([r.point for r in rows]), np.array([r.normal for r in rows])
        normal[[r.surface > r.round for r in rows]] *= -1.0
        return Gaps(
            value=np.array([r.value for r in rows]),
            gradient=self.work(q, pair, point, normal)[:, :SIZE],
            pair=pair,
            feature=tuple(r.feature for r in rows),
            point=point,
            normal=normal,
            rows=rows,
        )

    def _wire(self, wire: PartName, q: Array, down: SectionPose) -> list[Gap]:
        """Gaps of a wire to both splints and to the shank, which stands between the wires: each keeps to its side."""
        i, side = 2 * WIRES.index(wire), -1.0 if wire == "P6" else 1.0
        shank = (self.bolt_x + float(q[B]) + side * 0.5 * self.clamp.bolt.diameter, 0.0)
        radius = self.pairs["P1", wire].cylinder.radius
        bolt = Gap.flat(("P4", wire), "shank", shank, (side, 0.0), q[i : i + 2].tolist(), radius)
        return [*self._groove("P1", wire, q, down), *self._groove("P2", wire, q, down), bolt]

    def _groove(self, part: PartName, inside: PartName, q: Array, down: SectionPose) -> list[Gap]:
        """The contact model's pieces of a groove for the wire or the round back that lies in it."""
        pair, frame = self.pairs[part, inside], down if part == "P2" else _AT_REST
        if inside == "P2":
            frame = SectionPose(down.x - float(q[W]), float(q[D]) - self.clamp.back_clearance)
            centre, angle = (down.x, down.y), down.angle
        else:
            self.queries += 1
            i = 2 * WIRES.index(inside)
            centre, angle = (float(q[i]), float(q[i + 1])), 0.0
        u, v = frame.local(*centre)
        T = SectionPose(u, v, angle - frame.angle).T()
        pieces, r, R = self.model.pieces(pair, T), pair.cylinder.radius, pair.groove.radius
        rows = []
        points, normals = pieces.point.tolist(), pieces.normal.tolist()
        for gap, point, normal, feature in zip(pieces.distance.tolist(), points, normals, pieces.feature, strict=True):
            bend = 0.0
            if feature.startswith("arc"):
                bend = -1.0 / max(abs(R - r - gap), _FULL * R)
            elif feature.startswith("lip"):
                bend = 1.0 / max(r + gap, _FULL * R)
            rows.append(Gap(part, inside, feature, gap, (point[0], -point[2]), (normal[0], -normal[2]), centre, bend))
        if inside != "P2":
            self._end_face(rows, u, v)
        for row in rows:
            row.point, row.normal = frame.point(*row.point), frame.direction(*row.normal)
        return rows

    def _end_face(self, rows: list[Gap], u: float, v: float) -> None:
        """A splint's faces end at its outer edge: beside it that is the nearest piece to a wire at (u, v).

        Pieces that are nearer than the edge stand `_FAR` away: the groove's material has no end.
        """
        splint, wire = rows[0].surface, rows[0].round
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
        nearest = min(rows, key=lambda row: row.value)
        gap = away - self.pairs[splint, wire].cylinder.radius
        for row in rows:
            row.value = _FAR if row.value < gap else row.value
        nearest.value, nearest.feature, nearest.curvature = gap, EDGE, 1.0 / away if above > 0.0 else 0.0
        nearest.point, nearest.normal = (
            (edge, height if above > 0.0 else v),
            (side * beyond / away, looks * above / away),
        )

    def _faces(self, down: SectionPose) -> list[Gap]:
        """Gaps of the splints' inner faces, which are straight, so least at an end of their overlap."""
        up, face, rows = self.clamp.up_splint, self.clamp.down_splint.face_depth, []
        for side, feature in ((-1.0, "left edge"), (1.0, "right edge")):
            corner, edge = down.point(side * self.lever, face), (self.bolt_x + side * 0.5 * up.width, up.thickness)
            if side * (corner[0] - edge[0]) <= 0.0:  # P2's corner under P1's face
                rows.append(Gap.flat(("P1", "P2"), feature, edge, (0.0, 1.0), corner))
            else:  # P1's edge over P2's face
                rows.append(Gap.flat(("P2", "P1"), feature, corner, down.direction(0.0, -1.0), edge))
        return rows

    def _stops(self, q: Array, down: SectionPose) -> list[Gap]:
        """What ends the down splint's tilt and slide (Table 2 of the paper): its underside on the saddle's edges, its
        slot on the shank, and the play of hole and washer where there is any."""
        rows, clamp, joints = [], self.clamp, self.clamp.joints
        splint, saddle, up = clamp.down_splint, clamp.saddle, clamp.up_splint
        # Centred, the slot's lower ends meet the shank first.
        depths = (splint.slot_bottom, splint.face_depth) if joints.washer or joints.saddle else (splint.slot_bottom,)
        axis, d = self.bolt_x + float(q[B]), float(q[D])
        saddle_axis, edge_y = axis + float(q[V]), d + saddle.radius * math.cos(saddle.half_angle) - clamp.back_clearance
        underside = down.point(0.0, splint.underside_depth)
        for side in (-1.0, 1.0):
            edge, shank = (saddle_axis + side * 0.5 * saddle.width, edge_y), axis + side * 0.5 * clamp.bolt.diameter
            rows.append(Gap.flat(("P2", "P3"), EDGES, underside, down.direction(0.0, 1.0), edge))
            for depth in depths:
                wall = down.point(side * 0.5 * splint.slot_width, depth)
                rows.append(Gap.flat(("P4", "P2"), "slot", (shank, 0.0), (side, 0.0), wall))
            if joints.hole:
                hole = (self.bolt_x + side * 0.5 * up.hole_diameter, 0.0)
                rows.append(Gap.flat(("P1", "P4"), "hole", hole, (-side, 0.0), (shank, 0.5 * up.thickness)))
            if joints.washer:
                hole = (saddle_axis + side * 0.5 * saddle.hole_diameter, 0.0)
                rows.append(Gap.flat(("P3", "P4"), "hole", hole, (-side, 0.0), (shank, d + splint.back_radius)))
        return rows
