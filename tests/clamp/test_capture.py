"""Where a clamp catches a wire, against a motion of the same law by springs and points on outlines."""

import json
import math
import os
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from clamp3d import load_clamp, placement
from clamp3d.baselines import Cas
from clamp3d.clamp.closing import open_start
from clamp3d.clamp.parts import parts
from clamp3d.clamp.placement import CaptureMap, Outcome, close_from, close_on
from clamp3d.clamp.section import WIRES, Section
from clamp3d.errors import NotClampedError, SolverError
from clamp3d.kernel import rotation
from clamp3d.output.placement_report import capture_figure
from tests.clamp.orders import manifold
from tests.clamp.outlines import outline
from tests.refusals import refusals_of

COUNT = int(os.environ.get("CLAMP3D_RANDOM_STARTS", "16"))
STIFF = 4.0
"""Springs of so many bolt forces a mm hold contacts: parts sink in by a few tenths of a mm."""
STEP = 0.2 / STIFF
ROUND, REST = 200, 0.01
"""What moves by less than so many mm in a round of so many steps is at rest: normals of points tremble a little."""
POINTS = 0.2
"""Spacing (mm) of an outline's points: the nearest is 1e-4 mm farther than the arc, and springs give way by 0.1 mm."""


class Springs:
    """Closings side by side: columns x6, y6, x7, y7, distance, scaled tilt, height over the saddle's arc.

    Each coordinate is dragged alike, the bolt pulls the distance with force 1, and what overlaps is pushed apart.
    """

    def __init__(self, clamp):
        self.clamp, self.middle, self.lever = clamp, clamp.up_splint.width / 2, clamp.down_splint.width / 2
        self.rows = [[cKDTree(outline(clamp, part, side, POINTS)) for side in (-1.0, 1.0)] for part in ("P1", "P2")]
        self.radii = clamp.line.radius, clamp.jumper.radius
        saddle = clamp.saddle
        self.edge_below = saddle.radius * math.cos(saddle.half_angle) - (saddle.radius - clamp.down_splint.back_radius)

    def close(self, q):
        q, moving = q.copy(), np.arange(len(q))
        for _ in range(150):
            state = q[moving]
            for _ in range(ROUND):
                state += STEP * self.force(state)
            moved = np.abs(state - q[moving]).max(axis=1)
            q[moving] = state
            moving = moving[moved > REST]
            if not len(moving):
                return q
        raise AssertionError(f"{len(moving)} closings did not come to rest")

    def seen(self, q, x, y):
        """Points (x, y) in the down splint's axes."""
        c, s = np.cos(q[:, 5] / self.lever), np.sin(q[:, 5] / self.lever)
        dx, dy = x - self.middle, y - (q[:, 4] - q[:, 6])
        return np.column_stack([dx * c - dy * s, dx * s + dy * c])

    def push(self, q, force, gap, gradient):
        """Add what a gap's spring does where it is closed; ``gradient`` by column."""
        size = STIFF * np.maximum(0.0, -gap)
        for column, slope in gradient.items():
            force[:, column] += size * slope

    def force(self, q):
        clamp, down = self.clamp, self.clamp.down_splint
        force = np.zeros_like(q)
        force[:, 4] = -1.0
        tilt = q[:, 5] / self.lever
        c, s = np.cos(tilt), np.sin(tilt)
        for i, r in enumerate(self.radii):
            side, xy = 2.0 * i - 1.0, q[:, 2 * i : 2 * i + 2]
            away, k = self.rows[0][i].query(xy)
            n = (xy - self.rows[0][i].data[k]) / away[:, None]
            self.push(q, force, away - r, {2 * i: n[:, 0], 2 * i + 1: n[:, 1]})
            local = self.seen(q, *xy.T)
            away, k = self.rows[1][i].query(local)
            u, v = (local - self.rows[1][i].data[k]).T / away
            # A turn of the splint moves the wire's centre the other way about its origin.
            turn = (u * -local[:, 1] + v * local[:, 0]) / self.lever
            nx, ny = u * c + v * s, v * c - u * s
            self.push(q, force, away - r, {2 * i: nx, 2 * i + 1: ny, 4: -ny, 6: ny, 5: turn})
            self.push(q, force, side * (xy[:, 0] - self.middle) - 0.5 * clamp.bolt.diameter - r, {2 * i: side})
            # Faces: the down splint's corner over the up splint's, of the same width or narrower.
            corner = q[:, 4] - q[:, 6] + down.face_depth * c - side * self.lever * s
            slope = -(down.face_depth * s + side * self.lever * c) / self.lever
            self.push(q, force, corner - clamp.up_splint.thickness, {4: 1.0, 6: -1.0, 5: slope})
            wall = side * (side * 0.5 * down.slot_width * c + down.slot_bottom * s) - 0.5 * clamp.bolt.diameter
            slope = side * (down.slot_bottom * c - side * 0.5 * down.slot_width * s) / self.lever
            self.push(q, force, wall, {5: slope})
            ex, ey = side * 0.5 * clamp.saddle.width, q[:, 6] + self.edge_below
            slope = (ex * c - ey * s) / self.lever
            self.push(q, force, ex * s + ey * c - down.underside_depth, {6: c, 5: slope})
        self.push(q, force, q[:, 6], {6: 1.0})
        return force

    def seats(self, q, i):
        """Gaps of wire ``i`` to the arcs of the up and the down splint, by angle within the arc; inf beside it."""
        gaps = []
        for own, xy, into in (
            (self.clamp.up_splint, q[:, 2 * i : 2 * i + 2], -1.0),
            (self.clamp.down_splint, self.seen(q, *q[:, 2 * i : 2 * i + 2].T), 1.0),
        ):
            groove, side = (own.line_groove, own.jumper_groove)[i], 2.0 * i - 1.0
            middle = self.middle if into < 0.0 else 0.0
            dx, dy = xy[:, 0] - middle - side * groove.offset, into * (xy[:, 1] - groove.centre_depth)
            face = own.thickness if into < 0.0 else own.face_depth
            half = math.acos(-into * (groove.centre_depth - face) / groove.radius)
            gap = groove.radius - np.hypot(dx, dy) - self.radii[i]
            gaps.append(np.where(np.abs(np.arctan2(dx, dy)) <= half, gap, np.inf))
        return np.array(gaps)


