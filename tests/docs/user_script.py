"""A user's script as mypy --strict sees it: it is checked with the package, never run."""

from typing import assert_type

import clamp3d
from clamp3d import Assembly, CheckResult, Clamp, Distance, Scene, distance, shapes

assert_type(clamp3d.check(clamp3d.load_scene("scene.toml")), CheckResult)
assembly = clamp3d.assemble("reference", line="LJ-500")
assert_type(assembly, Assembly)
clamp3d.export(assembly.scene, "ref.step")
assert_type(clamp3d.load("reference"), Clamp | Scene)
gap = distance(shapes.box((1.0, 2.0, 3.0)), shapes.cylinder(1.0, 2.0))
assert_type(gap, Distance)
assert_type(gap.value, float)
