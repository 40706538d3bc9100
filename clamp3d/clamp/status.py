"""What a closing has come to: where each wire lies in its grooves, and whether the clamp holds both.

The one place that says "clamped": `run`, `check`, `view`, `report`, `export`, `tolerance` and `sweep` all ask it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.contact import measure_contacts, overlap
from clamp3d.clamp.dimensions import TITLES, Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.final_state import FinalState
from clamp3d.clamp.matrix import PAIRS, Pair
from clamp3d.clamp.parts import parts
from clamp3d.clamp.places import section_poses
from clamp3d.clamp.section import EDGES, SPLINTS, WIRES, D, Section
from clamp3d.clamp.stepped import SteppedState
from clamp3d.clamp.surfaces import TOUCHING
from clamp3d.geometry.pose import SectionPose, inverse
from clamp3d.kernel.contact_model import GroovePair

CLAMPED = "clamped"
_KEPT_APART: frozenset[Pair] = frozenset((("P1", "P4"), ("P3", "P4"), ("P4", "P5")))
"""The bolt stands in the middle of these parts' holes, which are wider, but for what play the section counts."""
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
    clamp, poses = section.clamp, section_poses(section, final.q)
    places = seats(clamp, poses, section.model, resolution)
    reason = _not_held(section, final, places, resolution)
    if not reason and (shortfall := bolt_shortfall(clamp, float(final.q[D]))) > 0.0:
        reason = f"the bolt is {shortfall:.4g} mm too short for the nut"
    if not reason:
        reason = _overlap(section, final, poses)
    if reason:
        return ClosingStatus(False, f"not {CLAMPED}: {reason}", (), places)
    lips = [seat for seat in places if seat.feature == "lip"]
    warnings = tuple(f"{s.wire} rests on a lip of the {TITLES[s.splint]}'s groove, not in its arc" for s in lips)
    text = f"{CLAMPED}, but {' and '.join(_beside(lips, 'on a lip of', 'groove'))}" if lips else CLAMPED
    return ClosingStatus(True, text, warnings, places)


def seats(
    clamp: Clamp, poses: Mapping[PartName, SectionPose], model: ContactModel, resolution: float = TOUCHING
) -> tuple[Seat, ...]:
    """Where each wire stands in each of its grooves, by its distances from arc, lips, face and the face's end.

    Parameters
    ----------
    clamp : Clamp
    poses : dict of SectionPose
        Where splints and wires are.
    model : ContactModel
        Measures the gap.
    resolution : float
        Gaps up to this touch, mm.
    """
    pairs, found = groove_pairs(clamp), []
    for splint, wire in itertools.product(SPLINTS, WIRES):
        pair, T = pairs[splint, wire], inverse(poses[splint].T()) @ poses[wire].T()
        away, feature = _nearest(clamp, pair, T[0, 3], -T[2, 3])
        gap = away - pair.cylinder.radius if feature == "edge" else float(model.distances(pair, T[None])[0])
        touches = gap <= resolution
        detail = _DETAILS[feature] if touches else "loose"
        found.append(Seat(splint, wire, touches and feature == "arc", gap, detail, feature, touches))
    return tuple(found)


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


def _nearest(clamp: Clamp, pair: GroovePair, u: float, v: float) -> tuple[float, SeatFeature]:
    """How far a wire's axis at (u, v) in a splint's section axes is from its surface, mm, and what is nearest there."""
    up, side = pair.a == "P1", -1.0 if pair.b == "P6" else 1.0
    middle, half = (0.5 * clamp.up_splint.width,) * 2 if up else (0.0, 0.5 * clamp.down_splint.width)
    looks = 1.0 if up else -1.0  # the mouth, down or up
    groove, centre = pair.groove, pair.T_a_groove[:3, 3]
    lip, face = groove.radius * math.sin(groove.half_angle), -groove.radius * math.cos(groove.half_angle)
    x, y = u - float(centre[0]), looks * (v + float(centre[2]))
    places: list[tuple[float, SeatFeature]] = [(math.hypot(abs(x) - lip, y - face), "lip")]
    if groove.radius * (groove.half_angle - math.atan2(abs(x), -y)) > TOUCHING:
        places.append((abs(groove.radius - math.hypot(x, y)), "arc"))
    beyond = side * (u - middle) - half
    if beyond > 0.0:
        return math.hypot(beyond, max(y - face, 0.0)), "edge"
    if abs(x) > lip + TOUCHING:
        places.append((abs(y - face), "flat face"))
    return min(places)


