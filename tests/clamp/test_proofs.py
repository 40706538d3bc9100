"""What the proof of a final state rests on, each part alone: a step less and a wrong answer would be called proven."""

import itertools
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import null_space

from clamp3d import assemble, load_clamp
from clamp3d.baselines import Cas
from clamp3d.clamp import final_state
from clamp3d.clamp.equilibria import same
from clamp3d.clamp.final_state import open_up, solve_final_state
from clamp3d.clamp.play import meetings
from clamp3d.clamp.result import Waypoint
from clamp3d.clamp.section import D, S, Section, U
from clamp3d.engine.model import ModelCache
from clamp3d.errors import SolverError
from clamp3d.kernel import SectionPose


@pytest.fixture(scope="module")
def section():
    return Section(load_clamp(), Cas())


@pytest.mark.parametrize("shift", [5e-7, -5e-7])
@pytest.mark.parametrize("wire", [None, 4.0])
def test_a_state_that_is_off_is_not_proven(wire, shift, monkeypatch):
    """Where flat faces meet and it is a little open, all forces balance: only that they act across gaps tells."""
    section = Section(load_clamp(line=wire, jumper=wire), Cas())
    polish = final_state._polish

    def off(*arguments):
        q, step = polish(*arguments)
        q = q.copy()
        q[D] += shift
        return q, step

    monkeypatch.setattr(final_state, "_polish", off)
    with pytest.raises(SolverError, match="final state not proven"):
        solve_final_state(section)


def test_proven_is_what_meets_every_limit(section):
    state = solve_final_state(section)
    for name, good, bad in (("violation", 9e-10, 1.1e-9), ("optimality", 9e-10, 1.1e-9), ("curvature", -9e-7, -1.1e-6)):
        assert replace(state, **{name: good}).is_proven
        assert not replace(state, **{name: bad}).is_proven
    for name in ("violation", "optimality"):
        assert not replace(state, **{name: np.nan}).is_proven


def test_curvature_is_that_of_the_distance_on_motions_that_keep_contacts_closed(section):
    """Second differences: each motion is brought back onto the contacts by Newton's method."""
    state, moving, h = solve_final_state(section), list(section.free), 0.02
    rows = np.flatnonzero(state.multipliers)
    motions = null_space(state.gaps.gradient[rows][:, moving])
    assert motions.shape[1] == 2

    def distance(motion):
        q = state.q.copy()
        q[moving] += motion
        for _ in range(8):
            gaps = section.gaps(q)
            q[moving] -= np.linalg.pinv(gaps.gradient[rows][:, moving]) @ gaps.value[rows]
        return q[D]

    turns = [h * motions @ (np.cos(t), np.sin(t)) for t in np.linspace(0.0, np.pi, 60)]
    least = min(distance(turn) + distance(-turn) - 2.0 * state.q[D] for turn in turns) / h**2
    assert state.curvature == pytest.approx(least, rel=2e-3)


@pytest.mark.parametrize("moved", [{D: -0.3}, {U: -0.2}, {1: -0.2}, {S: 0.4, 3: 0.3}])
def test_an_overlapping_state_is_opened_until_it_is_free_and_hardly_further(section, moved):
    q = solve_final_state(section).q
    for k, by in moved.items():
        q[k] += by
    opened = open_up(section, q, 0.01)
    assert section.gaps(q).value.min() < -0.1
    assert section.gaps(opened).value.min() >= -1e-9
    assert np.abs(opened - q).max() < 0.8
    assert open_up(section, q, 1e-6) is None or D not in moved


def test_a_state_with_play_that_is_not_proven_is_said_to_be_so_beside_the_others(monkeypatch):
    def fails_first(section, *start, **more):
        if section.clamp.joints.hole and not section.clamp.joints.saddle:
            raise SolverError("no proof")
        return solve_final_state(section, *start, **more)

    monkeypatch.setattr(sys.modules["clamp3d.clamp.assemble"], "solve_final_state", fails_first)
    hole, *others = assemble(others=True).with_play
    assert (hole.status, hole.distance) == ("not proven: no proof", None)
    assert len(others) == 2
    assert all("not proven" not in play.status for play in others)


def test_states_that_differ_in_what_is_loose_are_two(section):
    state = solve_final_state(section)
    assert same(state, state)
    for loose in (("P6",), ("P7",), ("P6", "P7")):
        assert not same(state, replace(state, loose=loose))
        assert not same(replace(state, loose=loose), state)
    for k in range(6):
        moved = state.q.copy()
        moved[k] += 1e-4
        assert not same(state, replace(state, q=moved))


def test_a_splint_that_turns_past_a_wire_meets_it_between_two_waypoints():
    """At both waypoints they stand clear and no origin moves: only that the splint turns brings its end to the line."""
    clamp = load_clamp()
    far = {name: SectionPose(1000.0 * k, 5000.0) for k, name in enumerate(("P2", "P3", "P4", "P5", "P7"))}
    reach = clamp.up_splint.width

    def path(a, b, wire):
        poses = [{**far, "P1": SectionPose(0.0, 0.0, angle), "P6": SectionPose(*wire)} for angle in (a, b)]
        return [Waypoint("P1", label, p) for label, p in zip(("before", "after"), poses, strict=True)]

    beside = (0.7 * reach, 0.0)
    turned = path(0.9, -0.9, beside)  # the splint lies along x when it is level
    assert meetings(clamp, turned, [("P1", "P6")], ModelCache()) == {("P1", "P6"): "P1 (after)"}
    for pairs in itertools.permutations([("P1", "P6"), ("P1", "P5"), ("P1", "P4")]):  # the others are far away
        assert meetings(clamp, turned, pairs, ModelCache()) == {("P1", "P6"): "P1 (after)"}
    away = path(0.9, -0.9, (0.7 * reach, 4.0 * reach))
    assert meetings(clamp, away, [("P1", "P6")], ModelCache()) == {}
    assert meetings(clamp, path(0.9, 0.9, beside), [("P1", "P6")], ModelCache()) == {}
