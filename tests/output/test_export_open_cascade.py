"""Files read back by Open CASCADE: STEP with true surfaces, names, colours and units; GLB in mm, Z up."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from clamp3d.clamp.dimensions import PARTS, TITLES, Clamp
from clamp3d.clamp.parts import parts
from clamp3d.engine.check import check
from clamp3d.engine.scene import Scene
from clamp3d.geometry import shapes
from clamp3d.geometry.pose import translation
from clamp3d.output.export import export
from clamp3d.output.palette import PART_COLOURS

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")


@dataclass
class Product:
    name: str
    shape: Any  # placed
    T: np.ndarray
    colour: list[int] | None


def read_step(path: Path) -> tuple[str, list[Product]]:
    """Name of the root product and its leaves (itself, if it has none); lengths in mm whatever the file's unit."""
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.STEPCAFControl import STEPCAFControl_Reader

    document = new_document()
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    assert reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone
    assert reader.Transfer(document)
    return products(document)


def new_document() -> Any:
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document

    return TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))


def no_labels() -> Any:
    """An empty sequence of labels, whose class has another name since OCP 8."""
    try:
        from OCP.collections import Sequence_TDF_Label as Labels
    except ModuleNotFoundError:
        from OCP.TDF import TDF_LabelSequence as Labels
    return Labels()


def products(document: Any) -> tuple[str, list[Product]]:
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    free = no_labels()
    shapes.GetFreeShapes(free)
    (root,) = list(free)
    return name_of(root), list(_leaves(document, root, TopLoc_Location()))


def _leaves(document: Any, label: Any, place: Any) -> Iterator[Product]:
    from OCP.TDF import TDF_Label
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    children = no_labels()
    if XCAFDoc_ShapeTool.GetComponents_s(label, children):
        for component in list(children):
            referred = TDF_Label()
            assert XCAFDoc_ShapeTool.GetReferredShape_s(component, referred)
            yield from _leaves(document, referred, place.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(component)))
    else:
        M = place.Transformation()
        T = np.vstack([[[M.Value(i, j) for j in range(1, 5)] for i in range(1, 4)], [0, 0, 0, 1]])
        shape = XCAFDoc_ShapeTool.GetShape_s(label).Moved(place)
        yield Product(name_of(label), shape, T, _colour(document, label))


def name_of(label: Any) -> str:
    from OCP.TDataStd import TDataStd_Name

    attribute = TDataStd_Name()
    assert label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
    return str(attribute.Get().ToExtString())


def faces(shape: Any) -> Iterator[Any]:
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        yield TopoDS.Face(explorer.Current())
        explorer.Next()


def volume(shape: Any) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-9)
    return float(properties.Mass())


def bounds(shape: Any) -> np.ndarray:
    """Tight box (2, 3) of a shape, arcs taken as arcs."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    low, high = box.CornerMin(), box.CornerMax()
    return np.array([[low.X(), low.Y(), low.Z()], [high.X(), high.Y(), high.Z()]])


def _colour(document: Any, label: Any) -> list[int] | None:
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.XCAFDoc import XCAFDoc_ColorTool, XCAFDoc_ColorType

    colour = Quantity_Color()
    for kind in (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen):
        if XCAFDoc_ColorTool.GetColor_s(label, kind, colour):
            values = colour.Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)
            return [round(255 * value) for value in values]
    return None


def surfaces(shape: Any) -> list[Any]:
    from OCP.BRep import BRep_Tool

    return [BRep_Tool.Surface_s(face) for face in faces(shape)]


@pytest.mark.parametrize("unit", ["mm", "in", "m"])
def test_step_assembly(reference: Clamp, odd_poses: dict, odd_scene: Scene, tmp_path: Path, unit: str) -> None:
    written = export(odd_scene, tmp_path, format="step", unit=unit)
    text = written.files[0].read_text()
    assert {"mm": "SI_UNIT(.MILLI.,.METRE.)", "in": "CONVERSION_BASED_UNIT('INCH'", "m": "SI_UNIT($,.METRE.)"}[
        unit
    ] in text
    root, found = read_step(written.files[0])
    assert root == "reference"
    assert [product.name for product in found] == [f"{name} {TITLES[name]}" for name in PARTS]
    for name, product in zip(PARTS, found, strict=True):
        part = parts(reference)[name]
        np.testing.assert_allclose(product.T, odd_poses[name], atol=1e-9)
        assert volume(product.shape) == pytest.approx(part.volume, rel=1e-9)
        np.testing.assert_allclose(bounds(product.shape), part.bounds_at(odd_poses[name]), atol=2e-6)
        assert product.colour == list(trimesh.visual.color.hex_to_rgba(PART_COLOURS[name])[:3])


def test_step_keeps_cylinders_as_cylinders_and_planes_as_planes(reference: Clamp, tmp_path: Path) -> None:
    written = export(reference, tmp_path, format="step", layout="parts")
    radii: dict[str, Counter[float]] = {}
    for name, path in zip(PARTS, written.files, strict=True):
        root, (product,) = read_step(path)
        assert root == f"{name} {TITLES[name]}"
        kinds = surfaces(product.shape)
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


def test_step_manifest(odd_scene: Scene, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    written = export(odd_scene, tmp_path, format="step")
    assert capfd.readouterr().out == ""  # stdout is for data
    listing = json.loads(written.manifest.read_text())
    assert (listing["unit"], listing["mesh_error_mm"]) == ("mm", None)
    _, found = read_step(written.files[0])
    for name, product in zip(PARTS, found, strict=True):
        entry = listing["parts"][name]
        assert entry["chord_error_mm"] == 0.0
        assert entry["volume_mm3"] == pytest.approx(volume(product.shape), rel=1e-9)
        np.testing.assert_allclose(entry["bounds"], bounds(product.shape), atol=2e-6)


@pytest.mark.parametrize("suffix", ["step", "glb"])
def test_clashes_are_bodies_of_their_own(tmp_path: Path, suffix: str) -> None:
    """Two turned boxes and a pin in one of them: the common parts, calculated by hand, under the pairs' names."""
    scene = Scene().add("a", shapes.box((10, 10, 10)), translation(3, 0, 0)).add("b", shapes.box((10, 10, 10)))
    scene = scene.moved({"b": translation(11, 2, 1)}).add("pin", shapes.cylinder(1.0, 4.0), translation(3, 0, 6))
    path = export(check(scene), tmp_path / f"all.{suffix}").files[0]
    common = {"clash a - b": 2.0 * 8.0 * 9.0, "clash a - pin": np.pi * 1.0}
    if suffix == "step":
        volumes = {p.name: solid_volume(p.shape) for p in read_step(path)[1]}
        tolerance = 1e-9
    else:
        read = trimesh.load(path)
        volumes = {name: read.geometry[read.graph[name][1]].volume * 1e9 for name in read.graph.nodes_geometry}
        tolerance = 0.02
    assert volumes.keys() == {"a", "b", "pin", *common}
    for name, volume in common.items():
        assert volumes[name] == pytest.approx(volume, rel=tolerance)


def solid_volume(shape: Any) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())
