import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d.errors import InputError
from clamp3d.kernel import Capsule, Cylinder, SweptArc, rotation, translation
from clamp3d.kernel.arc_and_circle import ArcRelation, arc_circle
from clamp3d.kernel.relation import Relation3D, groove_relation

GROOVE, MAJOR = SweptArc(7.0, math.radians(60.0), 50.0), SweptArc(7.0, math.radians(120.0), 50.0)
S, H = 7.0 * math.sin(GROOVE.half_angle), -7.0 * math.cos(GROOVE.half_angle)
TILT = rotation((1, 0, 0), 0.01)


def at_lip(angle):
    """Where a wire of radius 3 touches the lip N of the major arc, ``angle`` off the face's normal."""
    return translation(S - 3.0 * math.sin(angle), 3.5 + 3.0 * math.cos(angle), 0.0)


@pytest.mark.parametrize(
    ("groove", "radius", "T", "wanted"),
    [
        (GROOVE, 3.0, translation(0.0, -2.0, 0.0), "inside"),
        (GROOVE, 3.0, translation(0.0, -2.0, 0.0) @ TILT, "inside"),
        (GROOVE, 3.0, translation(0.0, 0.0, 0.0), "outside"),
        (GROOVE, 3.0, translation(0.0, -2.0, 70.0), "outside"),
        (GROOVE, 3.0, translation(0.0, -4.0, 0.0), "interior contact"),
        (GROOVE, 3.0, translation(0.0, -4.1, 0.0), "intersect"),
        (GROOVE, 3.0, translation(0.0, -5.0, 0.0) @ TILT, "intersect"),
        (GROOVE, 3.0, translation(S + 5.0, H + 3.0, 0.0), "exterior contact"),
        (GROOVE, 3.0, translation(S - 3.0 * math.sin(1.0), H + 3.0 * math.cos(1.0), 0.0), "interior contact"),
        (GROOVE, 3.0, translation(0.0, -12.0, 68.0), "exterior contact"),
        (GROOVE, 9.0, translation(0.0, H + math.sqrt(81.0 - S * S), 0.0), "interior contact"),
        (GROOVE, 3.0, translation(0.0, H + 2.9, 0.0), "inside"),
        (GROOVE, 3.0, translation(0.0, H + 3.1, 0.0), "outside"),
        (GROOVE, 0.5, translation(0.0, -3.0, 0.0) @ rotation((0, 1, 0), math.pi / 2), "outside"),
        # Fig. 6: exterior if the centre is beyond the perpendicular to OM at M, here 30 deg off the face's normal.
        (MAJOR, 3.0, at_lip(0.2), "exterior contact"),
        (MAJOR, 3.0, at_lip(math.radians(29.9)), "exterior contact"),
        (MAJOR, 3.0, at_lip(0.6), "interior contact"),
    ],
)
def test_table_3_in_any_pose(groove, radius, T, wanted):
    length = 4.0 if wanted == "outside" and radius == 0.5 else 80.0
    assert groove_relation(groove, Capsule(radius, length), T, tolerance=1e-9).relation.value == wanted


@settings(max_examples=150, deadline=None)
@given(st.floats(0.2, 2.9), st.floats(0.5, 11.9), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_parallel_wire_agrees_with_the_plane_relation(half, r, x, y):
    # Only outside the material: the arc of the plane relation is a curve, without material behind it.
    groove, wire = SweptArc(12.0, half, 50.0), Capsule(r, 80.0)
    answer = groove_relation(groove, wire, translation(x, y, 0.0), tolerance=1e-9)
    plane = arc_circle(12.0, half, r, x, y, tolerance=1e-9)
    if answer.contact.feature.name not in ("ARC", "LIP_M", "LIP_N") or answer.contact.axis_inside:
        return
    assert abs(answer.contact.distance - plane.gap) < 1e-12
    is_above = y >= 0.0 > -12 * math.cos(half)
    if plane.relation is ArcRelation.INSIDE or (plane.relation is ArcRelation.OUTSIDE and is_above):
        # a circle that covers the region of the chord only partly may reach under a flat face: then it intersects
        assert answer.relation.value == plane.relation.value


def test_uncertain_where_the_tolerance_is_below_the_error_bound():
    T = translation(0.0, -4.0, 0.0) @ rotation((0, 0, 1), 0.3)
    wire = Capsule(3.0, 80.0)
    assert groove_relation(GROOVE, wire, T, tolerance=0.0).relation is Relation3D.UNCERTAIN
    assert groove_relation(GROOVE, wire, T, tolerance=1e-13).relation is Relation3D.INTERIOR_CONTACT
    assert groove_relation(GROOVE, wire, translation(0, -2, 0), tolerance=0.0).relation is Relation3D.INSIDE
    for tolerance in (-1.0, 3.0, math.nan):
        with pytest.raises(InputError, match="tolerance must be >= 0 mm and less than both radii"):
            groove_relation(GROOVE, wire, T, tolerance=tolerance)


@pytest.mark.parametrize("kind", [Cylinder, Capsule])
def test_a_flat_ended_cylinder_is_inside_if_it_reaches_the_block(kind):
    """By turns to the nearest point of the block and of the wire, which leads to where they are nearest."""
    rng = np.random.default_rng(4)
    counts = {Relation3D.INSIDE: 0, Relation3D.OUTSIDE: 0}
    for _ in range(200):
        wire, T = kind(rng.uniform(0.5, 6.0), rng.uniform(0.5, 20.0)), rotation(rng.normal(size=3), rng.uniform(0, 3))
        T[:3, 3] = rng.uniform((-4.0, H - 2.0, -33.0), (4.0, H + 12.0, 33.0))
        relation = groove_relation(GROOVE, wire, T, tolerance=1e-9).relation
        if relation not in counts:
            continue
        p, r, half = T[:3, 3], wire.radius, 0.5 * wire.length
        for _ in range(200):
            q = np.array([p[0], min(p[1], H), np.clip(p[2], -25.0, 25.0)])
            m = (q - T[:3, 3]) @ T[:3, :3]
            foot = np.array([0.0, 0.0, np.clip(m[2], -half, half)])
            out = m - foot if kind is Capsule else m * (1.0, 1.0, 0.0)
            p = T[:3, 3] + T[:3, :3] @ (foot + out * min(1.0, r / max(np.linalg.norm(out), 1e-300)))
        n, d = (p - q) * (0.0, 1.0, 1.0), T[:3, 2]  # the block has no end along x
        n /= max(np.linalg.norm(n), 1e-300)
        near = n @ T[:3, 3] - half * abs(n @ d) - r * (1.0 if kind is Capsule else np.linalg.norm(np.cross(n, d)))
        apart = near - n[1] * H - abs(n[2]) * 25.0  # how far the plane square to n keeps them apart
        if apart > 1e-9 or np.linalg.norm(p - q) < 1e-9:
            counts[relation] += 1
            assert relation is (Relation3D.OUTSIDE if apart > 1e-9 else Relation3D.INSIDE)
    assert min(counts.values()) > 20
