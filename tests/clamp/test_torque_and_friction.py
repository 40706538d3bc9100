"""Torque and friction band against hand-calculated values, and methods that share nothing with the code."""

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from legends import friction_figure
from scipy.optimize import brentq

from clamp3d import InputError, load_clamp
from clamp3d.baselines import Cas
from clamp3d.clamp.dimensions import Limits
from clamp3d.clamp.friction import MARGIN, Balance, FrictionBand
from clamp3d.clamp.section import SIZE, D, S, Section
from clamp3d.clamp.torque import tighten, torque_per_newton
from clamp3d.output.run_report import measured_to_text
from tests.clamp.random_clamps import changed

REFERENCE = load_clamp()


@pytest.fixture(scope="module")
def finder():
    """Its bands are calculated once."""
    made = FrictionBand(REFERENCE)
    made.band, made.friction_for = cache(made.band), cache(made.friction_for)
    return made


M16 = {"bolt.diameter": 16.0, "bolt.pitch": 2.0, "nut.across_flats": 24.0, "up_splint.hole_diameter": 17.5}


@pytest.mark.parametrize(
    ("values", "friction", "lever"),
    [
        # by hand: 0.16 * 2.5 = 0.4; 0.58 * (20 - 0.649519 * 2.5) = 10.65820; (30 + 22) / 4 = 13
        *(({}, *row) for row in ((0.10, 2.765820), (0.14, 3.712148), (0.20, 5.131640))),
        (M16, 0.12, 2.588187),  # 0.32 + 0.58 * 14.700962 * 0.12 + 10.375 * 0.12
    ],
)
def test_torque_equation_by_hand(values, friction, lever):
    assert torque_per_newton(changed(REFERENCE, values), friction) == pytest.approx(lever, abs=1e-6)


def test_loads_and_slip_by_hand(run):
    tight = tighten(run, 80.0, friction=(0.20, 0.10, 0.14), groove_friction=(0.30, 0.15, 0.20))
    low, high = 80e3 / 5.131640, 80e3 / 2.765820
    loads = {(load.force.a, load.force.b): load for load in tight.contacts}
    for wire, share in (("P6", 0.541), ("P7", 0.462)):
        newton = loads["P1", wire].newton
        assert (newton.low, newton.high) == pytest.approx((share * low, share * high), rel=2e-3)
        line_load = loads["P1", wire].line_load
        assert (line_load.low, line_load.high) == pytest.approx((newton.low / 60.0, newton.high / 60.0))
        pull = tight.slip[wire]  # both grooves rub
        assert (pull.low, pull.high) == pytest.approx((0.15 * 2 * newton.low, 0.30 * 2 * newton.high))
    assert loads["P2", "P3"].line_load is None
    assert tight.preload == pytest.approx((low, high))
    assert len(tight.contacts) == len(loads) == 5  # not what is held on the bolt's axis without a contact
    data, line = tight.to_dict(), tight.contacts[0]
    assert data["preloads"] == [{"friction": mu, "preload_n": newton} for mu, newton in tight.preloads]
    assert data["slip_n"] == {wire: list(pull) for wire, pull in tight.slip.items()}
    held = {"a": "P1", "b": "P6", "feature": "arc", "force_n": list(line.newton)}
    assert data["contacts"][0] == held | {"line_load_n_per_mm": list(line.line_load)}
    assert "line_load_n_per_mm" not in data["contacts"][-1]


def test_line_load_takes_each_splints_own_length(run):
    longer = replace(run, clamp=replace(REFERENCE, down_splint=replace(REFERENCE.down_splint, length=90.0)))
    loads = {load.force.a: load for load in tighten(longer, 80.0).contacts if load.force.b == "P6"}
    assert loads["P1"].line_load.low == pytest.approx(1.5 * loads["P2"].line_load.low, rel=1e-9)


def test_limits_are_reached_at_their_torque(run):
    limits = Limits(bolt_force=50e3, line_load=200.0, wire_pull=2000.0)
    limited = replace(run, clamp=replace(REFERENCE, limits=limits))
    reached = {item.limit: item.torque for item in tighten(limited, 80.0, groove_friction=(0.1, 0.15, 0.2)).limits}
    assert len(reached) == 1 + 4 + 2
    assert reached["bolt force 50000 N"].low == pytest.approx(50 * 2.765820)
    assert reached["bolt force 50000 N"].high == pytest.approx(50 * 5.131640)
    torque = reached["line load 200 N/mm at P1-P6"]
    for value, end in ((torque.low, "high"), (torque.high, "low")):  # at this torque the load's end is the limit
        [load] = [c for c in tighten(limited, value).contacts if (c.force.a, c.force.b) == ("P1", "P6")]
        assert getattr(load.line_load, end) == pytest.approx(200.0)
    pull = reached["P7 holds a pull of 2000 N"]
    assert tighten(limited, pull.high).slip["P7"].low == pytest.approx(2000.0)
    assert tighten(limited, pull.low).slip["P7"].high == pytest.approx(2000.0)


