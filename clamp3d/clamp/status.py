"""What a closing has come to: where each wire lies in its grooves, and whether the clamp holds both.

The one place that says "clamped": `run`, `check`, `view`, `report`, `export`, `tolerance` and `sweep` all ask it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.contact import measure_contacts, overlap
from clamp3d.clamp.dimensions import PAIRS, TITLES, TOUCHING, Clamp, Pair, PartName
from clamp3d.clamp.parts import clamp_scene
from clamp3d.clamp.section import EDGE, EDGES, SPLINTS, WIRES, D, Gaps, Section
from clamp3d.clamp.stepped import SteppedState
from clamp3d.engine.check import check
from clamp3d.engine.result import NOT_CLEAN
from clamp3d.geometry.pose import Array

if TYPE_CHECKING:  # it imports SciPy's optimisers, 0.4 s of CPU, which a scene without a clamp needs not
    from clamp3d.clamp.final_state import FinalState

CLAMPED = "clamped"
_KEPT_APART: frozenset[Pair] = frozenset((("P1", "P4"), ("P3", "P4"), ("P4", "P5")))
"""The bolt stands in the middle of these parts' holes, which are wider, but for what play the section counts."""
_SAME = 1e-12
"""Gaps in mm that differ by less are of one place: an arc and its lip differ by rounding where they meet."""
SeatFeature = Literal["arc", "lip", "flat face", "edge"]
_DETAILS: dict[SeatFeature, str] = {
    "arc": "seated in the groove",
    "lip": "rests on the lip",
    "flat face": "rests on the flat face",
    "edge": "rests on the edge",
}


@dataclass(frozen=True, slots=True)
class Seat:
    """How a wire stands to its groove in a splint.

    Attributes
    ----------
    splint, wire : str
    seated : bool
        Whether it touches the groove's arc.
    gap : float
        Signed distance of the two, mm.
    detail : str
        In words.
    feature : str
        What of the splint is nearest: "arc", "lip", "flat face", or "edge" where the face ends.
    touches : bool
    """

    splint: PartName
    wire: PartName
    seated: bool
    gap: float
    detail: str
    feature: SeatFeature
    touches: bool

    @property
    def in_groove(self) -> bool:
        """Whether the groove holds the wire, in its arc or on the lips of its mouth."""
        return self.touches and self.feature in ("arc", "lip")


@dataclass(frozen=True, slots=True)
class ClosingStatus:
    """What a closing has come to.

    Attributes
    ----------
    clamped : bool
        Whether both wires are held by the grooves of both splints, nothing overlaps and the nut is wholly on the bolt.
    text : str
        "clamped", "clamped, but P6 rests on ...", or "not clamped: ..." with the reason.
    warnings : tuple of str
        What is not as it should be though the clamp holds: a wire on a lip.
    seats : tuple of Seat
        Each wire in each of its grooves.
    """

    clamped: bool
    text: str
    warnings: tuple[str, ...]
    seats: tuple[Seat, ...]

    def __str__(self) -> str:
        return self.text


def closing_status(section: Section, final: FinalState | SteppedState, resolution: float = TOUCHING) -> ClosingStatus:
    """What a final state has come to; gaps of a stepped one up to ``resolution`` mm count as closed."""
    places = seats(section, final.q, resolution)
    reason = _not_held(section, final, places, resolution)
    if not reason and (shortfall := bolt_shortfall(section.clamp, float(final.q[D]))) > 0.0:
        reason = f"the bolt is {shortfall:.4g} mm too short for the nut"
    if not reason:
        reason = _overlap(section, final)
    if reason:
        return ClosingStatus(False, f"not {CLAMPED}: {reason}", (), places)
    lips = [seat for seat in places if seat.feature == "lip"]
    warnings = tuple(f"{s.wire} rests on a lip of the {TITLES[s.splint]}'s groove, not in its arc" for s in lips)
    text = f"{CLAMPED}, but {' and '.join(_beside(lips, 'on a lip of'))}" if lips else CLAMPED
    return ClosingStatus(True, text, warnings, places)


