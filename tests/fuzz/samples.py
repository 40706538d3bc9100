"""Good files, to be spoilt: a clamp, a scene with most of what a scene file can say, a tetrahedron."""

from pathlib import Path

import trimesh

from clamp3d.clamp import loader

CLAMP = (Path(loader.__file__).parent / "data" / "reference.toml").read_text(encoding="utf-8")
SCENE = """
unit = "mm"
contact = 0.01
clearance = 0.5
[parts.block]
shape = "groove-block"
radius = 7.0
half_angle_deg = 60
length = 50.0
width = 60.0
height = 20.0
grooves = [{ x = 18.0, radius = 5.0, half_angle_deg = 50.0 }]
holes = [{ diameter = 4.0, at = [-15.0, 3.0], axis = "y" }]
[parts.pin]
shape = "cylinder"
conductor = "LJ-120"
length = 40.0
pose = { matrix = [[1.0, 0.0, 0.0, 60.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 60.0]] }
[parts.tetra]
shape = "mesh"
file = "tetra.stl"
fit = "round"
pose = { translation = [50.0, 2.0, 3.0], axis = [0.0, 0.0, 1.0], angle_deg = 30.0 }
[[motions]]
parts = ["pin"]
screw = { axis = [0.0, 0.0, 1.0], point = [60.0, 0.0, 0.0], angle_deg = 90.0, pitch = 2.0 }
"""
_CORNERS, _SIDES = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
TETRA = trimesh.Trimesh(_CORNERS, _SIDES).export(file_type="stl_ascii").encode()
