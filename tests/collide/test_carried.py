"""Faces of CAD that stay on themselves in a motion, and pairs that never see each other, against Open CASCADE."""

import itertools
import math

import numpy as np
import pytest

from clamp3d import min_clearance
from clamp3d.brep.solid import BrepSolid
from clamp3d.collide.carried import Carried, axis_of, curves, pairs_of
from clamp3d.collide.model import FINEST_CAD, ModelCache
from clamp3d.collide.moving_pair import MovingPair, least_distance
from clamp3d.collide.slopes import facing
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.motion import Motion
from clamp3d.core.pose import rotation, translation

b3 = pytest.importorskip("build123d")
TURN, SLIDE = Motion.screw((0, 0, 1), 2.0), Motion.translate((0, 0, 3.0))
SCREW = Motion.screw((0, 0, 1), 2.0, travel=3.0)


def brep(shape, name="part"):
    (solid,) = shape.solids()
    return BrepSolid.of(solid.wrapped, name)


def plate(hole, size=20.0, thick=10.0):
    return b3.Box(size, size, thick) - hole


def chamfered(radius, length):
    pin = b3.Cylinder(radius, length)
    return b3.chamfer(pin.edges().filter_by(b3.GeomType.CIRCLE), 1.0)


def ridge(radius):
    """Two cones that meet in a sharp ring."""
    return b3.Pos(0, 0, 1) * b3.Cone(radius, 1, 2) + b3.Pos(0, 0, -1) * b3.Cone(1, radius, 2)


PARTS = {
    "plate": lambda: plate(b3.Cylinder(5, 20)),
    "countersunk": lambda: plate(b3.Cylinder(5, 20)) - b3.Pos(0, 0, 5) * b3.Cone(4, 7, 3),
    "slanted": lambda: b3.Pos(0, 0, -9) * (b3.Rot(20, 0, 0) * b3.Box(30, 30, 4)),
    "square hole": lambda: plate(b3.Box(10, 10, 20)),
    "pin": lambda: b3.Cylinder(4.8, 16),
    "chamfered": lambda: chamfered(4.8, 16),
    "ridge": lambda: ridge(4.8),
    "pointed": lambda: b3.Rot(180, 0, 0) * b3.Cone(3, 0, 8),
    "bolt": lambda: b3.Cylinder(4.7, 16) + b3.Pos(0, 0, 10) * b3.Cylinder(8, 4),
}


def moved(shape, T):
    from OCP.gp import gp_Trsf
    from OCP.TopLoc import TopLoc_Location

    place = gp_Trsf()
    place.SetValues(*T[:3].ravel().tolist())
    return shape.Moved(TopLoc_Location(place))


def gap(a, b):
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    return BRepExtrema_DistShapeShape(a, b).Value()


@pytest.mark.parametrize("moving", ["chamfered", "ridge", "pointed", "bolt"])
@pytest.mark.parametrize("still", ["countersunk", "slanted", "square hole"])
def test_nearest_points_are_on_faces_that_are_kept(moving, still):
    one, other = PARTS[moving](), PARTS[still]()
    a, b = brep(one), brep(other)
    kept = facing(a, b, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0]))
    assert not kept.all()
    rng = np.random.default_rng(3)
    faces = [[f.wrapped for f in shape.solids()[0].faces()] for shape in (one, other)]
    for _ in range(5):
        T = rotation((0, 0, 1), rng.uniform(0.0, 6.0))
        T[:3, 3] = *rng.uniform(-0.15, 0.15, 2), rng.uniform(-2.0, 25.0)
        known = gap(moved(one.solids()[0].wrapped, T), other.solids()[0].wrapped)
        if known > 0.0:
            least = min(gap(moved(faces[0][i], T), faces[1][j]) for i, j in np.argwhere(kept))
            assert least == pytest.approx(known, abs=1e-7)


# Part, hole, motion, and their distance.
KEPT = {
    "pin turns": (lambda: b3.Cylinder(4.95, 16), PARTS["plate"], TURN, 0.05),
    "pin slides": (lambda: b3.Cylinder(4.95, 16), PARTS["plate"], SLIDE, 0.05),
    "pin screws": (lambda: b3.Cylinder(4.95, 16), PARTS["plate"], SCREW, 0.05),
    "key slides": (lambda: b3.Box(9.98, 9.98, 20), PARTS["square hole"], SLIDE, 0.01),
    "shaft turns on its shoulder": (
        lambda: b3.Cylinder(4.9, 16) + b3.Pos(0, 0, 7.05) * b3.Cylinder(8, 4), PARTS["plate"], TURN, 0.05
    ),
    "cone turns": (
        lambda: b3.Cone(6.9, 2.9, 10), lambda: plate(b3.Cone(7, 3, 10)), TURN, 0.1 * 10 / math.hypot(10, 4)
    ),
    "ball turns": (
        lambda: b3.Sphere(4.9), lambda: b3.Box(14, 14, 14) - b3.Sphere(5), Motion.screw((1, 2, 2), 1.0), 0.1
    ),
    "ring turns": (lambda: b3.Torus(6, 1.92), lambda: plate(b3.Torus(6, 2)), TURN, 0.08),
}  # fmt: skip


