"""The clamp in its section: ten numbers place the parts, gaps say what may not overlap.

Everything is seen from the up splint (P1 at rest), in the paper's section frame. The state q (10,) holds in mm: the two
wire centres x6, y6, x7, y7; d, how far below P1's origin the down splint's stands when it rests in the saddle's apex
(the bolt draws the saddle, and d is where that is); s = half width * tilt; the shifts b of the bolt in the up splint's
hole, v of the saddle on the bolt and w of the down splint in the saddle, 0 unless the clamp's joints have play; and u,
how high the round back stands over the saddle's arc, 0 unless the saddle's edges lift it off.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from functools import cache, cached_property

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
EDGE_CODE = -1.0
"""Its number in compiled loops, where others have those of `Feature`."""
EDGES = "saddle's edge"
"""Feature of the gap between the down splint's underside and the saddle."""
SEAT = "arc"
"""Feature of the gap between the round back and the saddle's arc: the last one of `Section.gaps`."""

_SPARE, _SPARE_OF_LEVER = 10.0, 0.2
"""How much wider than the wires need a clamp stands open, mm, and at most how much of its half width."""
_NEAR = 0.1 * LARGEST
"""States with coordinates below are asked at once; further off the model tells what is wrong."""


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
_FEATURES = {EDGE_CODE: EDGE} | {float(feature.value): str(feature) for feature in Feature}
"""Names of what the kernel says is nearest."""


