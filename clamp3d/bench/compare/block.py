"""A plain block with one groove: the smallest part to try contact models on."""

from __future__ import annotations

import math

from clamp3d.core.extrusion import Extrusion
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array, rotation
from clamp3d.core.primitives import Cylinder, SweptArc
from clamp3d.core.profile import Arc, Profile
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError


def grooved_block(groove: SweptArc, *, width: float, depth: float) -> Solid:
    """Block ``width`` x ``depth`` mm in section, as long as its groove, whose mouth is in the middle of the top face.

    The arc centre is the part's origin, the mouth is up (+Z), the groove runs along Y. Raises InputError where the
    groove does not fit into the block.

    >>> block = grooved_block(SweptArc(12.0, math.radians(70.0), 60.0), width=137.0, depth=30.0)
    >>> block.bounds.round(3).tolist()
    [[-68.5, -30.0, -34.104], [68.5, 30.0, -4.104]]
    """
    R, half = groove.radius, groove.half_angle
    face = R * math.cos(half)
    widest = R * math.sin(half) if half < math.pi / 2 else R
    for name, value, least in (("width", width, 2.0 * widest), ("depth", depth, R - face)):
        if not (math.isfinite(value) and value > least):
            raise InputError(f"block {name} must be > {least:g} mm to hold the groove, got {value}")
    w, bottom = width / 2, face + depth
    outline = Profile.of(
        (-w, face), Arc((0.0, 0.0), R, math.pi / 2 + half, math.pi / 2 - half), (w, face), (w, bottom), (-w, bottom)
    )
    body = Extrusion(outline, "Y", -groove.length / 2, groove.length / 2)
    return Solid("P1", (body,), title="Grooved block", volume=body.volume)


def block_pair(groove: SweptArc, wire: Cylinder) -> GroovePair:
    """The groove of `grooved_block` (as part P1) and a wire (P6) whose own frame has its axis on Y."""
    lay: Array = rotation([1.0, 0.0, 0.0], math.pi / 2)
    lay = lay.round()  # a quarter turn has no rounding: mouth +y to Z, groove axis z to -Y
    return GroovePair("P1", "P6", groove, lay, wire, lay)