def _not_held(section: Section, final: FinalState | SteppedState, places: tuple[Seat, ...], resolution: float) -> str:
    """Why the grooves do not hold both wires; nothing if they do."""
    slipped = section.escaped(final.q)
    if slipped:
        return f"{' and '.join(slipped)} slips out of its groove"
    if isinstance(final, FinalState):
        stops, loose = set(final.active), set(final.loose)
    else:
        named = zip(final.gaps.pair, final.gaps.feature, final.gaps.value, strict=True)
        stops = {(pair, feature) for pair, feature, gap in named if gap <= resolution}
        loose = {wire for wire in WIRES if not all(seat.touches for seat in places if seat.wire == wire)}
    if loose:
        reasons = stop_words(stops)
        if not reasons:  # a wire on four lips holds both splints, whatever they do to the other one
            reasons.append(f"{' and '.join(w for w in WIRES if w not in loose)} alone holds the splints apart")
        return f"{' and '.join(reasons)}, {' and '.join(sorted(loose))} loose"
    beside = [seat for seat in places if seat.touches and not seat.in_groove]
    alone = [s.wire for s in places if not s.touches]
    held = [f"{s.wire} is held by the {TITLES[s.splint]} alone" for s in places if s.wire in alone and s.in_groove]
    return " and ".join([*_beside(beside, "beside", "groove", verb="lies "), *held])


def _beside(places: Iterable[Seat], where: str, what: str, verb: str = "") -> list[str]:
    """'P6 lies beside the up splint's groove' of each wire, or 'beside both splints' grooves'."""
    words = []
    for wire, own in itertools.groupby(sorted(places, key=lambda seat: seat.wire), key=lambda seat: seat.wire):
        titles = [TITLES[seat.splint] for seat in own]
        of = f"the {titles[0]}'s {what}" if len(titles) == 1 else f"both splints' {what}s"
        words.append(f"{wire} {verb}{where} {of}")
    return words


def _overlap(section: Section, final: FinalState | SteppedState, poses: dict[PartName, SectionPose]) -> str:
    """The deepest overlap in words: of the section's gaps, or of parts that it does not look at."""
    gaps = final.gaps
    k = int(gaps.value.argmin())
    if gaps.value[k] < -TOUCHING:
        return f"{gaps.pair[k][0]} overlaps {gaps.pair[k][1]} by {-gaps.value[k]:.4g} mm"
    near = _near_pairs(section.clamp, poses, _KEPT_APART | set(gaps.pair))
    contacts = measure_contacts(section.clamp, poses, section.model, pairs=near) if near else ()
    return overlap(min(contacts, key=lambda c: c.gap)) if contacts else ""


def _near_pairs(clamp: Clamp, poses: dict[PartName, SectionPose], known: frozenset[Pair]) -> list[Pair]:
    """Pairs of parts, but for ``known`` ones, whose boxes overlap."""
    boxes = {}
    for name, solid in parts(clamp).items():
        R, p = poses[name].T()[:3, :3], poses[name].T()[:3, 3]
        high = np.array([max(body.support(R[k]) for body in solid.bodies) for k in range(3)]) + p
        low = np.array([-max(body.support(-R[k]) for body in solid.bodies) for k in range(3)]) + p
        boxes[name] = low, high
    rest = [pair for pair in PAIRS if pair not in known]
    return [
        (a, b)
        for a, b in rest
        if (boxes[a][0] < boxes[b][1] - TOUCHING).all() and (boxes[b][0] < boxes[a][1] - TOUCHING).all()
    ]
