"""Analytic contact features of a clamp: its grooves, and the cylinders that lie in them, in part coordinates.

Part frames: origin as published (section), middle of the part along the wires; axes X right, Y along the wires, Z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clamp3d.clamp.dimensions import Clamp, GrooveDimensions, PartName
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import Cylinder, SweptArc

# Columns: the feature's x, y, z in part axes. A groove's mouth is +y and its axis z; a cylinder's axis is z.
_MOUTH_DOWN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_MOUTH_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, slots=True)
class GroovePair:
    """A groove and the cylinder that is meant to lie in it (type 3 of the connection matrix).

    ``T_a_groove`` and ``T_b_cylinder`` (4, 4) place them in the frames of their parts ``a`` and ``b``.
    """

    a: PartName
    b: PartName
    groove: SweptArc
    T_a_groove: Array
    cylinder: Cylinder
    T_b_cylinder: Array


def groove_pairs(clamp: Clamp) -> dict[tuple[PartName, PartName], GroovePair]:
    """The five CAS pairs of a clamp (Fig. 5): each splint with each wire, and the saddle with P2's round back.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> [f"{a}-{b}" for a, b in groove_pairs(load_clamp())]
    ['P1-P6', 'P1-P7', 'P2-P6', 'P2-P7', 'P3-P2']
    """
    up, down, saddle = clamp.up_splint, clamp.down_splint, clamp.saddle
    wires: dict[PartName, Cylinder] = {
        "P6": Cylinder(clamp.line.radius, clamp.wire_length),
        "P7": Cylinder(clamp.jumper.radius, clamp.wire_length),
    }
    pairs = {}
    for wire, key, side in (("P6", "line_groove", -1), ("P7", "jumper_groove", 1)):
        g: GrooveDimensions = getattr(up, key)
        arc = SweptArc(g.radius, math.acos((g.centre_depth - up.thickness) / g.radius), up.length)
        T = _pose(_MOUTH_DOWN, up.width / 2 + side * g.offset, g.centre_depth)
        pairs["P1", wire] = GroovePair("P1", wire, arc, T, wires[wire], _pose(_MOUTH_UP, 0.0, 0.0))
    for wire, key, side in (("P6", "line_groove", -1), ("P7", "jumper_groove", 1)):
        g = getattr(down, key)
        arc = SweptArc(g.radius, math.acos((down.face_depth - g.centre_depth) / g.radius), down.length)
        T = _pose(_MOUTH_UP, side * g.offset, g.centre_depth)
        pairs["P2", wire] = GroovePair("P2", wire, arc, T, wires[wire], _pose(_MOUTH_UP, 0.0, 0.0))
    back = Cylinder(down.back_radius, down.length)
    arc = SweptArc(saddle.radius, saddle.half_angle, saddle.length)
    pairs["P3", "P2"] = GroovePair("P3", "P2", arc, _pose(_MOUTH_UP, 0.0, 0.0), back, _pose(_MOUTH_UP, 0.0, 0.0))
    return pairs  # type: ignore[return-value]


def _pose(R: Array, u: float, v: float) -> Array:
    """Feature at section point (u right, v down) of its part."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = (u, 0.0, -v)
    return T
