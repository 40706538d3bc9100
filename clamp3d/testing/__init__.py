"""Properties that every bound must have, for tests of any shape, against an oracle that shares no formula with them.

The oracle knows a body only by its definition, as a `Body`: a function of points that tells how far outside they are at
least. From that alone `common` bounds how deep two bodies share a point, by branch and bound over boxes of points, and
`separation` their distance. The ``assert_...`` functions state what an answer promises and raise AssertionError where
the oracle proves it broken; what the oracle cannot decide passes.

>>> from clamp3d import distance, shapes
>>> from clamp3d.geometry.pose import translation
>>> box, wire, T = shapes.box((10, 10, 10)), shapes.cylinder(3, 20), translation(9, 0, 0)
>>> assert_distance(distance(box, wire, T), box, wire, T)
"""

from clamp3d.testing.assertions import assert_distance, assert_lower_on_way, assert_motion, directions, pose_at
from clamp3d.testing.bodies import Body, Field, body
from clamp3d.testing.search import Common, common, separation

__all__ = [
    "Body",
    "Common",
    "Field",
    "assert_distance",
    "assert_lower_on_way",
    "assert_motion",
    "body",
    "common",
    "directions",
    "pose_at",
    "separation",
]
