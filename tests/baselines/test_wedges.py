"""Wedges fill the outline with chords for arcs: area by the closed form, every point in exactly one piece."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.wedges import Wedge, Wedges, part_wedges, prism
from clamp3d.bench.compare.scene import grooved_block
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.core.primitives import SweptArc
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError


def _inside(wedge: Wedge, points: np.ndarray, margin: float) -> np.ndarray:
    """Whether points lie in a convex polygon by more than ``margin`` (less, if it is negative)."""
    along = np.roll(wedge.polygon, -1, axis=0) - wedge.polygon
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return ((points[:, None] - wedge.polygon) * normal).sum(2).min(axis=1) > margin


def _chord_hollow(x: np.ndarray, y: np.ndarray, R: float, half: float, m: int) -> np.ndarray:
    """Whether points lie between the mouth and m chords of an arc about the origin, written in polar coordinates.

    y is counted from the centre towards the deepest line. Beside the arc's rays lies the part, or, where the arc is
    more than a half circle, the mouth.
    """
    step = 2.0 * half / m
    angle = np.arctan2(x, y)
    from_middle = (angle + half) % step - step / 2
    chord = R * math.cos(step / 2) / np.cos(from_middle)
    return np.where(np.abs(angle) < half, np.hypot(x, y) < chord, half > math.pi / 2)


@settings(max_examples=60, deadline=None)
@given(
    radius=st.floats(1.0, 60.0),
    half_deg=st.floats(2.0, 150.0),
    unit_deg=st.floats(1.0, 170.0),
    spare=st.floats(0.1, 50.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_block_is_filled_once(radius: float, half_deg: float, unit_deg: float, spare: float, seed: int) -> None:
    half, unit = math.radians(half_deg), math.radians(unit_deg)
    face = radius * math.cos(half)
    width = 2.0 * (radius * math.sin(min(half, math.pi / 2)) + spare)
    depth = radius - face + spare
    block = grooved_block(SweptArc(radius, half, 10.0), width=width, depth=depth)
    wedges = part_wedges(block, unit)
    m = math.ceil(2.0 * half / unit - 1e-9)
    # Rectangle less the polygon of m chords and the mouth.
    hollow = 0.5 * radius**2 * (m * math.sin(2.0 * half / m) - math.sin(2.0 * half))
    assert sum(w.area for w in wedges) == pytest.approx(width * depth - hollow, abs=1e-5, rel=1e-12)
    assert len(wedges) == m + (2 if half < math.pi / 2 else 0)

    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-width / 2, width / 2, 400), rng.uniform(face, face + depth, 400)])
    least = sum(_inside(w, points, 1e-6).astype(int) for w in wedges)
    most = sum(_inside(w, points, -1e-6).astype(int) for w in wedges)
    assert (least <= 1).all()  # no overlap
    material = ~_chord_hollow(points[:, 0], points[:, 1], radius, half, m)
    assert (most[material] >= 1).all()  # no gap
    assert (least[~material] == 0).all()  # nothing in the groove


@pytest.mark.parametrize("name", ["P1", "P2", "P3"])
@pytest.mark.parametrize("unit_deg", [1.0, 10.0, 40.0])
def test_clamp_parts_are_filled_once(name: str, unit_deg: float) -> None:
    part: Solid = parts(load_clamp())[name]  # type: ignore[index]
    unit = math.radians(unit_deg)
    wedges = part_wedges(part, unit)
    profile = part.bodies[0].profile
    expected = profile.area
    for arc in profile.arcs:
        if arc.sweep < 0.0:
            expected += arc.chord_area(max(1, math.ceil(-arc.sweep / unit - 1e-9)))
        else:
            expected -= arc.chord_area(arc.chord_count(0.01))
    assert sum(w.area for w in wedges) == pytest.approx(expected, rel=1e-12)
    low, high = profile.bounds
    points = np.random.default_rng(0).uniform(low, high, (4000, 2))
    assert (sum(_inside(w, points, 1e-6).astype(int) for w in wedges) <= 1).all()
    for wedge in wedges:
        vertices, faces = prism(wedge.polygon, -30.0, 30.0)
        shape = convex(vertices, faces)  # closed, outward, convex, or InputError
        corners = shape.solid.vertices[shape.solid.faces]
        volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
        assert volume == pytest.approx(60.0 * wedge.area, rel=1e-9)


def test_unit_angle_and_part_are_checked() -> None:
    clamp = parts(load_clamp())
    for bad in (0.0, -1.0, math.pi, math.nan):
        with pytest.raises(InputError, match=r"unit angle must be (between 0 and 180 deg|a finite number)"):
            Wedges(clamp, bad)
    with pytest.raises(InputError, match="part P6 must have a groove"):
        part_wedges(clamp["P6"], 0.1)
    with pytest.raises(InputError, match="part P4 must be one body"):
        part_wedges(clamp["P4"], 0.1)
