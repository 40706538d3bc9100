"""Machines with bearings, gears and seals of bd_warehouse: a gearbox, planets, a spindle, a hydraulic cylinder."""

import math
from collections import Counter

from bd_warehouse.bearing import (
    SingleRowCappedDeepGrooveBallBearing,
    SingleRowDeepGrooveBallBearing,
    SingleRowTaperedRollerBearing,
)
from bd_warehouse.fastener import ClearanceHole, HexNut, PlainWasher, SocketHeadCapScrew, TapHole
from bd_warehouse.gear import SpurGear
from bd_warehouse.o_rings import ORing
from bd_warehouse.retaining_ring import ExternalSnapRing, InternalSnapRing, RetainingRingGroove
from bolted import DOWN, FLIP, UP, place
from build123d import (
    Axis,
    Box,
    BuildPart,
    Cylinder,
    GridLocations,
    Location,
    Locations,
    Mode,
    PolarLocations,
    Pos,
    Rot,
    Torus,
    add,
    chamfer,
    fillet,
)

from clamp3d.files.cad import Key


def whole(parts, name, bearing, *places):
    """All solids of a bearing at some places: the races, then its rollers, caps or cage."""
    solids, numbers = bearing.solids(), {}
    often = Counter(Key(solid.wrapped) for solid in solids)
    for at in places:
        for k, solid in enumerate(solids):
            rest = "roller" if often[Key(solid.wrapped)] > 1 else f"cap-{k - 1}" if bearing.capped else "cage"
            kind = ("outer", "inner")[k] if k < 2 else rest
            numbers[kind] = numbers.get(kind, -1) + 1
            parts[f"{name}-{kind}_{numbers[kind]}"] = (at * solid).wrapped


def gearbox():
    """Two shafts with a gear each, in deep groove ball bearings, capped ones on the slower shaft; eight screws."""
    ball, capped = SingleRowDeepGrooveBallBearing("M8-24-8"), SingleRowCappedDeepGrooveBallBearing("M8-24-8")
    screw, apart, wide = SocketHeadCapScrew("M5-0.8", 16, "iso4762"), 2.0 * 17.5 + 0.05, 40.0
    at = [(0.0, 0.0), (apart, 0.0)]
    posts = [Pos(0.5 * apart, 0, 0) * x for x in GridLocations(84, 44, 2, 2).locations]
    parts = {}
    with BuildPart() as plate:
        with Locations((0.5 * apart, 0, 0)):
            Box(100, 60, 12, align=UP)
        fillet(plate.edges().filter_by(Axis.Z), 8)
        with Locations(*at):
            Cylinder(12, 8, align=UP, mode=Mode.SUBTRACT)
            Cylinder(7.5, 12, align=UP, mode=Mode.SUBTRACT)
        with Locations(*(x * Pos(0, 0, 12) for x in posts)):
            ClearanceHole(screw, counter_sunk=False)
    with BuildPart() as post:
        Cylinder(6, wide, align=UP)
        with Locations(Pos(0, 0, wide), FLIP):
            TapHole(screw, depth=14, counter_sunk=False)
    ends = [Pos(0, 0, wide), FLIP]
    place(parts, "plate", plate.part, *ends)
    place(parts, "post", post.part, *posts)
    place(
        parts,
        "screw",
        screw,
        *(Pos(x.position.X, x.position.Y, 0) * end * Pos(0, 0, 12) for end in ends for x in posts),
    )
    for k, (teeth, bearing, name) in enumerate(((15, ball, "ball"), (20, capped, "capped"))):
        x = at[k][0]
        with BuildPart() as shaft:
            Cylinder(4, wide + 30)
            Cylinder(7, wide - 1)
            chamfer(shaft.edges().group_by(Axis.Z)[0] + shaft.edges().group_by(Axis.Z)[-1], 1)
        turn = 0.0 if k == 0 else 180.0 / teeth * (1 + teeth % 2)
        with BuildPart() as gear:
            add(SpurGear(2.0, teeth, 20, 12, root_fillet=0.4))
            Cylinder(7, 20, mode=Mode.SUBTRACT)
        place(parts, f"shaft-{teeth}", shaft.part, Pos(x, 0, 0.5 * wide))
        place(parts, f"gear-{teeth}", gear.part, Pos(x, 0, 0.5 * wide) * Rot(0, 0, turn))
        whole(parts, name, bearing, *(Pos(x, 0, 0) * end for end in ends))
    return parts


