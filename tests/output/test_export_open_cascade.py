"""Files read back by Open CASCADE: STEP with true surfaces, names, colours and units; GLB in mm, Z up."""

import json
from collections import Counter

import numpy as np
import pytest
import trimesh

from clamp3d import Scene, check, export, shapes
from clamp3d.clamp.dimensions import PARTS, TITLES
from clamp3d.clamp.parts import parts
from clamp3d.files.formats import UNITS_MM
from clamp3d.kernel import translation
from clamp3d.output.palette import PART_COLOURS

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")


from clamp3d.files.open_cascade import explore, occ
from tests.cad import bounds
from tests.output.step_reader import read_step


@pytest.mark.parametrize(
    ("unit", "words"),
    [("mm", "SI_UNIT(.MILLI.,.METRE.)"), ("in", "CONVERSION_BASED_UNIT('INCH'"), ("m", "SI_UNIT($,.METRE.)")],
)
def test_step_assembly(reference, odd_poses, odd_scene, tmp_path, capfd, unit, words):
    written = export(odd_scene, tmp_path, format="step", unit=unit)
    assert capfd.readouterr().out == ""  # stdout is for data
    assert words in written.files[0].read_text()
    leaves = read_step(written.files[0])
    listing = json.loads(written.manifest.read_text())
    assert (listing["unit"], listing["mesh_error_mm"]) == (unit, None)
    assert [leaf.path for leaf in leaves] == [("reference", f"{name} {TITLES[name]}") for name in PARTS]
    for name, product in zip(PARTS, leaves, strict=True):
        part, entry = parts(reference)[name], listing["parts"][name]
        np.testing.assert_allclose(product.T, odd_poses[name][:3], atol=1e-9)
        assert product.volume == pytest.approx(part.volume, rel=1e-9) == entry["volume_mm3"]
        box = bounds(product.shape)
        np.testing.assert_allclose(box, part.bounds_at(odd_poses[name]), atol=2e-6)
        np.testing.assert_allclose(np.array(entry["bounds"]) * UNITS_MM[unit], box, atol=2e-6)
        assert (product.colour, entry["chord_error_mm"]) == (PART_COLOURS[name], 0.0)


def test_step_keeps_cylinders_as_cylinders_and_planes_as_planes(reference, tmp_path):
    written = export(reference, tmp_path, format="step", layout="parts")
    radii = {}
    for name, path in zip(PARTS, written.files, strict=True):
        (product,) = read_step(path)
        assert product.path == (f"{name} {TITLES[name]}",)
        kinds = [occ.BRep_Tool.Surface_s(face) for face in explore(product.shape, "FACE")]
        assert {type(surface).__name__ for surface in kinds} <= {"Geom_Plane", "Geom_CylindricalSurface"}
        radii[name] = Counter(round(s.Radius(), 9) for s in kinds if type(s).__name__ == "Geom_CylindricalSurface")
    assert radii == {
        "P1": {23.8012: 2, 11.0: 1},
        "P2": {23.8012: 2, 48.0: 1},
        "P3": {49.23: 1, 11.0: 1},
        "P4": {10.0: 1},
        "P5": {10.0: 1},
        "P6": {16.335: 1},
        "P7": {7.125: 1},
    }


def test_a_sphere_is_a_sphere_in_step(tmp_path):
    scene = Scene().add("ball", shapes.sphere(5.0), translation(1.0, 2.0, 3.0))
    (file,) = export(scene, tmp_path / "ball.step").files
    (product,) = read_step(file)
    assert product.volume == pytest.approx(4.0 / 3.0 * np.pi * 125.0, rel=1e-9)
    np.testing.assert_allclose(bounds(product.shape), [[-4.0, -3.0, -2.0], [6.0, 7.0, 8.0]], atol=2e-6)
    (surface,) = (occ.BRep_Tool.Surface_s(face) for face in explore(product.shape, "FACE"))
    assert type(surface).__name__ == "Geom_SphericalSurface"


@pytest.mark.parametrize("suffix", ["step", "glb"])
def test_clashes_are_bodies_of_their_own(tmp_path, suffix):
    """Two turned boxes and a pin in one of them: the common parts, calculated by hand, under the pairs' names."""
    scene = Scene().add("a", shapes.box((10, 10, 10)), translation(3, 0, 0)).add("b", shapes.box((10, 10, 10)))
    scene = scene.moved({"b": translation(11, 2, 1)}).add("pin", shapes.cylinder(1.0, 4.0), translation(3, 0, 6))
    path = export(check(scene), tmp_path / f"all.{suffix}").files[0]
    common = {"clash a - b": 2.0 * 8.0 * 9.0, "clash a - pin": np.pi * 1.0}
    if suffix == "step":
        volumes = {leaf.name: leaf.volume for leaf in read_step(path)}
        tolerance = 1e-9
    else:
        read = trimesh.load(path)
        volumes = {name: read.geometry[read.graph[name][1]].volume * 1e9 for name in read.graph.nodes_geometry}
        tolerance = 0.02
    assert volumes.keys() == {"a", "b", "pin", *common}
    for name, volume in common.items():
        assert volumes[name] == pytest.approx(volume, rel=tolerance)
