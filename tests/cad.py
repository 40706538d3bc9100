"""Solids and STEP assemblies made by Open CASCADE alone: nothing of clamp3d is used here."""

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.GProp import GProp_GProps
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_DocumentTool
from scipy.spatial.transform import Rotation

for printer in [*Message.DefaultMessenger_s().Printers()]:
    Message.DefaultMessenger_s().RemovePrinter(printer)


def transformation(T):
    """A pose (4, 4) as Open CASCADE has it."""
    move = gp_Trsf()
    move.SetValues(*(float(x) for x in np.asarray(T)[:3].ravel()))
    return move


def location(T):
    return TopLoc_Location(transformation(T))


def moved(shape, T):
    """The shape with its geometry moved by T (4, 4)."""
    return BRepBuilderAPI_Transform(shape, transformation(T), True).Shape()


def shift(x=0.0, y=0.0, z=0.0):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def turn(axis, angle):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(angle * np.asarray(axis, float) / np.linalg.norm(axis)).as_matrix()
    return T


def upright(x=0.0, y=0.0, z=0.0):
    return gp_Ax2(gp_Pnt(x, y, z), gp_Dir(0, 0, 1))


def block(low, high):
    return BRepPrimAPI_MakeBox(gp_Pnt(*map(float, low)), gp_Pnt(*map(float, high))).Shape()


def rod(radius, low, high, x=0.0, y=0.0):
    return BRepPrimAPI_MakeCylinder(upright(x, y, low), radius, high - low).Shape()


def cone(bottom, top, low, high):
    return BRepPrimAPI_MakeCone(upright(0, 0, low), bottom, top, high - low).Shape()


def ball(radius, z=0.0):
    return BRepPrimAPI_MakeSphere(gp_Pnt(0, 0, z), radius).Shape()


def ring(major, minor, z=0.0):
    return BRepPrimAPI_MakeTorus(upright(0, 0, z), major, minor).Shape()


def cut(shape, *tools):
    for tool in tools:
        shape = BRepAlgoAPI_Cut(shape, tool).Shape()
    return shape


def solids_of(shape):
    explorer, solids = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID), []
    while explorer.More():
        solids.append(explorer.Current())
        explorer.Next()
    return solids


def first_solid(shape):
    return solids_of(shape)[0]


def volume(shape, *accuracy):
    """mm^3; to a relative ``accuracy``, or to Open CASCADE's default."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, *accuracy)
    return properties.Mass()


def bounds(shape):
    """Tight box (2, 3) of a shape, arcs taken as arcs."""
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return np.array([point.Coord() for point in (box.CornerMin(), box.CornerMax())])


def common_volume(a, b):
    """The volume that two shapes share, mm^3."""
    return volume(BRepAlgoAPI_Common(a, b).Shape())


def random_pose(rng, reach=50.0):
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
    T[:3, 3] = rng.uniform(-reach, reach, 3)
    return T


def matrix(location):
    """The pose (4, 4) of a location."""
    move = location.Transformation()
    return np.array([[move.Value(i, j) for j in range(1, 5)] for i in range(1, 4)] + [[0.0, 0.0, 0.0, 1.0]])


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


def read_step(path):
    """The solids of a STEP file, in their order."""
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    return solids_of(reader.OneShape())
