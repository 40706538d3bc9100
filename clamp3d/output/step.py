"""STEP (AP214) through Open CASCADE: true faces, and the tree, names and colours of the file that parts came from.

Needs the extra ``step`` (cadquery-ocp-novtk); imported when a file is written.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from clamp3d.errors import Clamp3dError, InputError
from clamp3d.files.bodies import Component, printable
from clamp3d.files.open_cascade import explore, location, occ, parse, require_open_cascade
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import Array, inverse
from clamp3d.geometry.profile import Arc
from clamp3d.geometry.shapes import Solid, Sphere
from clamp3d.output.placed import PlacedPart

UNITS = {"mm": "MM", "cm": "CM", "m": "M", "in": "INCH"}
"""Units of a STEP file that can be chosen, and Open CASCADE's names of them."""

_THROUGH = 1.0  # mm by which a hole's tool stands out at both ends


def step(placed: Sequence[PlacedPart], title: str, unit: str) -> bytes:
    """The parts as one STEP file: an assembly, or the part alone if there is one and it has no pose.

    Parts from a file stand in its tree of assemblies, the others in the assembly ``title``. Raises InputError for a
    part that is a mesh, MissingLibraryError without Open CASCADE, Clamp3dError if that fails.
    """
    require_open_cascade()
    tree = _Tree(title, placed)
    writer = occ.STEPCAFControl_Writer()
    before = occ.Interface_Static.CVal_s("write.step.unit")
    occ.Interface_Static.SetCVal_s("write.step.unit", UNITS[unit])
    try:
        stream, done = io.BytesIO(), occ.IFSelect_ReturnStatus.IFSelect_RetDone
        if not writer.Transfer(tree.document) or writer.WriteStream(stream) != done:
            raise Clamp3dError(f"Open CASCADE could not write {title} as STEP")
        return stream.getvalue()
    finally:
        occ.Interface_Static.SetCVal_s("write.step.unit", before)


class _Tree:
    """A document of Open CASCADE (XDE) with a product for each shape, and a component for each place of one."""

    def __init__(self, title: str, placed: Sequence[PlacedPart]) -> None:
        self.document = occ.TDocStd_Document(occ.TCollection_ExtendedString("XmlOcaf"))
        occ.XCAFDoc_DocumentTool.SetLengthUnit_s(self.document, 1e-3)  # metres: the shapes are in mm
        self._shapes = occ.XCAFDoc_DocumentTool.ShapeTool_s(self.document.Main())
        self._colours = occ.XCAFDoc_DocumentTool.ColorTool_s(self.document.Main())
        self._products: dict[tuple[int, bool], tuple[Any, str]] = {}
        self._assemblies: dict[Component | None, tuple[Any, Array]] = {}
        if len(placed) == 1 and _stands_alone(placed[0]):
            self._product(placed[0])
            return
        tops = {top for item in placed if item.component and (top := _top(item.component)) is not item.component}
        root = tops.pop() if len(tops) == 1 else None  # else an assembly of assemblies
        label = _named(self._shapes.NewShape(), title if root is None else root.name)
        self._assemblies |= {None: (label, np.eye(4)), root: (label, np.eye(4) if root is None else root.T)}
        for item in placed:
            self._add(item)
        self._shapes.UpdateAssemblies()

    def _add(self, item: PlacedPart) -> None:
        holder, T = self._assembly(item.component.assembly if item.component else None)
        product, colour = self._product(item)
        label = _named(self._shapes.AddComponent(holder, product, location(inverse(T) @ item.T)), item.label)
        if item.colour != colour:
            self._paint(label, item.colour)

    def _assembly(self, component: Component | None) -> tuple[Any, Array]:
        """Label and pose of an assembly. Each use of one is a product, so that its parts have names of their own."""
        if component not in self._assemblies:
            assert component is not None
            holder, T = self._assembly(component.assembly)
            label = _named(self._shapes.NewShape(), component.name)
            _named(self._shapes.AddComponent(holder, label, location(inverse(T) @ component.T)), component.instance)
            self._assemblies[component] = label, component.T
        return self._assemblies[component]

    def _product(self, item: PlacedPart) -> tuple[Any, str]:
        """Label and colour of a part's shape: those of its first place."""
        face_colours = item.component.face_colours if item.component else {}
        key = id(item.shape), bool(face_colours)
        if key not in self._products:
            shape = exact_solid(item)
            label = self._shapes.AddShape(shape, False)
            self._products[key] = label, item.colour
            _named(label, item.component.name if item.component else item.label)
            self._paint(label, item.colour)
            faces = [*explore(shape, "FACE")]
            for number, colour in face_colours.items():
                self._paint(self._shapes.AddSubShape(label, faces[number]), colour)
        return self._products[key]

    def _paint(self, label: Any, colour: str) -> None:

        value = occ.Quantity_Color()
        occ.Quantity_Color.ColorFromHex_s(colour, value)
        self._colours.SetColor(label, value, occ.XCAFDoc_ColorType.XCAFDoc_ColorGen)


