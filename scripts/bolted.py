"""Parts of bd_warehouse that are bolted together: a pipe flange, plates with screws, pipes in clips, a piano hinge."""

import itertools

from bd_warehouse.fastener import (
    ClearanceHole,
    CounterSunkScrew,
    HexHeadScrew,
    HexNut,
    HexNutWithFlange,
    PanHeadScrew,
    PlainWasher,
    SocketHeadCapScrew,
    TapHole,
)
from bd_warehouse.flange import SlipOnFlange, WeldNeckFlange
from bd_warehouse.pipe import Pipe
from build123d import (
    Align,
    Axis,
    Box,
    BuildPart,
    Cylinder,
    Edge,
    FilletPolyline,
    Location,
    Locations,
    Mode,
    PolarLocations,
    Pos,
    Rot,
    chamfer,
    fillet,
)

UP = (Align.CENTER, Align.CENTER, Align.MIN)
DOWN = (Align.CENTER, Align.CENTER, Align.MAX)
FLIP = Rot(180, 0, 0)
GRID = list(itertools.product((-45, -22.5, 0, 22.5, 45), (-26, 26)))


def place(parts, name, made, *places):
    """A part of build123d at each of some places, as instances of one product: named ``name_0``, ``name_1``."""
    solid = made.solid()
    for k, at in enumerate(places or (Location(),)):
        parts[name if len(places) < 2 else f"{name}_{k}"] = (at * solid).wrapped


def flange():
    """A slip-on flange on a pipe, a gasket, a welding neck: twelve M20 bolts with two washers and a nut each."""
    slip, neck = SlipOnFlange("6", 300, "Raised"), WeldNeckFlange("6", 300, "Raised")
    gasket, bolts = 1.5, PolarLocations(269.9 / 2, 12).locations
    top, bottom = (_seat(x) + 0.5 * gasket for x in (slip, neck))
    washer, screw = PlainWasher("M20", "iso7089"), HexHeadScrew("M20-2.5", 110, "iso4014")
    thick, parts = 3.3, {}
    place(parts, "slip-on", slip, Pos(0, 0, 0.5 * gasket))
    place(parts, "welding-neck", neck, Pos(0, 0, -0.5 * gasket) * FLIP)
    place(parts, "gasket", Cylinder(110, gasket) - Cylinder(86, gasket))
    place(parts, "pipe", Pipe("6", "stainless", "40S", path=Edge.make_line((0, 0, 2.4), (0, 0, 180))))
    place(parts, "bolt", screw, *(at * Pos(0, 0, top + thick) for at in bolts))
    ends = [at * Pos(0, 0, z) for z in (top, -bottom - thick) for at in bolts]
    place(parts, "washer", washer, *ends)
    place(parts, "nut", HexNut("M20-2.5", "iso4032"), *(at * Pos(0, 0, -bottom - thick) * FLIP for at in bolts))
    return parts


def _seat(made):
    """How far from the face of a flange the nuts sit."""
    backs = made.faces().filter_by(Axis.Z).sort_by(lambda face: face.area)
    return next(face.center().Z for face in reversed(backs) if face.normal_at().Z > 0.5)


def plates():
    """A base, a cover and a rail: socket heads in counterbores, through bolts with flanged nuts, sunk screws, pins."""
    cap, bolt = SocketHeadCapScrew("M6-1", 25, "iso4762"), HexHeadScrew("M8-1.25", 45, "iso4014")
    sunk, washer = CounterSunkScrew("M4-0.7", 16, "iso10642"), PlainWasher("M8", "iso7089")
    corners = [(x, y) for x in (-66, 66) for y in (-26, 26)]
    rail_at, pin_at = [(x, 0) for x in (-30, -10, 10, 30)], [(-56, 0), (56, 0)]
    with BuildPart() as base:
        Box(150, 80, 20, align=DOWN)
        fillet(base.edges().filter_by(Axis.Z), 6)
        with Locations(*((x, y, 0) for x, y in GRID)):
            TapHole(cap, depth=18, counter_sunk=False)
        with Locations(*((x, y, 0) for x, y in corners)):
            ClearanceHole(bolt, counter_sunk=False)
        with Locations(*((x, y, 0) for x, y in pin_at)):
            Cylinder(3, 12, align=DOWN, mode=Mode.SUBTRACT)
    with BuildPart() as cover:
        Box(150, 80, 14, align=UP)
        fillet(cover.edges().filter_by(Axis.Z), 6)
        with Locations(*((x, y, 14) for x, y in GRID)):
            ClearanceHole(cap)
        with Locations(*((x, y, 14) for x, y in corners)):
            ClearanceHole(bolt, fit="Close", counter_sunk=False)
        with Locations(*((x, y, 14) for x, y in rail_at)):
            TapHole(sunk, depth=11, counter_sunk=False)
        with Locations(*((x, y, 0) for x, y in pin_at)):
            Cylinder(3, 14, align=UP, mode=Mode.SUBTRACT)
    with BuildPart() as rail:
        with Locations((0, 0, 14)):
            Box(90, 20, 8, align=UP)
        chamfer(rail.faces().sort_by(Axis.Z)[-1].edges(), 1)
        with Locations(*((x, y, 22) for x, y in rail_at)):
            ClearanceHole(sunk)
    parts = {}
    for name, made in (("base", base.part), ("cover", cover.part), ("rail", rail.part)):
        place(parts, name, made)
    place(parts, "cap-screw", cap, *(at for at in cap.hole_locations if at.position.Z > 0.5))
    place(parts, "countersunk", sunk, *(at for at in sunk.hole_locations if at.position.Z > 15))
    place(parts, "bolt", bolt, *(Pos(x, y, 15.6) for x, y in corners))
    place(parts, "washer", washer, *(Pos(x, y, 14) for x, y in corners))
    place(parts, "nut", HexNutWithFlange("M8-1.25", "din1665"), *(Pos(x, y, -20) * FLIP for x, y in corners))
    pin = Cylinder(3, 24)
    place(parts, "pin", chamfer(pin.edges().sort_by(Axis.Z)[0], 0.5), *(Pos(x, y, 1) for x, y in pin_at))
    return parts


