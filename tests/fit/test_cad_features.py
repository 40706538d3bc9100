"""Features of STEP solids are their cylindrical faces: no other face is one, and arcs apart stay apart."""

import math

import numpy as np
import pytest

pytest.importorskip("OCP")

from clamp3d import fit_file
from clamp3d.files.bodies import Body, Reading
from clamp3d.files.solid import BrepSolid
from clamp3d.fit.cad import cad_features
from tests.cad import cone, cut, location, ring, rod, shift
from tests.files.assemblies import box, fuse, solid_of, write_step


def features(shape):
    return cad_features(Reading((Body("part", BrepSolid.of(solid_of(shape), "part"), np.eye(4)),)), "part")


@pytest.mark.parametrize(
    ("shape", "note"), [(cone(2.5, 2.0, 0, 20), "1 cone"), (ring(9, 1.5), "1 torus"), (box((0, 0, 0), (1, 1, 1)), None)]
)
def test_what_is_no_cylinder_is_named_and_not_one(shape, note):
    _, found, notes = features(shape)
    assert found == []
    assert notes == ([] if note is None else [f"faces that are no cylinders: {note}"])


def test_arcs_apart_on_one_axis_stay_apart():
    slotted = cut(rod(10, 0, 8), box((-11, -3, -1), (11, 3, 9)), box((-3, -3, -1), (3, 3, 9)))
    whole = fuse(slotted, rod(5, 0, 8))
    _, found, _ = features(whole)
    arcs = [values for sense, values in found if values["radius"] == pytest.approx(10.0)]
    assert len(arcs) == 2
    for values in arcs:
        assert 2.0 * values["half_angle"] == pytest.approx(math.pi - 2.0 * math.asin(0.3), abs=1e-9)
        assert values["covered_area"] == pytest.approx(2.0 * values["half_angle"] * 10.0 * 8.0)
        assert values["arc_error"] < 1e-9
        assert values["length_error"] < 1e-9


@pytest.mark.parametrize("aside", [0.8, 0.01])
def test_two_bores_that_cut_each_other_are_two(aside):
    _, found, _ = features(cut(box((-20, -20, 0), (20, 20, 6)), rod(5, -1, 7), rod(5, -1, 7, aside)))
    assert [values["radius"] for _, values in found] == [5.0, 5.0]


def test_a_file_gives_holes_grooves_and_cylinders_with_their_places(tmp_path):
    plate = cut(box((-20, -10, 0), (20, 10, 6)), rod(3, -1, 7, 5, 2), rod(2, 3, 7, -8), rod(4, -1, 7, 20))
    pin = rod(2.5, 0, 30).Located(location(shift(60)))
    result = fit_file(write_step({"plate": plate, "pin": pin}, tmp_path / "a.step"))
    through, blind = result.holes
    (pin,), (groove,) = result.cylinders, result.grooves
    assert (through.radius, through.through, blind.radius, blind.through) == (3.0, True, 2.0, False)
    assert (groove.half_angle, pin.half_angle) == (pytest.approx(math.pi / 2), math.pi)
    for feature, middle, length in (
        (through, (5, 2, 3), 6), (blind, (-8, 0, 4.5), 3), (pin, (60, 0, 15), 30), (groove, (20, 0, 3), 6),
    ):  # fmt: skip
        np.testing.assert_allclose(feature.T_part_feature[:3, 3], middle, atol=1e-9)
        assert feature.length == pytest.approx(length)
        assert feature.error_bound < 1e-9
        assert np.linalg.det(feature.T_part_feature) == pytest.approx(1.0)
        local = (result.mesh.vertices[result.mesh.faces[feature.faces]] - middle) @ feature.T_part_feature[:3, :3]
        np.testing.assert_allclose(np.hypot(local[..., 0], local[..., 1]), feature.radius, atol=1e-9)
        assert np.abs(np.arctan2(local[..., 0], -local[..., 1])).max() <= feature.half_angle + 1e-9
