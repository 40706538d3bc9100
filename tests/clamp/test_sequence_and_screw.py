from dataclasses import replace

import numpy as np
import pytest

from clamp3d import InputError, assemble, load_clamp
from clamp3d.baselines import Cas
from clamp3d.clamp.sequence import parse_sequence


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "step 1"),
        (
            "P1|P2P3P4P5 -> P8 -> P2 -> P5|P3P4",
            "part of sequence step 2 must be one of P1, P2, .*, got 'P8'",
        ),
        ("P1|P2P2", "P2 is named twice"),
        ("P1|P2P3P4P5 -> P6 -> P7", "part of sequence step 2 must be one of P1, P2, P3, P4, P5, P7, got 'P6'"),
        ("P1|P2P3P4P5 -> P2 -> P5|P3P4", "must bring every part but P6; missing P7 in"),
        ("P1|P2P3P4P5 -> P7 -> P2 -> P2", r"step 4, P2: P2 \(down splint\) is closed already"),
        ("P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4 -> P3", r"step 5, P3: P3 \(saddle washer\) is closed already"),
        ("P1/P2", "must read like"),
    ],
)
def test_a_sequence_that_closes_no_clamp_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_sequence(text)


def test_every_step_ends_at_a_contact_that_is_declared():
    run = assemble(load_clamp(), Cas())
    by_step = {}
    for event in run.events:
        by_step.setdefault(event.step, []).append((event.a, event.b))
    assert list(by_step) == ["P1|P2P3P4P5", "P7", "P2", "P5|P3P4"]
    assert by_step["P1|P2P3P4P5"] == [("P1", "P6")]
    assert by_step["P7"] == [("P1", "P7")]
    assert {("P2", "P6"), ("P2", "P7")} <= set(by_step["P2"])
    assert ("P2", "P3") in by_step["P5|P3P4"]
    assert run.turns == pytest.approx((run.path[0].poses["P2"].y - run.path[0].poses["P1"].y - run.closing) / 2.5)


@pytest.mark.parametrize("lacking", [-0.01, 0.01, 30.0, 67.0])
def test_a_bolt_that_does_not_fill_the_nut_does_not_clamp(lacking):
    clamp, poses = load_clamp(), assemble(load_clamp(), Cas()).poses
    through = clamp.bolt.shank_length + poses["P4"].y - poses["P5"].y  # its end flush with the nut's free face
    run = assemble(replace(clamp, bolt=replace(clamp.bolt, shank_length=through - lacking)), Cas())
    short = f"not clamped: the bolt is {lacking:.4g} mm too short for the nut"
    assert run.status == ("clamped" if lacking < 0.0 else short)
    gaps = {(c.a, c.b): c.gap for c in run.contacts}
    assert gaps["P4", "P5"] == pytest.approx(max(0.0, lacking - run.clamp.nut.height), abs=1e-6)
    assert np.isfinite(list(gaps.values())).all()


def test_scenes_are_the_parts_at_their_poses():
    assembly = assemble()
    for waypoint in (assembly.path[0], assembly.path[-1]):
        scene = assembly.scene_at(waypoint)
        assert [part.name for part in scene.parts] == ["P1", "P2", "P3", "P4", "P5", "P6", "P7"]
        for part in scene.parts:
            assert np.array_equal(part.T_world, waypoint.T_world(part.name))
    assert all(np.array_equal(part.T_world, assembly.T_world(part.name)) for part in assembly.scene.parts)
