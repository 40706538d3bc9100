"""One status in every command, and the seat of each wire as outlines measured by shapely say."""

import contextlib
import math
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from clamp3d import assemble, load_clamp, monte_carlo, placement, sensitivity
from clamp3d.baselines import Cas
from clamp3d.clamp.closing import CLOSING
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.parts import parts
from clamp3d.clamp.section import EDGES, SIZE, WIRES, D, Section
from clamp3d.clamp.status import closing_status, seats, stop_words
from clamp3d.clamp.stepped import SteppedState
from clamp3d.errors import NotClampedError, SolverError, without_numbers
from clamp3d.geometry.profile import Arc
from tests.clamp.random_clamps import whole_clamp

COMMANDS = ("run", "check", "tolerance --n 1", "sweep --steps 4", "report -o", "export -o", "view --html")
FIRST = {0: "faces meet", 8: "lies beside", 12: "clamped", 14: "the bolt stops", 24: "the saddle's edge stops"}
"""Random clamps of each kind, and what their status says."""
COUNT = int(os.environ.get("CLAMP3D_RANDOM_CLAMPS", "0"))
TOUCH = 1e-6
"""Gap in mm up to which a wire touches; chords of an arc are nearer than it is, by as much."""


def nearest_feature(run, splint, wire):
    """What of a splint's outline is nearest to a wire, and the gap; arcs are chords within 1e-6 mm."""
    profile = parts(run.clamp)[splint].bodies[0].profile
    radius = (run.clamp.line if wire == "P6" else run.clamp.jumper).radius
    a, b = run.poses[splint], run.poses[wire]
    c, s = math.cos(a.angle), math.sin(a.angle)
    centre = shapely.Point((b.x - a.x) * c - (b.y - a.y) * s, (b.x - a.x) * s + (b.y - a.y) * c)
    grooves = sorted((e for e in profile.edges if isinstance(e, Arc) and e.sweep < 0.0), key=lambda e: e.centre[0])
    groove = grooves[0 if wire == "P6" else 1]
    count = math.ceil(abs(groove.sweep) / math.sqrt(8e-6 / groove.radius))
    arc = shapely.LineString([groove.at(t) for t in np.linspace(groove.start_angle, groove.end_angle, count)])
    level = groove.start[1]
    half = 0.5 * (run.clamp.up_splint if splint == "P1" else run.clamp.down_splint).width
    middle = half if splint == "P1" else 0.0
    outer = middle + (-half if wire == "P6" else half)
    lips = sorted((groove.start[0], groove.end[0]))
    gaps = {
        "lip": min(centre.distance(shapely.Point(x, level)) for x in lips),
        "arc": centre.distance(arc),
        "flat face": min(
            centre.distance(shapely.LineString([(lips[0] if wire == "P6" else lips[1], level), (outer, level)])),
            centre.distance(shapely.LineString([(lips[1] if wire == "P6" else lips[0], level), (middle, level)])),
        ),
        "edge": centre.distance(shapely.Point(outer, level)),
    }
    least = min(gaps.values())
    name = next(name for name, gap in gaps.items() if gap <= least + 1e-7)
    return name, least - radius


@pytest.mark.parametrize("k", [*FIRST, *range(100, 100 + COUNT)])
def test_a_random_clamp_has_one_status_and_the_seats_that_its_outlines_show(k):
    clamp = whole_clamp(np.random.default_rng([32, k]))
    try:
        run = assemble(clamp)
    except SolverError:
        with pytest.raises(SolverError):
            monte_carlo(clamp, n=1)
        return
    assert FIRST.get(k, "") in run.status
    for seat in run.seats:
        name, gap = nearest_feature(run, seat.splint, seat.wire)
        assert seat.touches or gap > 0.0
        assert not seat.touches or gap <= TOUCH
        if seat.touches:
            assert seat.feature == name
            (contact,) = (c for c in run.contacts if (c.a, c.b) == (seat.splint, seat.wire))
            assert contact.feature == name
            assert contact.type == (3 if name in ("arc", "lip") else 2)
    in_groove = all(seat.touches and seat.feature in ("arc", "lip") for seat in run.seats)
    assert in_groove or not run.clamped
    assert not in_groove or run.clamped or any(w in run.status for w in ("too short", "loose", "slips", "overlaps"))
    assert bool(run.closing_status.warnings) == (run.clamped and any(s.feature == "lip" for s in run.seats))
    assert run.passed == (run.clamped and not run.undeclared)
    assert run.passed or run.findings[0].severity == "error"
    assert k != 8 or (3, 2) in {(d.declared, d.measured) for d in run.matrix_differences}
    many = monte_carlo(clamp, n=1, tolerance=0.0, wire_tolerance_percent=0.0)
    assert many.nominal_status == run.status
    assert many.status == (without_numbers(run.status),)
    assert many.nominal == (run.distance if run.clamped else None)
    for ask in (sensitivity, lambda clamp: placement(clamp, columns=4)):
        if run.clamped:
            with contextlib.suppress(SolverError):  # not an isolated state has no derivatives
                ask(clamp)
        else:
            with pytest.raises(NotClampedError, match=re.escape(run.status)):
                ask(clamp)


