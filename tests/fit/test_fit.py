"""Whole meshes: exact, coarse, rotated, mirrored, scattered, broken, and without any groove."""

import numpy as np
import pytest
import trimesh

from clamp3d import fit_mesh, load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.geometry import meshing
from clamp3d.shapes import make_mesh
from tests.fit.fit_shapes import CENTRE_HEIGHT, CENTRES, HALF, LENGTH, RADIUS, off_groove, prism, scan, splint


def fitted(mesh, sigma=0.0):
    """The fit of a mesh whose corners are scattered by ``sigma`` mm, in single precision."""
    V = mesh.vertices + np.random.default_rng(0).normal(0.0, sigma, mesh.vertices.shape)
    return fit_mesh(make_mesh(V.astype(np.float32).astype(np.float64), mesh.faces, float32=True), progress=followed)


def followed(stage, share):
    assert stage in ("strips", "patches")
    assert 0.0 <= share <= 1.0


def check_grooves(result, T=None):
    """Both grooves are there, and the fitted surface lies within its own error of the true one."""
    T = np.eye(4) if T is None else T
    assert len(result.grooves) == 2
    seen = set()
    for g in result.grooves:
        R = g.T_part_feature[:3, :3]
        assert np.allclose(np.cross(R[:, 0], R[:, 1]), R[:, 2], atol=1e-12)
        assert np.allclose(R.T @ R, np.eye(3), atol=1e-12)
        own = np.linalg.inv(T) @ np.append(g.T_part_feature[:3, 3], 1.0)
        k = int(np.argmin([abs(own[0] - x) for x in CENTRES]))
        seen.add(k)
        assert off_groove(g, CENTRES[k], T) <= g.fit_error
        mouth = T[:3, :3] @ np.array([0.0, -1.0, 0.0])
        assert R[:, 1] @ mouth > np.cos(0.05)
        assert abs(g.half_angle - HALF) <= g.arc_error + 3e-6
        assert abs(g.length - LENGTH) <= 2 * g.length_error + 1e-4
    assert seen == {0, 1}


@pytest.mark.parametrize("chord_error", [0.3, 0.05, 0.005])
def test_exact_tessellation_has_no_facet_bias(chord_error):
    result = fitted(splint(chord_error, hole=11.0))
    check_grooves(result)
    for g in result.grooves:
        # Single precision at 68 mm is 4e-6 mm; a shallow arc magnifies it. An inscribed-facet bias would be 0.7 of
        # the chord error.
        assert abs(g.radius - RADIUS) < 2e-4
        assert 0.4 * chord_error < g.chord_error <= chord_error
        assert g.error_bound <= g.chord_error + 2e-4
    (hole,) = result.holes
    assert hole.through
    assert abs(hole.radius - 11.0) < 1e-5
    assert not result.cylinders
    assert result.notes == ()


def test_every_round_surface_of_the_reference_clamp_is_found_and_no_other():
    fits = [fitted(meshing.mesh(part, 0.05)) for part in parts(load_clamp()).values()]
    counts = [(len(f.grooves), len(f.cylinders), len(f.holes)) for f in fits]
    assert counts == [(2, 0, 1), (2, 1, 0), (1, 0, 1), (0, 1, 0), (0, 0, 1), (0, 1, 0), (0, 1, 0)]  # P1 to P7


def test_mirrored_part_keeps_its_grooves():
    mesh = splint(hole=11.0)
    flip = np.diag([1.0, 1.0, -1.0, 1.0])
    mirrored = trimesh.Trimesh(mesh.vertices @ flip[:3, :3], mesh.faces, process=False)  # winding now inside out
    result = fitted(mirrored)
    check_grooves(result, flip)
    assert not result.cylinders
    assert any("inside out" in note for note in result.notes)


def test_scan_within_three_standard_errors():
    sigma = 0.05
    result = fit_mesh(make_mesh(*scan(1.5, sigma, 0)), progress=followed)
    (g,) = result.features
    assert g.name == "G1"
    R, middle = g.T_part_feature[:3, :3], g.T_part_feature[:3, 3]
    at = R.T @ ((0.0, CENTRE_HEIGHT, middle[2]) - middle)
    tilt = R.T @ (0.0, 0.0, np.sign(R[2, 2]))
    error = np.array([RADIUS - g.radius, at[0], at[1], tilt[0], tilt[1]])
    assert np.all(np.abs(error) <= 3.0 * np.sqrt(np.diag(g.covariance)))
    assert off_groove(g, 0.0) <= g.error_bound
    assert abs(g.residual_rms / sigma - 1.0) < 0.15
    assert abs(g.half_angle - HALF) <= g.arc_error
    assert any("not closed" in note for note in result.notes)


