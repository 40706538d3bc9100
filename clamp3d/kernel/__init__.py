"""The closed forms: a groove and a cylinder in 3D, an arc and a circle in a section, single poses, batches and motions.

>>> import math
>>> from clamp3d.geometry.pose import translation
>>> groove, wire = SweptArc(12.0, math.radians(70), 60.0), Cylinder(10.5, 200.0)
>>> signed_distance(groove, wire, translation(0.0, -1.0, 0.0)).distance
0.5
"""

from clamp3d.geometry.pose import SectionPose, rotation, translation
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc
from clamp3d.kernel.arc_and_circle import ArcContact, ArcRelation, arc_circle, classify_arc_circle
from clamp3d.kernel.distance import Feature, SignedDistance, SignedDistances, signed_distance, signed_distances
from clamp3d.kernel.pieces import GroovePieces, groove_pieces
from clamp3d.kernel.rectangle import HoleContact, HoleRelation, Rectangle, hole_bolt
from clamp3d.kernel.relation import GrooveRelation, Relation3D, groove_relation, relative_pose
from clamp3d.kernel.subgradient import GeneralisedGradient, generalised_gradient

__all__ = [
    "ArcContact",
    "ArcRelation",
    "Capsule",
    "Cylinder",
    "Feature",
    "GeneralisedGradient",
    "GroovePieces",
    "GrooveRelation",
    "HoleContact",
    "HoleRelation",
    "Rectangle",
    "Relation3D",
    "SectionPose",
    "SignedDistance",
    "SignedDistances",
    "SweptArc",
    "arc_circle",
    "classify_arc_circle",
    "generalised_gradient",
    "groove_pieces",
    "groove_relation",
    "hole_bolt",
    "relative_pose",
    "rotation",
    "signed_distance",
    "signed_distances",
    "translation",
]
