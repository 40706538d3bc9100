"""The closing path: one answer in every command, stops that are there, play, forces and their virtual work."""

import math
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from shapely import LineString

from clamp3d import assemble, load_clamp
from clamp3d.baselines import Cas
from clamp3d.clamp.closing import STRIDE
from clamp3d.clamp.dimensions import GrooveDimensions, Joints
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import EDGES, WIRES, D, Section, U, W
from tests.clamp.outlines import Outlines
from tests.clamp.random_clamps import changed, check_clamps, whole_clamp


def test_an_optimiser_and_a_grid_agree():
    """Two of the clamps that ``scripts/check-clamps`` takes hundreds of."""
    score = check_clamps(2, 1)
    assert score.findings == []
    assert score.asked["optimiser without play"] == score.asked["optimiser with play"] == 2
    assert score.asked["equilibria named"] == 1


def test_the_open_clamp_overlaps_nothing_at_any_tilt():
    for k in range(60):
        section = Section(whole_clamp(np.random.default_rng([9, k])), Cas())
        for tilt in section.clamp.tilt_stop * np.linspace(-1.0, 1.0, 5):
            q = section.open_state(section.open_distance(), tilt)
            gaps, down, clamp = section.gaps(q), section.down_splint(q), section.clamp
            apart = [gap for gap, pair in zip(gaps.value, gaps.pair, strict=True) if pair != ("P2", "P3")]
            assert min(apart) >= -1e-9, k
            for (x, y), wire in zip(q[:4].reshape(2, 2), WIRES, strict=True):  # no further from their middle than that
                low = (x - down.x) * math.sin(down.angle) + (y - down.y) * math.cos(down.angle)
                room = min(y - clamp.up_splint.thickness, clamp.down_splint.face_depth - low)
                middle = 0.5 * np.add(*section.arc_centres(q, wire))
                assert x in (middle[0], *section.mouth(wire), *section.reach(wire))
                assert section.mouth(wire)[0] <= x <= section.mouth(wire)[1] or x in section.reach(wire)
                assert y == middle[1] or room == pytest.approx(section.pairs["P1", wire].cylinder.radius)


def test_inner_faces_are_as_far_apart_as_their_lines():
    """Of splints of any widths, tilts and shifts that all but touch; shapely measures the two lines."""
    for k in range(60):
        rng = np.random.default_rng([12, k])
        section = Section(whole_clamp(rng), Cas())
        up, down = section.clamp.up_splint, section.clamp.down_splint
        q = section.open_state(section.open_distance(), rng.uniform(-0.2, 0.2))
        q[W] += rng.uniform(-10.0, 10.0)
        for _ in range(20):
            corners = [section.down_splint(q).point(side * section.lever, down.face_depth) for side in (-1.0, 1.0)]
            q[D] -= LineString([(0.0, up.thickness), (up.width, up.thickness)]).distance(LineString(corners)) - 1e-3
        assert section.face_gap(q) == pytest.approx(1e-3, abs=1e-9)


@pytest.mark.parametrize("joints", [Joints(), Joints(hole=True, saddle=True, washer=True)])
def test_the_saddles_edge_lifts_the_down_splint_off_its_arc_but_no_arc_pulls(joints):
    """An optimiser that knows neither states nor multipliers closes as far, and the edge carries the bolt's force."""
    clamp = replace(whole_clamp(np.random.default_rng([0, 204])), joints=joints)
    final = solve_final_state(Section(clamp, Cas()))
    least, overlap = Outlines(clamp).lowest(final.q)
    assert overlap == pytest.approx(0.0, abs=1e-9)
    assert least == pytest.approx(float(final.q[D]), abs=1e-5)
    run = assemble(clamp)
    on_saddle = {f.feature: f for f in run.forces if (f.a, f.b) == ("P2", "P3")}
    assert sum(f.force * f.direction[2] for f in on_saddle.values()) == pytest.approx(-1.0, abs=1e-9)
    assert min(c.gap for c in run.contacts if (c.a, c.b) != ("P4", "P5")) >= -1e-6
    sideways = sum(f.force * f.direction[0] * ((f.b == "P2") - (f.a == "P2")) for f in run.forces)
    assert sideways == pytest.approx(0.0, abs=1e-9)
    assert run.closing == pytest.approx(final.q[D] - final.q[U])
    if not joints.saddle:
        assert list(on_saddle) == [EDGES]
        assert any(abs(state.q[D] - final.q[D]) < 1e-8 for state in equilibria(Section(clamp, Cas())))
        assert {c.relation: c.type for c in run.contacts if (c.a, c.b) == ("P2", "P3")} == {"contact": 2}
        assert final.q[U] > 3.0


