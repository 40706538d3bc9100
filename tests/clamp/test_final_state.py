"""The final state against the published figures and the independently computed distances of the reconstruction."""

import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from clamp3d import InputError, assemble, load_clamp
from clamp3d.baselines import Cas, Chords
from clamp3d.bench.stress.assemblies.envelope import Envelope
from clamp3d.bench.stress.assemblies.family import ASSEMBLIES
from clamp3d.bench.stress.assemblies.minima import minima
from clamp3d.clamp.assemble import TILT_STEP
from clamp3d.clamp.conductors import catalogue
from clamp3d.clamp.contact import measure_contacts
from clamp3d.clamp.dimensions import Joints
from clamp3d.clamp.final_state import TOLERANCE, solve_final_state
from clamp3d.clamp.section import SIZE, WIRES, B, D, S, Section, U, V, W
from clamp3d.clamp.stepped import solve_stepped
from clamp3d.engine.model import ModelCache
from clamp3d.errors import SolverError
from tests.clamp.random_clamps import changed, whole_clamp

CACHE = ModelCache()


@pytest.fixture(scope="module")
def clamp():
    return load_clamp("reference")


def test_any_open_start_ends_in_the_same_state(clamp):
    section = Section(clamp, Cas())
    known = solve_final_state(section).q
    rng = np.random.default_rng(20)
    limit = clamp.tilt_stop
    for _ in range(6):
        start = section.open_state(section.open_distance() + rng.uniform(0.0, 60.0), rng.uniform(-limit, limit))
        start[:4] += rng.uniform(-5.0, 5.0, 4)
        gaps = section.gaps(start)
        apart = [v for v, pair in zip(gaps.value, gaps.pair, strict=True) if pair != ("P2", "P3")]
        assert min(apart) > 0.0
        assert solve_final_state(section, start).q == pytest.approx(known, abs=1e-9)


@pytest.mark.parametrize("k", [0, 6, 10])
def test_positions_that_are_tried_are_those_that_envelopes_in_closed_form_leave_free(k):
    """Down from the open clamp, each time at the free tilt next to the last one; at last at the one with most room."""
    clamp, step, turn, told = whole_clamp(np.random.default_rng([41, k]), major=0.0), 2.0, math.radians(1.0), []
    section, envelope, most = Section(clamp, Cas()), Envelope(clamp), math.floor(clamp.tilt_stop / turn)
    turns = list(range(-most, most + 1))
    least = envelope.faces(turn * np.array(turns))
    for wire, name in zip(envelope.wires, WIRES, strict=True):
        x = np.sort(np.clip(wire.places(turn * np.array(turns)), *section.mouth(name)), axis=1)
        least = np.maximum(least, np.nanmin(wire.least(x, turn * np.array(turns)), axis=1))
    expected, tried, last, d = [], 0, 0, step * math.ceil(section.open_distance() / step)
    while min(least) <= d:
        order = sorted(turns, key=lambda i: (abs(i - last), abs(i)))
        count, last = next((n, i) for n, i in enumerate(order, 1) if least[i + most] <= d)
        tried, d = tried + count, d - step
        expected.append((tried, pytest.approx(d + step, abs=1e-9)))
    found = solve_stepped(section, step=step, tilt_step=turn, progress=lambda *at: told.append(at))
    assert told == expected
    assert found.motion_steps == tried + len(turns)
    assert k == 10 or found.q[S] == pytest.approx(section.lever * turn * turns[least.argmin()])  # 10: loose wires
    assert found.q[D] == pytest.approx(d + step, abs=1e-9)
    fine = solve_stepped(section, resolution=0.0625, step=step, tilt_step=turn, progress=lambda *at: told.append(at))
    assert told[len(expected) : 2 * len(expected)] == expected
    made = [*(count for count, _ in told[len(expected) :]), fine.motion_steps + 1]
    assert made == sorted({*made})
    assert told[-1][1] == pytest.approx(fine.q[D], abs=1e-12)
    assert fine.q[D] % 0.0625 == pytest.approx(0.0, abs=1e-9)
    if k == 0:  # the saddle's edge stops it
        assert -clamp.tilt_stop <= fine.q[S] / section.lever <= turn / 32.0 - clamp.tilt_stop
    else:
        assert 0.0 <= fine.q[D] - solve_final_state(section).q[D] <= 0.0625
    chords = solve_stepped(Section(clamp, Chords(0.5)), step=10.0, tilt_step=0.1)
    gaps = [gap for gap, pair in zip(chords.gaps.value, chords.gaps.pair, strict=True) if pair == ("P2", "P3")]
    assert min(gaps) == pytest.approx(0.0, abs=1e-9)  # the saddle is drawn up to its chords


