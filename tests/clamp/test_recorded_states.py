"""What is asked of single states of a clamp, as it was once recorded: parts that a whole assembly seldom reaches.

``python -m tests.clamp.test_recorded_states`` records it again.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clamp3d import assemble, load_clamp, monte_carlo, placement, sensitivity
from clamp3d.baselines import Cas, Chords
from clamp3d.clamp.dimensions import Joints
from clamp3d.clamp.equilibria import describe, equilibria
from clamp3d.clamp.friction import FrictionBand
from clamp3d.clamp.placement import Outcome, close_on
from clamp3d.clamp.section import SIZE, WIRES, Section
from clamp3d.clamp.status import closing_status, stop_words
from clamp3d.clamp.stepped import SteppedState
from clamp3d.clamp.tolerance import sample_dimensions
from clamp3d.errors import InputError
from tests.clamp.random_clamps import whole_clamp
from tests.recorded import record_tests

DATA = Path(__file__).with_name("data")
PLAY = Joints(hole=True, saddle=True, washer=True)
MIX = np.sqrt(np.arange(2.0, 2.0 + SIZE))
"""Ten numbers in one: a derivative's sum with these shows each of its terms."""


def clamps():
    """The reference clamp, one with thick wires, and random ones, without play and with it; chords see two of them."""
    made = [(load_clamp(), Cas()), (load_clamp(line=46.0, jumper=9.0), Chords(0.2))]
    for k, model in ((4, Cas()), (8, Cas()), (12, Chords(0.15))):
        made.append((replace(whole_clamp(np.random.default_rng([41, k])), joints=PLAY), model))
    return made


def gaps():
    """Gaps, derivatives and words at random states, also of wires that have left their grooves or the clamp."""
    rng, rows = np.random.default_rng(17), []
    for clamp, model in clamps():
        section = Section(clamp, model)
        width = clamp.up_splint.width
        rows.append([*section.mouth("P6"), *section.reach("P7"), section.open_distance(), section.least_slack])
        for k in range(3):
            q = section.open_state(section.open_distance() - rng.uniform(2.0, 30.0), rng.uniform(-0.2, 0.2))
            rows.append(q.tolist())
            q += rng.normal(0.0, 1.5, SIZE)
            if k > 1:
                q[0], q[2] = rng.uniform(-8.0, 0.45 * width), rng.uniform(0.55 * width, width + 8.0)
            found, force = section.gaps(q), rng.uniform(0.5, 1.0, 200)
            places = found.point @ MIX[:2], found.normal @ MIX[:2], found.gradient @ MIX
            for row in zip(found.pair, found.feature, found.value.tolist(), *(x.tolist() for x in places), strict=True):
                rows.append([f"{row[0][0]}-{row[0][1]} {row[1]}", *row[2:]])
            bend = section.hessian(q, found, force[: len(found.value)])
            rows += [(bend @ MIX).tolist(), [section.splint_distance(q), section.face_gap(q), *section.escaped(q)]]
            state = SteppedState(q, found, 0)
            for reach in (1e-6, 3.0):
                status = closing_status(section, state, reach)
                rows.append([status.text, *(f"{seat.detail} {seat.feature}" for seat in status.seats)])
            near = zip(found.pair, found.feature, found.value < 3.0, strict=True)
            rows.append(stop_words([(pair, feature) for pair, feature, touches in near if touches]))
            rows.append([section.state(section.poses(q)) @ MIX, section.seated(q) @ MIX])
    return rows


def leaning():
    """Openings of clamps that close on a leaning wire, and from where they catch it."""
    rows = [[outcome.label, int(outcome)] for outcome in Outcome]
    turns = np.random.default_rng(2).uniform(-0.06, 0.06, (12, 2)) * (1.0, 0.4)
    for run in (assemble(), assemble(line=40.0, jumper=20.0)):
        for wire in WIRES:
            opening, in_grooves = close_on(run, wire, turns)
            rows += [opening.tolist(), in_grooves.tolist()]
    found = placement(load_clamp(line=40.0, jumper=20.0), wire="P7", columns=7, yaw=0.2, seat_tolerance=0.2)
    told = [found.capture.sideways.tolist(), found.capture.height.tolist(), found.capture.outcome.tolist()]
    return [*rows, *told, found.capture.captured, *([limit.low, limit.high, limit.reach] for limit in found.limits)]


def bands():
    """Friction bands of two clamps, and how much friction a distance needs."""
    rows = []
    for line, jumper in ((30.0, 14.0), (40.0, 26.0)):
        band = FrictionBand(load_clamp(line=line, jumper=jumper))
        rows += [[*band.ends(friction)] for friction in (0.02, 0.15, 0.6)]
        rows.append([band.distance, *(band.friction_for(band.distance + by) for by in (-0.05, 0.0, 0.08, 9.0))])
    with pytest.raises(InputError, match="needs both wires in the arcs") as refused:
        FrictionBand(load_clamp(line=48.0, jumper=47.8))
    return [*rows, str(refused.value)]


def ends():
    """Where random clamps end, with and without play, and what holds them there."""
    rows = []
    for k in (20, 22, 23, 28):
        run = assemble(replace(whole_clamp(np.random.default_rng([41, k])), joints=PLAY if k % 4 else Joints()))
        row = [run.status, run.distance, run.tilt, run.turns, [str(finding) for finding in run.findings]]
        rows.append([*row, *([f"{f.a}-{f.b} {f.feature}", f.force, f.direction @ MIX[:3]] for f in run.forces)])
        rows.append([[f"{e.a}-{e.b} {e.relation}", e.travel] for e in run.events])
    return rows


def changes():
    """Derivatives by the dimensions, samples of them, and all equilibria."""
    rows = []
    for joints in (Joints(), Joints(hole=True, saddle=True)):
        for line, jumper in ((None, None), (48.0, 47.8)):
            clamp = replace(load_clamp(line=line, jumper=jumper), joints=joints)
            rows += [[row.name, row.value, row.derivative] for row in sensitivity(clamp)]
    for distribution in ("uniform", "normal"):
        spec = monte_carlo(load_clamp(), n=1, seed=9, distribution=distribution).spec
        rows += [sample_dimensions(spec, index) for index in (0, 7)]
    section = Section(load_clamp(line=40.0, jumper=20.0), Cas())
    for state in equilibria(section):
        rows.append([state.q.tolist(), state.loose, state.curvature, describe(state, section.escaped(state.q))])
    return rows


test_states_are_those_that_were_recorded, record = record_tests(DATA, gaps, leaning, bands, ends, changes)


if __name__ == "__main__":
    record()
