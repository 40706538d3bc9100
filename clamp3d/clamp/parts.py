"""The seven parts as analytic bodies: outlines drawn along an axis, less their holes. No mesh here.

Part frames: origin as published, part's middle at Y = 0; axes X right, Y along the wires, Z up. Section outlines are
given in the paper's section coordinates u right, v down, so X = u and Z = -v.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance, shown
from clamp3d.clamp.dimensions import (
    PARTS,
    TITLES,
    Bolt,
    Clamp,
    DownSplint,
    GrooveDimensions,
    Nut,
    PartName,
    Saddle,
    UpSplint,
    Wire,
)
from clamp3d.clamp.profile import Arc, Profile
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array

# Columns: directions of the outline's a, b and of the drawing axis in part axes; both are right-handed.
_FRAMES = {
    "Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "Z": np.eye(3),
}


@dataclass(frozen=True, slots=True)
class Extrusion:
    """An outline drawn along part axis Y or Z from ``start`` to ``end`` mm.

    Along Y the outline's coordinates are (u, v), u = X and v = -Z; along Z they are (X, Y).
    """

    profile: Profile
    axis: Literal["Y", "Z"]
    start: float
    end: float

    @property
    def frame(self) -> Array:
        """Rotation (3, 3): outline coordinates (a, b, along) to part axes (X, Y, Z)."""
        return _FRAMES[self.axis].copy()

    @property
    def length(self) -> float:
        """Length along the axis in mm."""
        return self.end - self.start

    @property
    def volume(self) -> float:
        """Area times length in mm^3."""
        return self.profile.area * self.length

    def support(self, direction: ArrayLike) -> float:
        """Largest dot product of ``direction`` (3,) in part axes with a point of the body, mm; exact on arcs."""
        da, db, along = (float(d) for d in np.asarray(direction) @ _FRAMES[self.axis])
        return self.profile.support(da, db) + max(along * self.start, along * self.end)


@dataclass(frozen=True, slots=True)
class Part:
    """One part: the union of ``bodies`` (they touch at most) less the ``holes`` (each goes right through).

    ``volume`` in mm^3 is closed form; ``not_modelled`` says what the real part has and this one has not.
    """

    name: PartName
    title: str
    bodies: tuple[Extrusion, ...]
    holes: tuple[Extrusion, ...]
    volume: float
    not_modelled: str = ""

    @property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of the bounding box in part axes, mm; arcs taken as arcs."""
        return self.bounds_at(np.eye(4))

    def bounds_at(self, T: Array) -> Array:
        """Lower and upper corner (2, 3) of the bounding box along the target's axes, placed by ``T`` (4, 4)."""
        reach = [[max(body.support(s * axis) for body in self.bodies) for axis in T[:3, :3]] for s in (-1.0, 1.0)]
        return np.array([T[:3, 3] - reach[0], T[:3, 3] + reach[1]]) + 0.0


def parts(clamp: Clamp) -> dict[PartName, Part]:
    """All seven parts of a clamp, in the order P1 to P7. Raises InputError if a hole is longer than its part.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> {name: round(part.volume) for name, part in parts(load_clamp()).items()}["P1"]
    212456
    """
    instance("clamp", clamp, Clamp)
    return {
        "P1": _up_splint(clamp.up_splint),
        "P2": _down_splint(clamp.down_splint),
        "P3": _saddle(clamp.saddle),
        "P4": _bolt(clamp.bolt),
        "P5": _nut(clamp.nut, clamp.bolt.diameter),
        "P6": _wire("P6", clamp.line, clamp.wire_length),
        "P7": _wire("P7", clamp.jumper, clamp.wire_length),
    }


def check_part_name(name: str) -> PartName:
    """Return ``name`` if it is one of P1 to P7, else raise InputError."""
    if not (isinstance(name, str) and name in PARTS):
        raise InputError(f"unknown part {shown(name)}; available: {', '.join(PARTS)}")
    return name


def _up_splint(d: UpSplint) -> Part:
    _check_hole("up_splint.hole_diameter", d.hole_diameter, d.length)
    middle = d.width / 2
    outline = Profile.of(
        (0.0, 0.0),
        (d.width, 0.0),
        (d.width, d.thickness),
        _groove(d.jumper_groove, middle + d.jumper_groove.offset, d.jumper_groove.centre_depth - d.thickness, up=True),
        _groove(d.line_groove, middle - d.line_groove.offset, d.line_groove.centre_depth - d.thickness, up=True),
        (0.0, d.thickness),
    )
    body = _along_wires(outline, d.length)
    hole = Extrusion(Profile.circle(d.hole_diameter / 2, (middle, 0.0)), "Z", -d.thickness, 0.0)
    return Part("P1", TITLES["P1"], (body,), (hole,), body.volume - hole.volume)


