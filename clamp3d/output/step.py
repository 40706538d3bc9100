"""STEP (AP214) through Open CASCADE: planes and true cylinders, a product tree with names and colours, no facets.

Needs the extra ``step`` (cadquery-ocp-novtk); imported when a file is written.
"""

from __future__ import annotations

import itertools
import re
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from clamp3d.errors import Clamp3dError, InputError
from clamp3d.files.open_cascade import explore
from clamp3d.files.solid import BrepSolid, require_open_cascade
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import Arc
from clamp3d.geometry.shapes import Solid
from clamp3d.output.pages import now
from clamp3d.output.palette import rgb
from clamp3d.output.placed import PlacedPart

UNITS = {"mm": "MM", "cm": "CM", "m": "M", "in": "INCH"}
"""Units of a STEP file that can be chosen, and Open CASCADE's names of them."""

_THROUGH = 1.0  # mm by which a hole's tool stands out at both ends


def step(placed: Sequence[PlacedPart], title: str, unit: str) -> bytes:
    """The parts as one STEP file: an assembly ``title`` if they have poses or are several, else the part alone.

    Its time stamp is the environment's SOURCE_DATE_EPOCH (seconds since 1970), if set. Raises InputError for a part
    that is a mesh, MissingLibraryError without Open CASCADE, Clamp3dError if that fails.
    """
    require_open_cascade()
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Writer

    stamp = f"{now():%Y-%m-%dT%H:%M:%S}"
    document = _document(placed, title)
    writer = STEPCAFControl_Writer()
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    before = Interface_Static.CVal_s("write.step.unit")
    Interface_Static.SetCVal_s("write.step.unit", UNITS[unit])
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "out.step"
            transferred = writer.Transfer(document)
            _header(writer, title, stamp)
            if not transferred or writer.Write(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
                raise Clamp3dError(f"Open CASCADE could not write {title} as STEP")
            content = path.read_bytes()
    finally:
        Interface_Static.SetCVal_s("write.step.unit", before)
    return _canonical(content)


def solid(part: Solid) -> Any:
    """The part as a TopoDS_Shape in its own frame, mm: its extrusions fused, its holes cut.

    Raises MissingLibraryError without Open CASCADE.
    """
    require_open_cascade()
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
    from OCP.BRepCheck import BRepCheck_Analyzer

    shape = _prism(part.bodies[0])
    for body in part.bodies[1:]:
        shape = BRepAlgoAPI_Fuse(shape, _prism(body)).Shape()
    for hole in part.holes:
        shape = BRepAlgoAPI_Cut(shape, _prism(hole, _THROUGH)).Shape()
    shape = _only_solid(shape, part)
    if not BRepCheck_Analyzer(shape).IsValid():
        raise Clamp3dError(f"Open CASCADE finds the solid of {part.name} not valid")
    return shape


def _prism(shape: Extrusion, overlap: float = 0.0) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
    from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pnt, gp_Vec

    frame = shape.frame
    along = frame[:, 2]
    level = shape.start - overlap

    def point(ab: tuple[float, float]) -> Any:
        return gp_Pnt(*(frame @ [*ab, level]).tolist())

    outline = BRepBuilderAPI_MakeWire()
    for edge in shape.profile.edges:
        if isinstance(edge, Arc):
            # Open CASCADE's parameter grows: a concave arc runs about the reversed axis.
            sense = 1.0 if edge.sweep > 0 else -1.0
            axes = gp_Ax2(point(edge.centre), gp_Dir(*(sense * along).tolist()), gp_Dir(*frame[:, 0].tolist()))
            made = BRepBuilderAPI_MakeEdge(gp_Circ(axes, edge.radius), sense * edge.start_angle, sense * edge.end_angle)
        else:
            made = BRepBuilderAPI_MakeEdge(point(edge.start), point(edge.end))
        outline.Add(made.Edge())
    face = BRepBuilderAPI_MakeFace(outline.Wire()).Face()
    return BRepPrimAPI_MakePrism(face, gp_Vec(*(along * (shape.length + 2.0 * overlap)).tolist())).Shape()


def _only_solid(shape: Any, part: Solid) -> Any:
    solids = list(explore(shape, "SOLID"))
    if len(solids) != 1:
        raise Clamp3dError(f"Open CASCADE makes {len(solids)} solids of {part.name}, expected 1")
    return solids[0]


def _document(placed: Sequence[PlacedPart], title: str) -> Any:
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    def name(label: Any, text: str) -> None:
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(text, True))

    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1e-3)  # metres: the shapes are in mm
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    instances = Counter(id(item.shape) for item in placed if isinstance(item.shape, BrepSolid))
    tree = len(placed) > 1 or placed[0].T_world_part is not None
    root = shapes.NewShape() if tree else None
    if tree:
        name(root, title)
    for item in placed:
        label = shapes.AddShape(exact_solid(item), False)  # one product for all instances of a shape from CAD
        name(label, item.shape.name if instances[id(item.shape)] > 1 else item.label)
        r, g, b = (channel / 255 for channel in rgb(item.colour))
        colour = Quantity_Color(r, g, b, Quantity_TypeOfColor.Quantity_TOC_sRGB)
        colours.SetColor(label, colour, XCAFDoc_ColorType.XCAFDoc_ColorGen)
        if tree:
            name(shapes.AddComponent(root, label, location(item.T)), item.label)
    shapes.UpdateAssemblies()
    return document