def test_a_wire_on_a_lip_is_clamped_with_a_warning():
    run = assemble(line=48, jumper=47.8)
    assert run.status == "clamped, but P6 on a lip of both splints' grooves and P7 on a lip of both splints' grooves"
    assert run.clamped
    assert run.passed
    said = [f.text for f in run.findings if f.severity == "warning"]
    lips = [f"{w} rests on a lip of the {s} splint's groove, not in its arc" for s in ("up", "down") for w in WIRES]
    assert said == lips


def test_a_wire_that_rolls_out_of_its_groove_touches_one_feature_after_the_other():
    """By hand: along the up splint's arc, around its lip, along its face, around its edge; P2 is far below."""
    section, R, r, level = Section(load_clamp(), Cas()), 23.8012, 16.335, 27.726
    centre, q = np.array([68.5 - 46.0349, 48.7901]), section.open_state(100.0)
    half, outer = math.acos((centre[1] - level) / R), np.array([0.0, level])

    def away(t):
        return np.array([math.sin(t), math.cos(t)])

    lip = centre - R * away(half)
    for feature, words, places in (
        ("arc", "seated in the groove", [centre - (R - r) * away(t) for t in (0.0, half - 1e-3)]),
        ("lip", "rests on the lip", [lip + r * away(t) for t in (half, 0.01)]),
        ("flat face", "rests on the flat face", [0.5 * (lip + outer) + r * away(0.0)]),
        ("edge", "rests on the edge", [outer + r * away(t) for t in (-0.01, -1.5)]),
    ):
        for q[:2] in places:
            up, _, down, _ = seats(section, q)
            assert (up.feature, up.detail, up.touches, up.seated) == (feature, words, True, feature == "arc")
            assert up.in_groove == (feature in ("arc", "lip"))
            assert (down.detail, down.touches, down.seated, down.in_groove) == ("loose", False, False, False)
            assert up.gap == pytest.approx(0.0, abs=1e-9)
    q[:2] = centre - (R - r - 2e-6) * away(0.0)
    assert [seats(section, q, *reach)[0].detail for reach in ((), (1e-5,))] == ["loose", "seated in the groove"]


def test_what_a_status_says_of_a_state():
    section = Section(load_clamp(), Cas())
    final = solve_final_state(section)

    def said(by, **more):
        q = final.q + by * CLOSING
        return str(closing_status(section, replace(final, q=q, **more)))

    alone = " and ".join(f"{wire} is held by the up splint alone" for wire in WIRES)
    assert [said(by) for by in (5e-7, 2e-6)] == ["clamped", f"not clamped: {alone}"]
    up = final.q - 1e-5 * np.eye(SIZE)[3]  # the jumper, off the down splint
    for state in (replace(final, loose=("P7",)), SteppedState(up, section.gaps(up), 0)):
        assert str(closing_status(section, state)) == "not clamped: P6 alone holds the splints apart, P7 loose"
    gaps = section.gaps(final.q - 1e-4 * CLOSING)
    a, b = gaps.pair[int(gaps.value.argmin())]
    assert said(0.0, gaps=gaps) == f"not clamped: {a} overlaps {b} by {-gaps.value.min():.4g} mm"
    edge = (
        final.q[D] - 44.0 + math.sqrt(49.23**2 - 22.0**2) - 1.23
    )  # of the saddle; the down splint overlaps the nut less
    assert said(-44.0) == f"not clamped: P1 overlaps P3 by {27.726 - edge:.4g} mm"
    stops = [(("P2", "P4"), "slot"), (("P4", "P6"), "shank"), (("P1", "P2"), "left edge"), (("P1", "P6"), "arc")]
    words = ["faces meet", "power line rests on the bolt", "the bolt stops the down splint"]
    assert stop_words([*stops, *stops, (("P2", "P3"), EDGES)]) == [*words, "the saddle's edge stops the down splint"]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.usefixtures("without_pictures")
def test_every_command_ends_with_the_same_exit_code(command, tmp_path, main):
    """Of a clamp that does not close; those of the reference clamp are seen where its answers are."""
    text = (Path(__file__).parents[2] / "clamp3d/clamp/data/reference.toml").read_text()
    file = tmp_path / "clamp.toml"
    file.write_text(text.replace('"LJ-630"', '"LJ-16"').replace('"LJ-120"', '"LJ-16"'))
    out = {"report -o": [tmp_path / "report"], "export -o": [tmp_path / "a.stl"], "view --html": [tmp_path / "a.html"]}
    ended, said, error = main(*command.split(), *out.get(command, []), file)
    assert ended == 1
    if command not in ("report -o", "view --html"):
        assert "not clamped: faces meet, P6 and P7 loose" in said + error


def test_what_cannot_be_proven_is_code_4_in_every_command(monkeypatch, main):
    def unproven(*_, **__):
        raise SolverError("final state not proven")

    for module in ("assemble", "final_state"):
        monkeypatch.setattr(f"clamp3d.clamp.{module}.solve_final_state", unproven)
    for command in ("run", "check reference", "tolerance --n 1", "sweep"):
        ended, said, error = main(*command.split())
        assert ended == 4, command
        assert "not clamped" not in said + error