@cache
def _pairs(wires: tuple[PartName, ...], counts: tuple[tuple[int, int], ...]) -> tuple[Pair, ...]:
    """Of the gaps of ``wires``, each with ``counts`` of pieces of the up and the down splint, and the shank."""
    found: list[Pair] = []
    for wire, (up, below) in zip(wires, counts, strict=True):
        found += [("P1", wire)] * up + [("P2", wire)] * below + [("P4", wire)]
    return tuple(found)


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

    def face_gaps(self, tilts: Array) -> Array:
        """`face_gap` (n,) at tilts (n,) in rad, d and all shifts 0; mm."""
        from clamp3d.clamp.kernel_section import face_gaps  # compiled on first use

        found = np.empty(len(tilts))
        down, work = self._down(np.zeros(SIZE)), (np.empty(2), np.zeros((2, SIZE)), np.empty((2, 4)))
        face_gaps(np.ascontiguousarray(tilts, np.float64), down, self._sizes, *work, found)
        return found

    def _gaps(self, q: Array, wires: tuple[PartName, ...], *, stops: bool) -> Gaps:
        from clamp3d.clamp import kernel_section as kernel  # compiled on first use

        q = np.ascontiguousarray(q, np.float64)
        down = self._down(q)
        at_once = type(self.model) is Cas and float(np.abs(q).max()) < _NEAR
        asked = [] if at_once else [self._both_pieces(q, down, wire) for wire in wires]
        counts = [(3, 3)] * len(wires) if at_once else [(len(up), len(below)) for up, below, _ in asked]
        pairs = _pairs(wires, tuple(counts)) + (self._stops[0] if stops else ())
        value, gradient, place = np.empty(len(pairs)), np.zeros((len(pairs), SIZE)), np.empty((len(pairs), 4))
        features: tuple[str, ...] = ()
        at = 0
        if at_once:
            self.queries.contact += 2 * len(wires)
            first, pieces = WIRES.index(wires[0]) if wires else 0, np.empty((2, 2, 3, 6))
            last, work = first + len(wires), np.empty((3, 14))
            shapes = self._sizes, self.grooves, self._faces
            kernel.wires(q, down, first, last, *shapes, work, pieces, value, gradient, place)
            for codes in pieces[first:last, :, :, 5].reshape(-1, 6).tolist():
                features += (*[_FEATURES[code] for code in codes], "shank")
                at += 7
        else:
            for wire, (up, below, named) in zip(wires, asked, strict=True):
                rows = slice(at, at := at + len(named))
                given = q, down, 2 * WIRES.index(wire), self._sizes, self.pairs["P1", wire].cylinder.radius, up, below
                kernel.wire(*given, value[rows], gradient[rows], place[rows])
                features += named
        if stops:
            joints = self.clamp.joints
            walls = 2 if joints.washer or joints.saddle else 1  # centred, the slot's lower ends meet the shank first
            plays = joints.hole, joints.washer, walls
            kernel.stops(q, down, self._sizes, *plays, value[at:], gradient[at:], place[at:])
            features += self._stops[1]
        return Gaps(value, gradient, pairs, features, place[:, :2], place[:, 2:])

    def _both_pieces(self, q: Array, down: Array, wire: PartName) -> tuple[Array, Array, tuple[str, ...]]:
        """`_pieces` of both splints for a wire at a state, and what they and the shank are."""
        i = 2 * WIRES.index(wire)
        px, py, c, s, *_ = down.tolist()
        x, y = q[i : i + 2].tolist()
        dx, dy = x - px, y - py
        up, named = self._pieces("P1", wire, x, y)
        below, named_below = self._pieces("P2", wire, dx * c - dy * s, dx * s + dy * c, c, s)
        return up, below, (*named, *named_below, "shank")

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

        places = [(u + h, v), (u - h, v), (u, v + h), (u, v - h), *[(u, v)] * (splint == "P2")]
        right, left, under, over, *here = self._pushes(splint, wire, np.array(places), force, c, s)
        turning = np.column_stack([right - left, under - over]) / (2.0 * h)
        by_q, found = np.zeros((2, SIZE)), np.zeros((SIZE, SIZE))
        by_q[:, i : i + 2] = turn
        if splint == "P2":
            by_q[:, B : W + 1] = -turn[:, :1]
            by_q[:, [D, U]] = np.column_stack([-turn[:, 1], turn[:, 1]])
            by_q[:, W] += slope * turn[:, 1]
            by_q[:, S] = np.array((-v, u)) / self.lever
            along, deep = here[0].tolist()
            found[S] = (deep * by_q[0] - along * by_q[1]) / self.lever
            found += found.T
            found[S, S] *= 0.5
            found[W, W] += bend * (along * turn[0, 1] + deep * turn[1, 1])
        return dot(dot(by_q.T, turning), by_q) + found

    def _pushes(self, splint: PartName, wire: PartName, places: Array, force: Array, c: float, s: float) -> Array:
        """``force`` (k,) times the normals of `_pieces` of a wire at each of ``places`` (n, 2)."""
        if type(self.model) is not Cas or float(np.abs(places).max()) >= _NEAR:
            return np.array([dot(force, self._pieces(splint, wire, u, v, c, s)[0][:, 3:5]) for u, v in places.tolist()])
        from clamp3d.clamp.kernel_section import pushes  # compiled on first use

        self.queries.contact += len(places)
        groove = WIRES.index(wire), SPLINTS.index(splint)
        work, found = (np.empty((3, 14)), np.empty((3, 6))), np.empty(places.shape)
        pushes(self.grooves[groove], self._faces[groove], places, force, *work, found)
        return found

    @cached_property
    def grooves(self) -> Array:
        """Dimensions (2, 2, 8) in mm of each wire's groove in each splint, as the kernel takes them."""
        found = np.empty((2, 2, 8))
        for (i, wire), (k, splint) in itertools.product(enumerate(WIRES), enumerate(SPLINTS)):
            pair = self.pairs[splint, wire]
            groove, r, T = pair.groove, pair.cylinder.radius, pair.T_a_groove
            found[i, k, :5] = groove.radius, groove.half_angle, 0.5 * groove.length, r, 0.5 * pair.cylinder.length
            found[i, k, 5:] = T[0, 3], -T[2, 3], 1.0 if splint == "P1" else -1.0
        return found

    @cached_property
    def _faces(self) -> Array:
        """Where each splint's face ends on each wire's side (2, 2, 4), in mm, as the kernel takes it."""
        up, face = self.clamp.up_splint, self.clamp.down_splint.face_depth
        sides = ((-1.0, 0.0, -self.lever), (1.0, up.width, self.lever))
        return np.array([((a, side, up.thickness, 1.0), (b, side, face, -1.0)) for side, a, b in sides])

    def _pieces(
        self, splint: PartName, wire: PartName, u: float, v: float, c: float = 1.0, s: float = 0.0
    ) -> tuple[Array, tuple[str, ...]]:
        """The model's pieces for a wire at (u, v) in the splint's own axes (right, down), which is turned by (c, s).

        Gap, point and normal of each (k, 6; the last column is not used), and what it is. The faces end at the splint's
        outer edge: the groove's material has no end.
        """
        from clamp3d.clamp.kernel_section import end  # compiled on first use

        pair, face = self.pairs[splint, wire], self._faces[WIRES.index(wire), SPLINTS.index(splint)]
        self.queries.contact += 1
        T = np.array([c, 0.0, s, u, 0.0, 1.0, 0.0, 0.0, -s, 0.0, c, -v, 0.0, 0.0, 0.0, 1.0]).reshape(4, 4)
        found = self.model.pieces(pair, T)
        flat = found.point[:, ::2] * _RIGHT_DOWN, found.normal[:, ::2] * _RIGHT_DOWN
        rows = np.ascontiguousarray(np.column_stack([found.distance, *flat, np.zeros(len(found.feature))]), np.float64)
        end(face, pair.cylinder.radius, u, v, rows)
        return rows, tuple(
            EDGE if code else name for code, name in zip(rows[:, 5].tolist(), found.feature, strict=True)
        )

    @cached_property
    def _edge_below(self) -> float:
        """The saddle's edges below d, mm."""
        saddle = self.clamp.saddle
        return saddle.radius * math.cos(saddle.half_angle) - self.clamp.back_clearance
