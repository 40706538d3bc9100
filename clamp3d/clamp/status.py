"""How a final state ended, in words."""

from __future__ import annotations

from collections.abc import Iterable

from clamp3d.clamp.contact import Contact, measure_contacts, overlap
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.final_state import FinalState
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.section import MOUTH, SPLINTS, WIRES, D, Section
from clamp3d.clamp.stepped import SteppedState
from clamp3d.clamp.steps import section_poses

CLAMPED = "clamped"

_REACHABLE: tuple[Pair, ...] = (("P4", "P6"), ("P4", "P7"), ("P6", "P7"))
"""Pairs that the solver does not keep apart, though wires that are held can overlap there."""


def measured_status(
    section: Section, final: FinalState | SteppedState, resolution: float, contacts: Iterable[Contact] | None = None
) -> str:
    """`final_status`, but parts that overlap are not clamped, whatever holds the wires.

    ``contacts`` are those of the state; without them the bolt and the wires are measured.
    """
    status = final_status(section.clamp, final, resolution)
    if status != CLAMPED:
        return status
    if contacts is None:
        contacts = measure_contacts(section.clamp, section_poses(section, final.q), section.model, pairs=_REACHABLE)
    deepest = overlap(min(contacts, key=lambda c: c.gap))
    return f"not clamped: {deepest}" if deepest else CLAMPED


def final_status(clamp: Clamp, final: FinalState | SteppedState, resolution: float) -> str:
    """'clamped' if both wires are held between the splints and the nut is wholly on the bolt, else why not.

    ``resolution`` mm: gaps of a stepped state up to it count as closed.
    """
    gaps = final.gaps
    if isinstance(final, FinalState):
        stops = set(final.active)
        loose = set(final.loose)
    else:
        near = [v <= resolution for v in gaps.value]
        stops = {(p, f) for p, f, n in zip(gaps.pair, gaps.feature, near, strict=True) if n}
        held = {p for p, _ in stops}
        loose = {w for w in WIRES if not all((splint, w) in held for splint in SPLINTS)}
    slipping = sorted({pair[1] for pair, feature in stops if feature == MOUTH})
    if slipping:
        return f"not clamped: {' and '.join(slipping)} slips out of its groove"
    if not loose:
        shortfall = bolt_shortfall(clamp, float(final.q[D]))
        return CLAMPED if shortfall <= 0.0 else f"not clamped: the bolt is {shortfall:.4g} mm too short for the nut"
    reasons = []
    if any(pair == ("P1", "P2") for pair, _ in stops):
        reasons.append("faces meet")
    if any(feature == "tilt limit" for _, feature in stops):
        reasons.append("tilt limit reached")
    if not reasons:  # a wire on four lips holds both splints, whatever they do to the other one
        reasons.append(f"{' and '.join(w for w in WIRES if w not in loose)} alone holds the splints apart")
    return f"not clamped: {' and '.join(reasons)}, {' and '.join(sorted(loose))} loose"


def bolt_shortfall(clamp: Clamp, d: float) -> float:
    """How far the bolt's end lies below the nut's free face, mm, with the down splint at ``d``; negative: stands out.

    The round back rests in the saddle's apex at any tilt, so that bolt and saddle follow ``d``.
    """
    stack = d + clamp.down_splint.back_radius + clamp.saddle.apex_thickness + clamp.nut.height
    return stack - clamp.bolt.shank_length
