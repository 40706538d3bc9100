"""The contact models against the exact groove and each other; wedges fill the outline once, and all of it."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from clamp3d import Cylinder, assemble, load_clamp
from clamp3d.baselines import METHODS, Cas, Chords, Hulls, Meshes, Wedges, contact_model
from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.wedges import part_wedges, prism
from clamp3d.bench.compare.scene import block_pair, grooved_block
from clamp3d.clamp.parts import groove_pairs, parts
from clamp3d.geometry.pose import inverse, rotation, translation
from clamp3d.geometry.profile import Arc
from clamp3d.shapes import SweptArc, mesh
from tests.refusals import refusals

GROOVE = SweptArc(12.0, math.radians(70.0), 60.0)
PAIR = block_pair(GROOVE, Cylinder(10.5, 200.0))
BLOCK = grooved_block(GROOVE, width=137.0, depth=30.0)
MESH_ERROR = 0.0457
CHORD = mesh(BLOCK, MESH_ERROR).metadata["chord_error"]


def _poses(n, tilt, seed=0):
    """Wires about the middle of the groove, some of them through its walls; the wire's axis is Y."""
    rng = np.random.default_rng(seed)
    out = np.empty((n, 4, 4))
    for T in out:
        x, y, z = rng.uniform(-1.7, 1.7, 3)
        T[:] = translation(x, y, z) @ rotation([rng.normal(), 0.0, rng.normal()], rng.uniform(0.0, tilt))
        T[:] = T @ rotation([0.0, 1.0, 0.0], rng.uniform(-3.0, 3.0))
    return out


def _check_pieces(model, poses):
    """The least of the gaps is the distance, and each keeps the contract of points and normals."""
    distances = model.distances(PAIR, poses)
    for T, d in zip(poses, distances, strict=True):
        pieces = model.pieces(PAIR, T)
        assert pieces.distance.min() == pytest.approx(d, abs=1e-6)
        assert len(pieces.distance) == len(pieces.point) == len(pieces.normal) == len(pieces.feature)
        assert np.allclose(np.linalg.norm(pieces.normal, axis=1), 1.0)


def test_wedges_of_a_fine_unit_are_the_exact_groove_at_any_tilt():
    poses = _poses(36, 0.02)
    exact = Cas().distances(PAIR, poses)
    model = Wedges({"P1": BLOCK}, math.radians(2.0))
    error = model.distances(PAIR, poses) - exact
    chord = 24.0 * math.sin(math.radians(0.5)) ** 2
    apart = exact > chord
    assert apart.sum() > 10
    assert error[apart].max() < 1e-6
    assert error[apart].min() > -chord - 1e-6
    assert (error + exact)[exact < 0.0].max() < 0.0  # no hit is missed
    _check_pieces(model, poses[:4])


def test_mesh_is_too_tight_by_its_chord_error_at_most():
    poses = _poses(120, 0.02, seed=1)
    exact = Cas().distances(PAIR, poses)
    model = Meshes({"P1": BLOCK}, MESH_ERROR)
    found = model.distances(PAIR, poses)
    apart = exact > CHORD
    error = (found - exact)[apart]
    assert apart.sum() > 20
    assert error.max() < 1e-6
    assert error.min() > -CHORD - 1e-6
    assert (found[exact < 0.0] < 0.0).all()  # no hit is missed
    assert any("no depth" in limit for limit in model.limits)
    shallow = (exact < 0.0) & (exact > -0.3)
    assert shallow.sum() > 5
    assert np.abs(found - exact)[shallow].max() < CHORD + 1e-6
    _check_pieces(model, poses[apart][:4])


def intrusion(decomposition, pair):
    """How far in mm the hulls reach into the groove: its radius less that of the thickest coaxial wire that is free.

    Exact for the hulls: the distance of the groove's axis, without end, from each hull's outline seen along it.
    """
    T = inverse(pair.T_a_groove)
    free = np.inf
    for hull in decomposition.hulls:
        seen = (hull @ T[:3, :3].T + T[:3, 3])[:, :2]
        outline = seen[ConvexHull(seen).vertices]
        along = np.roll(outline, -1, axis=0) - outline
        t = np.clip(-(outline * along).sum(1) / (along**2).sum(1), 0.0, 1.0)
        nearest = float(np.linalg.norm(outline + t[:, None] * along, axis=1).min())
        inside = bool((along[:, 0] * outline[:, 1] - along[:, 1] * outline[:, 0] <= 0.0).all())
        free = min(free, 0.0 if inside else nearest)
    return pair.groove.radius - free


