"""Solids from CAD that stand on a flat face: the bound along its normal holds, and is sharp where they do."""

import numpy as np
import pytest

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")

from clamp3d.engine.slab import slab_distance
from clamp3d.files import cad_process
from clamp3d.files.faces import OTHER
from clamp3d.geometry.pose import inverse
from tests.cad import ball, block, cone, cut, moved, rod, shift, turn
from tests.files.assemblies import fuse
from tests.kinds import cad_model as model
from tests.public.placed_pairs import placed_pair, random_pose


def lowers(a, b, T):
    """The bounds of the second at ``T`` in the first, and of the first in the second; -inf for none."""
    pairs = (slab_distance(a, b, T, lambda _: True), slab_distance(b, a, inverse(T), lambda _: True))
    return [-np.inf if distance is None else distance.lower for distance in pairs]


FLAT = (
    "nut_on_plate", "boxes_face_to_face", "box_on_its_edge", "box_on_its_corner", "ball_on_plate", "ring_on_plate",
    "rods_end_to_end", "plates_drilled_alike", "screw_in_plate", "hexagon_in_hexagon", "pin_in_hole",
    "spline_under_plate",
)  # fmt: skip


@pytest.mark.parametrize("family", FLAT)
def test_no_placed_pair_is_nearer_than_its_bound(family):
    rng = np.random.default_rng(FLAT.index(family))
    for gap in (-0.07, -0.004, 0.0, 0.03):
        pair, T = placed_pair(family, rng, gap, splines=0.3), random_pose(rng)
        for lower in lowers(model(pair.a), model(moved(pair.b, T)), inverse(T)):
            assert lower <= gap + 1e-9
            if family in ("nut_on_plate", "boxes_face_to_face", "rods_end_to_end"):
                assert lower == pytest.approx(gap - 1e-6, abs=3e-7)


@pytest.mark.parametrize("gap", [-0.05, -0.003, 0.0, 0.02])
def test_a_washer_beside_a_hub_is_as_far_from_the_flange_as_from_its_plane(gap):
    """The hub is higher than the washer, and goes over into the plane by a cone; the hole below lies behind it."""
    flange = fuse(rod(40.0, -8.0, 0.0), cone(18.0, 10.0, 0.0, 30.0))
    flange = model(cut(flange, rod(4.0, -9.0, 31.0, 25.0)))
    for angle in (0.0, 0.3, 1.2):
        ring = moved(cut(rod(6.5, 0.0, 2.0), rod(4.2, -1.0, 3.0)), shift(25.0, 0.0, gap) @ turn((0, 0, 1), angle))
        for T in (np.eye(4), random_pose(np.random.default_rng(3))):
            found = lowers(flange, model(moved(ring, T)), inverse(T))
            assert max(found) <= gap
            assert min(found) == pytest.approx(gap - 1e-6, abs=1e-7)


def test_a_bound_is_none_where_more_than_a_plane_is_near():
    slot = cut(block((-20, -20, -10), (20, 20, 10)), block((-5, -21, 0), (5, 21, 11)))
    in_slot = block((-4, -9, 0), (5.03, 9, 4))  # stands on the slot's floor, and is 0.03 mm in its wall
    on_rod, plate = block((-9, -9, 3.0), (9, 9, 6.0)), fuse(block((-9, -9, -3), (9, 9, 0)), rod(2.0, -1.0, 3.05))
    bump = fuse(block((-9, -9, -3), (9, 9, 0)), ball(2.0, -1.92))  # 0.08 mm above the plane
    for first, second, depth in (
        (slot, in_slot, 0.03),
        (plate, on_rod, 0.05),
        (bump, block((-9, -9, 0), (9, 9, 4)), 0.08),
    ):
        assert max(lowers(model(first), model(second), np.eye(4))) <= -depth


@pytest.mark.parametrize("slit", [0.005, 0.05])
def test_who_is_inside_stands_on_no_face_of_a_slit(slit):
    """Nothing of the solid's surface is higher than the slit near the block, which is in the solid for all that."""
    solid = cut(block((-20, -20, -20), (20, 20, 20)), block((-6, -6, 0), (6, 6, slit)))
    assert max(lowers(model(solid), model(block((-2, -2, 0), (2, 2, 5))), np.eye(4))) == -np.inf


def facing(solid, way):
    """An upright rod turned so that the middle of a facet of its coarse mesh faces ``way``, and that facet's sag."""
    mesh = model(solid).outer(0.1)
    x, y, _ = mesh.normals[np.abs(mesh.normals[:, 2]) < 0.1][0]
    turned = turn((0, 0, 1), np.arctan2(*way[::-1]) - np.arctan2(y, x))
    reach = (model(moved(solid, turned)).outer(0.1).vertices @ (*way, 0.0)).max()
    return moved(solid, turned), 30.0 - reach


def test_what_is_beside_counts_though_it_is_further_from_the_meshes():
    """A wall beside what stands over a plane, nearer than this; a sagging facet of either is beyond the margin."""
    floor, near = block((-70, -40, -5), (5, 40, 0)), block((-8, -4, 0.095), (0, 4, 5))
    standing, sag = facing(rod(30.0, 0.095, 5.0), (1.0, 0.0))
    post, _ = facing(rod(30.0, -1.0, 9.0), (-1.0, 0.0))
    beside = 0.1 - sag / 2
    assert beside < 0.085

    def walled(solid, x):
        return fuse(solid, block((x, -20, -1), (9, 20, 9)))

    for flat, other, gap in (
        (walled(floor, 0.02), block((-8, -4, 0.05), (0, 4, 5)), 0.02),
        (walled(floor, beside), moved(standing, shift(-30.0)), beside),
        (fuse(floor, moved(post, shift(30.0 + beside))), near, beside),
        (walled(cut(floor, rod(15.0, -9, 9, -20.0)), 0.11), block((-8, -4, 0.12), (0, 4, 5)), 0.11),
    ):
        assert max(lowers(model(flat), model(other), np.eye(4))) <= gap + 1e-9


def test_a_ball_may_lie_on_any_side_of_a_block():
    a, b = model(block((-5, -5, -5), (5, 5, 5))), model(ball(2.0))
    for way in np.concatenate([np.eye(3), -np.eye(3)]) * 7.01:
        assert lowers(a, b, shift(*way)) == pytest.approx([0.01 - 1e-6] * 2, abs=3e-7)


def test_extents_of_splines_are_not_believed(monkeypatch):
    pair = placed_pair("spline_under_plate", np.random.default_rng(3), -0.02, splines=0.0)
    a, b = model(pair.a), model(pair.b)
    bounds = cad_process.face_bounds_at
    monkeypatch.setattr(cad_process, "face_bounds_at", lambda *given: bounds(*given) - 0.05)
    spline = next(x for x in (a, b) if x.is_free_form)
    kind = spline.shape.surfaces.kind
    tops = spline.shape.tops(np.array([0.0, 0.0, 1.0]), np.arange(len(kind)))
    assert np.isinf(tops[kind == OTHER]).all()
    assert np.isfinite(tops[kind != OTHER]).all()