def pipes():
    """Two bent pipes in eight clips on a plate; each clip with two pan heads on washers, in tapped holes."""
    screw, washer = PanHeadScrew("M5-0.8", 16, "iso1580"), PlainWasher("M5", "iso7089")
    parts, radius, high = {}, 0.5 * 0.84 * 25.4, 18.0
    runs = {
        "pipe-long": [(-140, -60, high), (20, -60, high), (20, 60, high), (140, 60, high)],
        "pipe-short": [(-140, -10, high), (-40, -10, high), (-40, 90, high), (140, 90, high)],
    }
    for name, corners in runs.items():
        path = FilletPolyline(*corners, radius=32)
        place(parts, name, Pipe("1/2", "stainless", "40S", path=path.wire()))
    with BuildPart() as clip:
        Box(54, 12, high - 2 * radius + 6, align=UP)
        Box(2 * radius + 6, 12, high + radius + 3, align=UP)
        fillet(clip.edges().filter_by(Axis.Y).group_by(Axis.Z)[-1], radius)
        with Locations(Pos(0, 0, high) * Rot(90, 0, 0)):
            Cylinder(radius, 30, mode=Mode.SUBTRACT)
        with Locations((-21, 0, high - 2 * radius + 6), (21, 0, high - 2 * radius + 6)):
            ClearanceHole(screw, depth=20, counter_sunk=False)
    foot = high - 2 * radius + 6
    across = [(-110, -60), (-30, -60), (60, 60), (120, 60), (-90, -10), (20, 90), (80, 90)]
    along = [(20, 0)]
    clips = [Pos(x, y, 0) * Rot(0, 0, 90) for x, y in across] + [Pos(x, y, 0) for x, y in along]
    holes = [at * Pos(x, 0, 0) for at in clips for x in (-21, 21)]
    with BuildPart() as plate:
        with Locations((0, 15, 0)):
            Box(300, 210, 12, align=DOWN)
        with Locations(*holes):
            TapHole(screw, depth=12, counter_sunk=False)
    place(parts, "plate", plate.part)
    place(parts, "clip", clip.part, *clips)
    place(parts, "washer", washer, *(at * Pos(0, 0, foot) for at in holes))
    place(parts, "screw", screw, *(at * Pos(0, 0, foot + 1.1) for at in holes))
    return parts


def piano():
    """A piano hinge between two boards: twenty knuckles on one pin, twelve countersunk screws with crossed recesses."""
    screw = CounterSunkScrew("M4-0.7", 16, "iso7046")
    length, wide, thick, outer = 240.0, 24.0, 2.5, 3.5
    knuckle, at = length / 20, [20.0 + 40.0 * k for k in range(6)]
    parts = {}
    for side, name in ((-1, "left"), (1, "right")):
        turned = Pos(side * 14, 0, 0)
        with BuildPart() as leaf:
            with Locations((side * 14, 0.5 * length, 0)):
                Box(wide - 4, length, thick, align=(Align.CENTER, Align.CENTER, Align.MAX))
            for k in range(20):
                if k % 2 == (side > 0):
                    with Locations((0, (k + 0.5) * knuckle, 0)):
                        Cylinder(outer, knuckle - 0.2, rotation=(90, 0, 0))
                        with Locations((side * 2.5, 0, 0)):
                            Box(5, knuckle - 0.2, thick, align=(Align.CENTER, Align.CENTER, Align.MAX))
            with Locations((0, 0.5 * length, 0)):
                Cylinder(2.05, 2 * length, rotation=(90, 0, 0), mode=Mode.SUBTRACT)
            with Locations(*(turned * Pos(0, y, 0) for y in at)):
                ClearanceHole(screw)
        with BuildPart() as board:
            with Locations((side * 30, 0.5 * length, -thick)):
                Box(52, length, 18, align=DOWN)
            with Locations(*(turned * Pos(0, y, -thick) for y in at)):
                TapHole(screw, depth=15, counter_sunk=False)
        place(parts, f"leaf-{name}", leaf.part)
        place(parts, f"board-{name}", board.part)
        place(parts, f"screw-{name}", screw, *(turned * Pos(0, y, 0) for y in at))
    place(parts, "pin", Pos(0, 0.5 * length, 0) * Rot(90, 0, 0) * Cylinder(2.0, length + 4))
    return parts


BOLTED = {made.__name__: made for made in (flange, plates, pipes, piano)}
