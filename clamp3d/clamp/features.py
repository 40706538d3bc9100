"""Analytic contact features of a clamp: its grooves, and the cylinders that lie in them, in part coordinates.

Part frames: origin as published (section), middle of the part along the wires; axes X right, Y along the wires, Z up.
"""

from __future__ import annotations

import math

import numpy as np

from clamp3d.clamp.dimensions import Clamp, GrooveDimensions, PartName, Wire
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array
from clamp3d.core.primitives import Cylinder, SweptArc

# Columns: the feature's x, y, z in part axes. A groove's mouth is +y and its axis z; a cylinder's axis is z.
_MOUTH_DOWN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_MOUTH_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def groove_pairs(clamp: Clamp) -> dict[tuple[PartName, PartName], GroovePair]:
    """The five CAS pairs of a clamp (Fig. 5): each splint with each wire, and the saddle with P2's round back.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> [f"{a}-{b}" for a, b in groove_pairs(load_clamp())]
    ['P1-P6', 'P1-P7', 'P2-P6', 'P2-P7', 'P3-P2']
    """
    up, down, saddle = clamp.up_splint, clamp.down_splint, clamp.saddle
    sides: tuple[tuple[PartName, int, Wire, GrooveDimensions, GrooveDimensions], ...] = (
        ("P6", -1, clamp.line, up.line_groove, down.line_groove),
        ("P7", +1, clamp.jumper, up.jumper_groove, down.jumper_groove),
    )
    pairs: dict[tuple[PartName, PartName], GroovePair] = {}
    for wire, side, dimensions, over, _ in sides:
        cylinder = Cylinder(dimensions.radius, clamp.wire_length)
        arc = _arc(over, over.centre_depth - up.thickness, up.length)
        T = _pose(_MOUTH_DOWN, up.width / 2 + side * over.offset, over.centre_depth)
        pairs["P1", wire] = GroovePair("P1", wire, arc, T, cylinder, _pose(_MOUTH_UP, 0.0, 0.0))
    for wire, side, dimensions, _, under in sides:
        cylinder = Cylinder(dimensions.radius, clamp.wire_length)
        arc = _arc(under, down.face_depth - under.centre_depth, down.length)
        T = _pose(_MOUTH_UP, side * under.offset, under.centre_depth)
        pairs["P2", wire] = GroovePair("P2", wire, arc, T, cylinder, _pose(_MOUTH_UP, 0.0, 0.0))
    back = Cylinder(down.back_radius, down.length)
    seat = SweptArc(saddle.radius, saddle.half_angle, saddle.length)
    pairs["P3", "P2"] = GroovePair("P3", "P2", seat, _pose(_MOUTH_UP, 0.0, 0.0), back, _pose(_MOUTH_UP, 0.0, 0.0))
    return pairs


def _arc(groove: GrooveDimensions, centre_to_face: float, length: float) -> SweptArc:
    """The arc ends on the inner face, ``centre_to_face`` mm from its centre: that is its half angle."""
    return SweptArc(groove.radius, math.acos(centre_to_face / groove.radius), length)


def _pose(R: Array, u: float, v: float) -> Array:
    """Feature at section point (u right, v down) of its part."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = (u, 0.0, -v)
    return T


def wire_pairs(clamp: Clamp) -> list[GroovePair]:
    """The four pairs of a splint's groove and a wire."""
    return [pair for pair in groove_pairs(clamp).values() if pair.b in ("P6", "P7")]