def seats(section: Section, q: Array, resolution: float = TOUCHING) -> tuple[Seat, ...]:
    """Where each wire stands in each of its grooves; gaps up to ``resolution`` mm touch."""
    exact, places = Section(section.clamp, Cas()), []
    for splint, wire in itertools.product(SPLINTS, WIRES):
        gap, _ = _nearest(section.wire_gaps(q, wire), splint)
        _, feature = _nearest(exact.wire_gaps(q, wire), splint)
        touches = gap <= resolution
        detail = _DETAILS[feature] if touches else "loose"
        places.append(Seat(splint, wire, touches and feature == "arc", gap, detail, feature, touches))
    return tuple(places)


def _nearest(gaps: Gaps, splint: PartName) -> tuple[float, SeatFeature]:
    """The gap to a splint, mm, and what of the splint is nearest: of an arc and the lip that ends it the lip."""
    own = [k for k, pair in enumerate(gaps.pair) if pair[0] == splint]
    gap = float(gaps.value[own].min())
    names = {gaps.feature[k] for k in own if gaps.value[k] <= gap + _SAME}
    starts: dict[str, SeatFeature] = {"lip": "lip", "arc": "arc", "flat": "flat face", EDGE: "edge"}
    return gap, next((starts[start] for start in starts if any(n.startswith(start) for n in names)), "arc")


def stop_words(stops: Iterable[tuple[Pair, str]]) -> list[str]:
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


def _not_held(section: Section, final: FinalState | SteppedState, places: tuple[Seat, ...], resolution: float) -> str:
    """Why the grooves do not hold both wires; nothing if they do."""
    slipped = section.escaped(final.q)
    if slipped:
        return f"{' and '.join(slipped)} slips out of its groove"
    if isinstance(final, SteppedState):
        named = zip(final.gaps.pair, final.gaps.feature, final.gaps.value, strict=True)
        stops = {(pair, feature) for pair, feature, gap in named if gap <= resolution}
        loose = {wire for wire in WIRES if not all(seat.touches for seat in places if seat.wire == wire)}
    else:
        stops, loose = set(final.active), set(final.loose)
    if loose:
        reasons = stop_words(stops)
        if not reasons:  # a wire on four lips holds both splints, whatever they do to the other one
            reasons.append(f"{' and '.join(w for w in WIRES if w not in loose)} alone holds the splints apart")
        return f"{' and '.join(reasons)}, {' and '.join(sorted(loose))} loose"
    beside = [seat for seat in places if seat.touches and not seat.in_groove]
    alone = [s.wire for s in places if not s.touches]
    held = [f"{s.wire} is held by the {TITLES[s.splint]} alone" for s in places if s.wire in alone and s.in_groove]
    return " and ".join([*_beside(beside, "lies beside"), *held])


def _beside(places: Iterable[Seat], where: str) -> list[str]:
    """'P6 ``where`` the up splint's groove' of each wire, or '... both splints' grooves'."""
    words = []
    for wire, own in itertools.groupby(sorted(places, key=lambda seat: seat.wire), key=lambda seat: seat.wire):
        titles = [TITLES[seat.splint] for seat in own]
        groove = f"the {titles[0]}'s groove" if len(titles) == 1 else "both splints' grooves"
        words.append(f"{wire} {where} {groove}")
    return words


def _overlap(section: Section, final: FinalState | SteppedState) -> str:
    """The deepest overlap in words: of the section's gaps, or of parts that it does not look at."""
    gaps, poses = final.gaps, section.poses(final.q)
    k = int(gaps.value.argmin())
    if gaps.value[k] < -TOUCHING:
        return f"{gaps.pair[k][0]} overlaps {gaps.pair[k][1]} by {-gaps.value[k]:.4g} mm"
    rest = [pair for pair in PAIRS if pair not in _KEPT_APART | set(gaps.pair)]
    scene = clamp_scene(section.clamp, {part: pose.T() for part, pose in poses.items()})
    clashes = [(row.a, row.b) for row in check(scene, pairs=rest, depths=False).rows if row.verdict in NOT_CLEAN]
    contacts = measure_contacts(section.clamp, poses, section.model, pairs=clashes) if clashes else ()
    return overlap(min(contacts, key=lambda c: c.gap)) if contacts else ""
