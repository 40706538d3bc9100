"""The seven parts as analytic bodies: outlines drawn along an axis, less their holes, their grooves, and their scene.

Part frames: origin as published, part's middle at Y = 0; axes X right, Y along the wires, Z up. Section outlines are
given in the paper's section coordinates u right, v down, so X = u and Z = -v.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from clamp3d.checks import instance
from clamp3d.clamp.dimensions import (
    TITLES,
    TOUCHING,
    Bolt,
    Clamp,
    DownSplint,
    GrooveDimensions,
    Nut,
    PartName,
    Saddle,
    UpSplint,
)
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.scene import Part, Scene
from clamp3d.errors import InputError
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import Cylinder, SweptArc
from clamp3d.geometry.profile import Arc, Profile
from clamp3d.geometry.shapes import Solid
from clamp3d.kernel.contact_model import GroovePair

# Columns: the feature's x, y, z in part axes. A groove's mouth is +y and its axis z; a cylinder's axis is z.
_MOUTH_DOWN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_MOUTH_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_kept = lru_cache(maxsize=16)
"""A clamp asks for the same parts at every pose."""
_ANGLES = 256
"""Angles of a mean that is exact to rounding up to a hole of 0.9999 of the saddle's radius."""


def parts(clamp: Clamp) -> dict[PartName, Solid]:
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
        "P6": wire_solid("P6", clamp.line.radius, clamp.wire_length),
        "P7": wire_solid("P7", clamp.jumper.radius, clamp.wire_length),
    }


def clamp_scene(clamp: Clamp, poses: Mapping[str, Array], *, clearance: float = 0.0) -> Scene:
    """The parts P1 to P7 at ``poses`` (``T_world_part``, mm); contacts that the matrix declares are allowed."""
    placed = tuple(Part(name, solid, poses[name]) for name, solid in parts(clamp).items())
    allowed = tuple(Allowed(a, b) for a, row in clamp.connections.items() for b, kind in row.items() if kind)
    return Scene(placed, TOUCHING, clearance, allowed, name=clamp.name)


def groove_pairs(clamp: Clamp) -> dict[tuple[PartName, PartName], GroovePair]:
    """The five CAS pairs of a clamp (Fig. 5): each splint with each wire, and the saddle with P2's round back.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> [f"{a}-{b}" for a, b in groove_pairs(load_clamp())]
    ['P1-P6', 'P1-P7', 'P2-P6', 'P2-P7', 'P3-P2']
    """
    up, down, saddle = clamp.up_splint, clamp.down_splint, clamp.saddle
    pairs: dict[tuple[PartName, PartName], GroovePair] = {}
    for name, splint, mouth, middle in (("P1", up, _MOUTH_DOWN, up.width / 2), ("P2", down, _MOUTH_UP, 0.0)):
        for wire, side, radius, groove in (
            ("P6", -1, clamp.line.radius, splint.line_groove),
            ("P7", +1, clamp.jumper.radius, splint.jumper_groove),
        ):
            arc = SweptArc(groove.radius, splint.half_angle(groove), splint.length)
            T = _pose(mouth, middle + side * groove.offset, groove.centre_depth)
            cylinder = Cylinder(radius, clamp.wire_length)
            pairs[name, wire] = GroovePair(name, wire, arc, T, cylinder, _pose(_MOUTH_UP, 0.0, 0.0))
    back = Cylinder(down.back_radius, down.length)
    seat = SweptArc(saddle.radius, saddle.half_angle, saddle.length)
    pairs["P3", "P2"] = GroovePair("P3", "P2", seat, _pose(_MOUTH_UP, 0.0, 0.0), back, _pose(_MOUTH_UP, 0.0, 0.0))
    return pairs