@pytest.mark.parametrize(
    ("torque", "friction", "message"),
    [
        (0.0, (0.1,), "torque must be > 0 and at most 1e6 Nm, got 0"),
        (math.nan, (0.1,), "torque must be a finite number, got nan"),
        (80.0, (0.1, 0.0), "friction must be > 0 and at most 1, got 0, 0.1$"),
        (80.0, (), "friction must be > 0 and at most 1, got nothing"),
        (80.0, (0.5, 1.001), "friction must be > 0 and at most 1, got 0.5, 1.001"),
        (1.001e6, (1.0,), "torque must be > 0 and at most 1e6 Nm, got 1.001e[+]06"),
    ],
)
def test_bad_values(run, torque, friction, message):
    with pytest.raises(InputError, match=message):
        tighten(run, torque, friction=friction)
    for unfit in ({"forces": ()}, {"closing_status": replace(run.closing_status, clamped=False)}):
        with pytest.raises(InputError, match="torque: needs a clamp that the exact solver has closed, got 'clamped'"):
            tighten(replace(run, **unfit), 80.0)
    assert tighten(run, 1e6, friction=(1.0,)).preload.low == pytest.approx(1e9 / 24.058198)  # 0.4 + 10.658198 + 13


def test_every_coefficient_names_its_source(run):
    sources = {c.name: c.source for c in tighten(run, 80.0).coefficients}
    assert "VDI 2230" in sources["torque terms"]
    assert sources["friction of wire and groove"].startswith("chosen")
    usual = {c.name: c.value for c in tighten(run, 80.0).coefficients}
    assert (usual["pitch diameter"], usual["bearing diameter"]) == ("18.376 mm", "26 mm")
    assert sources["friction of thread and nut face"].startswith("chosen")
    values = {c.name: c.value for c in tighten(run, 80.0, friction=(0.15,), groove_friction=(0.3,)).coefficients}
    assert values["friction of thread and nut face"] == "0.15"
    assert values["friction of wire and groove"] == "0.3"
    for mu in (0.05, 0.3):
        given = {c.name: c.source for c in tighten(run, 80.0, friction=(mu,), groove_friction=(mu,)).coefficients}
        assert given["friction of wire and groove"].startswith("given")
        assert given["friction of thread and nut face"].startswith("given")


def test_work_of_forces_is_that_of_the_gaps():
    """Along the normal it must be the gap's derivative; along the tangent, what the touching material moves."""
    section, q = Section(REFERENCE, Cas()), np.zeros(SIZE)
    q[:6] = FrictionBand(REFERENCE).final.q[:6] + np.array((0.3, -0.2, 0.1, 0.4, 0.5, -0.7))
    gaps, pose = section.gaps(q), section.down_splint(q)
    tangents = gaps.normal @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    along = section.work(q, gaps.pair, gaps.point, tangents)
    assert section.work(q, gaps.pair, gaps.point, gaps.normal)[:, SIZE:] == pytest.approx(0.0, abs=1e-9)  # round wires
    for k in [k for k, (a, b) in enumerate(gaps.pair) if b in ("P6", "P7") and a != "P4"]:
        i, radius = ("P6", "P7").index(gaps.pair[k][1]), section.pairs[gaps.pair[k]].cylinder.radius
        assert abs(along[k, SIZE + i]) == pytest.approx(1.0 + gaps.value[k] / radius, abs=1e-6)
        if gaps.pair[k][0] == "P2":
            c, s, h = math.cos(pose.angle), math.sin(pose.angle), 1e-6
            x, y = gaps.point[k] - (pose.x, pose.y)
            moved = replace(pose, angle=pose.angle + h).point(x * c - y * s, x * s + y * c)
            assert along[k, S] == pytest.approx(-tangents[k] @ (moved - gaps.point[k]) / h / section.lever, abs=1e-5)
            assert along[k, D] == pytest.approx(-tangents[k, 1])


