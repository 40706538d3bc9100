"""STEP assemblies written by Open CASCADE itself: the truth that the reader is held to."""

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.Interface import Interface_Static
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_DocumentTool


def location(T):
    move = gp_Trsf()
    move.SetValues(*np.asarray(T)[:3].flatten().tolist())
    return TopLoc_Location(move)


def plate():
    box = BRepPrimAPI_MakeBox(gp_Pnt(-20, -10, 0), gp_Pnt(20, 10, 5)).Shape()
    tool = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(10, 0, -1), gp_Dir(0, 0, 1)), 3.0, 7).Shape()
    return BRepAlgoAPI_Cut(box, tool).Shape()


def pin():
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 2.5, 10.0).Shape()


class Tree:
    """An XDE document to which products and instances are added."""

    def __init__(self):
        self.document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
        XCAFDoc_DocumentTool.SetLengthUnit_s(self.document, 1e-3)
        self.tool = XCAFDoc_DocumentTool.ShapeTool_s(self.document.Main())

    def product(self, name, shape=None):
        label = self.tool.NewShape() if shape is None else self.tool.AddShape(shape, False)
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(name, True))
        return label

    def put(self, parent, child, T, name="instance"):
        label = self.tool.AddComponent(parent, child, location(T))
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(name, True))

    def write(self, path, unit="MM"):
        self.tool.UpdateAssemblies()
        writer = STEPCAFControl_Writer()
        writer.SetNameMode(True)
        before = Interface_Static.CVal_s("write.step.unit")
        Interface_Static.SetCVal_s("write.step.unit", unit)
        try:
            assert writer.Transfer(self.document)
            writer.Write(str(path))
        finally:
            Interface_Static.SetCVal_s("write.step.unit", before)
        return path


def pose(rng):
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=rng).as_matrix()
    T[:3, 3] = rng.uniform(-50, 50, 3)
    return T


def nested(rng):
    """A tree of three levels with a pin that is there three times; and name, volume and pose of each solid."""
    tree = Tree()
    root, sub, plates, pins = (
        tree.product("machine"),
        tree.product("sub, assembly"),
        tree.product("plate", plate()),
        tree.product("pin: 5 x 10", pin()),
    )
    a, b, c, d, e = (pose(rng) for _ in range(5))
    tree.put(root, sub, a)
    tree.put(sub, plates, b)
    tree.put(sub, pins, c)
    tree.put(root, sub, d)
    tree.put(root, pins, e)
    hole, full = 40 * 20 * 5 - np.pi * 9 * 5, np.pi * 2.5**2 * 10
    truth = [
        ("plate_1", hole, a @ b),
        ("pin-5-x-10_1", full, a @ c),
        ("plate_2", hole, d @ b),
        ("pin-5-x-10_2", full, d @ c),
        ("pin-5-x-10_3", full, e),
    ]
    return tree, truth
