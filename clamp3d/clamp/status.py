"""How a final state ended, in words."""

from __future__ import annotations

from collections.abc import Iterable

from clamp3d.clamp.contact import Contact, overlap
from clamp3d.clamp.dimensions import TITLES, Clamp
from clamp3d.clamp.final_state import FinalState
from clamp3d.clamp.scene import CONTACT
from clamp3d.clamp.section import EDGES, SPLINTS, WIRES, D, Section
from clamp3d.clamp.stepped import SteppedState

CLAMPED = "clamped"


def final_status(
    section: Section,
    final: FinalState | SteppedState,
    resolution: float = CONTACT,
    contacts: Iterable[Contact] = (),
) -> str:
    """'clamped' if the splints hold both wires, nothing overlaps and the nut is wholly on the bolt; else why not.

    ``resolution`` mm: gaps of a stepped state up to it count as closed. ``contacts`` are those of the state where they
    have been measured: the section keeps apart every pair that can meet.
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
    slipped = section.escaped(final.q)
    if slipped:
        return f"not clamped: {' and '.join(slipped)} slips out of its groove"
    if not loose:
        shortfall = bolt_shortfall(section.clamp, float(final.q[D]))
        if shortfall > 0.0:
            return f"not clamped: the bolt is {shortfall:.4g} mm too short for the nut"
        k = int(gaps.value.argmin())
        if gaps.value[k] < -CONTACT:
            return f"not clamped: {gaps.pair[k][0]} overlaps {gaps.pair[k][1]} by {-gaps.value[k]:.4g} mm"
        deepest = overlap(min(contacts, key=lambda c: c.gap)) if contacts else ""
        return f"not clamped: {deepest}" if deepest else CLAMPED
    reasons = stop_words(stops)
    if not reasons:  # a wire on four lips holds both splints, whatever they do to the other one
        reasons.append(f"{' and '.join(w for w in WIRES if w not in loose)} alone holds the splints apart")
    return f"not clamped: {' and '.join(reasons)}, {' and '.join(sorted(loose))} loose"


def stop_words(stops: Iterable[tuple[tuple[str, str], str]]) -> list[str]:
    """What stops the splints beside the wires, in words: pairs and features that touch."""
    words = []
    for (a, b), feature in stops:
        if (a, b) == ("P1", "P2"):
            words.append("faces meet")
        elif feature == EDGES or (a, b) == ("P2", "P4"):
            words.append(f"the {TITLES[b] if b == 'P4' else feature} stops the down splint")
        elif a == "P4":
            words.append(f"{TITLES[b]} rests on the bolt")
    return sorted(set(words))


def bolt_shortfall(clamp: Clamp, d: float) -> float:
    """How far the bolt's end lies below the nut's free face, mm, with the saddle at ``d``; negative: stands out."""
    stack = d + clamp.down_splint.back_radius + clamp.saddle.apex_thickness + clamp.nut.height
    return stack - clamp.bolt.shank_length