def test_an_assembly_by_tried_positions_is_the_exact_one_within_its_resolution(run):
    told, seen, thin = [], [], {"line": "LJ-16", "jumper": "LJ-16"}
    settings = {"progress": lambda *at: told.append(at), "on_waypoint": seen.append}
    found = assemble(solver="stepped", moves=(0.29, TILT_STEP), **settings)
    fine = assemble(solver="bisection", moves=(0.29, TILT_STEP), **thin)
    exact = assemble(**thin)
    assert 0.0 <= fine.closing - exact.closing <= 1e-3
    assert "down splint touches P1" in [waypoint.label for waypoint in exact.path]  # their faces
    assert 0.0 < found.closing - run.closing <= 0.29
    assert run.turns - found.turns == pytest.approx((found.closing - run.closing) / 2.5)
    assert (found.resolution, fine.resolution, run.resolution) == (0.29, 0.01, 1e-6)
    assert (found.start, found.status, fine.status) == (run.start, run.status, exact.status)
    assert [found.violation, found.optimality, found.others, found.with_play, *found.forces] == [None] * 4
    assert found.work.contact_queries > found.work.motion_steps > told[-1][0] > run.work.motion_steps == 0
    assert [(e.step, e.a, e.b) for e in found.events] == [(e.step, e.a, e.b) for e in run.events]
    assert [e.travel for e in found.events[2:]] == pytest.approx([found.start.closing - found.closing] * 5)
    assert [(d.a, d.b) for d in found.matrix_differences] == [(d.a, d.b) for d in run.matrix_differences]
    assert {f.severity for f in fine.findings if "declared 3" in f.text} == {"warning"}
    assert seen == list(found.path)


