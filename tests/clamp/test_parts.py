"""Boxes of the parts as published, and their closed-form volumes against meshes whose error is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d import InputError, load_clamp
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.parts import parts
from clamp3d.geometry.meshing import volume_bounds
from clamp3d.shapes import mesh
from tests.clamp.random_clamps import changed

CLAMP = load_clamp()
REFERENCE = parts(CLAMP)


def test_bounds_are_the_published_sizes():
    corner = 30.0 / math.sqrt(3)
    expected = {
        "P1": [[0, -30, -27.7260], [137, 30, 0]],
        "P2": [[-68.5, -30, -48.0], [68.5, 30, -24.5505]],
        "P3": [[-22, -30, -61.42], [22, 30, -math.sqrt(49.23**2 - 22**2)]],
        "P4": [[-corner, -15, -172.5], [corner, 15, 0]],
        "P5": [[-corner, -15, -26.4], [corner, 15, 0]],
        "P6": [[-16.335, -90, -16.335], [16.335, 90, 16.335]],
        "P7": [[-7.125, -90, -7.125], [7.125, 90, 7.125]],
    }
    for name, box in expected.items():
        np.testing.assert_allclose(REFERENCE[name].bounds, box, atol=1e-12)


@pytest.mark.parametrize("mesh_error", [0.5, 1e-4])
@pytest.mark.parametrize("name", PARTS)
def test_mesh_is_closed_and_within_its_computed_volume_error(name, mesh_error):
    part = REFERENCE[name]
    solid = mesh(part, mesh_error)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.body_count == 1
    assert solid.euler_number == (0 if part.holes else 2)  # a through hole is one handle
    assert solid.units == "mm"
    assert solid.metadata["chord_error"] <= mesh_error == solid.metadata["mesh_error"]
    np.testing.assert_allclose(solid.bounds, part.bounds, atol=1e-12)
    low, high = volume_bounds(part, mesh_error)
    rounding = 1e-13 * part.volume
    assert low - rounding <= solid.volume <= high + rounding
    if name not in ("P2", "P3"):  # there every chord is drawn along the whole length: the bound is met
        extreme = low if part.volume - low > high - part.volume else high
        assert solid.volume == pytest.approx(extreme, rel=1e-12)


@settings(deadline=None, max_examples=15)
@given(radius=st.floats(5.0, 25.0), depth=st.floats(-0.9, 0.95), gap=st.floats(0.0, 30.0), error=st.floats(1e-3, 2.0))
def test_other_grooves_major_arcs_too_give_closed_meshes(radius, depth, gap, error):
    """Depth is the centre below the face in radii: a negative one is an arc of more than 180 degrees."""
    groove = replace(
        CLAMP.up_splint.line_groove, radius=radius, offset=12.0 + radius + gap, centre_depth=60.0 + depth * radius
    )
    up = replace(CLAMP.up_splint, width=200.0, thickness=60.0, line_groove=groove, jumper_groove=groove)
    part = parts(replace(CLAMP, up_splint=up))["P1"]
    half = math.acos(depth)
    void = radius**2 * (half - math.sin(half) * math.cos(half))
    assert part.volume == pytest.approx(60.0 * (200.0 * 60.0 - 2 * void) - math.pi * 121 * 60.0, rel=1e-12)
    solid = mesh(part, error)
    low, high = volume_bounds(part, error)
    assert solid.is_watertight
    assert low - 1e-7 <= solid.volume <= high + 1e-7


FLAT = {
    "face_depth": 0.5,
    "back_half_angle_deg": 89.0,
    **{f"{g}_groove.centre_depth": -23.2 for g in ("line", "jumper")},
}
WIDE = {"hole_diameter": 97.9, "width": 98.0, "length": 100.0}


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("P2", {"down_splint.slot_width": 66.0}),  # which comes out of the flat underside beside the round back
        ("P3", {f"down_splint.{key}": FLAT[key] for key in FLAT} | {f"saddle.{key}": WIDE[key] for key in WIDE}),
    ],
)
def test_wide_holes_have_the_volume_of_their_mesh(name, values):
    part = parts(changed(CLAMP, values | {"down_splint.max_tilt_deg": None}))[name]
    low, high = volume_bounds(part, 1e-4)
    assert low < mesh(part, 1e-4).volume < high


def test_bad_values_say_what_is_wrong():
    for bad in (0.0, -1.0, math.nan, math.inf, 1e-7):
        with pytest.raises(InputError, match="mesh_error must be a finite length >= 1e-06 mm"):
            mesh(REFERENCE["P5"], bad)
    for part, hole in (("up_splint", "hole_diameter"), ("down_splint", "slot_length"), ("saddle", "hole_diameter")):
        size = getattr(getattr(CLAMP, part), hole)
        parts(changed(CLAMP, {f"{part}.length": size + 1e-6}))
        with pytest.raises(
            InputError, match=rf"{part}\.{hole} must be < the part's length = {size:g} mm, got {size:g}"
        ):
            parts(changed(CLAMP, {f"{part}.length": size}))