def _down_splint(d: DownSplint) -> Part:
    _check_hole("down_splint.slot_length", d.slot_length, d.length)
    half = math.radians(d.back_half_angle_deg)
    right = d.width / 2
    outline = Profile.of(
        (-right, d.face_depth),
        _groove(d.line_groove, -d.line_groove.offset, d.face_depth - d.line_groove.centre_depth, up=False),
        _groove(d.jumper_groove, d.jumper_groove.offset, d.face_depth - d.jumper_groove.centre_depth, up=False),
        (right, d.face_depth),
        (right, d.underside_depth),
        Arc((0.0, 0.0), d.back_radius, math.pi / 2 - half, math.pi / 2 + half),
        (-right, d.underside_depth),
    )
    body = _along_wires(outline, d.length)
    slot = Extrusion(Profile.rectangle(d.slot_width, d.slot_length), "Z", -d.back_radius, -d.face_depth)
    # Section of the slot: from the inner face down to the round back, or to the flat underside beside it.
    s, back = d.slot_width / 2, d.back_radius * math.sin(half)
    reach = min(s, back)
    under_back = reach * math.sqrt(d.back_radius**2 - reach**2) + d.back_radius**2 * math.asin(reach / d.back_radius)
    section = under_back + 2.0 * (s - reach) * d.underside_depth - 2.0 * s * d.face_depth
    return Part("P2", TITLES["P2"], (body,), (slot,), body.volume - section * d.slot_length)


def _saddle(d: Saddle) -> Part:
    _check_hole("saddle.hole_diameter", d.hole_diameter, d.length)
    bottom = d.radius + d.apex_thickness
    edge = math.sqrt(d.radius**2 - (d.width / 2) ** 2)
    outline = Profile.of(
        (-d.width / 2, edge),
        Arc((0.0, 0.0), d.radius, math.pi / 2 + d.half_angle, math.pi / 2 - d.half_angle),
        (d.width / 2, edge),
        (d.width / 2, bottom),
        (-d.width / 2, bottom),
    )
    body = _along_wires(outline, d.length)
    a = d.hole_diameter / 2
    hole = Extrusion(Profile.circle(a), "Z", -bottom, -edge)
    drilled = math.pi * a * a * bottom - _disk_under_arch(a, d.radius)
    return Part("P3", TITLES["P3"], (body,), (hole,), body.volume - drilled)


def _bolt(d: Bolt) -> Part:
    shank = Extrusion(Profile.circle(d.diameter / 2), "Z", -d.shank_length, 0.0)
    head = Extrusion(Profile.hexagon(d.head_across_flats), "Z", -d.shank_length - d.head_height, -d.shank_length)
    return Part("P4", TITLES["P4"], (shank, head), (), shank.volume + head.volume, "thread")


def _nut(d: Nut, bolt_diameter: float) -> Part:
    body = Extrusion(Profile.hexagon(d.across_flats), "Z", -d.height, 0.0)
    hole = Extrusion(Profile.circle(bolt_diameter / 2), "Z", -d.height, 0.0)
    return Part("P5", TITLES["P5"], (body,), (hole,), body.volume - hole.volume, "thread; washers are part of the nut")


def _wire(name: PartName, wire: Wire, length: float) -> Part:
    body = _along_wires(Profile.circle(wire.radius), length)
    return Part(name, TITLES[name], (body,), (), body.volume, "strands")


def _groove(d: GrooveDimensions, centre: float, centre_to_face: float, *, up: bool) -> Arc:
    """Concave arc about u = ``centre`` that ends on the inner face; its material lies above it (``up``) or below."""
    half = math.acos(centre_to_face / d.radius)
    middle = -math.pi / 2 if up else math.pi / 2
    return Arc((centre, d.centre_depth), d.radius, middle + half, middle - half)


def _along_wires(profile: Profile, length: float) -> Extrusion:
    return Extrusion(profile, "Y", -length / 2, length / 2)


def _disk_under_arch(a: float, radius: float) -> float:
    """Volume between a disk of radius ``a`` and the cylinder of ``radius`` that arches over it, axis in its plane.

    It is 4 a^2 R times the integral of cos^2 t sqrt(1 - m sin^2 t) from 0 to pi/2 with m = (a / R)^2, which complete
    elliptic integrals of that parameter give as ((1 + m) E - (1 - m) K) / (3 m).
    """
    from scipy.special import ellipe, ellipk

    m = (a / radius) ** 2
    return float(4.0 * a * a * radius * ((1.0 + m) * ellipe(m) - (1.0 - m) * ellipk(m)) / (3.0 * m))


def _check_hole(key: str, size: float, length: float) -> None:
    if size >= length:
        raise InputError(f"{key} must be < the part's length = {length:g} mm, got {size:g}")