def test_moves_that_would_never_end_are_refused(clamp):
    section = Section(clamp, Cas())
    limits = {"step": section.open_distance() / 1e5, "tilt_step": clamp.tilt_stop / 1e5}
    for name, limit in limits.items():
        unit = f"{math.degrees(limit):.4g} deg" if name == "tilt_step" else f"{limit:.4g} mm"
        moves = {"step": 1.0, "tilt_step": TILT_STEP}
        with pytest.raises(InputError, match=rf"step must be >= {re.escape(unit)} here"):
            solve_stepped(section, **moves | {name: 0.999 * limit})
        with pytest.raises(InputError, match="step must be > 0"):
            solve_stepped(section, **moves | {name: 0.0})
        with pytest.raises(ZeroDivisionError):  # begins
            solve_stepped(section, **moves | {name: 1.001 * limit}, progress=lambda *_: 1 // 0)
    section.open_distance = lambda: 1.5
    with pytest.raises(SolverError, match="the open clamp overlaps at a distance of 2 mm"):
        solve_stepped(section, step=1.0, tilt_step=TILT_STEP)


@pytest.mark.parametrize(("model", "aside"), [(Cas(), 0.0), (Cas(), 40.0), (Chords(math.radians(7.0)), 0.0)])
def test_gradients_agree_with_differences(clamp, model, aside):
    """Where joints have play, and where wires have left the faces."""
    rng, h = np.random.default_rng(16), 1e-6
    section = Section(replace(clamp, joints=Joints(hole=True, saddle=True, washer=True)), model)
    for _ in range(6):
        q = section.open_state(26.0, 0.05) + 0.3 * rng.normal(size=SIZE)
        q[[0, 2]] += -aside, aside
        numeric = [(section.gaps(q + h * e).value - section.gaps(q - h * e).value) / (2.0 * h) for e in np.eye(SIZE)]
        assert np.allclose(np.array(numeric).T, section.gaps(q).gradient, atol=2e-6)


@pytest.mark.parametrize("plays", [(), ("hole",), ("saddle",), ("washer",), ("hole", "saddle", "washer")])
def test_gaps_of_the_section_are_those_of_the_bodies_in_space(plays):
    """Also beside the splints' outer edges, where their faces end; the bolt is pushed off the saddle's bottom."""
    joints = Joints(**dict.fromkeys(plays, True))
    clamp = changed(whole_clamp(np.random.default_rng(7)), {"down_splint.slot_length": 55.0, "joints": joints})
    section, apart = Section(clamp, Cas()), 0
    for tilt, (aside, down) in itertools.product((0.06, -0.06), ((0.0, 0.0), (36.0, -45.0), (36.0, 0.0), (36.0, 45.0))):
        q = section.open_state(section.open_distance(), tilt)
        q[:4] += -aside, down, aside, down
        q[[D, U]] += 3.0
        q[[B, V, W]] += np.array([0.2, -0.1, -2.5 * np.sign(tilt)]) * [joints.hole, joints.washer, joints.saddle]
        gaps, poses = section.gaps(q), section.poses(q)
        seen = [*q[:4], q[D] - q[U], q[S], 0.0, 0.0, q[[B, V, W]].sum(), 0.0]
        assert section.state(poses) == pytest.approx(seen, abs=1e-12)
        poses["P4"] = replace(poses["P4"], y=poses["P4"].y + 5.0)
        bolted = [] if aside else [("P1", "P4"), ("P2", "P4"), ("P3", "P4"), ("P4", "P6"), ("P4", "P7")]
        pairs = [("P2", "P3"), *itertools.product(("P1", "P2"), WIRES), *bolted]
        for contact in measure_contacts(clamp, poses, pairs=pairs, cache=CACHE):
            pair = contact.a, contact.b
            idle = clamp.up_splint.hole_diameter if "P1" in pair else clamp.saddle.hole_diameter
            own = [gap for gap, its in zip(gaps.value, gaps.pair, strict=True) if its == pair]
            least = min(own, default=0.5 * (idle - clamp.bolt.diameter))
            if least > 0.0 or contact.a == "P1":  # beneath the down splint's grooves the section's material has no end
                assert max(contact.gap, 0.0) == pytest.approx(max(least, 0.0), abs=1e-6), pair
                apart += least > 0.0
            if contact.a == "P1" and contact.b in WIRES and least > 0.0:
                x, y = gaps.point[[i for i, its in enumerate(gaps.pair) if its == pair][int(np.argmin(own))]]
                at = np.array([x + poses["P1"].x, -y - poses["P1"].y])
                assert contact.point[[0, 2]] == pytest.approx(at, abs=1e-6)
    assert apart > 40


def test_where_wires_begin_and_where_they_escape_by_hand(clamp):
    section = Section(clamp, Cas())
    half = math.sqrt(23.8012**2 - (48.7901 - 27.726) ** 2)
    for wire, middle in (("P6", 68.5 - 46.0349), ("P7", 68.5 + 49.8315)):
        assert section.mouth(wire) == pytest.approx((middle - half, middle + half))
    assert section.reach("P6") == pytest.approx((-16.335, 68.5 - 10.0 - 16.335))
    assert section.reach("P7") == pytest.approx((68.5 + 10.0 + 7.125, 137.0 + 7.125))
    assert section.least_slack == pytest.approx(23.8012 - 16.335)
    for aside, low, high in ((0.0, 0.0, 137.0), (2.0, 2.0, 137.0), (-2.0, 0.0, 135.0)):  # of the down splint
        q = section.open_state(60.0)
        q[W] = aside
        for x, out in ((low - 0.1, True), (low + 0.1, False), (high - 0.1, False), (high + 0.1, True)):
            for i in (0, 1):
                moved = q.copy()
                moved[2 * i] = x
                assert section.escaped(moved) == WIRES[i : i + out]


def test_a_wire_about_the_middle_of_a_groove_has_the_curvature_of_a_groove_that_it_all_but_fills(clamp):
    """No point of the arc is nearest then; for the centres' distance, which is zero, 1e-9 of its radius stands."""
    section = Section(clamp, Cas())
    q = section.open_state(60.0)
    q[:2] = section.arc_centres(q, "P6")[0]
    (row,) = (row for row in section.gaps(q).rows if (row.surface, row.round, row.feature) == ("P1", "P6", "arc"))
    assert row.value == pytest.approx(section.least_slack, abs=1e-12)
    assert row.curvature == pytest.approx(-1e9 / 23.8012)


def test_curvatures_agree_with_differences_of_gradients(clamp):
    """Of every gap alone: wires in arcs and on lips, beside the splints' edges, faces, slot, saddle."""
    rng, h, seen = np.random.default_rng(5), 1e-5, set()
    section = Section(replace(clamp, joints=Joints(hole=True, saddle=True, washer=True)), Cas())
    for d, (aside, down) in itertools.product((33.0, 60.0), ((0.0, 0.0), (14.0, 0.0), (30.0, 0.0), (30.0, -40.0))):
        q = section.open_state(d, 0.03) + np.append(0.3 * rng.normal(size=6), 0.01 * rng.normal(size=4))
        q[:4] += -aside, down, aside, down
        sides = [[section.gaps(q + s * h * e).gradient for e in np.eye(SIZE)] for s in (1.0, -1.0)]
        numeric, gaps = np.subtract(*sides) / (2.0 * h), section.gaps(q)
        for k in np.flatnonzero(gaps.value < 30.0):  # others are behind what an edge has replaced
            force = np.eye(len(gaps.value))[k]
            assert np.allclose(section.hessian(q, gaps, force), numeric[:, k], atol=1e-7), gaps.feature[k]
            seen |= {(gaps.pair[k], gaps.feature[k].split()[0])}
    assert {(("P1", "P6"), "arc"), (("P2", "P7"), "lip"), (("P2", "P3"), "arc"), (("P2", "P4"), "slot")} <= seen


def test_pairs_of_conductors_end_in_a_stated_result():
    """The thinnest, the thickest and a spread of others: what the status says is what the contacts are."""
    names = list(catalogue())[::17]
    stated = set()
    for k, (line, jumper) in enumerate(itertools.product(names, names)):
        run = assemble(load_clamp(line=line, jumper=jumper), Cas())
        assert run.violation <= TOLERANCE
        assert run.optimality <= TOLERANCE
        held = {(s.splint, s.wire) for s in run.seats if s.seated}
        if run.status == "clamped":
            assert len(held) == 4, (line, jumper)
            assert not run.undeclared
        else:
            assert run.status.startswith("not clamped: ")
            if "faces meet" in run.status:
                assert any({c.a, c.b} == {"P1", "P2"} and abs(c.gap) < 1e-6 for c in run.contacts)
                assert run.undeclared
        if k % 3 == 0:  # the envelopes of the wires' ways in closed form, without gradients or multipliers
            low = [m for m in minima(Envelope(run.clamp)) if abs(m.d - run.closing) <= 1e-6]
            assert any(abs(m.tilt - run.tilt) <= 1e-5 for m in low), (line, jumper, run.closing)
        stated.add(run.status.split(",")[0])
    assert {"clamped", "not clamped: faces meet"} <= stated


def test_a_start_that_overlaps_is_refused(clamp):
    section = Section(clamp, Cas())
    with pytest.raises(InputError, match=r"P. and P. overlap by \d+\.\d+ mm"):
        solve_final_state(section, section.open_state(0.0))


def test_a_loose_wire_in_a_sliver_is_put_down_without_overlap():
    """The faces meet and leave the jumper 3e-7 mm of room between two arcs whose normals are nearly opposite."""
    case = ASSEMBLIES["assembly: faces meet"].cases(17, 0).cases[16]
    state = solve_final_state(Section(case.clamp, Cas()), case.start)
    assert state.loose == ("P7",)
    assert state.gaps.value.min() >= -1e-9


@pytest.mark.parametrize(("k", "loose", "on"), [(1, "P6", "P1"), (2, "P7", "P2"), (11, "P6", "P1"), (11, "P7", "P2")])
def test_the_clamp_hangs_on_a_loose_line_and_a_loose_jumper_lies_in_it(k, loose, on):
    section = Section(whole_clamp(np.random.default_rng([77, k])), Cas())
    state = solve_final_state(section)
    gaps = [gap for gap, pair in zip(state.gaps.value, state.gaps.pair, strict=True) if pair == (on, loose)]
    assert loose in state.loose
    assert min(gaps) == pytest.approx(0.0, abs=1e-6)