def exact_solid(item: PlacedPart) -> Any:
    """The TopoDS_Shape of a part: drawn anew, or as it came from CAD. Raises InputError for a mesh."""
    if isinstance(item.shape, BrepSolid):
        return item.shape.solid
    if isinstance(item.shape, Solid):
        return solid(item.shape)
    raise InputError(f"{item.name} is a mesh: STEP holds true faces, not facets; use stl, obj, ply, glb or 3mf")


def location(T: Array) -> Any:
    """A pose (4, 4) in mm as a TopLoc_Location."""
    from OCP.gp import gp_Trsf
    from OCP.TopLoc import TopLoc_Location

    transform = gp_Trsf()
    transform.SetValues(*T[:3].flatten().tolist())
    return TopLoc_Location(transform)


def _canonical(content: bytes) -> bytes:
    """The same file, the same bytes each time.

    Open CASCADE numbers the instances of an assembly for as long as the process lives, and lists the colours in the
    order of their addresses: instances are numbered from 1 here, colours follow the order of their solids.
    """
    count = itertools.count(1)
    content = re.sub(
        rb"NEXT_ASSEMBLY_USAGE_OCCURRENCE\('\d+',(.*?)\);",
        lambda m: b"NEXT_ASSEMBLY_USAGE_OCCURRENCE('%d',%s);" % (next(count), re.sub(rb"\n *", b"", m[1])),
        content,
        flags=re.DOTALL,
    )
    colour = rb"^#\d+ = MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION"
    first = re.search(colour, content, re.MULTILINE)
    if first is None:
        return content
    end = content.index(b"ENDSEC;", first.start())
    blocks = [
        block for block in re.split(rb"(?=%s)" % colour, content[first.start() : end], flags=re.MULTILINE) if block
    ]
    blocks.sort(key=lambda block: int(re.search(rb"STYLED_ITEM\('[^']*',\([^)]*\),#(\d+)\)", block)[1]))  # type: ignore[index]
    tail = b"".join(blocks)
    old = [int(number) for number in re.findall(rb"^#(\d+) = ", tail, re.MULTILINE)]
    new = {before: min(old) + i for i, before in enumerate(old)}
    tail = re.sub(rb"#(\d+)", lambda m: b"#%d" % new.get(int(m[1]), int(m[1])), tail)
    return content[: first.start()] + tail + content[end:]


def _header(writer: Any, title: str, stamp: str) -> None:
    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.TCollection import TCollection_HAsciiString

    header = APIHeaderSection_MakeHeader(writer.ChangeWriter().Model())
    header.SetName(TCollection_HAsciiString(title.encode("ascii", "replace").decode()))
    header.SetAuthorValue(1, TCollection_HAsciiString(""))
    header.SetOrganizationValue(1, TCollection_HAsciiString(""))
    header.SetTimeStamp(TCollection_HAsciiString(stamp))
    header.SetOriginatingSystem(TCollection_HAsciiString("clamp3d"))
