"""Pairs of CAD solids whose distance, or whose deepest overlap, follows from a formula.

Each family below places two solids with a given ``gap`` (mm): positive is their distance, negative minus the depth of
the deepest point of one inside the other. Open CASCADE makes the solids and writes them as STEP; nothing of clamp3d is
used here. ``scripts/check-placed`` checks thousands of them, the tests beside this file some of each family.
"""

import math
from collections import defaultdict
from dataclasses import dataclass
from functools import cache

import numpy as np

from clamp3d.files.open_cascade import occ
from tests.cad import (
    Tree,
    array_of,
    ball,
    block,
    bounds,
    cone,
    cut,
    first_solid,
    matrix,
    moved,
    random_pose,
    ring,
    rod,
    shift,
    transformation,
    turn,
)

CONTACT = 0.01
"""The contact threshold that the verdicts are for, mm."""
SPACING = 400.0
"""Pairs of one file stand this far from each other, mm."""
OVERLAPS = frozenset({"clash", "contained", "duplicate"})


# --- Solids -----------------------------------------------------------------------------------------------------------


def hexagon(apothem, low, high):
    """A hexagonal prism with two faces square to y."""
    polygon = occ.BRepBuilderAPI_MakePolygon()
    for k in range(6):
        angle, far = math.pi * k / 3, apothem / math.cos(math.pi / 6)
        polygon.Add(occ.gp_Pnt(far * math.cos(angle), far * math.sin(angle), low))
    polygon.Close()
    face = occ.BRepBuilderAPI_MakeFace(polygon.Wire()).Face()
    return occ.BRepPrimAPI_MakePrism(face, occ.gp_Vec(0, 0, high - low)).Shape()


def arch(half_width, height, length):
    """A prism along y under a Bezier curve whose highest point is (0, y, height)."""
    ends = [occ.gp_Pnt(s * half_width, -length / 2, 0) for s in (-1, 1)]
    poles = ends[0], occ.gp_Pnt(0, -length / 2, 2 * height), ends[1]
    return occ.BRepPrimAPI_MakePrism(face_under(poles), occ.gp_Vec(0, length, 0)).Shape()


def face_under(poles):
    """The face between a Bezier curve and its chord."""
    curve = occ.BRepBuilderAPI_MakeEdge(occ.Geom_BezierCurve(array_of("gp_Pnt", poles))).Edge()
    chord = occ.BRepBuilderAPI_MakeEdge(poles[-1], poles[0]).Edge()
    return occ.BRepBuilderAPI_MakeFace(occ.BRepBuilderAPI_MakeWire(curve, chord).Wire()).Face()


def bulge(radius, half_length):
    """A Bezier curve turned about z: its greatest radius is at z = 0."""
    poles = occ.gp_Pnt(0, 0, -half_length), occ.gp_Pnt(2 * radius, 0, 0), occ.gp_Pnt(0, 0, half_length)
    axis = occ.gp_Ax1(occ.gp_Pnt(0, 0, 0), occ.gp_Dir(0, 0, 1))
    return occ.BRepPrimAPI_MakeRevol(face_under(poles), axis).Shape()


def drilled(rng, low, high, radius):
    """A plate from ``low`` to ``high`` along z with a hole of ``radius`` in the middle and six more around it."""
    size = radius + rng.uniform(14.0, 20.0)
    far = radius + 7.0
    centres = [(far * math.cos(k * math.pi / 3), far * math.sin(k * math.pi / 3)) for k in range(6)]
    holes = [rod(2.0, low - 1, high + 1, x, y) for x, y in centres]
    return cut(block((-size, -size, low), (size, size, high)), rod(radius, low - 1, high + 1), *holes)


# --- Families ---------------------------------------------------------------------------------------------------------


def pin_in_hole(rng, gap):
    """Coaxial: a pin in the middle hole of a drilled plate."""
    r = rng.uniform(2.0, 8.0)
    return drilled(rng, -5, 5, r + gap), rod(r, -12, rng.uniform(6, 15))


