from dataclasses import replace

import numpy as np
import pytest

from clamp3d import InputError, assemble, load_clamp
from clamp3d.baselines import Cas
from clamp3d.clamp.contact import measure_contacts
from clamp3d.clamp.dimensions import Joints
from clamp3d.clamp.sequence import as_published, parse_sequence


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
        ("P1|P2P3P4P5 -> P7 -> P2 -> P1|P2", r"step 4, P1\|P2: P2 \(down splint\) is closed already"),
        ("P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4 -> P3", r"step 5, P3: P3 \(saddle washer\) is closed already"),
        ("P1|", "must read like"),
        (" -> ".join(["P7"] * 31), "at most 30 steps, got 31"),
    ],
)
def test_a_sequence_that_closes_no_clamp_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_sequence(text)


def test_the_papers_steps_move_their_parts_as_far_as_their_contacts_say(run):
    clamp, path = run.clamp, [w.poses for w in run.path]
    assert [w.label for w in run.path] == [
        *("open clamp beside the line", "line between the splints", "up splint rests on the line"),
        *("jumper between the splints", "jumper in the up splint's groove", "down splint touches P6"),
        *("down splint touches P7", "splints closed", "nut tightened"),
    ]
    assert path[0]["P1"].x == pytest.approx(clamp.line.radius + 20.0)  # 20 mm of free way on either side of the splints
    free = path[0]["P1"].x + clamp.up_splint.width + clamp.jumper.radius + 20.0
    assert [poses["P7"].x for poses in path[:3]] == pytest.approx([free] * 3)
    for poses, wire in zip(path[:4], ("P6", "P6", "P7", "P7"), strict=True):  # at half height between the faces
        faces = poses["P1"].y + clamp.up_splint.thickness, poses["P2"].y + clamp.down_splint.face_depth
        assert sum(faces) == pytest.approx(2.0 * poses[wire].y, abs=1e-9)
    apart = [poses["P2"].y - poses["P1"].y for poses in path]
    # Straight up until the line, which lies in the middle of the upper arc, is in the middle of the lower one.
    assert apart[5] == pytest.approx(path[5]["P6"].y - path[5]["P1"].y - 3.4624 - (23.8012 - clamp.line.radius))
    inner, seat, end = "interior contact", "seat", pytest.approx(path[-2]["P4"].y - path[-1]["P4"].y)
    expected = [
        ("P1|P2P3P4P5", "P1P6", inner, pytest.approx(path[2]["P1"].y - path[1]["P1"].y)),
        ("P7", "P1P7", inner, pytest.approx(path[3]["P7"].y - path[4]["P7"].y)),
        *(("P2", f"P2P{k + 1}", inner, pytest.approx(apart[2] - apart[k], abs=2e-3)) for k in (5, 6)),
        *(("P5|P3P4", pair, word, end) for pair, word in (("P2P3", inner), ("P1P5", seat), ("P3P4", seat))),
    ]
    assert [(e.step, e.a + e.b, e.relation, e.travel) for e in run.events] == expected
    for event, k in zip(run.events, (2, 4, 5, 6, 8, 8, 8), strict=True):
        (contact,) = measure_contacts(clamp, path[k], pairs=[(event.a, event.b)])
        assert contact.gap == pytest.approx(0.0, abs=1e-6)
    assert run.turns == pytest.approx((apart[2] - run.closing) / 2.5)
    for name, k in (("open", 0), ("final", -1), ("P7", 4), ("1", 2), ("2", 4), ("4", 8)):
        assert run.waypoint(name) is run.path[k]
    with pytest.raises(InputError, match=r"available: open, P1\|P2P3P4P5 \(or 1\), .*, P5\|P3P4 \(or 4\), final"):
        run.waypoint("5")