def planets():
    """A planetary set of module 1: sun, three planets on capped bearings and pins, ring gear between covers, screws."""
    sun, planet, ring, thick = 18, 15, 48, 4.0
    bearing = SingleRowCappedDeepGrooveBallBearing("M4-11-4")
    screw, parts = SocketHeadCapScrew("M4-0.7", 20, "iso4762"), {}
    orbit, screws = PolarLocations(0.5 * (sun + planet), 3).locations, PolarLocations(30.0, 6).locations
    with BuildPart() as inner:
        add(SpurGear(1.0, sun, 20, thick))
        Cylinder(4, 30, mode=Mode.SUBTRACT)
    with BuildPart() as middle:
        add(SpurGear(1.0, planet, 20, thick))
        Cylinder(5.5, 30, mode=Mode.SUBTRACT)
    with BuildPart() as outer:
        Cylinder(34, thick + 4)
        add(SpurGear(1.0, ring, 20, 30, addendum=1.25, dedendum=1.0), mode=Mode.SUBTRACT)
        with Locations(*(at * Pos(0, 0, 10) for at in screws)):
            ClearanceHole(screw, counter_sunk=False)
    with BuildPart() as carrier:
        Cylinder(22, 3, align=UP)
        with Locations(*orbit):
            Cylinder(2, 3, align=UP, mode=Mode.SUBTRACT)
        Cylinder(6, 3, align=UP, mode=Mode.SUBTRACT)
    covers = []
    for tapped in (True, False):
        with BuildPart() as cover:
            Cylinder(34, 8, align=UP)
            Cylinder(26, 4, align=UP, mode=Mode.SUBTRACT)
            Cylinder(5, 8, align=UP, mode=Mode.SUBTRACT)
            with Locations(*(at * Pos(0, 0, 8) for at in screws)):
                (TapHole if tapped else ClearanceHole)(screw, counter_sunk=False)
        covers.append(cover.part)
    pin = Cylinder(2, thick + 5.6)
    place(parts, "sun", inner.part)
    place(parts, "shaft", Cylinder(4, 44))
    place(parts, "ring", outer.part)
    turned = []
    for k in range(3):
        angle = 2 * math.pi * k / 3
        turned.append(math.degrees(math.pi + angle + (0.5 * sun * angle - 0.5 * math.pi) / (0.5 * planet) - angle))
    place(parts, "planet", middle.part, *(at * Rot(0, 0, turn) for at, turn in zip(orbit, turned, strict=True)))
    place(parts, "pin", chamfer(pin.edges(), 0.3), *orbit)
    whole(parts, "bearing", bearing, *(at * Pos(0, 0, -0.5 * thick) for at in orbit))
    place(parts, "carrier", carrier.part, Pos(0, 0, 0.5 * thick + 0.2), FLIP * Pos(0, 0, 0.5 * thick + 0.2))
    place(parts, "cover-bottom", covers[0], FLIP * Pos(0, 0, 0.5 * thick + 2))
    place(parts, "cover-top", covers[1], Pos(0, 0, 0.5 * thick + 2))
    place(parts, "screw", screw, *(at * Pos(0, 0, 0.5 * thick + 10) for at in screws))
    return parts


def spindle():
    """Two tapered roller bearings back to back on a shaft with a retaining ring, in a housing with two covers."""
    bearing, snap = SingleRowTaperedRollerBearing("M20-42-15"), ExternalSnapRing("20")
    screw, parts = SocketHeadCapScrew("M5-0.8", 16, "iso4762"), {}
    holes = PolarLocations(28.0, 6).locations
    with BuildPart() as housing:
        Box(76, 76, 70)
        fillet(housing.edges().filter_by(Axis.Z), 10)
        Cylinder(19, 70, mode=Mode.SUBTRACT)
        for end in (Location(), FLIP):
            with Locations(end * Pos(0, 0, 35)):
                Cylinder(21, 15, align=DOWN, mode=Mode.SUBTRACT)
        with Locations(*(end * at * Pos(0, 0, 35) for end in (Location(), FLIP) for at in holes)):
            TapHole(screw, depth=14, counter_sunk=False)
    with BuildPart() as cover:
        Cylinder(34, 6, align=UP)
        Cylinder(18.5, 6, align=UP, mode=Mode.SUBTRACT)
        with Locations(*(at * Pos(0, 0, 6) for at in holes)):
            ClearanceHole(screw, counter_sunk=False)
    with BuildPart() as shaft:
        Cylinder(10, 110)
        Cylinder(12.5, 40)
        with Locations((0, 0, 35)):
            add(RetainingRingGroove(snap), mode=Mode.SUBTRACT)
    place(parts, "housing", housing.part)
    place(parts, "shaft", shaft.part)
    place(parts, "snap-ring", snap, Pos(0, 0, 35))
    ends = [Pos(0, 0, 20), FLIP * Pos(0, 0, 20)]
    whole(parts, "taper", bearing, *ends)
    covers = [Pos(0, 0, 35), FLIP * Pos(0, 0, 35)]
    place(parts, "cover", cover.part, *covers)
    place(parts, "screw", screw, *(end * at * Pos(0, 0, 6) for end in covers for at in holes))
    return parts