def pin_off_centre(rng, gap):
    """Tangent inside: a pin beside the middle of its hole."""
    r, off = rng.uniform(2.0, 8.0), rng.uniform(0.2, 1.0)
    return drilled(rng, -5, 5, r + off + gap), moved(rod(r, -12, 9), shift(off))


def tube_in_tube(rng, gap):
    r, low = rng.uniform(4.0, 12.0), rng.uniform(-15.0, -8.0)
    inner = cut(rod(r, low, 10), rod(r - 2, -20, 20))
    return cut(rod(r + gap + 3, -10, 10), rod(r + gap, -20, 20)), inner


def rods_side_by_side(rng, gap):
    """Tangent: two parallel cylinders."""
    r, s = rng.uniform(2.0, 9.0, 2)
    return rod(r, -10, 10), moved(rod(s, -14, rng.uniform(3, 16)), shift(r + s + gap))


def rods_crossed(rng, gap):
    """Tangent: two cylinders whose axes cross at some angle."""
    r, s = rng.uniform(2.0, 6.0, 2)
    return rod(r, -25, 25), moved(rod(s, -25, 25), shift(r + s + gap) @ turn((1, 0, 0), rng.uniform(0.6, 1.57)))


def rods_end_to_end(rng, gap):
    """Coaxial, face to face."""
    r, s = rng.uniform(3.0, 9.0, 2)
    return rod(r, -10, 0), rod(s, gap, 12)


def balls(rng, gap):
    r, s = rng.uniform(3.0, 10.0, 2)
    way = rng.normal(size=3)
    return ball(r), moved(ball(s), shift(*((r + s + gap) * way / np.linalg.norm(way))))


def ball_in_socket(rng, gap):
    """Concentric: a ball in a hollow half as deep as the block."""
    r = rng.uniform(3.0, 8.0)
    return cut(block((-14, -14, -14), (14, 14, 0)), ball(r + gap)), ball(r)


def ball_on_plate(rng, gap):
    r, x, y = rng.uniform(3.0, 10.0), *rng.uniform(-8, 8, 2)
    return block((-15, -15, -6), (15, 15, 0)), moved(ball(r), shift(x, y, r + gap))


def ball_in_cone(rng, gap):
    """Tangent: a ball in a conical seat of half angle ``a`` whose tip is the origin."""
    r, a = rng.uniform(3.0, 5.0), rng.uniform(0.5, 0.9)
    seat = cone(0.0, 16 * math.tan(a), 0.0, 16.0)
    return cut(block((-25, -25, -4), (25, 25, 15)), seat), ball(r, (r + gap) / math.sin(a))


def taper_in_hub(rng, gap):
    """Coaxial cones of one half angle, one moved along the axis."""
    a, r = rng.uniform(0.05, 0.4), rng.uniform(6.0, 9.0)
    slope = math.tan(a)
    pin = cone(r - 14 * slope, r + 14 * slope, -14, 14)
    hole = cone(r - 10 * slope, r + 10 * slope, -10, 10)
    hub = cut(block((-22, -22, -7), (22, 22, 7)), hole)
    return hub, moved(pin, shift(0, 0, gap / math.sin(a)))


def cones_side_by_side(rng, gap):
    """Tangent: two equal cones upside down to each other; their lines are parallel, ``gap`` apart."""
    a, r, h = rng.uniform(0.1, 0.5), rng.uniform(8.0, 11.0), 12.0
    small = r - h * math.tan(a)
    return cone(r, small, 0, h), moved(cone(small, r, 0, h), shift(r + small + gap / math.cos(a)))


def ring_on_plate(rng, gap):
    major, minor = rng.uniform(8.0, 14.0), rng.uniform(1.5, 3.0)
    return block((-20, -20, -5), (20, 20, 0)), ring(major, minor, minor + gap)