@pytest.mark.parametrize("sequence", [None, "P1|P2P3P4P5 -> P7 -> P5|P2P3P4"])
def test_what_meets_while_the_nut_takes_up_play_is_told_with_its_way(sequence):
    run, met = assemble(replace(load_clamp(), joints=Joints(hole=True)), sequence=sequence), {}
    labels, paths = [w.label for w in run.path], {w.label: w.poses for w in run.path}
    expected = [f"down splint touches P{k}" for k in (6, 7, 6)]
    all_the_way = run.start.closing - run.closing
    if sequence is None:
        expected += ["splints closed", "saddle meets the down splint", "nut tightened"]
        before, held = paths["splints closed"], paths["saddle meets the down splint"]
        assert before["P3"].y - before["P1"].y == pytest.approx(run.start.closing - 1.23)  # left where it was
        assert held["P3"].y - held["P2"].y == pytest.approx(-1.23)  # and drawn up to the round back
        drawn = run.start.closing - (held["P2"].y - held["P1"].y)
    else:
        expected += ["down splint touches P7", "up splint touches P4", "nut tightened"]
        drawn = all_the_way
    assert labels[-6:] == expected
    for e in run.events:
        met.setdefault(e.a + e.b, []).append(e.travel)
    assert (met["P1P5"], met["P3P4"], met["P2P3"]) == tuple(
        [pytest.approx(way)] for way in (all_the_way,) * 2 + (drawn,)
    )
    assert met["P1P4"] == [pytest.approx(all_the_way, abs=1e-3)]
    assert len(met["P2P6"]) == len(met["P2P7"]) == 2
    sideways = sum(f.force * f.direction[0] * ((f.b == "P2") - (f.a == "P2")) for f in run.forces)
    assert sideways == pytest.approx(0.0, abs=1e-9)


def test_only_the_papers_own_steps_are_as_published():
    kinds = {
        "P1 | P5P4 P3P2 → P7 \\rightarrow P2 -> P5|P4P3": "bring bring close tighten",
        "P1|P2P3P4P5 -> P7 -> P2": "bring bring close tighten",
        "P1|P2P3P4P5 -> P7": "bring bring close tighten",
        "P2|P1P3P4P5 -> P7": "bring bring close tighten",
        "P1|P2P3P4P5 -> P7 -> P5|P2P3P4": "bring bring tighten",
        "P1|P3 -> P2|P4P5 -> P2|P3 -> P7 -> P5|P3P4": "bring bring bring bring tighten",
        "P1|P2P3P4P5 -> P7 -> P5|P1P3P4 -> P5|P3": "bring bring bring bring close tighten",
        "P2 -> P2 -> P1|P3P4P5 -> P7": "bring close bring bring tighten",
        "P1|P2P4P5 -> P7 -> P5|P3P4": "bring bring bring close tighten",
        "P1|P2P3P4P5 -> P7 -> P3|P4P5": "bring bring bring close tighten",
    }
    for k, (text, expected) in enumerate(kinds.items()):
        steps = parse_sequence(text)
        assert [step.kind for step in steps] == expected.split(), text
        assert as_published(steps) == (k < 3)
    names = [step.name for step in parse_sequence("P1 -> P7 -> P2 -> P3|P4 -> P5")]
    assert names == ["P1", "P7", "P2 (step 3)", "P3|P4", "P5", "P2 (step 6)", "P5|P3P4"]


@pytest.mark.parametrize("lacking", [-0.01, 0.01, 30.0, 67.0])
def test_a_bolt_that_does_not_fill_the_nut_does_not_clamp(lacking, run):
    clamp, poses = run.clamp, run.poses
    through = clamp.bolt.shank_length + poses["P4"].y - poses["P5"].y  # its end flush with the nut's free face
    made = assemble(replace(clamp, bolt=replace(clamp.bolt, shank_length=through - lacking)), Cas())
    short = f"not clamped: the bolt is {lacking:.4g} mm too short for the nut"
    assert made.status == ("clamped" if lacking < 0.0 else short)
    loose = replace(load_clamp(line="LJ-16", jumper="LJ-16"), bolt=made.clamp.bolt)
    assert assemble(loose).status == "not clamped: faces meet, P6 and P7 loose"
    gaps = {(c.a, c.b): c.gap for c in made.contacts}
    assert gaps["P4", "P5"] == pytest.approx(max(0.0, lacking - clamp.nut.height), abs=1e-6)
    assert np.isfinite(list(gaps.values())).all()
