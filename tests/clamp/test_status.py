"""One status in every command, and the seat of each wire as outlines measured by shapely say."""

import contextlib
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
import shapely

from clamp3d import assemble, monte_carlo, placement, sensitivity
from clamp3d.clamp.parts import parts
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
    assert [f.severity for f in run.findings].count("warning") >= 4


@pytest.mark.parametrize(
    ("command", "wire", "code"),
    [*((name, "LJ-16", 1) for name in COMMANDS), *((name, None, 0) for name in COMMANDS[:4])],
)
def test_every_command_ends_with_the_same_exit_code(command, wire, code, tmp_path, monkeypatch, main):
    monkeypatch.setattr("clamp3d.output.report_page._pictures", lambda *_: {"overview": [], "steps": [], "pairs": []})
    text = (Path(__file__).parents[2] / "clamp3d/clamp/data/reference.toml").read_text()
    if wire is not None:
        text = text.replace('"LJ-630"', f'"{wire}"').replace('"LJ-120"', f'"{wire}"')
    file = tmp_path / "clamp.toml"
    file.write_text(text)
    out = {"report -o": [tmp_path / "report"], "export -o": [tmp_path / "a.stl"], "view --html": [tmp_path / "a.html"]}
    ended, said, error = main(*command.split(), *out.get(command, []), file)
    assert ended == code
    if code and command not in ("report -o", "view --html"):
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