def ring_in_groove(rng, gap):
    """Concentric: a seal in a round groove of a shaft."""
    minor = rng.uniform(1.0, 2.0)
    return cut(rod(9.0, -8, 8), ring(9.0, minor + gap)), ring(9.0, minor)


def ring_on_shaft(rng, gap):
    """Coaxial: a seal on a plain shaft."""
    major, minor = rng.uniform(8.0, 14.0), rng.uniform(1.5, 3.0)
    return rod(major - minor - gap, -10, 10), ring(major, minor)


def ball_in_ring(rng, gap):
    """A ball that lies on a ring."""
    major, minor, r = rng.uniform(8.0, 10.0), rng.uniform(1.5, 3.0), rng.uniform(9.0, 12.0)
    reach = minor + r + gap
    return ring(major, minor), ball(r, math.sqrt(reach**2 - major**2))


def boxes_face_to_face(rng, gap):
    x, y = rng.uniform(-8, 8, 2)
    return block((-10, -10, -8), (10, 10, 0)), moved(block((-6, -5, 0), (6, 5, 7)), shift(x, y, gap))


def box_on_its_edge(rng, gap):
    """An edge of a turned box over a plate."""
    tilt = turn((1, 0, 0), rng.uniform(0.2, 1.3))
    return block((-15, -15, -6), (15, 15, 0)), moved(block((-6, 0, 0), (6, 8, 8)), shift(0, 0, gap) @ tilt)


def box_on_its_corner(rng, gap):
    tilt = turn((1, 1, 0), rng.uniform(0.3, 0.6)) @ turn((1, 0, 0), rng.uniform(0.3, 0.6))
    corners = (tilt[:3, :3] @ np.array(np.meshgrid([0, 8], [0, 8], [0, 8])).reshape(3, -1))[2]
    tilted = moved(block((0, 0, 0), (8, 8, 8)), shift(0, 0, gap - corners.min()) @ tilt)
    return block((-20, -20, -6), (20, 20, 0)), tilted


def hexagon_in_hexagon(rng, gap):
    """A hexagonal bar in a socket: parallel faces; in an overlap the bar's edges are deepest."""
    r = rng.uniform(4.0, 9.0)
    wider = gap if gap > 0.0 else gap * math.cos(math.pi / 6)
    return cut(rod(r + 8, -8, 0), hexagon(r + wider, -9, 1)), hexagon(r, -12, 5)


def hexagon_in_bore(rng, gap):
    """The six edges of a hexagonal bar in a round hole."""
    r = rng.uniform(4.0, 9.0)
    return cut(rod(r + 8, -8, 0), rod(r + gap, -9, 1)), hexagon(r * math.cos(math.pi / 6), -12, 5)


def spline_under_plate(rng, gap):
    height = rng.uniform(4.0, 8.0)
    return block((-20, -20, 0), (20, 20, 6)), moved(arch(10.0, height, 14.0), shift(0, 0, -height - gap))


def spline_in_bore(rng, gap):
    """A turned spline in a coaxial bore."""
    r = rng.uniform(4.0, 8.0)
    return cut(rod(r + 6, -5, 5), rod(r + gap, -6, 6)), bulge(r, rng.uniform(12, 16))


def plates_drilled_alike(rng, gap):
    state = np.random.default_rng(rng.integers(1 << 30))
    plate = drilled(state, -6, 0, 4.0)
    return plate, moved(plate, shift(0, 0, 6.0 + gap) @ turn((0, 0, 1), math.pi / 3 * rng.integers(6)))


@cache
def thread():
    """The helical ridge of an M10 screw, and the radius of its crest: nearly 5, for it is made of splines."""
    from bd_warehouse.thread import IsoThread

    iso = IsoThread(major_diameter=10, pitch=1.5, length=6, end_finishes=("square", "square"))
    ridge = first_solid(iso.wrapped)
    return ridge, 6.0 - occ.BRepExtrema_DistShapeShape(ridge, cut(rod(8, -4, 12), rod(6.0, -5, 13))).Value()