@pytest.mark.parametrize("case", KEPT)
def test_a_fit_that_stays_is_known_at_once(case):
    part, hole, motion, known = KEPT[case]
    world = np.eye(4)
    if "key" not in case:  # somewhere in space
        world = translation(30.0, -20.0, 10.0) @ rotation((1, 2, 3), 1.1)
        turn, shift = world[:3, :3], world[:3, 3]
        if motion.angle:
            travel = float(motion.travel @ motion.axis)
            motion = Motion.screw(turn @ motion.axis, motion.angle, point=shift, travel=travel)
        else:
            motion = Motion.translate(turn @ motion.travel)
    cache = ModelCache()
    a, b = cache.model(brep(part())), cache.model(brep(hole()))
    pair = MovingPair(a, b, motion, world, world)
    found, _ = least_distance(pair, Thresholds(contact=1e-3, clearance=0.5), None)
    assert found.lower <= known + 1e-9
    assert found.upper >= known - 1e-9
    assert found.lower >= known - 2e-3
    assert cache.counters.queries["swept meshes"] <= 3


@pytest.mark.parametrize("case", KEPT)
def test_curves_are_as_far_apart_as_the_faces(case):
    part, hole, motion, known = KEPT[case]
    moving, still = brep(part()), brep(hole())
    world = rotation((3, -1, 2), 0.8)
    motion = Motion(world[:3, :3] @ motion.axis, np.zeros(3), motion.angle, world[:3, :3] @ motion.travel)
    made = [curves(s.surfaces, world, motion) for s in (moving, still)]
    axis = axis_of(motion) @ world[:3, :3]
    found = pairs_of(*made, facing(moving, still, axis, axis), motion, known + 0.01)
    assert known - 1.5e-3 <= found.gap((0.0, 1.0), 1.0) <= known


def test_what_goes_along_an_axis_is_met_where_it_is():
    rng = np.random.default_rng(0)
    for _ in range(50):
        moving, still = (np.sort(rng.uniform(-5.0, 5.0, (3, 2)), axis=1) for _ in range(2))
        pairs = Carried(rng.uniform(0.0, 2.0, 3), moving, still, rng.uniform(-9.0, 9.0))
        stretch = np.sort(rng.uniform(0.0, 1.0, 2))
        ways = pairs.travel * np.linspace(*stretch, 2001)[:, None]
        between = np.maximum(still[:, 0] - moving[:, 1] - ways, moving[:, 0] + ways - still[:, 1])
        known = np.hypot(pairs.apart, np.maximum(between, 0.0)).min()
        assert known - 0.01 <= pairs.gap(tuple(stretch), 20.0) <= known
        assert pairs.gap(tuple(stretch), 0.5 * known) == 0.5 * known


@pytest.mark.parametrize("turn", [0.0, 5.0])
@pytest.mark.parametrize("when", [0.23, 0.71])
def test_a_collar_that_passes_a_hole_is_seen_when_it_is_there(when, turn):
    """A shaft 2 mm off its hole with a collar 0.1 mm off, which is in the hole for a tenth of the way."""
    way = 60.0
    shaft = b3.Cylinder(3, 200) + b3.Pos(0, 0, -when * way) * b3.Cylinder(4.9, 2)
    axis = Motion.screw((0, 0, 1), turn, travel=way) if turn else Motion.translate((0, 0, way))
    found = min_clearance(brep(plate(b3.Cylinder(5, 20), thick=4.0)), brep(shaft), axis)
    assert found.distance.lower <= 0.1 + 1e-9
    assert found.distance.upper >= 0.1 - 1e-9
    assert found.distance.upper - found.distance.lower <= 2.1 * FINEST_CAD
    assert abs(found.t - when) <= 3.1 / way


@pytest.mark.parametrize("seed", range(4))
def test_bounds_hold_against_many_instants(seed):
    """Parts that are nearly where they fit, and motions nearly along the axis: some faces are carried, others not."""
    rng = np.random.default_rng(seed)
    names = list(itertools.product(["pin", "chamfered", "ridge", "bolt"], ["plate", "countersunk", "square hole"]))
    moving, still = names[rng.integers(len(names))]
    one, other = PARTS[moving](), PARTS[still]()
    start = translation(*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.0, 6.0))
    motion = [
        Motion.translate((0, 0, rng.uniform(-4.0, 4.0))),
        Motion.screw((0, 0, 1), rng.uniform(-3.0, 3.0), point=start[:3, 3] if seed % 2 else (0, 0, 0)),
        Motion.screw((0, 0, 1), rng.uniform(-3.0, 3.0), travel=rng.uniform(-4.0, 4.0)),
        Motion.translate((0.02, 0, rng.uniform(-4.0, 4.0))),
    ][seed % 4]
    found = min_clearance(brep(other), brep(one), motion, start).distance
    instants = [motion.at(t, start) for t in np.linspace(0.0, 1.0, 13)]
    known = min(gap(moved(one.solids()[0].wrapped, T), other.solids()[0].wrapped) for T in instants)
    assert found.lower <= known + 1e-7
    if known > 0.0:
        assert found.upper >= 0.0
        assert found.lower >= known - max(2.1 * FINEST_CAD, 0.03 * known) - 0.02


def test_the_axis_of_a_straight_way_is_its_direction():
    np.testing.assert_allclose(axis_of(Motion.translate((0.0, 3.0, 4.0))), [0.0, 0.6, 0.8])