def _stands_alone(item: PlacedPart) -> bool:
    """Whether a part has no pose, or is the one product of its file."""
    is_product = item.component is not None and item.component.assembly is None
    return item.T_world_part is None or (is_product and np.array_equal(item.T, np.eye(4)))


def _top(component: Component) -> Component:
    """The outermost assembly that holds a component."""
    while component.assembly is not None:
        component = component.assembly
    return component


def _named(label: Any, text: str) -> Any:
    """The label with a name."""

    occ.TDataStd_Name.Set_s(label, occ.TCollection_ExtendedString(printable(text), True))
    return label


def solid(part: Solid) -> Any:
    """The part as a TopoDS_Shape in its own frame, mm: its extrusions fused, its holes cut.

    Raises MissingLibraryError without Open CASCADE.
    """
    shape = _prism(part.bodies[0])
    for body in part.bodies[1:]:
        shape = occ.BRepAlgoAPI_Fuse(shape, _prism(body)).Shape()
    for hole in part.holes:
        shape = occ.BRepAlgoAPI_Cut(shape, _prism(hole, _THROUGH)).Shape()
    solids = [*explore(shape, "SOLID")]
    if len(solids) != 1 or not occ.BRepCheck_Analyzer(solids[0]).IsValid():
        raise Clamp3dError(f"Open CASCADE makes no valid solid of {part.name}")
    return solids[0]


def _prism(shape: Extrusion, overlap: float = 0.0) -> Any:

    frame = shape.frame
    along = frame[:, 2]
    level = shape.start - overlap

    def point(ab: tuple[float, float]) -> Any:
        return occ.gp_Pnt(*(frame @ [*ab, level]).tolist())

    outline = occ.BRepBuilderAPI_MakeWire()
    for edge in shape.profile.edges:
        if isinstance(edge, Arc):
            # Open CASCADE's parameter grows: a concave arc runs about the reversed axis.
            sense = 1.0 if edge.sweep > 0 else -1.0
            normal, first = (occ.gp_Dir(*v.tolist()) for v in (sense * along, frame[:, 0]))
            circle = occ.gp_Circ(occ.gp_Ax2(point(edge.centre), normal, first), edge.radius)
            made = occ.BRepBuilderAPI_MakeEdge(circle, sense * edge.start_angle, sense * edge.end_angle)
        else:
            made = occ.BRepBuilderAPI_MakeEdge(point(edge.start), point(edge.end))
        outline.Add(made.Edge())
    face = occ.BRepBuilderAPI_MakeFace(outline.Wire()).Face()
    return occ.BRepPrimAPI_MakePrism(face, occ.gp_Vec(*(along * (shape.length + 2.0 * overlap)).tolist())).Shape()


def exact_solid(item: PlacedPart) -> Any:
    """The TopoDS_Shape of a part: drawn anew, or as it came from CAD. Raises InputError for a mesh."""
    if isinstance(item.shape, BrepSolid):
        return parse(item.shape.brep)  # a new one: equal solids of two products stay two
    if isinstance(item.shape, Solid):
        return solid(item.shape)
    if isinstance(item.shape, Sphere):
        return occ.BRepPrimAPI_MakeSphere(item.shape.radius).Solid()
    raise InputError(f"{item.name} is a mesh: STEP holds true faces, not facets; use stl, obj, ply, glb or 3mf")