def thread_in_tube(rng, gap):
    """A thread in a coaxial tube."""
    ridge, crest = thread()
    return cut(rod(rng.uniform(7.0, 10.0), -4, 12), rod(crest + gap, -5, 13)), ridge


@cache
def fastener(kind):
    from bd_warehouse.fastener import HexHeadScrew, HexNut, SocketHeadCapScrew

    part = {
        "nut": lambda: HexNut("M8-1.25", "iso4032"),
        "hex": lambda: HexHeadScrew("M6-1", 20, "iso4014"),
        "cap": lambda: SocketHeadCapScrew("M6-1", 20, "iso4762"),
    }[kind]()
    return first_solid(part.wrapped)


def nut_on_plate(rng, gap):
    nut, size = fastener("nut"), rng.uniform(12, 20)
    return block((-size, -size, -6), (size, size, 0)), moved(nut, shift(0, 0, gap - bounds(nut)[0, 2]))


def screw_in_plate(rng, gap):
    """The seat of a screw's head over a plate with a clearance hole; the shank hangs down from z = 0."""
    head = fastener(("hex", "cap")[rng.integers(2)])
    plate = cut(block((-15, -15, -6), (15, 15, 0)), rod(3.5, -7, 1))
    return plate, moved(head, shift(0, 0, gap))


SOLIDS = {
    "box": lambda rng: block((0, 0, 0), (rng.uniform(5, 10), 9, 6)),
    "cylinder": lambda rng: rod(rng.uniform(5, 10), -5, 5),
    "ball": lambda rng: ball(rng.uniform(5, 10)),
    "ring": lambda rng: ring(10.0, rng.uniform(2, 4)),
    "cone": lambda rng: cone(rng.uniform(7, 10), rng.uniform(2, 6), 0, 9),
    "drilled plate": lambda rng: drilled(rng, -4, 4, 5.0),
    "prism": lambda rng: hexagon(rng.uniform(5, 10), 0, 8),
    "nut": lambda rng: fastener("nut"),
    "screw": lambda rng: fastener("cap"),
    "spline": lambda rng: bulge(rng.uniform(5, 10), 12.0),
}


def duplicate(rng, gap, kind=None):
    """One solid twice, ``|gap|`` apart along some direction: an overlap however small the way between them."""
    shape, way = SOLIDS[kind or rng.choice(list(SOLIDS))](rng), rng.normal(size=3)
    return shape, shape.Located(occ.TopLoc_Location(transformation(shift(*(abs(gap) * way / np.linalg.norm(way))))))


def contained(rng, gap):
    """A small solid wholly inside a large one, ``|gap|`` below its faces."""
    size = rng.uniform(4.0, 7.0)
    inner = (block((-size, -size, -size), (size, size, size)), ball(size), rod(size, -size, size))[rng.integers(3)]
    far = size + abs(gap)
    outer = block((-far, -far, -far), (far, far, far)) if rng.integers(2) else rod(1.8 * far, -far, far)
    return outer, inner


PLACED = (
    pin_in_hole, pin_off_centre, tube_in_tube, rods_side_by_side, rods_crossed, rods_end_to_end, balls, ball_in_socket,
    ball_on_plate, ball_in_cone, taper_in_hub, cones_side_by_side, ring_on_plate, ring_in_groove, ring_on_shaft,
    ball_in_ring, boxes_face_to_face, box_on_its_edge, box_on_its_corner, hexagon_in_hexagon, hexagon_in_bore,
    spline_under_plate, spline_in_bore, plates_drilled_alike, thread_in_tube, nut_on_plate, screw_in_plate, duplicate,
    contained,
)  # fmt: skip
FAMILIES = {family.__name__: family for family in PLACED}


# --- Pairs ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PlacedPair:
    """Two solids, ``a`` and ``b``, with the ``gap`` (mm) that their family's formula gives them."""

    family: str
    a: object
    b: object
    gap: float

    @property
    def right(self):
        """The verdicts that are right for the pair."""
        if self.family.startswith(("duplicate", "contained")):
            return OVERLAPS
        if self.gap < -CONTACT:
            return frozenset({"clash"})
        return frozenset({"contact" if self.gap <= CONTACT else "clear"})


