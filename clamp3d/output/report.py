"""A report for an assembly reviewer: what was measured at the final state, and how the clamp came there.

The facts are gathered here; `report_page` turns them into a page, JSON and CSV.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from clamp3d.baselines.model import ContactModel
from clamp3d.checks import number
from clamp3d.clamp.contacts import CONTACT, measure_pairs, seats
from clamp3d.clamp.dimensions import PARTS, TITLES, Clamp, PartName
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Assembly, Contact, Seat, Waypoint
from clamp3d.clamp.section import Section
from clamp3d.clamp.verdict import CLEARANCE
from clamp3d.core.pose import SectionPose
from clamp3d.output.pair_rows import PairRow, pair_rows
from clamp3d.output.section import edge_openings

Poses = dict[PartName, SectionPose]

TIGHTENING_STAGES = 4
_PARALLEL = math.radians(0.005)  # the angle that prints as 0.00 deg


@dataclass(frozen=True, slots=True)
class StepRow:
    """The state at the end of a motion, as a line worker checks it; lengths in mm, tilt in rad.

    ``opening_line`` and ``opening_jumper`` are the heights between the splints' inner edges on either side,
    ``turns`` those of the nut from open. ``seats`` say for each groove whether its wire lies in it, ``outside`` which
    wires are not between the splints yet.
    """

    number: int
    step: str
    label: str
    waypoint: Waypoint
    opening_line: float
    opening_jumper: float
    tilt: float
    turns: float
    seats: tuple[Seat, ...]
    outside: tuple[PartName, ...]

    @property
    def parallel(self) -> bool:
        """Whether the splints are parallel, to the printed digits."""
        return abs(self.tilt) < _PARALLEL

    def seat(self, wire: PartName) -> str:
        """A wire's place in words."""
        if wire in self.outside:
            return "not in the clamp yet"
        own = [s for s in self.seats if s.wire == wire]
        held = [s.splint for s in own if s.seated]
        if len(held) == len(own):
            return "fully in both grooves"
        rests = [f"{s.splint}: {s.detail}" for s in own if not s.seated and s.detail != "loose"]
        words = [f"in {' and '.join(held)}'s groove"] if held else []
        loose = [f"{s.gap:.1f} mm from {s.splint}" for s in own if s.detail == "loose"]
        return "; ".join([*words, *rests, *loose])


@dataclass(frozen=True, slots=True)
class TighteningRow:
    """A stage of the tightening: ``turns`` of the nut in it, ``way`` mm the bolt is drawn up, gap of the saddle."""

    turns: float
    way: float
    saddle_gap: float


@dataclass(frozen=True, slots=True)
class Report:
    """Everything a report says about a run. Lengths in mm."""

    run: Assembly
    rows: tuple[PairRow, ...]
    steps: tuple[StepRow, ...]
    tightening: tuple[TighteningRow, ...]
    modelled: tuple[str, ...]
    not_modelled: tuple[str, ...]
    clearance: float
    mesh_error: float

    @property
    def findings(self) -> tuple[str, ...]:
        """What a reviewer has to look at, the worst first; empty if all is as it should be."""
        out = [] if self.run.clamped else [self.run.status]
        for severity in ("error", "warning"):
            out += [
                f"{row.name} ({row.titles}): {row.verdict}" + (f"; {row.remark}" if row.remark else "")
                for row in self.rows
                if row.severity == severity
            ]
        named = {row.name for row in self.rows if row.severity == "error"}
        out += [str(u) for u in self.run.undeclared if f"{u.a}-{u.b}" not in named]
        return tuple(out)

    @property
    def passed(self) -> bool:
        """Whether the clamp holds both wires and nothing meets that should not."""
        return self.run.clamped and not self.run.undeclared and all(row.severity != "error" for row in self.rows)


def report(run: Assembly, model: ContactModel, *, clearance: float = CLEARANCE, mesh_error: float = 0.001) -> Report:
    """Measure all 21 pairs at the final state of ``run`` and every waypoint on the way to it.

    ``mesh_error`` mm is the chord error of the outlines that pairs without a groove are measured on. Raises InputError
    for a bad clearance or mesh error.

    >>> from clamp3d.clamp.assemble import assemble
    >>> from clamp3d.clamp.loader import load_clamp
    >>> from clamp3d.baselines.cas import Cas
    >>> found = report(assemble(load_clamp(), Cas()), Cas())
    >>> len(found.rows), found.passed, found.findings
    (21, True, ())
    """
    clearance = number("clearance", clearance)
    clamp, bodies = run.clamp, parts(run.clamp)
    rows = pair_rows(clamp, bodies, model, run.poses, clearance=clearance, mesh_error=mesh_error)
    section = Section(clamp, model)
    first = run.path[0].poses
    # A solver that tries positions leaves small gaps; what it counted as seated is seated here.
    resolution = max([CONTACT, *(s.gap for s in run.seats if s.seated)])
    steps = tuple(_step(section, number, waypoint, first, resolution) for number, waypoint in enumerate(run.path, 1))
    model_limits = [f"method {run.method}: {limit}" for limit in run.limits]
    return Report(
        run=run,
        rows=rows,
        steps=steps,
        tightening=_tightening(section, run),
        modelled=_modelled(run, mesh_error),
        not_modelled=(*_not_modelled(clamp), *model_limits),
        clearance=clearance,
        mesh_error=mesh_error,
    )