def test_split_strips_and_cracks():
    """Triangles cut in four put vertices on chords; a torn mesh parts the groove; neither moves the surface."""
    whole = splint()
    check_grooves(fitted(whole.subdivide()))
    centre = whole.triangles_center
    torn = trimesh.Trimesh(whole.vertices, whole.faces[~((centre[:, 0] > 55) & (centre[:, 0] < 57))], process=False)
    soup = trimesh.Trimesh(**trimesh.triangles.to_kwargs(torn.triangles), process=False)
    turned = soup.faces.copy()
    turned[::7] = turned[::7, ::-1]
    soup.faces = turned
    result = fitted(soup)
    assert len(result.grooves) == 2
    for g in result.grooves:
        assert off_groove(g, min(CENTRES, key=lambda x, g=g: abs(g.T_part_feature[0, 3] - x))) <= g.fit_error
    assert any("turned" in note for note in result.notes)


def test_cylinder_wire_and_blind_hole():
    wire = trimesh.creation.cylinder(7.125, 180.0, sections=48)
    (c,) = fitted(wire).features
    assert (c.name, c.full) == ("C1", True)
    assert abs(c.radius - 7.125) < 1e-5
    assert abs(c.length - 180.0) < 1e-4
    block = trimesh.creation.box([40.0, 40.0, 40.0])
    drill = trimesh.creation.cylinder(6.0, 40.0, sections=40)
    drill.apply_translation([0.0, 0.0, 15.0])
    (h,) = fitted(trimesh.boolean.difference([block, drill], engine="manifold")).features
    assert not h.through
    assert abs(h.radius - 6.0) < 1e-5
    assert abs(h.length - 25.0) < 1e-4


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box([30.0, 20.0, 10.0]),
        trimesh.creation.icosphere(subdivisions=3, radius=10.0),
        trimesh.creation.cone(10.0, 20.0, sections=48),
        trimesh.creation.cylinder(10.0, 20.0, sections=6),  # a hexagon is a nut
        trimesh.creation.torus(200.0, 50.0, major_sections=24, minor_sections=16),
    ],
    ids=["box", "sphere", "cone", "hexagon", "torus"],
)
def test_nothing_is_made_up(mesh):
    result = fitted(mesh)
    assert not result.grooves
    assert not result.features
    assert "no groove: no concave circular arc found" in result.notes


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("gap", "count"), [(4.0, 1), (6.0, 2)])
def test_bars_in_line_are_one_up_to_a_quarter_of_the_shorter_one_apart(gap, count, side):
    bars = [trimesh.creation.cylinder(5.0, length, sections=32) for length in (20.0, 30.0)]
    bars[1].apply_translation((0.0, 0.0, side * (25.0 + gap)))
    lengths = [bar.length for bar in fitted(trimesh.util.concatenate(bars)).cylinders]
    assert lengths == pytest.approx([50.0 + gap] if count == 1 else [30.0, 20.0], abs=1e-4)


@pytest.mark.parametrize("flank_deg", [20.0, 60.0])
def test_v_and_trapezoid_grooves_are_not_arcs(flank_deg):
    s = 5.0 * np.tan(np.radians(flank_deg))
    for dip in ([(5, 0), (0, -s), (-5, 0)], [(9, 0), (4, -s), (-4, -s), (-9, 0)]):
        mesh = prism([(-20, -20), (20, -20), (20, 0), *dip, (-20, 0)], 30.0)
        assert not fitted(mesh).features
    assert not fitted(mesh.subdivide().subdivide(), 0.02).grooves


@pytest.mark.parametrize("turn", [0.0, np.pi / 48.0, 0.3])
def test_the_error_holds_for_the_lines_between_all_strips(turn):
    """Corners in single precision that nobody says are: some lie on one circle to the last digit, most do not."""
    angle = turn + np.arange(48) * (2.0 * np.pi / 48.0)
    rod = prism(np.column_stack([10.0 * np.cos(angle), 10.0 * np.sin(angle)]), 20.0)
    corners = rod.vertices.astype(np.float32).astype(np.float64)
    for found in fit_mesh(make_mesh(corners, rod.faces)).cylinders:
        local = (corners - found.T_part_feature[:3, 3]) @ found.T_part_feature[:3, :3]
        assert np.abs(np.hypot(local[:, 0], local[:, 1]) - found.radius).max() <= found.fit_error
        assert found.fit_error <= 1e-4
