"""What the kernel said at some hundred poses, as it was once recorded: a change of any number is seen.

What it was judged by then is in the other files here. ``python -m tests.kernel.test_recorded`` records it again.
"""

import itertools
import math
from pathlib import Path

import numpy as np

from clamp3d import kernel
from clamp3d.kernel.distance import Feature
from tests.recorded import record_tests

MIX = np.sqrt(np.arange(2.0, 8.0))
"""Six numbers in one: a vector's product with these shows each of its terms."""
UNIT = 2.0**-53


def scenes():
    """Grooves and cylinders of all proportions at all kinds of poses: along the groove, in a face, oblique."""
    rng = np.random.default_rng(12)
    for k in range(300):
        R, H, r = 12.0, float(rng.choice([3.0, 20.0, 60.0])), float(rng.choice([0.5, 5.0, 10.5, 14.0]))
        groove = kernel.SweptArc(R, float(rng.choice([0.3, 1.1, 1.5, 1.9, 2.7])), 2.0 * H)
        wire = (kernel.Cylinder, kernel.Capsule)[k % 2](r, float(rng.choice([0.7, 6.0, 50.0, 300.0])))
        axis = np.eye(3)[k // 3 % 3] if k % 3 == 0 else rng.normal(size=3)
        T = kernel.rotation(axis, float(rng.choice([0.02, 0.3, 1.3, 2.5])))
        if k % 5 == 0:
            T = kernel.rotation((1.0, 0.0, 0.0), math.pi * (k % 4 == 1))
        lip = np.array([R * math.sin(groove.half_angle), -R * math.cos(groove.half_angle), H])
        places = [(0.0, 0.0, 0.0), lip, (0.0, -R, H), lip * (-1.6, 1.0, -0.5), (2.0, lip[1] - 9.0, 0.0)]
        T[:3, 3] = np.array(places[k // 7 % 5]) + rng.normal(size=3) * (4.0, 4.0, 6.0) * (1.0 if k % 4 else 0.3)
        yield groove, wire, T
    for k, (x, y, z) in enumerate(itertools.product((0.0, 5.0), (0.0, -12.0, -15.0, 4.0), (0.0, 20.0, -22.0))):
        for axis, r in itertools.product(np.eye(3) * (-1.0) ** k, (2.0, 30.0)):  # square, and on the axes of symmetry
            T = kernel.translation(x, y, z)
            T[:3, :3] = np.column_stack([np.roll(axis, 1), np.cross(axis, np.roll(axis, 1)), axis])
            yield kernel.SweptArc(12.0, 1.3, 40.0), (kernel.Cylinder, kernel.Capsule)[k % 2](r, 9.0), T


def distances():
    rows = []
    for k, (groove, wire, T) in enumerate(scenes()):
        a = kernel.signed_distance(groove, wire, T)
        vectors = [a.normal @ MIX[:3], a.point_on_groove @ MIX[:3], a.point_on_cylinder @ MIX[:3], a.gradient @ MIX]
        relation = kernel.groove_relation(groove, wire, T, tolerance=0.3).relation
        words = f"{a.feature}, {relation}, {a.axis_inside}, {a.unique if k % 9 == 0 else ''}"
        rows.append([words, a.distance, *vectors, a.along, a.error_bound / UNIT])
    return rows


def pieces():
    rows = []
    for groove, wire, T in [*scenes()][::4]:
        p = kernel.groove_pieces(groove, wire, T)
        rows.append([str(Feature(code)) for code in p.feature.tolist()] + p.distance.tolist())
        rows.append([*(p.gradient @ MIX).tolist(), *(p.normal @ MIX[:3] + p.point_on_groove @ MIX[3:]).tolist()])
    return rows


def sections():
    """Arcs and circles, holes and bolts in the plane, apart and in contact, and what tolerance was applied."""
    rng, rows = np.random.default_rng(14), []
    for k in range(120):
        half, r = float(rng.choice([0.5, 1.4, 2.2])), float(rng.choice([1.0, 5.0, 9.0]))
        x, y = rng.uniform(-14.0, 14.0, 2).tolist()
        c = kernel.arc_circle(7.0, half, r, x, y, tolerance=(0.0, 0.4)[k % 2])
        applied = c.tolerance / UNIT * (k % 2 == 0)
        rows.append([f"{c.relation}, {c.feature}", c.gap, *np.ravel(c.points).tolist(), applied])
        u, v, turn, lean = rng.uniform((-2.0, -2.0, -0.3, -0.2), (2.0, 2.0, 0.3, 0.2)).tolist()
        bolt = kernel.Rectangle(0.5, float(rng.choice([-1.0, 20.0])), 9.0, 12.0, lean)
        h = kernel.hole_bolt(kernel.Rectangle(u, v, 11.0, (4.0, 15.0)[k % 2], turn), bolt, tolerance=(0.0, 0.4)[k % 2])
        numbers = [h.gap_left, h.gap_right, *h.point, *h.normal, *np.ravel(h.points).tolist()]
        rows.append([str(h.relation), *(min(x, 1e9) for x in numbers), h.tolerance / UNIT * (k % 2 == 0)])
    return rows


test_kernel_is_as_recorded, record = record_tests(Path(__file__).with_name("data"), distances, pieces, sections)


if __name__ == "__main__":
    record()