def cylinder():
    """A hydraulic cylinder: tube, piston with rings in their grooves, rod, heads, tie rods with nuts and washers."""
    parts, bore, long = {}, 40.0, 90.0
    seal, rod_seal = ORing("326"), ORing("210")
    snap, washer, nut = InternalSnapRing("28"), PlainWasher("M10", "iso7089"), HexNut("M10-1.5", "iso4032")
    ties = GridLocations(50, 50, 2, 2).locations
    deep = seal.width * 0.85
    with BuildPart() as piston:
        Cylinder(0.5 * bore - 0.05, 24)
        Cylinder(8, 24, mode=Mode.SUBTRACT)
        with Locations((0, 0, -6), (0, 0, 6)):
            Cylinder(0.5 * bore, 1.2 * seal.width, mode=Mode.SUBTRACT)
            Cylinder(0.5 * bore - deep, 1.2 * seal.width)
        Cylinder(8, 24, mode=Mode.SUBTRACT)
    with BuildPart() as tube:
        Cylinder(0.5 * bore + 5, long)
        Cylinder(0.5 * bore, long, mode=Mode.SUBTRACT)
    heads = []
    for opened in (True, False):
        with BuildPart() as head:
            Box(66, 66, 22, align=UP)
            fillet(head.edges().filter_by(Axis.Z), 8)
            with Locations(*ties):
                Cylinder(5.25, 60, mode=Mode.SUBTRACT)
            Cylinder(0.5 * bore + 5, 4, align=UP, mode=Mode.SUBTRACT)
            if opened:
                Cylinder(10, 60, mode=Mode.SUBTRACT)
                with Locations((0, 0, 9)):
                    Torus(10 + 0.4 * rod_seal.width, 0.5 * rod_seal.width, mode=Mode.SUBTRACT)
                with Locations((0, 0, 15)):
                    Cylinder(14, 10, align=UP, mode=Mode.SUBTRACT)
                with Locations((0, 0, 18.5)):
                    add(RetainingRingGroove(snap), mode=Mode.SUBTRACT)
        heads.append(head.part)
    with BuildPart() as rod:
        with Locations((0, 0, -12)):
            Cylinder(8, 24, align=UP)
        with Locations((0, 0, 12)):
            Cylinder(9.95, 90, align=UP)
        chamfer(rod.edges().group_by(Axis.Z)[-1], 1)
    bush = Cylinder(14, 3.5, align=UP) - Cylinder(10, 3.5, align=UP)
    top, bottom = Pos(0, 0, 0.5 * long - 4), Pos(0, 0, -0.5 * long + 4) * FLIP
    place(parts, "tube", tube.part)
    place(parts, "piston", piston.part)
    place(parts, "rod", rod.part)
    place(parts, "seal", seal, *(Pos(0, 0, z) for z in (-6, 6)))
    place(parts, "rod-seal", rod_seal, top * Pos(0, 0, 9))
    place(parts, "head-open", heads[0], top)
    place(parts, "head-blind", heads[1], bottom)
    place(parts, "bush", bush, top * Pos(0, 0, 15))
    place(parts, "snap-ring", snap, top * Pos(0, 0, 18.5))
    place(parts, "tie-rod", Cylinder(5, long + 28 + 36), *ties)
    ends = [Pos(at.position.X, at.position.Y, 0) * end * Pos(0, 0, 22) for end in (top, bottom) for at in ties]
    place(parts, "washer", washer, *ends)
    place(parts, "nut", nut, *(end * Pos(0, 0, 2.2) for end in ends))
    return parts


MACHINES = {made.__name__: made for made in (gearbox, planets, spindle, cylinder)}
