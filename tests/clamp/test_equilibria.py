"""More than one equilibrium: each found, proven, told to the user; known cases in closed form."""

import json
import math
from dataclasses import replace

import pytest

from clamp3d import assemble
from clamp3d.baselines import Cas
from clamp3d.bench.stress.assemblies.clamps import clamp_of
from clamp3d.bench.stress.assemblies.envelope import Envelope
from clamp3d.bench.stress.assemblies.family import ASSEMBLIES
from clamp3d.clamp.equilibria import describe, equilibria
from clamp3d.clamp.section import D, Section


def clamp_with(radius, wire, half_angle=math.pi / 3):
    """Four grooves and both wires alike, symmetric about the bolt."""
    clamp = clamp_of(radius, half_angle, 45.0, 2.0 * wire)
    assert clamp is not None
    return clamp


def test_oversize_wires_rest_on_all_lips():
    # On two lips 2 s = 2 * 15 sin 60 deg apart, above and below: its centre is sqrt(18^2 - s^2) off each face.
    clamp = clamp_with(15.0, 18.0)
    s = 15.0 * math.sin(math.pi / 3)
    off = math.sqrt(18.0**2 - s**2)
    expected = clamp.up_splint.thickness - clamp.down_splint.face_depth + 2.0 * off
    section = Section(clamp, Cas())
    states = equilibria(section)
    assert states[0].q[4] == pytest.approx(expected, abs=1e-9)
    assert states[0].q[5] == pytest.approx(0.0, abs=1e-9)
    assert describe(states[0], ()) == (
        "power line on a lip of the up splint and a lip of the down splint, "
        "jumper on a lip of the up splint and a lip of the down splint"
    )
    assert not section.escaped(states[0].q)
    free = replace(states[0], multipliers=0.0 * states[0].multipliers, loose=("P7",))
    assert describe(free, ("P6",)) == "power line slips out of its groove, jumper loose"


def test_a_lip_holds_nothing_beside_the_face_that_a_wire_lies_on():
    """Between faces 2e-8 rad from parallel a wire creeps over the lip and falls into the groove."""
    clamp = ASSEMBLIES["assembly: tilt limit"].cases(50, 0).cases[45].clamp
    envelope, states = Envelope(clamp), equilibria(Section(clamp, Cas()))
    assert len(states) == 2
    assert states[0].q[D] < states[1].q[D]
    for state in states:
        assert envelope.falls(state.q) <= 1e-8


def test_a_run_tells_the_others_when_asked(run):
    assert run.others is None
    run = assemble("reference", Cas(), others=True)
    assert run.others
    assert [(len(p.joints), round(p.distance, 3)) for p in run.with_play] == [(1, 31.428), (2, 31.427), (3, 31.416)]
    assert all(abs(e.closing - run.closing) > 1e-6 or abs(e.tilt - run.tilt) > 1e-6 for e in run.others)
    for e in run.others:
        assert str(e) in [finding.text for finding in run.findings if finding.severity == "note"]
        assert e.is_equilibrium == ("slips" not in e.detail)
    data, keys = run.to_dict(), ("distance_mm", "closing_mm", "tilt_deg", "rests")
    ends = [(e.distance, e.closing, math.degrees(e.tilt), e.is_equilibrium) for e in run.others]
    assert [tuple(end[key] for key in keys) for end in data["other_ends"]] == ends
    assert data["with_play_mm"] == {", ".join(p.joints): p.distance for p in run.with_play}


def test_command_line_tells_them_unless_told_not_to(main):
    code, out, text = main("run", "--json", "-")
    assert code == 0
    assert "another equilibrium: 31.638 mm, tilt 12.33 deg: jumper on the face of the up splint" in text
    assert [round(e["distance_mm"], 3) for e in json.loads(out)["other_ends"]] == [31.638]
    assert "another equilibrium" not in main("run", "--quiet", "--no-equilibria")[1]
    code, _, error = main("run", "--quiet", "--solver", "stepped", "--equilibria")
    assert (code, "--equilibria goes with --solver exact, not stepped" in error) == (2, True)