def _pose(R: Array, u: float, v: float) -> Array:
    """Feature at section point (u right, v down) of its part."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = (u, 0.0, -v)
    return T


@_kept
def _up_splint(d: UpSplint) -> Solid:
    _check_hole("up_splint.hole_diameter", d.hole_diameter, d.length)
    middle = d.width / 2
    outline = Profile.of(
        (0.0, 0.0),
        (d.width, 0.0),
        (d.width, d.thickness),
        _groove(d, d.jumper_groove, middle + d.jumper_groove.offset, -math.pi / 2),
        _groove(d, d.line_groove, middle - d.line_groove.offset, -math.pi / 2),
        (0.0, d.thickness),
    )
    body = _along_wires(outline, d.length)
    hole = Extrusion(Profile.circle(d.hole_diameter / 2, (middle, 0.0)), "Z", -d.thickness, 0.0)
    return Solid("P1", (body,), (hole,), title=TITLES["P1"], volume=body.volume - hole.volume)


@_kept
def _down_splint(d: DownSplint) -> Solid:
    _check_hole("down_splint.slot_length", d.slot_length, d.length)
    half = math.radians(d.back_half_angle_deg)
    right = d.width / 2
    outline = Profile.of(
        (-right, d.face_depth),
        _groove(d, d.line_groove, -d.line_groove.offset, math.pi / 2),
        _groove(d, d.jumper_groove, d.jumper_groove.offset, math.pi / 2),
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
    return Solid("P2", (body,), (slot,), title=TITLES["P2"], volume=body.volume - section * d.slot_length)


@_kept
def _saddle(d: Saddle) -> Solid:
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
    return Solid("P3", (body,), (hole,), title=TITLES["P3"], volume=body.volume - drilled)


@_kept
def _bolt(d: Bolt) -> Solid:
    shank = Extrusion(Profile.circle(d.diameter / 2), "Z", -d.shank_length, 0.0)
    head = Extrusion(Profile.hexagon(d.head_across_flats), "Z", -d.shank_length - d.head_height, -d.shank_length)
    return Solid("P4", (shank, head), title=TITLES["P4"], volume=shank.volume + head.volume, not_modelled="thread")


@_kept
def _nut(d: Nut, bolt_diameter: float) -> Solid:
    body = Extrusion(Profile.hexagon(d.across_flats), "Z", -d.height, 0.0)
    hole = Extrusion(Profile.circle(bolt_diameter / 2), "Z", -d.height, 0.0)
    return Solid(
        "P5",
        (body,),
        (hole,),
        title=TITLES["P5"],
        volume=body.volume - hole.volume,
        not_modelled="thread; washers are part of the nut",
    )


@_kept
def wire_solid(name: PartName, radius: float, length: float) -> Solid:
    """A wire of ``length`` mm."""
    body = _along_wires(Profile.circle(radius), length)
    return Solid(name, (body,), title=TITLES[name], volume=body.volume, not_modelled="strands")


def _groove(splint: UpSplint | DownSplint, d: GrooveDimensions, centre: float, middle: float) -> Arc:
    """Concave arc about u = ``centre`` that ends on the inner face; ``middle`` is the direction of its material."""
    half = splint.half_angle(d)
    return Arc((centre, d.centre_depth), d.radius, middle + half, middle - half)


def _along_wires(profile: Profile, length: float) -> Extrusion:
    return Extrusion(profile, "Y", -length / 2, length / 2)


def _disk_under_arch(a: float, radius: float) -> float:
    """Volume between a disk of radius ``a`` and the cylinder of ``radius`` that arches over it, axis in its plane.

    It is 4 a^2 R times the integral of cos^2 t sqrt(1 - (a / R)^2 sin^2 t) from 0 to pi/2. The integrand is periodic,
    so the mean of evenly spaced values is the integral to rounding.
    """
    t = (np.arange(_ANGLES) + 0.5) * (math.pi / 2.0) / _ANGLES
    mean = np.mean(np.cos(t) ** 2 * np.sqrt(1.0 - (a / radius * np.sin(t)) ** 2))
    return float(2.0 * math.pi * a * a * radius * mean)


def _check_hole(key: str, size: float, length: float) -> None:
    if size >= length:
        raise InputError(f"{key} must be < the part's length = {length:g} mm, got {size:g}")