def test_the_down_splint_meets_the_wires_where_a_finer_path_meets_them():
    section, paths = Section(whole_clamp(np.random.default_rng([61, 8])), Cas()), []
    for stride in (STRIDE, 0.2 * STRIDE):
        met = {}
        solve_final_state(section, stride=stride, on_contact=met.setdefault)
        paths.append(np.array([met["P2", wire] for wire in WIRES]))
    assert paths[0] == pytest.approx(paths[1], abs=0.03)


def test_forces_on_each_wire_and_on_the_down_splint_balance(run):
    for part in ("P6", "P7", "P2"):
        total = sum(f.force * f.direction * ((f.b == part) - (f.a == part)) for f in run.forces)
        assert np.allclose(total, 0.0, atol=1e-9), part
    down = run.poses["P2"]
    moment = 0.0
    for f in run.forces:
        if "P2" in (f.a, f.b):
            arm, push = f.point - [down.x, 0.0, -down.y], f.direction * f.force * ((f.b == "P2") - (f.a == "P2"))
            moment += arm[2] * push[0] - arm[0] * push[2]
    assert moment == pytest.approx(0.0, abs=1e-6)


def test_a_wire_beyond_the_mouth_can_rest_between_face_and_groove():
    """Small up groove, set 10 mm aside: the mouth is no wall."""
    base = load_clamp(line=16, jumper=16)
    small = GrooveDimensions(radius=9.0, offset=56.0, centre_depth=base.up_splint.thickness + 5.0)
    section = Section(changed(base, {"up_splint.line_groove": small}), Cas())
    beyond = [s for s in equilibria(section) if not section.mouth("P6")[0] <= s.q[0] <= section.mouth("P6")[1]]
    assert beyond
    for state in beyond:
        assert not section.escaped(state.q)
        assert max(state.violation, state.optimality) <= 1e-9


@pytest.mark.parametrize(("k", "plays"), [(None, False), (8, True)])
def test_a_mirrored_clamp_ends_in_the_mirrored_state(k, plays):
    clamp = load_clamp() if k is None else whole_clamp(np.random.default_rng([61, k]))
    clamp = replace(clamp, joints=Joints(hole=plays, saddle=plays, washer=plays))
    other = {"line": clamp.jumper, "jumper": clamp.line}
    for splint in ("up_splint", "down_splint"):
        own = getattr(clamp, splint)
        other |= {f"{splint}.line_groove": own.jumper_groove, f"{splint}.jumper_groove": own.line_groove}
    words, states = [], []
    for run, side in ((assemble(clamp), 1.0), (assemble(changed(clamp, other)), -1.0)):
        text, left = str.maketrans("67", "67" if side > 0.0 else "76"), run.poses["P1"].x + 0.5 * clamp.up_splint.width
        forces = {f"{f.a}{f.b} {f.feature.split()[0]}".translate(text): f for f in run.forces}
        seats = [f"{s.splint}{s.wire} {s.detail}".translate(text) for s in run.seats]
        words.append((run.status.translate(text), sorted(forces), sorted(seats)))
        states.append([run.closing, side * run.tilt, *(side * (run.poses[p].x - left) for p in ("P2", "P3", "P4"))])
        for _, f in sorted(forces.items()):
            states[-1] += [f.force, side * f.direction[0], f.direction[2], side * (f.point[0] - left)]
    assert words[0] == words[1]
    assert states[0] == pytest.approx(states[1], abs=1e-8)


def scaled(part, by):
    """A clamp's part with all lengths times ``by``."""
    sizes = {f.name: getattr(part, f.name) for f in fields(part) if not f.name.endswith("_deg")}
    new = {key: by * size for key, size in sizes.items() if isinstance(size, float)}
    return replace(part, **new, **{key: scaled(size, by) for key, size in sizes.items() if is_dataclass(size)})


def test_a_scaled_clamp_closes_as_far_in_its_own_lengths():
    """Only where it begins is not to scale: open by 10 mm more than it must be, or a fifth of its half width."""
    clamp = load_clamp(line=32.67, jumper=14.25)
    base, small = (assemble(clamp if by == 1.0 else scaled(clamp, by), others=True) for by in (1.0, 0.1))
    assert base.start.closing == pytest.approx(27.726 - 24.5505 + 32.67 + 68.5 * math.sin(clamp.tilt_stop) + 10.0)
    assert 10.0 * small.start.closing == pytest.approx(base.start.closing - 10.0 + 0.2 * 68.5)
    lengths = [
        [run.distance, run.closing, *(e.distance for e in run.others), *(p.distance for p in run.with_play)]
        for run in (base, small)
    ]
    assert 10.0 * np.array(lengths[1]) == pytest.approx(lengths[0], abs=1e-9)
