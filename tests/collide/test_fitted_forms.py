"""What stands for a fitted mesh holds the part that the mesh was made from, to within the error that it states."""

import math

import numpy as np
import pytest
import trimesh

from clamp3d import shapes
from clamp3d.collide.model import ModelCache
from clamp3d.collide.surface import Surface, at_edges
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.linear import to_source
from clamp3d.core.mesh import make_mesh
from clamp3d.core.profile import Arc, Profile
from clamp3d.testing import body
from tests.kinds import DRAWN, faceted_shape

HALF_ROUND = Profile.of((-4.0, 0.0), (-4.0, -6.0), (4.0, -6.0), (4.0, 0.0), Arc((0.0, 0.0), 4.0, 0.0, math.pi))
ROUND_BACK = shapes.Solid("round back", (Extrusion(HALF_ROUND, "Z", -3.0, 5.0),))
KEYED = shapes.Solid(
    "keyed shaft",
    (
        Extrusion(Profile.circle(5.0), "Z", -9.0, 9.0),
        Extrusion(Profile.rectangle(3.0, 3.0, (5.0, 0.0)), "Z", -4.0, 4.0),
    ),
)
STEPPED = shapes.Solid(
    "stepped shaft", (Extrusion(Profile.circle(5.0), "Z", -9.0, 0.0), Extrusion(Profile.circle(3.0), "Z", 0.0, 9.0))
)
FLANGED = shapes.Solid(
    "flanged shaft",
    tuple(Extrusion(Profile.circle(r), "Z", low, high) for r, low, high in ((5, -9, -1), (8, -1, 1), (5, 1, 9))),
)


@pytest.mark.parametrize("fit", ["bound", "round"])
@pytest.mark.parametrize(
    "shape", [*DRAWN[:5], *DRAWN[6:], ROUND_BACK, KEYED, STEPPED, FLANGED], ids=lambda shape: shape.name
)
def test_the_forms_of_a_fitted_mesh_hold_the_part(shape, fit):
    """Points all over its surface: chords of round sides lie inside, so the hull of the corners alone does not."""
    model, solid = ModelCache().model(faceted_shape(shape, 0.3, fit)), body(shape)
    rng = np.random.default_rng(0)
    x = rng.uniform(*solid.box, (60_000, 3))
    x = x[solid.field(x) <= 0.0]
    x = np.vstack([x, ModelCache().model(shape).inner(0.002).vertices])
    deepest = np.full(len(x), -np.inf)
    for form in model.bodies:
        depth = np.min([piece.depth(x) for piece in form.outers], axis=0)
        for bore in form.bores:
            local = to_source(bore.T, x)
            out = np.hypot(local[:, 0], local[:, 1]) - bore.radius
            behind = local[:, 1] <= -bore.radius * math.cos(bore.half_angle) + 1e-9  # a groove's mouth ends its hollow
            depth = np.minimum(depth, out if bore.half_angle == math.pi else np.where(behind, out, np.inf))
        deepest = np.maximum(deepest, depth + form.error)
    assert deepest.min() >= -1e-9
    # And it is no wider than tangents are, at the corners of a hull and about the errors of the fit.
    for form in model.bodies:
        assert (form.bounds[0] >= solid.box[0] - form.error - 0.35).all()
        assert (form.bounds[1] <= solid.box[1] + form.error + 0.35).all()


@pytest.mark.parametrize("fit", ["bound", "round"])
def test_points_told_to_be_inside_a_fitted_part_are(fit):
    """As deep as said, and on fitted surfaces within the error; what is said of the outside is no nearer than it is."""
    for shape in (ROUND_BACK, DRAWN[0], DRAWN[6]):
        solid, fine = body(shape), ModelCache().model(shape).outer(0.002)
        for form in ModelCache().model(faceted_shape(shape, 0.3, fit)).bodies:
            if form.surface is None:
                continue
            x = np.random.default_rng(1).uniform(solid.box[0] - 1.0, solid.box[1] + 1.0, (4000, 3))
            depth, field = form.depth(x), solid.field(x)
            assert (field[depth > 0.0] <= 1e-9).all()
            assert (depth <= fine.depth(x) + 0.004)[depth > 0.0].all()
            assert (depth > 0.0).any()
            assert (depth[field > 1e-9] <= 0.0).all()


@pytest.mark.parametrize("fit", ["bound", "round"])
def test_a_key_in_a_hole_is_no_air(fit):
    """What stands into the circle of a hole or of a groove is the part's: the hole does not take it away."""
    tube = trimesh.creation.annulus(5.0, 9.0, 20.0, sections=64)
    key = trimesh.creation.box(bounds=[(3.0, -1.0, -10.0), (7.0, 1.0, 10.0)])
    made = trimesh.boolean.union([tube, key], engine="manifold")
    x = np.array([(3.5, 0.0, 0.0), (4.0, 0.5, 9.0), (7.0, 0.0, 0.0)])
    for form in ModelCache().model(shapes.MeshShape(make_mesh(made.vertices, made.faces), fit)).bodies or ():
        depth = np.min([piece.depth(x) for piece in form.outers], axis=0)
        for bore in form.bores:
            local = to_source(bore.T, x)
            depth = np.minimum(depth, np.hypot(local[:, 0], local[:, 1]) - bore.radius)
        assert (depth + form.error >= 0.0).all()


@pytest.mark.parametrize(("degrees", "wider"), [(28.0, False), (29.5, False), (30.5, True), (32.0, True)])
def test_facets_that_meet_at_more_than_thirty_degrees_are_of_two_patches(degrees, wider):
    """Both bulge: at the edge of two patches their errors add up, within one patch each is its own."""
    turn = math.radians(degrees)
    V = np.array([(0, 0, 0), (0, 1, 0), (-1, 0, 0), (math.cos(turn), 0, -math.sin(turn))], dtype=float)
    F = np.array([(0, 1, 2), (1, 0, 3)])
    found = at_edges(V, F, np.array([0.1, 0.2]))
    assert found == pytest.approx([0.3, 0.3] if wider else [0.1, 0.2], abs=1e-12)
    flat = at_edges(V, F, np.array([0.0, 0.2]))
    assert flat == pytest.approx([0.0, 0.2], abs=1e-12)
    assert at_edges(V, F, np.array([0.1, 0.2]), np.array([0, 1])) == pytest.approx([0.3, 0.3], abs=1e-12)
    assert at_edges(V, F, np.array([0.1, 0.2]), np.array([0, 0])) == pytest.approx([0.1, 0.2], abs=1e-12)


def test_the_error_at_an_acute_edge_grows_with_its_angle():
    """Two flanks that bulge by 0.1 and 0.2 mm meet within the sum of both over the sine of the angle between them."""
    for degrees in (20.0, 60.0, 85.0):
        wedge = math.radians(degrees)
        V = np.array([(0, 0, 0), (0, 0, 1), (-1, 0, 0), (-math.cos(wedge), -math.sin(wedge), 0)], dtype=float)
        F = np.array([(1, 0, 2), (0, 1, 3)])
        normal = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
        assert normal[0] @ [0, 1, 0] > 0.0 or normal[1] @ [0, 1, 0] > 0.0
        found = at_edges(V, F, np.array([0.1, 0.2]))
        assert found == pytest.approx(np.full(2, 0.3 / math.sin(wedge)), rel=1e-9)
    assert Surface(V, F, found).error == found.max()
