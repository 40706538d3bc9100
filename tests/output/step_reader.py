"""STEP files as Open CASCADE's own reader finds them, for files that clamp3d wrote."""

from clamp3d.files.open_cascade import occ
from tests.cad import matrix, volume


class Leaf:
    """A part of a product tree.

    ``name`` of its component; ``path``: names of the products from the root to its own; ``shape`` at its pose ``T``
    (3, 4), mm; ``solid``: the same for all places of a shape; ``colour`` and ``face_colours`` "#RRGGBB".
    """

    def __init__(self, name, path, label, place, colour):
        self.name, self.path, self.colour = name, path, colour or colour_of(label)
        shape = occ.XCAFDoc_ShapeTool.GetShape_s(label)
        self.shape, self.solid, self.volume = shape.Moved(place), shape.TShape(), volume(shape, 1e-9)
        self.T = matrix(place)[:3]
        self.face_colours = sorted(filter(None, map(colour_of, children(label))))


def read_step(path):
    """The parts in the order of the tree; lengths in mm whatever the file's unit."""
    document = occ.TDocStd_Document(occ.TCollection_ExtendedString("XmlOcaf"))
    reader = occ.STEPCAFControl_Reader()
    assert reader.ReadFile(str(path)) == occ.IFSelect_ReturnStatus.IFSelect_RetDone
    assert reader.Transfer(document)

    def walk(label, place, above, name, colour):
        names = (*above, name_of(label))
        components = [child for child in children(label) if occ.XCAFDoc_ShapeTool.IsComponent_s(child)]
        if not components:
            yield Leaf(name, names, label, place, colour)
        for component in components:
            product = occ.TDF_Label()
            occ.XCAFDoc_ShapeTool.GetReferredShape_s(component, product)
            at = place.Multiplied(occ.XCAFDoc_ShapeTool.GetLocation_s(component))
            yield from walk(product, at, names, name_of(component), colour_of(component))

    products = children(occ.XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).BaseLabel())
    (root,) = (label for label in products if occ.XCAFDoc_ShapeTool.IsFree_s(label))
    return list(walk(root, occ.TopLoc_Location(), (), name_of(root), None))


def children(label):
    walk = occ.TDF_ChildIterator(label)
    while walk.More():
        yield walk.Value()
        walk.Next()


def name_of(label):
    attribute = occ.TDataStd_Name()
    assert label.FindAttribute(occ.TDataStd_Name.GetID_s(), attribute)
    return attribute.Get().ToExtString()


def colour_of(label):
    colour = occ.Quantity_Color()
    if occ.XCAFDoc_ColorTool.GetColor_s(label, occ.XCAFDoc_ColorType.XCAFDoc_ColorSurf, colour):
        return occ.Quantity_Color.ColorToHex_s(colour).ToCString()
    return None
