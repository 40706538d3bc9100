"""Sequences other than the paper's: ways that are said to be free or blocked, seen by volumes of manifold3d."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from manifold3d import Manifold

from clamp3d import assemble, load_clamp
from clamp3d.baselines import Cas
from clamp3d.clamp.closing import open_start
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.parts import parts
from clamp3d.clamp.play import Log
from clamp3d.clamp.section import Section
from clamp3d.clamp.ways import Insertion, out
from clamp3d.errors import SequenceError
from clamp3d.kernel import translation
from clamp3d.output.report import make_report
from tests.clamp.orders import manifold
from tests.clamp.random_clamps import whole_clamp

SCREW = ("P4", "P5")  # one diameter, so facets overlap all around
TOUCHING = 5.0  # mm3 that facets of parts in contact overlap by; a sheet of 0.01 mm between two parts' ends is more


@cache
def bodies():
    return {name: manifold(part, np.eye(4)) for name, part in parts(load_clamp()).items()}


def volume(a, T_a, b, T_b):
    """What two parts share, mm3."""
    placed = [bodies()[name].transform(T[:3]) for name, T in ((a, T_a), (b, T_b))]
    return (placed[0] ^ placed[1]).volume()


def overlaps_on(path, steps=3):
    """Largest volume that two parts share anywhere on a path, looked at in ``steps`` instants of each stretch."""
    worst = 0.0
    for before, after in itertools.pairwise(path):
        for t in np.linspace(0.0, 1.0, steps):
            T = {}
            for name in PARTS:
                p, q = before.poses[name], after.poses[name]
                keys = ("x", "y", "angle", "along")
                T[name] = type(p)(*(getattr(p, k) + t * (getattr(q, k) - getattr(p, k)) for k in keys)).T()
            for a, b in itertools.combinations(PARTS, 2):
                if (a, b) != SCREW:
                    worst = max(worst, volume(a, T[a], b, T[b]))
    return worst


@pytest.mark.parametrize(
    "sequence",
    [
        "P2 -> P2 -> P7 -> P1 -> P3|P4 -> P5",
        "P4|P3 -> P2 -> P1 -> P5 -> P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4",
    ],
)
def test_parts_that_come_one_by_one_overlap_nowhere_and_end_in_the_same_clamp(sequence, run):
    published, run = run, assemble("reference", sequence=sequence)
    assert run.status == "clamped"
    assert run.distance == published.distance
    assert run.poses == published.poses
    assert run.undeclared == ()
    assert overlaps_on(run.path) < TOUCHING
    first = run.path[0].poses
    for a, b in itertools.combinations(PARTS, 2):
        if {a, b} != {"P3", "P4"}:
            (low, high), (other_low, other_high) = (parts(run.clamp)[n].bounds_at(first[n].T()) for n in (a, b))
            assert max((low - other_high).max(), (other_low - high).max()) >= 10.0 - 1e-9, (a, b)
    ways = dict.fromkeys((step.step for step in run.path), 0.0)
    for before, after in itertools.pairwise(run.path):
        if after.label.startswith("P") or after.label == "nut on the bolt's end":
            name, origin = (after.label[:2], after.label.split(", ")[1]) if "," in after.label else ("P5", "from above")
            by = (after.T_world(name) - before.T_world(name))[:3, 3]
            assert by == pytest.approx(-np.linalg.norm(by) * out(origin), abs=1e-9)
            ways[after.step] += np.linalg.norm(by)
    arrived = [(e.travel, ways[e.step]) for e in run.events if ways[e.step]]
    assert [travel for travel, _ in arrived] == pytest.approx([way for _, way in arrived])
    (ends,) = [w.poses for w in run.path if w.label == "nut on the bolt's end"]
    assert ends["P5"].y + run.clamp.nut.height == pytest.approx(ends["P4"].y, abs=1e-9)
    assert len({w.step for w in run.path}) == sequence.count("->") + 1 + ("P5|" not in sequence)
    assert run.events[-1].travel == pytest.approx(run.path[-2].poses["P4"].y - run.path[-1].poses["P4"].y)
    assert all(e.a < e.b for e in run.events)
    met = [w.label for w in run.path if "down splint touches" in w.label]  # the jumper waits while P2 is closed first
    assert met == [f"down splint touches {wire}" for wire in ("P6", "P7")[: 1 + ("P5|" in sequence)]]


def test_what_waits_is_shifted_in_the_world_and_in_plain_data(run):
    log = Log(Section(run.clamp, Cas()), None, aside={"P7": np.array([1.0, 2.0, 3.0])})
    log.reach("P7", "waits", run.poses)
    [waits] = log.path
    assert (waits.T_world("P7") - run.T_world("P7"))[:3, 3].tolist() == pytest.approx([1.0, 2.0, 3.0])
    written = waits.to_dict()["parts"]
    assert (written["P7"]["along"], written["P6"]) == (2.0, run.path[-1].to_dict()["parts"]["P6"])


def test_the_papers_own_motions_overlap_nowhere(run):
    assert overlaps_on(run.path) < TOUCHING


@pytest.mark.parametrize(
    ("sequence", "step", "pair", "travel", "moving"),
    [
        ("P1|P2P3P4P5 -> P7 -> P5|P3P4", r"step 3, P5\|P3P4", ("P3", "P2"), 0.0, {"P3", "P4"}),
        ("P1|P2P3P4P5 -> P2 -> P7", "step 3, P7", ("P7", "P2"), None, {"P7"}),
        ("P4 -> P1 -> P3 -> P7 -> P2 -> P5", "step 3, P3", ("P3", "P4"), 22.041, {"P3"}),
    ],
)
def test_a_blocked_step_names_pair_place_and_instant(sequence, step, pair, travel, moving):
    with pytest.raises(SequenceError, match=f"{step}: .* meets .* after") as refused:
        assemble("reference", sequence=sequence)
    first = refused.value.blocks[0]
    left = [block.way - block.travel for block in refused.value.blocks]
    assert left == sorted(left)
    assert (first.a, first.b) == pair
    assert f"t = {first.travel / first.way:.4f}" in str(refused.value)
    written = first.to_dict()
    assert (written["travel_mm"], written["way_mm"]) == (first.travel, first.way)
    assert written["t"] == pytest.approx(first.travel / first.way)
    assert "X {:z.3f}, Y {:z.3f}, Z {:z.3f}".format(*first.point) in str(refused.value)
    assert travel is None or first.travel == pytest.approx(travel, abs=1e-3)
    scene = refused.value.scene  # for the viewer: the parts that are there, on the same way
    (motion,) = scene.motions
    assert np.linalg.norm(motion.travel) == pytest.approx(first.way, abs=1e-9)
    assert set(motion.parts) == moving
    T = {part.name: part.T_world for part in scene.parts}
    assert set(motion.parts) | {first.b, "P6"} <= set(T)
    touching = translation(*(first.travel / first.way * motion.travel)) @ T[first.a]
    for name, pose in ((first.a, touching), (first.b, T[first.b])):
        assert bodies()[name].transform(pose[:3]).min_gap(Manifold.sphere(0.01).translate(first.point), 5.0) < 0.05
    for off, meets in ((0.2, True), (-0.2, False)):
        moved = translation(*((first.travel + off) / first.way * motion.travel)) @ T[first.a]
        assert (volume(first.a, moved, first.b, T[first.b]) > 1e-6) == meets


def test_a_splint_that_rests_on_the_line_beside_the_middle_of_its_groove_comes_from_above():
    """The last 1e-4 mm of a way onto a slope are proven by where it ends."""
    section = Section(whole_clamp(np.random.default_rng([0, 9])), Cas())
    place = {name: pose.T() for name, pose in section.poses(open_start(section)).items()}
    groove = section.pairs["P1", "P6"]
    assert abs(place["P1"][0, 3] + groove.T_a_groove[0, 3]) > 0.1  # not above the line
    ((origin, length),) = Insertion(section.clamp, [("P1", "P6")], place).way_out()
    assert origin == "from above"  # until its underside is over the line, and 20 mm more
    top = section.clamp.line.radius - place["P1"][2, 3]
    assert length == pytest.approx(top + section.clamp.up_splint.thickness + 20.0)
    for into, is_free in ((5e-4, True), (2e-3, False)):  # what touches slides, what overlaps is blocked
        sunk = place | {"P1": translation(0.0, 0.0, -into) @ place["P1"]}
        assert bool(Insertion(section.clamp, [("P1", "P6")], sunk).way_out()) == is_free


def test_a_report_of_any_sequence_counts_the_nuts_turns_from_the_open_clamp():
    """The nut draws all that is below it."""
    run = assemble(replace(load_clamp(), sequence="P1|P2P3P4P5 -> P7 -> P5|P2P3P4"))
    made = make_report(run)
    assert [row.turns for row in made.steps][:5] == [0.0] * 5
    assert made.steps[-1].turns == pytest.approx(run.turns)
    assert made.tightening[-1]["nut_turns"] == pytest.approx(run.turns)
    assert all(row["saddle_gap_mm"] == 0.0 for row in made.tightening)
