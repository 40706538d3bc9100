"""What a reviewer reads about each of the 21 pairs: verdict, distance with its error bound, point, normal, method."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.connections import CONVEX_PAIRS, TYPES, convex_gap
from clamp3d.clamp.contacts import CONTACT, Contact, measure_pairs
from clamp3d.clamp.dimensions import TITLES, Clamp, ConnectionType, PartName
from clamp3d.clamp.outlines import outline_gap
from clamp3d.clamp.section import Section
from clamp3d.clamp.verdict import Verdict, verdict
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array, SectionPose, inverse
from clamp3d.core.shapes import Solid

Poses = dict[PartName, SectionPose]
Severity = Literal["error", "warning", "note", "ok"]

_ROUNDING = 2.0**-44
"""Some hundred roundings of a double, relative to the largest coordinate: the closed forms take far fewer."""

SEVERITIES: dict[Severity, str] = {
    "error": "must be mended: parts overlap, meet though they should not, or a wire is loose",
    "warning": "cannot be decided within the error bound",
    "note": "nearer than the clearance, though nothing joins the two",
    "ok": "as it should be",
}


@dataclass(frozen=True, slots=True)
class PairRow:
    """One pair of parts at one state; lengths in mm, ``point`` and ``normal`` (3,) in the world.

    ``distance`` is signed, positive apart; ``error_bound`` mm is None where the method states none. ``lower_bound``
    marks a distance that is at least this much.
    """

    a: PartName
    b: PartName
    declared: ConnectionType
    verdict: Verdict
    severity: Severity
    relation: str
    feature: str
    distance: float
    error_bound: float | None
    lower_bound: bool
    point: Array
    normal: Array
    method: str
    remark: str

    @property
    def name(self) -> str:
        """Short name of the pair."""
        return f"{self.a}-{self.b}"

    @property
    def titles(self) -> str:
        """The two parts in words."""
        return f"{TITLES[self.a]}, {TITLES[self.b]}"

    @property
    def declared_as(self) -> str:
        """The connection matrix's entry in words."""
        return TYPES[self.declared]

    @property
    def contact(self) -> Contact:
        """The row as a contact, for drawing."""
        kind = self.declared or 2
        relation = "apart" if self.relation == "none" else self.relation
        return Contact(self.a, self.b, kind, relation, self.distance, self.point, self.normal, self.feature)


def pair_rows(
    clamp: Clamp,
    parts: dict[PartName, Solid],
    model: ContactModel,
    poses: Poses,
    *,
    clearance: float,
    mesh_error: float,
) -> tuple[PairRow, ...]:
    """All 21 pairs at ``poses``; pairs without a groove, hole, seat or thread are measured on their outlines."""
    section = Section(clamp, model)
    return tuple(
        _outline_row(clamp, parts, poses, contact, clearance, mesh_error)
        if (contact.a, contact.b) in CONVEX_PAIRS
        else _joined_row(section, parts, poses, contact, clearance)
        for contact in measure_pairs(section, poses, CONTACT)
    )


def beside_part(contact: Contact, part: Solid, pose: SectionPose) -> bool:
    """Whether a groove's nearest point lies beside its part: the kernel's faces run on without an end."""
    if contact.type != 3:
        return False
    T = pose.T()
    x = float(T[:3, 0] @ (contact.point - T[:3, 3]))
    low, high = part.bounds[:, 0]
    return not low - CONTACT <= x <= high + CONTACT


def error_bound(model: ContactModel, pair: GroovePair, T_a_b: Array) -> float | None:
    """Largest error in mm of ``model``'s distance: rounding for the closed form, chord error for chords, else None."""
    if model.name == "cas":
        from clamp3d.core.distance import signed_distance

        T = inverse(pair.T_a_groove) @ T_a_b @ pair.T_b_cylinder
        return float(signed_distance(pair.groove, pair.cylinder, T).error_bound)
    unit_angle = getattr(model, "unit_angle", None)
    if unit_angle is None:
        return None
    chords = math.ceil(2.0 * pair.groove.half_angle / unit_angle - 1e-9)
    return 2.0 * pair.groove.radius * math.sin(0.5 * pair.groove.half_angle / chords) ** 2


