"""Analytic contact features of a clamp: its grooves, and the cylinders that lie in them, in part coordinates.

Part frames: origin as published (section), middle of the part along the wires; axes X right, Y along the wires, Z up.
"""

from __future__ import annotations

import numpy as np

from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import Cylinder, SweptArc
from clamp3d.kernel.contact_model import GroovePair

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
