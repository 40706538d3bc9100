"""Closed-form volumes and boxes of the parts against quadrature of their heights, and their meshes against both."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad, quad

from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.errors import InputError
from clamp3d.geometry.meshing import mesh, volume_bounds
from clamp3d.geometry.profile import Arc, Profile

CLAMP = load_clamp()
REFERENCE = parts(CLAMP)


def _thickness_up(x: float) -> float:
    """Height of P1's material at x from its left edge, written from the published dimensions alone."""
    groove = next((c for c in (68.5 - 46.0349, 68.5 + 49.8315) if abs(x - c) < 23.8012), None)
    if groove is None:
        return 27.7260
    return min(27.7260, 48.7901 - math.sqrt(23.8012**2 - (x - groove) ** 2))


def _height_down(x: float) -> float:
    """Height of P2's material at x right of the bolt axis."""
    back = 48.0 * math.sin(math.radians(40.0))
    bottom = math.sqrt(48.0**2 - x * x) if abs(x) < back else 48.0 * math.cos(math.radians(40.0))
    top = 24.5505
    for centre, depth in ((-46.0349, 3.4624), (49.8315, 4.9057)):
        if abs(x - centre) < 23.8012:
            top = max(top, depth + math.sqrt(23.8012**2 - (x - centre) ** 2))
    return bottom - top


def _integral(f: Callable[[float], float], low: float, high: float, breaks: list[float]) -> float:
    edges = [low, *sorted(breaks), high]
    return sum(quad(f, a, b, epsabs=1e-10, epsrel=1e-13)[0] for a, b in itertools.pairwise(edges))


def test_up_splint_volume_is_its_height_integrated() -> None:
    mouth = math.sqrt(23.8012**2 - (48.7901 - 27.7260) ** 2)
    breaks = [c + s * mouth for c in (68.5 - 46.0349, 68.5 + 49.8315) for s in (-1, 1)]
    expected = 60.0 * _integral(_thickness_up, 0.0, 137.0, breaks) - math.pi * 11.0**2 * 27.7260
    assert REFERENCE["P1"].volume == pytest.approx(expected, rel=1e-11)


def test_down_splint_volume_is_its_height_integrated() -> None:
    back = 48.0 * math.sin(math.radians(40.0))
    breaks = [-back, back]
    for centre, depth in ((-46.0349, 3.4624), (49.8315, 4.9057)):
        mouth = math.sqrt(23.8012**2 - (24.5505 - depth) ** 2)
        breaks += [centre - mouth, centre + mouth]
    expected = 60.0 * _integral(_height_down, -68.5, 68.5, breaks)
    expected -= 22.0 * _integral(_height_down, -21.0, 21.0, [])
    assert REFERENCE["P2"].volume == pytest.approx(expected, rel=1e-11)


def test_saddle_volume_is_its_height_integrated_outside_the_hole() -> None:
    bottom = 49.230 + 12.19

    def height(_: float, x: float) -> float:
        return bottom - math.sqrt(49.230**2 - x * x)

    def rim(x: float) -> float:
        return math.sqrt(121 - x * x)

    drilled, _ = dblquad(height, -11, 11, lambda x: -rim(x), rim, epsabs=1e-9, epsrel=1e-12)
    whole = 60.0 * quad(lambda x: height(0.0, x), -22, 22, epsabs=1e-10)[0]
    assert REFERENCE["P3"].volume == pytest.approx(whole - drilled, rel=1e-11)


def test_bolt_nut_and_wires_are_textbook_solids() -> None:
    hexagon = math.sqrt(3) / 2 * 30.0**2
    assert REFERENCE["P4"].volume == pytest.approx(math.pi * 100 * 160 + hexagon * 12.5, rel=1e-14)
    assert REFERENCE["P5"].volume == pytest.approx((hexagon - math.pi * 100) * 26.4, rel=1e-14)
    assert REFERENCE["P6"].volume == pytest.approx(math.pi * (32.67 / 2) ** 2 * 180, rel=1e-14)
    assert REFERENCE["P7"].volume == pytest.approx(math.pi * (14.25 / 2) ** 2 * 180, rel=1e-14)


def test_bounds_are_the_published_sizes() -> None:
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


@pytest.mark.parametrize("mesh_error", [5.0, 0.5, 0.01, 1e-4])
@pytest.mark.parametrize("name", PARTS)
def test_mesh_is_closed_and_within_its_computed_volume_error(name: str, mesh_error: float) -> None:
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


@settings(deadline=None, max_examples=40)
@given(radius=st.floats(5.0, 25.0), depth=st.floats(-0.9, 0.95), gap=st.floats(0.0, 30.0), error=st.floats(1e-3, 2.0))
def test_other_grooves_major_arcs_too_give_closed_meshes(radius: float, depth: float, gap: float, error: float) -> None:
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


def test_bad_values_say_what_is_wrong() -> None:
    for bad in (0.0, -1.0, math.nan, math.inf, 1e-7):
        with pytest.raises(InputError, match="mesh_error must be a finite length >= 1e-06 mm"):
            mesh(REFERENCE["P5"], bad)
    short = replace(CLAMP, up_splint=replace(CLAMP.up_splint, length=20.0))
    with pytest.raises(InputError, match=r"up_splint.hole_diameter must be < the part's length = 20 mm, got 22"):
        parts(short)
    with pytest.raises(InputError, match="outline must be closed"):
        Profile((Arc((0, 0), 1, 0, math.pi),))
    with pytest.raises(InputError, match="counter-clockwise"):
        Profile.of((0.0, 0.0), (0.0, 1.0), (1.0, 0.0))
