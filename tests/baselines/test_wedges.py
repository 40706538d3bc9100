"""Wedges fill the outline with chords for arcs: once, and all of it."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d import load_clamp
from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.wedges import part_wedges, prism
from clamp3d.bench.compare.scene import grooved_block
from clamp3d.clamp.parts import parts
from clamp3d.geometry.profile import Arc
from clamp3d.shapes import SweptArc
from tests.refusals import refusals


def assert_filled_once(wedges, outline):
    """The pieces are convex, do not overlap, and together are the outline."""
    polygons = [shapely.Polygon(wedge.polygon) for wedge in wedges]
    assert all(p.convex_hull.area == pytest.approx(p.area, rel=1e-9) for p in polygons)
    assert sum(p.area for p in polygons) == pytest.approx(outline.area, rel=1e-12, abs=1e-5)
    # On a grid: without one a union loses a polygon where corners differ by rounding.
    assert shapely.union_all(polygons, grid_size=1e-9).symmetric_difference(outline).area < 1e-5


@settings(max_examples=25, deadline=None)
@given(
    radius=st.floats(1.0, 60.0), half_deg=st.floats(2.0, 150.0), unit_deg=st.floats(1.0, 170.0),
    spare=st.floats(0.1, 50.0),
)  # fmt: skip
def test_block_is_filled_once(radius, half_deg, unit_deg, spare):
    half, unit = math.radians(half_deg), math.radians(unit_deg)
    face = radius * math.cos(half)
    width = 2.0 * (radius * math.sin(min(half, math.pi / 2)) + spare)
    depth = radius - face + spare
    wedges = part_wedges(grooved_block(SweptArc(radius, half, 10.0), width=width, depth=depth), unit)
    m = math.ceil(2.0 * half / unit - 1e-9)
    assert len(wedges) == m + (2 if half < math.pi / 2 else 0)
    angles = np.linspace(-half, half, m + 1)
    hollow = shapely.Polygon(radius * np.column_stack([np.sin(angles), np.cos(angles)])) if m > 1 else shapely.Polygon()
    block = shapely.box(-width / 2, face, width / 2, face + depth)
    assert_filled_once(wedges, block.difference(hollow))


@pytest.mark.parametrize("name", ["P1", "P2", "P3"])
@pytest.mark.parametrize("unit_deg", [1.0, 40.0])
def test_clamp_parts_are_filled_once(name, unit_deg):
    part = parts(load_clamp())[name]
    unit, corners = math.radians(unit_deg), []
    for edge in part.bodies[0].profile.edges:
        corners.append(edge.start)
        if isinstance(edge, Arc):
            n = edge.chord_count(0.01) if edge.sweep > 0.0 else max(1, math.ceil(-edge.sweep / unit - 1e-9))
            turns = edge.start_angle + edge.sweep * np.arange(1, n) / n
            corners += [*(edge.centre + edge.radius * np.column_stack([np.cos(turns), np.sin(turns)]))]
    wedges = part_wedges(part, unit)
    assert_filled_once(wedges, shapely.Polygon(corners))
    for wedge in wedges:
        assert len(convex(prism(wedge.polygon, -30.0, 30.0)).solid.vertices) == 2 * len(wedge.polygon)


test_parts_without_wedges_are_refused = refusals(
    (lambda: part_wedges(parts(load_clamp())["P6"], 0.1), "part P6 must have a groove"),
    (lambda: part_wedges(parts(load_clamp())["P4"], 0.1), "part P4 must be one body"),
)
