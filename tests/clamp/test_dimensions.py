"""Dimensions made in Python: wrong values are the same one-line errors as from a file."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from clamp3d import InputError, load_clamp
from clamp3d.clamp.dimensions import SMALLEST, Joints, Wire
from tests.clamp.random_clamps import changed, whole_clamp


def test_wrong_values_in_python_are_one_line_too():
    with pytest.raises(InputError, match=r"^Wire: diameter: must be at least 1e-06, got -3\.0$"):
        Wire(diameter=-3.0)
    with pytest.raises(InputError, match=r"^Wire: diamter is not a known key; did you mean diameter\?$"):
        Wire(diamter=3.0)
    wide = r"^Clamp: line: the diameter must be < 274 mm, twice up_splint\.width, got 300; are both in mm\?$"
    with pytest.raises(InputError, match=wide):
        replace(load_clamp(), line=Wire(diameter=300.0))


def complaint(clamp, path, value):
    try:
        changed(clamp, {path: value})
    except InputError as error:
        return str(error)
    return ""


def _half_mouth(radius, into):
    """Half of the widest place of a groove whose centre lies ``into`` the material, by points of its circle."""
    turn = np.linspace(-math.pi, math.pi, 2_000_001)
    return radius * np.abs(np.sin(turn))[radius * np.cos(turn) <= into + 1e-9].max()


_UP, _DOWN = _half_mouth(23.8012, 27.726 - 48.7901), _half_mouth(23.8012, 3.4624 - 24.5505)
_EDGE = math.hypot(22.0, math.sqrt(49.23**2 - 22.0**2) - 1.23), math.atan2(22.0, math.sqrt(49.23**2 - 22.0**2) - 1.23)
_FLAT = 48.0 * math.cos(math.radians(40.0))


@pytest.mark.parametrize(
    ("path", "limit", "side", "message"),
    [
        ("up_splint.line_groove.offset", 68.5 - _UP, -1, "line_groove: the arc leaves the splint at its edge"),
        ("up_splint.jumper_groove.offset", 11.0 + _UP, 1, "jumper_groove: the arc meets the bolt hole"),
        ("up_splint.line_groove.centre_depth", 27.726 + 23.8012, -1, "line_groove: the arc does not reach its face"),
        ("down_splint.jumper_groove.offset", 68.5 - _half_mouth(23.8012, 4.9057 - 24.5505), -1, "the arc leaves"),
        ("down_splint.line_groove.offset", 21.0 + _DOWN, 1, "line_groove: the arc meets the bolt hole"),
        ("down_splint.line_groove.centre_depth", 24.5505 - 23.8012, 1, "line_groove: the arc does not reach its face"),
        ("down_splint.line_groove.centre_depth", _FLAT - 23.8012, -1, "line_groove: the arc cuts the underside"),
        ("down_splint.face_depth", _FLAT, -1, "face_depth must be above the flat underside"),
        ("down_splint.width", 96.0 * math.sin(math.radians(40.0)), 1, "width must be >= the round back's"),
        ("down_splint.slot_length", 20.0, 1, "down_splint.slot_length must be > bolt.diameter"),
        ("down_splint.slot_width", 20.0, 1, "down_splint.slot_width must be > bolt.diameter"),
        ("down_splint.back_half_angle_deg", math.degrees(_EDGE[1]), 1, "back_half_angle_deg must be >= 27"),
        (
            "down_splint.max_tilt_deg",
            math.degrees(math.acos(_FLAT / _EDGE[0]) - _EDGE[1]),
            -1,
            "where the saddle's edge stops the tilt",
        ),
        ("saddle.width", 2.0 * 49.23, -1, "width must be < 2 radius"),
        ("saddle.hole_diameter", 44.0, -1, "hole_diameter must be < width"),
        ("saddle.hole_diameter", 20.0, 1, "saddle.hole_diameter must be > bolt.diameter"),
        ("saddle.radius", 48.0, 1, "saddle.radius must be > down_splint.back_radius"),
        ("up_splint.hole_diameter", 20.0, 1, "up_splint.hole_diameter must be > bolt.diameter"),
        ("nut.across_flats", 20.0, 1, "nut.across_flats must be > bolt.diameter"),
        ("line.diameter", 2.0 * 137.0, -1, "line: the diameter must be < 274 mm, twice up_splint.width"),
        ("jumper.diameter", 2.0 * 137.0, -1, "jumper: the diameter must be < 274 mm, twice up_splint.width"),
    ],
)
def test_each_rule_holds_up_to_its_limit_and_no_further(path, limit, side, message):
    """Which follows from where the bodies meet; ``side``: whether the value must be above the limit or below."""
    clamp = load_clamp(line=30.0, jumper=30.0)

    wrong = complaint(clamp, path, limit * (1.0 - 1e-6 * side))
    assert message in wrong
    assert message not in complaint(clamp, path, limit * (1.0 + 1e-6 * side))
    if limit == round(limit, 2):  # it is itself too much
        assert message in complaint(clamp, path, limit)
    if "centre_depth" not in path and path != "down_splint.width":  # whose messages have other numbers
        assert f"{limit:.4g}"[:5] in wrong
    if "underside" in message and "centre_depth" in path:
        assert wrong.endswith(f"{_FLAT:.4g} mm, got {_FLAT:.4g}")


@pytest.mark.parametrize(
    ("path", "low", "high"),
    [
        ("limits.bolt_force", 0.0, 1e9),
        ("down_splint.back_half_angle_deg", 0.0, 90.0),
        ("down_splint.max_tilt_deg", 0.0, 45.0),
        ("bolt.pitch", SMALLEST * (1.0 - 1e-9), 1e5),
        ("down_splint.line_groove.centre_depth", -1e5, 1e5),
    ],
)
def test_each_value_has_a_range(path, low, high):
    wrong = rf"{path.rpartition('.')[2]}: must be (at least|greater than|less than)"
    for value in (low, high):
        assert re.search(wrong, complaint(load_clamp(), path, value))
    for value in (low + 1e-6, high * (1.0 - 1e-9)):
        assert not re.search(wrong, complaint(load_clamp(), path, value))


def test_what_a_file_leaves_out_and_what_follows_from_other_values():
    clamp = load_clamp()
    assert clamp.joints == Joints(hole=False, saddle=False, washer=False)
    pairs = (("P1", "P6"), ("P6", "P1"), ("P5", "P4"), ("P1", "P2"), ("P7", "P6"))
    assert [clamp.connection(*pair) for pair in pairs] == [3, 3, 1, 0, 0]
    lengths = [changed(clamp, {f"{splint}.length": 90.0}).wire_length for splint in ("up_splint", "down_splint")]
    assert lengths == [270.0, 270.0]


def test_a_groove_deeper_than_half_is_widest_inside_the_splint():
    """Its centre lies in the material: there its whole radius counts, not its mouth. And it must not cut the top."""
    up = load_clamp().up_splint
    wide = _half_mouth(23.8012, 60.0 - 52.274)
    assert wide == pytest.approx(23.8012, abs=1e-9)

    def made(offset, depth=52.274):
        groove = replace(up.line_groove, centre_depth=depth, offset=offset)
        replace(up, thickness=60.0, line_groove=groove, jumper_groove=groove)

    for offset, out, message in ((68.5 - wide, 1e-6, "leaves the splint"), (11.0 + wide, -1e-6, "meets the bolt hole")):
        made(offset - out)
        with pytest.raises(InputError, match=message):
            made(offset + out)
    shallow = replace(up.line_groove, centre_depth=up.line_groove.radius + 1e-6, offset=40.0)
    replace(up, line_groove=shallow)
    with pytest.raises(InputError, match="line_groove: the arc cuts the top face"):
        replace(up, line_groove=replace(shallow, centre_depth=shallow.radius))
    made(40.0, 60.0 - 23.8012 + 1e-6)
    with pytest.raises(InputError, match="does not reach its face"):
        made(40.0, 60.0 - 23.8012 - 1e-6)


@pytest.mark.parametrize("k", range(24))
def test_the_tilt_stops_where_edge_and_slot_touch_and_the_edges_lift_the_splint_no_further_than_they_must(k):
    """Points of the tilted splint, turned by hand, against the saddle's edges and the upright shank."""
    clamp = whole_clamp(np.random.default_rng([5, k]))
    down, saddle, tilts = clamp.down_splint, clamp.saddle, np.linspace(-0.5, 0.5, 9)
    below = math.sqrt(saddle.radius**2 - 0.25 * saddle.width**2) - (saddle.radius - down.back_radius)  # of the edges
    bottom = math.sqrt(max(down.back_radius**2 - 0.25 * down.slot_width**2, down.underside_depth**2))
    corners = [(0.5 * down.slot_width, side * v) for side in (-1.0, 1.0) for v in (down.face_depth, bottom)]

    def lift(t):
        return (down.underside_depth + 0.5 * saddle.width * abs(math.sin(t))) / math.cos(t) - below

    def room(t):
        return min(u * math.cos(t) + v * math.sin(t) for u, v in corners) - 0.5 * clamp.bolt.diameter

    for name, left in (("the saddle's edge", lambda t: -lift(t)), ("the slot", room)):
        stop = clamp.tilt_stops[name]
        assert left(stop) == pytest.approx(0.0, abs=1e-9)
        assert stop <= 0.0 or left(0.5 * stop) > 0.0
    assert clamp.tilt_stop == min(clamp.tilt_stops.values()) == clamp.tilt_stops[clamp.tilt_stopped_by]
    assert clamp.lifted(tilts) == pytest.approx([max(0.0, lift(t)) for t in tilts], abs=1e-9)