def test_hulls_fill_the_groove_and_no_more_than_their_intrusion(tmp_path, monkeypatch):
    monkeypatch.setenv("CLAMP3D_CACHE", str(tmp_path))
    settings = 0.05 * 137.0 / 1.6
    model = Hulls({"P1": BLOCK}, settings, mesh_error=0.5)
    poses = _poses(100, 0.0, seed=2)
    exact = Cas().distances(PAIR, poses)
    error = (model.distances(PAIR, poses) - exact)[exact > 0.0]
    filled = intrusion(model.decompositions["P1"], PAIR)
    assert -filled - 1e-6 < error.min() < -0.1
    assert error.max() < 0.01
    _check_pieces(model, poses[:4])
    again = Hulls({"P1": BLOCK}, settings, mesh_error=0.5)
    again.polytopes("P1")
    assert again.decompositions["P1"].cached


@pytest.mark.parametrize("unit_deg", [5.0, 40.0])
@pytest.mark.parametrize("key", [("P1", "P6"), ("P1", "P7"), ("P2", "P6"), ("P2", "P7"), ("P3", "P2")])
def test_wedges_of_the_reference_clamp_are_the_chords_of_its_section(key, unit_deg):
    clamp, unit = load_clamp(), math.radians(unit_deg)
    pair = groove_pairs(clamp)[key]
    T = pair.T_a_groove @ np.linalg.inv(pair.T_b_cylinder)
    rng = np.random.default_rng(3)
    poses = np.array([translation(*rng.uniform(-1.0, 1.0, 3)) @ T for _ in range(40)])
    expected = Chords(unit).distances(pair, poses)
    shallow = expected > -0.4  # beyond, a narrow wedge may be left sideways
    wedges = Wedges(parts(clamp), unit).distances(pair, poses)
    assert np.abs(wedges - expected)[shallow].max() < 1e-6
    assert ((wedges < 0.0) == (expected < 0.0)).all()


def test_wedges_in_3d_assemble_the_clamp_to_the_published_distance():
    clamp = load_clamp()
    result = assemble(clamp, Wedges(parts(clamp), math.radians(40.0)))
    assert result.clamped
    assert result.distance == pytest.approx(32.647, abs=2e-3)  # by steps: the chords


@pytest.mark.parametrize(("unit_deg", "m"), [(180.0 / 8, 8), (5.0, 36), (1.0, 180)])
def test_a_coaxial_wire_loses_the_chord_error(unit_deg, m):
    # Chords lie inside the hollow by R (1 - cos(half / m)): known figure 6.865 for R 7, half 90 deg, 8 chords.
    pair = block_pair(SweptArc(7.0, math.pi / 2, 50.0), Cylinder(1.0, 200.0))
    free = Chords(math.radians(unit_deg)).distances(pair, np.eye(4)[None])[0] + 1.0
    assert free == pytest.approx(7.0 * math.cos(math.pi / 2 / m), abs=1e-12)
    assert m != 8 or free == pytest.approx(6.865, abs=1e-3)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_is_made_and_makes_nothing_before_it_is_asked(name):
    model = contact_model(name, {"P1": BLOCK}, progress=False)
    assert model.name == name
    assert model.meshes_built == 0
    if name != "hulls":  # CoACD takes seconds
        assert abs(model.distances(PAIR, np.eye(4)[None])[0] - 1.5) < 0.06  # 12 - 10.5 less the chord error
        assert model.meshes_built == (1 if name == "mesh" else 0)


NAN, MADE = np.full((4, 4), np.nan), (Wedges({"P1": BLOCK}, 0.2), Meshes({"P1": BLOCK}, MESH_ERROR))
test_what_does_not_go_together_is_refused = refusals(
    (lambda: contact_model("mesh", {"P1": BLOCK}, threshold=1.0), "threshold goes with method hulls, got method 'mesh"),
    (lambda: contact_model("fog", None), "unknown method 'fog'; available: cas, chords, wedges, hulls, mesh"),
    (lambda: contact_model("wedges", None), "method 'wedges' needs the parts"),
    (lambda: contact_model("mesh", [BLOCK]), "parts must be"),
    (lambda: Wedges({"P2": BLOCK}, 0.2).distances(PAIR, np.eye(4)[None]), "unknown part 'P1'; available: P2"),
    *((lambda model=model: model.pieces(PAIR, NAN), "must be finite") for model in MADE),
    *((lambda model=model: model.distances(PAIR, NAN[None]), "must be finite") for model in MADE),
    (lambda: Chords(0.1).pieces(PAIR, rotation([1.0, 0.0, 0.0], 1e-6)), "parallel axes only"),
    *((lambda angle=angle: Chords(angle), "unit angle must be between") for angle in (0.0, -1.0, 4.0, math.nan)),
)


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
