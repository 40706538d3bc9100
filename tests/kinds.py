"""Shapes of every kind, for properties that hold for any of them."""

import math
from dataclasses import replace

import numpy as np
import trimesh
from hypothesis import strategies as st

from clamp3d import Scene
from clamp3d.engine.check import check
from clamp3d.engine.model import Counters, model_of
from clamp3d.engine.surface import Surface
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry import shapes
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.profile import Profile
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import SweptArc, make_mesh, mesh
from tests.cad import first_solid

TURNED = translation(1.0, -2.0, 0.5) @ rotation((1.0, 2.0, 3.0), 0.7)
"""A pose that nothing is square to."""


def box_mesh(size, error=None):
    """The mesh of a box, with one error for all its triangles."""
    cuboid = trimesh.creation.box(size)
    return Surface(np.array(cuboid.vertices), np.array(cuboid.faces), None if error is None else np.full(12, error))


SHANK = Extrusion(Profile.circle(4.0), "Z", -20.0, 10.0)
HEAD = Extrusion(Profile.of((-7.0, -7.0), (7.0, -7.0), (7.0, 7.0), (-7.0, 7.0)), "Z", 10.0, 15.0)
BLOCK = shapes.groove_block(SweptArc(7.0, math.radians(60.0), 50.0), 40.0, 20.0, name="block")
DRAWN = [
    BLOCK,
    shapes.groove_block(SweptArc(6.0, math.radians(110.0), 40.0), 40.0, 30.0, name="block with a narrow mouth"),
    shapes.groove_block(
        SweptArc(7.0, 1.0, 40.0),
        60.0,
        20.0,
        others=[(18.0, 5.0, 0.9)],
        holes=[shapes.Hole(2.0, (-15.0, 3.0), "y")],
        name="two grooves and a hole across",
    ),
    shapes.cylinder(5.0, 40.0),
    shapes.cylinder(8.0, 12.0, bore=4.0, name="tube"),
    shapes.box((30.0, 12.0, 18.0)),
    shapes.box((30.0, 25.0, 6.0), holes=[shapes.Hole(4.0, (3.0, 2.0))], name="plate"),
    shapes.Solid("bolt", (SHANK, HEAD)),
]


def mesh_shape(made, fit="off", **more):
    """A mesh of trimesh as a shape."""
    return shapes.MeshShape(make_mesh(made.vertices, made.faces), fit, **more)


def manifold_shape(made, fit="off", **more):
    """A body of manifold3d as a shape."""
    mesh = made.to_mesh64()
    return shapes.MeshShape(make_mesh(np.array(mesh.vert_properties)[:, :3], mesh.tri_verts), fit, **more)


def faceted_shape(solid, error, fit="off"):
    """The solid's mesh within ``error`` mm, corners on the true surface, as a shape."""
    return mesh_shape(mesh(solid, error), fit, name=solid.name)


def cad_model(solid):
    """The model of a solid of Open CASCADE, with counters of its own."""
    return model_of(BrepSolid.of(first_solid(solid), "solid"), Counters())


def cad_scene(a, b, T=None):
    """Two solids of Open CASCADE as parts "a" and "b", the second at ``T``."""
    first, second = (BrepSolid.of(first_solid(solid), "solid") for solid in (a, b))
    return Scene().add("a", first).add("b", second, T)


def pose(axis, angle, place):
    return translation(*place) @ rotation(axis, angle)


def poses(reach):
    """Rigid poses (4, 4) with offsets up to ``reach`` mm along each axis; upright ones are as likely as any."""
    angle = st.one_of(st.floats(0.0, 2.0 * math.pi), st.sampled_from([0.0, 1e-3, math.pi / 2, math.pi]))
    axis = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
    return st.builds(pose, axis, angle, st.tuples(*[st.floats(-reach, reach)] * 3))


def row_of(a, b, T, *, distances=False, cache=None, **scene):
    """The one row of the check of two parts."""
    (row,) = check(Scene(**scene).add("a", a).add("b", b, T), distances=distances, cache=cache).pairs
    return row


def measured_alike(scene, result, cache=None):
    """A check that measures every pair; its verdicts are those of ``result``, which only bounded the distances."""
    complete = check(replace(scene, motions=()), pairs=result.asked, distances=True, cache=cache)
    for row in complete.pairs:
        assert result.verdict(row.a, row.b) is row.verdict, (row.a, row.b)
    return complete