def test_symmetric_clamp_in_closed_form():
    """With both sides alike the greatest distance is at no tilt: both wires at the edge of their cones at once."""
    up, down = REFERENCE.up_splint, REFERENCE.down_splint
    groove, low = up.line_groove, down.line_groove
    alike = {"up_splint.jumper_groove": groove, "down_splint.jumper_groove": low}
    clamp = changed(load_clamp(line=32.67, jumper=32.67), alike)
    slack, friction = groove.radius - 16.335, 0.15
    finder = FrictionBand(clamp)
    d = groove.centre_depth - low.centre_depth - 2.0 * slack / math.hypot(1.0, friction)
    assert abs(finder.final.q[S]) < 1e-6
    assert finder.ends(friction)[1] >= d + down.face_depth - up.thickness - 1e-9
    assert finder.distance == pytest.approx(
        d + down.face_depth - up.thickness - 2 * slack * (1 - 1 / math.hypot(1, friction))
    )


def test_bands_of_more_friction_hold_those_of_less_up_to_where_the_arcs_end(finder):
    ends = np.array([finder.ends(friction) for friction in (0.2, 0.3, 0.4, 0.5, 0.55, 0.6, 0.7, 0.85, 1.0)])
    assert (np.diff(ends, axis=0) * (-1.0, 1.0)).min() >= -1e-6
    narrow = {"down_splint.slot_width": 39.5, "down_splint.max_tilt_deg": None}  # stops the tilt before the arcs end
    assert FrictionBand(changed(REFERENCE, narrow)).ends(1.0)[1] < ends[-1, 1] - 0.01
    proven = finder.band(1.0)
    assert (proven.least.distance, proven.greatest.distance) == pytest.approx(ends[-1], abs=1e-9)


def test_certificates(finder):
    band = finder.band(0.1)
    for end, beyond in ((band.least, -1.0), (band.greatest, 1.0)):
        assert end.unbalanced < 1e-9
        assert end.states_beyond > 100
        assert 1e-4 < end.weakest.drive < 1e-2
        total = sum(f.force * f.direction[2] for f in end.forces if f.a == "P1")
        assert total == pytest.approx(-1.0, abs=1e-6)  # the up splint takes the bolt's whole force
        assert (end.distance + beyond * MARGIN) not in band
    written = band.to_dict()
    assert written["least"]["weakest"]["drive"] == band.least.weakest.drive
    assert written["greatest"]["distance_mm"] == band.greatest.distance
    section, q = finder.section, finder.final.q
    assert Balance(section, q, section.gaps(q), 0.1).refute().drive < 1e-7  # in equilibrium there is no such motion


def test_least_friction_of_a_measured_distance(finder):
    friction = finder.friction_for(31.63)
    assert friction == pytest.approx(brentq(lambda mu: finder.ends(mu)[1] - 31.63, 0.05, 0.2), abs=2e-5)
    assert 0.3 < finder.friction_for(32.5) < 0.4
    assert finder.friction_for(29.147) is None
    assert finder.friction_for(finder.distance) == 0.0
    text = measured_to_text(finder, [finder.band(0.1)], 31.63, finder.friction_for(31.63))
    assert "at least 0.106; outside at friction 0.1" in text
    assert len(text.splitlines()) == 1
    assert "no friction up to 1" in measured_to_text(finder, [], 29.147, finder.friction_for(29.147))


def test_figure_draws_band_and_marks(finder):
    axes = friction_figure(finder, {"measured": (31.63,)}).axes[0]
    assert [line.get_ydata()[-1] for line in axes.lines[:2]] == pytest.approx(finder.ends(0.3), abs=1e-6)


def test_clamp_with_a_wire_outside_its_arcs_is_refused():
    with pytest.raises(InputError, match="all four grooves"):
        FrictionBand(load_clamp(line="LJ-16", jumper="LJ-16"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--torque", "-80"), "torque must be > 0 and at most 1e6 Nm, got -80"),
        (("--torque", "80", "--friction", "0,1"), "friction must be > 0 and at most 1, got 0, 1"),
        (("--measured", "-3"), "--measured must be a finite length > 0 mm, got -3"),
    ],
)
def test_command_refuses_a_value_before_it_prints_anything(arguments, message, main):
    code, out, err = main("run", "--quiet", "--no-equilibria", *arguments)
    assert (code, out) == (2, "")
    assert message in err


def test_command(finder, monkeypatch, main):
    monkeypatch.setattr("clamp3d.clamp.friction.FrictionBand", lambda _: finder)  # with its own: docs/usage.md
    asked = ("--torque", "80", "--measured", "31.63", "--groove-friction", "0.1")
    code, out, _ = main("run", "--quiet", "--no-equilibria", *asked, "--json", "-")
    data = json.loads(out)
    assert (code, data["torque"]["torque_nm"]) == (0, 80.0)
    assert data["friction_band"]["measured"]["least_friction"] == pytest.approx(0.1056, abs=1e-4)