def saddle_gap(section: Section, poses: Poses) -> float:
    """Gap in mm between the saddle and the round back."""
    pair = next(c for c in measure_pairs(section, poses, CONTACT) if (c.a, c.b) == ("P2", "P3"))
    return pair.distance


def contacts_to_draw(rows: tuple[PairRow, ...]) -> list[Contact]:
    """Every pair that touches, overlaps, or is declared to: those get a picture. A thread has nothing to show."""
    return [row.contact for row in rows if row.declared > 1 or (row.declared == 0 and row.distance <= CONTACT)]


def _step(section: Section, number: int, waypoint: Waypoint, first: Poses, resolution: float) -> StepRow:
    poses = waypoint.poses
    line, jumper = edge_openings(section.clamp, poses)
    pairs = measure_pairs(section, poses, CONTACT)
    up = poses["P1"].x
    wires: tuple[PartName, ...] = ("P6", "P7")
    outside = tuple(w for w in wires if not up < poses[w].x < up + section.clamp.up_splint.width)
    return StepRow(
        number=number,
        step=waypoint.step,
        label=waypoint.label,
        waypoint=waypoint,
        opening_line=line,
        opening_jumper=jumper,
        tilt=poses["P2"].angle - poses["P1"].angle,
        turns=round((_screwed(poses) - _screwed(first)) / section.clamp.bolt.pitch, 9) + 0.0,
        seats=seats(pairs, resolution),
        outside=outside,
    )


def _tightening(section: Section, run: Assembly) -> tuple[TighteningRow, ...]:
    """The nut's own step in equal stages: the bolt is drawn up until the saddle meets the round back."""
    before, after = run.path[-2].poses, run.path[-1].poses
    way = _screwed(after) - _screwed(before)
    rows = []
    for stage in range(TIGHTENING_STAGES + 1):
        f = stage / TIGHTENING_STAGES
        poses = {
            name: SectionPose(p.x + f * (after[name].x - p.x), p.y + f * (after[name].y - p.y), after[name].angle)
            for name, p in before.items()
        }
        gap = saddle_gap(section, poses)
        rows.append(TighteningRow(f * way / run.clamp.bolt.pitch, f * way, 0.0 if abs(gap) <= CONTACT else gap))
    return tuple(rows)


def _screwed(poses: Poses) -> float:
    """Height of the nut's free face below the bolt's free end in mm: by how much it is screwed on, up to a constant."""
    return poses["P5"].y - poses["P4"].y


def _modelled(run: Assembly, mesh_error: float) -> tuple[str, ...]:
    grooves = (
        "arcs against cylinders in closed form" if run.method == "cas" else f"as the method {run.method} sees them"
    )
    solver = {
        "exact": "least distance along the bolt with both wires free, proven",
        "stepped": "first position in steps along the bolt that fits",
        "bisection": "least distance along the bolt that fits, by bisection",
    }[run.solver]
    return (
        "seven rigid parts of nominal dimensions that move in the section: along x and y, the down splint also tilts",
        f"the five concave arc contacts (each splint with each wire, saddle with round back), {grooves}",
        "bolt in its two holes (relations of Table 2), nut and bolt head on their seats, nut and bolt as a screw joint",
        f"the pairs that nothing joins, on their outlines with a chord error of {mesh_error:g} mm",
        f"final state by the {run.solver} solver: {solver}",
        "wires as round cylinders of the conductor's outer diameter",
    )


def _not_modelled(clamp: Clamp) -> tuple[str, ...]:
    left_out = [
        f"{name} {TITLES[name]}: {part.not_modelled}" for name, part in parts(clamp).items() if part.not_modelled
    ]
    return (
        *left_out,
        "friction, deformation and forces: no torque and no clamping force follow from this report",
        "tolerances of manufacture and wear",
        "motions out of the section: wires that are bent, turned or shifted along the clamp",
    )


def part_rows(run: Assembly) -> list[tuple[PartName, str, SectionPose]]:
    """Each part with its title and its final pose in the section."""
    return [(name, TITLES[name], run.poses[name]) for name in PARTS]
