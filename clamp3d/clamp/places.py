"""Where all parts are in a state of the section, with the power line at rest."""

from __future__ import annotations

from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.section import B, S, Section, U, V, W
from clamp3d.geometry.pose import Array, SectionPose

Poses = dict[PartName, SectionPose]


def section_poses(section: Section, q: Array, saddle_d: float | None = None) -> Poses:
    """Section poses of all parts with the line at rest; ``saddle_d`` is where the saddle stands if not under P2."""
    clamp = section.clamp
    x, y = -float(q[0]), -float(q[1])
    down = section.down_splint(q)
    saddle_y = y + (down.y - _saddle_lift(section, q) if saddle_d is None else saddle_d - clamp.back_clearance)
    bolt_y = saddle_y + clamp.saddle.radius + clamp.saddle.apex_thickness - clamp.bolt.shank_length
    bolt_x = x + section.bolt_x + float(q[B])
    return {
        "P1": SectionPose(x, y),
        "P2": SectionPose(x + down.x, y + down.y, down.angle),
        "P3": SectionPose(bolt_x + float(q[V]), saddle_y),
        "P4": SectionPose(bolt_x, bolt_y),
        "P5": SectionPose(bolt_x, y - clamp.nut.height),
        "P6": SectionPose(0.0, 0.0),
        "P7": SectionPose(x + float(q[2]), y + float(q[3])),
    }


def saddle_rise(section: Section, q: Array, saddle_d: float) -> float:
    """How far the saddle rises from where it stood with ``saddle_d`` until it meets the round back at ``q``; mm."""
    opened = section.down_splint(q).y - saddle_d + section.clamp.back_clearance
    return _saddle_lift(section, q, opened) - opened


def _saddle_lift(section: Section, q: Array, lift: float = 0.0) -> float:
    """How far above P2's origin the saddle's arc centre, rising from ``lift``, ends: where it meets the round back, or
    u below that; mm."""
    pair, aside = section.pairs["P3", "P2"], float(q[W])
    for _ in range(100):
        section.queries.contact += 1
        back = SectionPose(aside, lift, float(q[S]) / section.lever)
        gap = float(section.model.pieces(pair, back.T()).distance.min())
        if abs(gap) <= 1e-12 * section.clamp.saddle.radius:
            break
        lift += gap
    return lift - float(q[U])