def brute_force(clamp, starts):
    """Which closings from states (n, 10) end with both wires on the arcs of both splints."""
    springs = Springs(clamp)
    q = springs.close(np.delete(starts, [6, 7, 8], axis=1))
    return np.all([(np.abs(springs.seats(q, i)) < 1.0 / STIFF).all(axis=0) for i in (0, 1)], axis=0)


def random_starts(section, count, rng):
    """States (count, 10) of the open clamp with one wire somewhere between the splints."""
    seat, starts = open_start(section), []
    while len(starts) < count:
        start, i = seat.copy(), int(rng.integers(2))
        start[2 * i] = rng.uniform(*section.reach(WIRES[i]))
        start[2 * i + 1] = rng.uniform(20.0, 90.0)
        if section.gaps(start).value.min() >= 0.0:
            starts.append(start)
    return np.array(starts)


def test_random_starts_end_as_with_springs():
    clamp = load_clamp()
    section = Section(clamp, Cas())
    starts = random_starts(section, COUNT, np.random.default_rng(11))
    outcome = np.array([close_from(section, start) for start in starts])
    seated = brute_force(clamp, starts)
    assert 0.3 * COUNT < seated.sum() < 0.7 * COUNT
    np.testing.assert_array_equal(outcome == Outcome.SEATED, seated)


def test_what_a_closing_ends_in(monkeypatch):
    section, thick = Section(load_clamp(), Cas()), Section(load_clamp(line=48, jumper=47.8), Cas())
    assert close_from(thick, open_start(thick)) == Outcome.ON_A_LIP
    for overlap, outcome in ((8e-7, Outcome.SEATED), (1.2e-6, Outcome.NO_ROOM)):
        start = open_start(section)
        start[1] -= overlap
        assert close_from(section, start) == outcome

    def unproven(*_):
        raise SolverError

    monkeypatch.setattr("clamp3d.clamp.placement.solve_final_state", unproven)
    assert close_from(section, open_start(section)) == Outcome.NOT_PROVEN


@pytest.fixture(scope="module")
def closings():
    """Each state from which `placed` closes the clamp, and what that ends in."""
    return []