def _joined_row(section: Section, parts: dict[PartName, Solid], poses: Poses, c: Contact, clearance: float) -> PairRow:
    clamp, model = section.clamp, section.model
    bound: float | None = _ROUNDING * max(abs(v) for pose in poses.values() for v in (pose.x, pose.y, 1.0))
    method, remark = "closed form (Table 2)", ""
    beside = beside_part(c, parts[c.a], poses[c.a])
    if c.type == 3:
        key = (c.a, c.b) if (c.a, c.b) in section.pairs else (c.b, c.a)
        pair = section.pairs[key]
        bound = error_bound(model, pair, inverse(poses[pair.a].T()) @ poses[pair.b].T())
        method = f"{model.name}, arc against cylinder"
        if beside:
            remark = "nearest point lies beside the part: it is at least this far"
    elif c.type == 1:
        method, remark = "screw joint (kinematic)", "threads run in each other by definition"
    elif c.feature == "flat face":
        method = "closed form, face on face"
    elif (c.a, c.b) == ("P1", "P2"):
        method = "closed form, inner faces"
    declared = clamp.connection(c.a, c.b)
    if bound is None:
        found: Verdict = "uncertain"
        remark = "the method states no error bound"
    else:
        found = verdict(c.distance, error_bound=bound, contact=CONTACT, clearance=clearance, allowed=declared != 0)
    return _row(c, declared, found, bound, beside, method, remark)


def _outline_row(
    clamp: Clamp, parts: dict[PartName, Solid], poses: Poses, c: Contact, clearance: float, mesh_error: float
) -> PairRow:
    gap = outline_gap(parts[c.a], poses[c.a], parts[c.b], poses[c.b], mesh_error)
    declared = clamp.connection(c.a, c.b)
    point = np.array([gap.point_a[0], 0.0, -gap.point_a[1]])
    method, remark, distance = "outlines in the section", "", gap.distance
    found: Verdict
    if gap.overlap:
        found = "contained" if gap.contained else "clash"
        distance = min(0.0, convex_gap(clamp, poses, c.a, c.b))
        normal, relation, remark = c.normal, "overlap", "depth of the parts' rectangles"
        bound = None
    else:
        away = np.array([gap.point_b[0] - gap.point_a[0], 0.0, gap.point_a[1] - gap.point_b[1]])
        length = float(np.linalg.norm(away))
        normal = away / length if length > 0.0 else c.normal
        relation, bound = "none", gap.error_bound
        found = verdict(distance, error_bound=bound, contact=CONTACT, clearance=clearance, allowed=declared != 0)
        if found in ("contact", "allowed"):
            relation = "contact"
    return _row(
        Contact(c.a, c.b, 2, relation, distance, point, normal, "outline"),
        declared, found, bound, False, method, remark,
    )  # fmt: skip


def _row(
    c: Contact,
    declared: ConnectionType,
    found: Verdict,
    bound: float | None,
    beside: bool,
    method: str,
    remark: str,
) -> PairRow:
    severity: Severity = "ok"
    if found in ("clash", "contained", "contact"):
        severity = "error"
        if found == "contact":
            remark = "met though the connection matrix declares no connection"
    elif found == "uncertain":
        severity = "warning"
    elif declared == 3 and found != "allowed":
        severity, remark = "error", remark or "declared to touch, and does not"
    elif declared == 0 and found == "clearance":
        severity = "note"
    return PairRow(
        a=c.a, b=c.b, declared=declared, verdict=found, severity=severity, relation=c.relation, feature=c.feature,
        distance=0.0 if abs(c.distance) <= 1e-12 else c.distance, error_bound=bound, lower_bound=beside,
        point=c.point, normal=c.normal + 0.0, method=method, remark=remark,
    )  # fmt: skip
