"""Bodies that a part can be made of.

>>> import math
>>> block = groove_block(SweptArc(7.0, math.radians(60), 50.0), width=40.0, height=20.0)
>>> wire = cylinder(6.5, 80.0)
"""

from clamp3d.files.formats import load_mesh
from clamp3d.geometry.mesh import Mesh, make_mesh
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc
from clamp3d.geometry.shapes import Hole, MeshShape, Solid, Sphere, box, cylinder, extrusion, groove_block, sphere

__all__ = [
    "Capsule",
    "Cylinder",
    "Hole",
    "Mesh",
    "MeshShape",
    "Solid",
    "Sphere",
    "SweptArc",
    "box",
    "cylinder",
    "extrusion",
    "groove_block",
    "load_mesh",
    "make_mesh",
    "mesh",
    "sphere",
]
