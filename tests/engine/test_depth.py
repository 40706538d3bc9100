"""Penetration depth against independent truths: Minkowski differences of vertices, brute force over translations."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from clamp3d.engine.check import check
from clamp3d.engine.convex import Rod
from clamp3d.engine.convex_depth import convex_depth
from clamp3d.engine.distance import distance
from clamp3d.engine.hull import hull
from clamp3d.engine.scene import Scene
from clamp3d.geometry import shapes
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.pose import rotation, translation
from clamp3d.geometry.primitives import SweptArc

HERE = np.eye(4)


def placed(rng, reach):
    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=rng).as_matrix()
    T[:3, 3] = rng.normal(size=3) * reach
    return T


def test_convex_polyhedra_have_the_depth_of_the_hull_of_vertex_differences():
    rng = np.random.default_rng(0)
    seen = 0
    for _ in range(60):
        a, b = (hull(rng.normal(size=(rng.integers(6, 24), 3)) * 5.0) for _ in range(2))
        T = placed(rng, 2.0)
        V = b.vertices @ T[:3, :3].T + T[:3, 3]
        truth = ConvexHull((a.vertices[:, None] - V[None]).reshape(-1, 3)).equations[:, 3].max()
        if truth < 0.0:
            seen += 1
            assert convex_depth(a, HERE, b, T).value == pytest.approx(truth, abs=1e-11)
    assert seen > 40


def test_cylinders_lie_between_inscribed_and_circumscribed_prisms():
    rng = np.random.default_rng(1)
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    rod = Rod(5.0, 20.0, HERE)

    def prism(scale):
        rim = 5.0 * scale * np.column_stack([np.cos(turn), np.sin(turn)])
        return hull(np.vstack([np.column_stack([rim, np.full(64, z)]) for z in (-10.0, 10.0)]))

    inner, outer = prism(1.0), prism(1.0 / math.cos(math.pi / 64))
    for _ in range(25):
        other = hull(rng.normal(size=(8, 3)) * 6.0)
        T = placed(rng, 3.0)
        d = convex_depth(rod, HERE, other, T)
        if d.upper < 0.0:
            assert d.upper - d.lower <= 1e-8
            assert convex_depth(outer, HERE, other, T).lower <= d.upper
            assert d.lower <= convex_depth(inner, HERE, other, T).upper


@pytest.mark.parametrize("x", [-15.0, -20.0, -25.0])
def test_bolt_through_the_wall_of_its_hole(x):
    """The shortest way is back into the hole: 14, 19, 24 mm."""
    plate = shapes.box((137.0, 60.0, 28.0), holes=[shapes.Hole(11.0)])
    d = distance(plate, shapes.cylinder(10.0, 160.0), translation(x, 0.0, 0.0))
    assert d.lower <= x + 1.0 <= d.upper
    row = check(Scene().add("plate", plate).add("bolt", shapes.cylinder(10.0, 160.0), translation(x, 0.0, 0.0))).pairs[
        0
    ]
    assert row.to_dict()["at_least_mm"] <= x + 1.0 <= row.to_dict()["at_most_mm"] + 1e-9


def test_wire_too_thick_for_its_groove_rests_on_both_lips():
    block = shapes.groove_block(SweptArc(7.0, math.radians(60.0), 50.0), 40.0, 20.0)
    truth = -3.5 + math.sqrt(7.5**2 - (7.0 * math.sin(math.radians(60.0))) ** 2)
    d = distance(block, shapes.cylinder(7.5, 80.0))
    assert -1.0 <= d.lower <= -truth <= d.upper


def test_bar_in_a_v_of_a_mesh():
    outline = [(-30, -25), (30, -25), (30, 20), (20, 20), (0, 0), (-20, 20), (-30, 20)]
    block = _extruded(outline, 40.0)
    cube = shapes.box((10.0, 10.0, 20.0))
    for drop in (0.01, 0.5, 3.0):
        T = translation(0.0, 5.0 * math.sqrt(2.0) - drop, 0.0) @ rotation([0, 0, 1], math.pi / 4)
        d = distance(block, cube, T)
        assert d.lower - 1e-9 <= -drop <= d.upper + 1e-9
        assert d.lower >= -1.2 * drop - 0.2
        assert d.direction == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)


def test_a_press_fit_is_judged_by_what_the_parts_share():
    plate, pin = shapes.box((40, 40, 8), holes=[shapes.Hole(5.0)]), shapes.cylinder(5.02, 20.0)
    scene = Scene().add("plate", plate).add("pin", pin)
    assert check(scene).verdict("plate", "pin").value == "clash"
    row = check(scene.allow(("plate", "pin"), overlap=0.03)).pairs[0]
    assert row.verdict.value == "allowed"
    assert row.distance.depth == pytest.approx(0.02, abs=1e-9)  # though the way out is lengthwise
    assert distance(plate, pin).lower <= -13.9


def test_without_depths_an_overlap_is_at_least():
    scene = Scene().add("a", shapes.box((10, 10, 10))).add("b", shapes.box((8, 8, 8)), translation(6.0, 0.0, 0.0))
    found = check(scene, depths=False).pairs[0].distance
    assert found.lower == -math.inf
    assert -3.0 <= found.upper < -0.01
    assert check(scene).pairs[0].distance.depth == pytest.approx(3.0, abs=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.7])
def test_what_touches_within_its_errors_comes_free_along_a_unit_normal(turn):
    """A wire on the floor of a groove that is known as a mesh only: its facets are 0.05 mm off."""
    groove = shapes.groove_block(SweptArc(7.0, 1.0, 30.0), 24.0, 12.0)
    made = mesh(groove, 0.05)
    block = shapes.MeshShape(make_mesh(made.vertices, made.faces), "off", "block", 0.05)
    wire = shapes.cylinder(3.0, 18.0)
    T = translation(4.0 * math.sin(turn), -4.0 * math.cos(turn), 0.0)
    d = distance(block, wire, T)
    assert d.lower < 0.0 < d.upper
    assert np.linalg.norm(d.normal) == pytest.approx(1.0, abs=1e-12)
    assert distance(groove, wire, translation(*((1e-6 - d.lower) * d.normal)) @ T).lower > 0.0


def _extruded(outline, half):
    import manifold3d

    made = manifold3d.CrossSection([outline]).extrude(2.0 * half).translate((0.0, 0.0, -half)).to_mesh64()
    mesh = make_mesh(np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts).astype(np.int64))
    return shapes.MeshShape(mesh, "off")


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-8, 3e-8, 1e-7])
def test_unique_is_not_claimed_where_rounding_decides(tilt):
    a, b = shapes.box((10, 10, 10)), shapes.box((4, 4, 4))
    assert distance(a, b, translation(0, 0, 9) @ rotation([1, 2, 0], tilt)).unique is not True
    assert distance(a, b, translation(0, 0, 9) @ rotation([1, 2, 0], 0.3)).unique is True
