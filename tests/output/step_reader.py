"""STEP files as Open CASCADE's own reader finds them, for files that clamp3d wrote."""

from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Quantity import Quantity_Color
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_ChildIterator, TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_ColorTool, XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from tests.cad import matrix, volume


class Leaf:
    """A part of a product tree.

    ``name`` of its component; ``path``: names of the products from the root to its own; ``shape`` at its pose ``T``
    (3, 4), mm; ``solid``: the same for all places of a shape; ``colour`` and ``face_colours`` "#RRGGBB".
    """

    def __init__(self, name, path, label, place, colour):
        self.name, self.path, self.colour = name, path, colour or colour_of(label)
        shape = XCAFDoc_ShapeTool.GetShape_s(label)
        self.shape, self.solid, self.volume = shape.Moved(place), shape.TShape(), volume(shape, 1e-9)
        self.T = matrix(place)[:3]
        self.face_colours = sorted(filter(None, map(colour_of, children(label))))


def read_step(path):
    """The parts in the order of the tree; lengths in mm whatever the file's unit."""
    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    reader = STEPCAFControl_Reader()
    assert reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone
    assert reader.Transfer(document)

    def walk(label, place, above, name, colour):
        names = (*above, name_of(label))
        components = [child for child in children(label) if XCAFDoc_ShapeTool.IsComponent_s(child)]
        if not components:
            yield Leaf(name, names, label, place, colour)
        for component in components:
            product = TDF_Label()
            XCAFDoc_ShapeTool.GetReferredShape_s(component, product)
            at = place.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(component))
            yield from walk(product, at, names, name_of(component), colour_of(component))

    products = children(XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).BaseLabel())
    (root,) = (label for label in products if XCAFDoc_ShapeTool.IsFree_s(label))
    return list(walk(root, TopLoc_Location(), (), name_of(root), None))


def children(label):
    walk = TDF_ChildIterator(label)
    while walk.More():
        yield walk.Value()
        walk.Next()


def name_of(label):
    attribute = TDataStd_Name()
    assert label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
    return attribute.Get().ToExtString()


def colour_of(label):
    colour = Quantity_Color()
    if XCAFDoc_ColorTool.GetColor_s(label, XCAFDoc_ColorType.XCAFDoc_ColorSurf, colour):
        return Quantity_Color.ColorToHex_s(colour).ToCString()
    return None