def draw_gap(rng, family):
    """A gap from 1e-4 to 0.1 mm either way, or 0; never within 2e-4 mm of the contact threshold."""
    if family == "duplicate":
        return float(rng.choice([0.0, 0.001, 0.009]))
    gap = CONTACT
    while abs(gap - CONTACT) < 2e-4:
        gap = 0.0 if rng.random() < 0.1 else 10.0 ** rng.uniform(-4.0, -1.0)
    return float(gap * rng.choice([-1.0, 1.0]))


def placed_pair(family, rng, gap=None, splines=0.1):
    """A pair of a family with its gap, or one that is drawn; each solid's faces are splines with some probability."""
    gap = draw_gap(rng, family) if gap is None else gap
    a, b = FAMILIES[family](rng, gap)
    if family not in ("duplicate", "thread_in_tube") and splines:
        a, b = (occ.BRepBuilderAPI_NurbsConvert(x, True).Shape() if rng.random() < splines else x for x in (a, b))
    return PlacedPair(family, a, b, gap)


def write_pairs(pairs, path, rng):
    """All pairs in one STEP file, far from each other: its solids are a and b of the first pair, of the second, ...

    Each pair stands at a random pose; half of them have it in their geometry, half in their placement. Both solids of a
    duplicate are instances of one product in half of the cases.
    """
    tree, side = Tree(), math.ceil(len(pairs) ** (1 / 3))
    root = tree.product("assembly")
    for k, pair in enumerate(pairs):
        T = shift(*(SPACING * np.array([k % side, k // side % side, k // side**2]))) @ random_pose(rng)
        if rng.random() < 0.5:
            for name, shape in (("a", pair.a), ("b", pair.b)):
                tree.put(root, tree.product(f"{name}{k}", first_solid(moved(shape, T))), np.eye(4))
        elif pair.family.startswith("duplicate"):
            shared = tree.product(f"twice{k}", first_solid(pair.a))
            tree.put(root, shared, T)
            tree.put(root, shared, T @ matrix(pair.b.Location()))
        else:
            for name, shape in (("a", pair.a), ("b", pair.b)):
                tree.put(root, tree.product(f"{name}{k}", first_solid(occ.BRepBuilderAPI_Copy(shape).Shape())), T)
    return tree.write(path)


def judge(pairs, result):
    """Family -> counts of right, wrong and uncertain; and a line for each pair that is not right."""
    rows, names = {frozenset((row.a, row.b)): row for row in result.pairs}, [part.name for part in result.scene.parts]
    assert len(names) == 2 * len(pairs)
    counts, lines = defaultdict(lambda: dict.fromkeys(("right", "wrong", "uncertain"), 0)), []
    for k, pair in enumerate(pairs):
        row = rows.get(frozenset(names[2 * k : 2 * k + 2]))
        verdict = "clear" if row is None else row.verdict.value
        worth = "right" if verdict in pair.right else "uncertain" if verdict == "uncertain" else "wrong"
        counts[pair.family][worth] += 1
        if worth != "right":
            bounds = "" if row is None else f", [{row.distance.lower:.6g}, {row.distance.upper:.6g}] {row.reason}"
            lines.append(f"{worth}: {pair.family}, gap {pair.gap:.6g}: {verdict}{bounds}")
        elif not holds(pair, row):
            counts[pair.family]["right"] -= 1
            counts[pair.family]["wrong"] += 1
            lines.append(f"wrong bounds: {pair.family}, gap {pair.gap:.6g}: {row.distance}")
    return counts, lines


def holds(pair, row, slack=1e-6):
    """Whether the bounds of a pair hold the formula's distance, or minus its depth."""
    if row is None or pair.right is OVERLAPS:
        return True
    return row.distance.lower - slack <= pair.gap <= row.distance.upper + slack