@pytest.fixture(scope="module")
def placed(closings):
    told = []

    def noted(section, start):
        closings.append((start.copy(), close_from(section, start)))
        return closings[-1][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("clamp3d.clamp.placement.close_from", noted)
        found = placement(wire="P7", columns=8, progress=lambda *at: told.append(at))
    assert told == [(k, 16) for k in range(16)]
    return found


def test_the_map_is_of_closings_from_its_places(placed, closings):
    found = placed.capture
    assert found.outcome.shape == (len(found.height), len(found.sideways)) == (2, 8)
    section = Section(load_clamp(), Cas())
    for ((i, j), code), (begun, ended) in zip(np.ndenumerate(found.outcome), closings, strict=True):
        start = open_start(section)
        start[2:4] += found.sideways[j], -found.height[i]
        assert begun == pytest.approx(start, abs=1e-12)
        assert ended == code
    seat, (low, high) = open_start(section), section.reach("P7")
    assert found.sideways + seat[2] == pytest.approx(np.linspace(low, high, 8))
    seat[3] -= 3.0 * found.height[0]  # the heights are a third and two thirds of the way to the down splint
    assert 2.0 * found.height[0] == pytest.approx(found.height[1])
    assert section.gaps(seat).value.min() == pytest.approx(0.0, abs=1e-4)
    low, high = found.captured
    assert low < 0.0 < high
    inside = (found.sideways >= low) & (found.sideways <= high)
    assert (found.outcome[:, inside] == Outcome.SEATED).all()
    assert sum(found.count(outcome) for outcome in Outcome) == found.outcome.size


def test_a_range_is_caught_only_where_every_place_with_room_is():
    s, o, none = Outcome.SEATED, Outcome.NOT_CLAMPED, Outcome.NO_ROOM
    rows = np.array([[s, none, s, s, s, o], [s, s, o, s, none, none]], dtype=np.int8)
    assert CaptureMap(np.arange(6.0), np.zeros(2), rows).captured == (0.0, 1.0)
    rows[0, :2] = o
    assert CaptureMap(np.arange(6.0), np.zeros(2), rows).captured == (3.0, 4.0)
    assert CaptureMap(np.arange(6.0), np.zeros(2), np.full((2, 6), o, dtype=np.int8)).captured is None


def test_a_pitched_wire_opens_by_its_lift_at_the_ends(run):
    """A wire pitched by a lifts either splint of half length 30 by 30 tan a, less what its own leaning takes back."""
    for a in (0.002, 0.008, 0.02):
        opening, _ = close_on(run, "P6", np.array([[0.0, a]]))
        assert opening[0] == pytest.approx(2 * 30.0 * math.tan(a), rel=0.06)


def test_the_opening_of_a_yawed_wire_is_that_of_meshes(run):
    """Each splint moved out by its share just parts from the wire, by manifold3d's volumes."""
    yaw = 0.05
    opening, _ = close_on(run, "P6", np.array([[yaw, 0.0]]))
    solids = parts(run.clamp)
    wire = manifold(solids["P6"], run.T_world("P6") @ rotation((0.0, 0.0, 1.0), yaw), 1e-3)
    needed = 0.0
    for name, up in (("P1", 1.0), ("P2", -1.0)):
        still = manifold(solids[name], run.T_world(name), 1e-3)
        low, high = -1.0, 5.0
        while high - low > 1e-3:
            middle = 0.5 * (low + high)
            shared = (still.translate((0.0, 0.0, up * middle)) ^ wire).volume() > 1e-3
            low, high = (middle, high) if shared else (low, middle)
        needed += low
    assert opening[0] == pytest.approx(needed, abs=0.02)


def test_limits_are_where_it_no_longer_closes(run, monkeypatch):
    monkeypatch.setattr("clamp3d.clamp.placement.capture_map", lambda *_: None)  # takes long, and is not looked at
    found = placement(columns=4)
    for k, limit in enumerate(found.limits):
        turns = np.zeros((4, 2))
        turns[:, k] = [end * share for share in (1.0 - 1e-6, 1.0 + 1e-6) for end in (limit.low, limit.high)]
        opening, in_grooves = close_on(run, "P6", turns)
        assert (in_grooves & (opening <= found.seat_tolerance)).tolist() == [True, True, False, False]
    assert [limit.reach for limit in found.limits] == [0.1, 0.05]
    narrow = placement(columns=4, yaw=0.01, pitch=0.001).limits
    assert [(limit.low, limit.high) for limit in narrow] == [(-0.01, 0.01), (-0.001, 0.001)]


test_bad_input = refusals_of(
    lambda settings: placement(**settings),
    ({"wire": "P1"}, "wire must be one of P6, P7, got 'P1'"),
    ({"seat_tolerance": -1.0}, "seat tolerance must be a finite length > 0 mm"),
    ({"columns": 3}, "columns must be a whole number from 4 to 1000, got 3"),
    ({"yaw": 0.0}, "yaw must be > 0 and < 90 deg, got 0 deg"),
    ({"pitch": math.pi / 2}, "pitch must be > 0 and < 90 deg, got 90 deg"),
)


def test_a_clamp_that_does_not_close_catches_nothing():
    clamp = load_clamp()
    with pytest.raises(NotClampedError, match="not clamped"):
        placement(replace(clamp, line=replace(clamp.line, conductor=None, diameter=3.0)))


def test_figure_shows_the_counts(placed):
    (legend,) = capture_figure(placed).legends
    shown = [text.get_text() for text in legend.get_texts()]
    assert f"seated ({placed.capture.count(Outcome.SEATED)})" in shown


def test_sweep_writes_map_and_points(placed, tmp_path, monkeypatch, main):
    def known(clamp, *, wire, columns, **_):
        assert (wire, columns) == ("P7", 8)
        return placed

    monkeypatch.setattr("clamp3d.cli.sweep.placement", known)
    picture, data = tmp_path / "map.png", tmp_path / "map.json"
    code, out, err = main("sweep", "--wire", "P7", "--steps", "8", "--map", picture, "--json", data)
    assert code == 0, err
    assert "  yaw    -5.402 to +5.402 deg\n" in out
    written = json.loads(data.read_text())
    assert (len(written["height_mm"]), len(written["sideways_mm"])) == (2, 8)
    assert {name for row in written["outcome"] for name in row} == {"seated", "not clamped"}
    assert sum(written["counts"].values()) == 16
    low, high = written["captured_mm"]
    assert f"sideways {low:+.1f} to {high:+.1f} mm" in out
    assert picture.read_bytes().startswith(b"\x89PNG")
