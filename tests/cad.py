"""Solids and STEP assemblies made by Open CASCADE alone: of clamp3d only the short ways to classes and shapes."""

import importlib

import numpy as np
from scipy.spatial.transform import Rotation

from clamp3d.files.open_cascade import explore, occ


def array_of(kind, values):
    """Values (n,) or (n, m) as an array of Open CASCADE, which counts from 1; ``kind``: gp_Pnt, double or int."""
    values = np.asarray(values, dtype=object)
    try:
        made = getattr(importlib.import_module("OCP.collections"), f"Array{values.ndim}_{kind}")
    except ModuleNotFoundError:  # of an older OCP
        old = {"gp_Pnt": "TColgp_Array%dOfPnt", "double": "TColStd_Array%dOfReal", "int": "TColStd_Array%dOfInteger"}
        made = getattr(occ, old[kind] % values.ndim)
    array = made(*(end for count in values.shape for end in (1, count)))
    for index in np.ndindex(*values.shape):
        array.SetValue(*(k + 1 for k in index), values[index])
    return array


def transformation(T):
    """A pose (4, 4) as Open CASCADE has it."""
    move = occ.gp_Trsf()
    move.SetValues(*(float(x) for x in np.asarray(T)[:3].ravel()))
    return move


def location(T):
    return occ.TopLoc_Location(transformation(T))


def moved(shape, T):
    """The shape with its geometry moved by T (4, 4)."""
    return occ.BRepBuilderAPI_Transform(shape, transformation(T), True).Shape()


def shift(x=0.0, y=0.0, z=0.0):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def turn(axis, angle):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(angle * np.asarray(axis, float) / np.linalg.norm(axis)).as_matrix()
    return T


def upright(x=0.0, y=0.0, z=0.0):
    return occ.gp_Ax2(occ.gp_Pnt(x, y, z), occ.gp_Dir(0, 0, 1))


def block(low, high):
    return occ.BRepPrimAPI_MakeBox(occ.gp_Pnt(*map(float, low)), occ.gp_Pnt(*map(float, high))).Shape()


def rod(radius, low, high, x=0.0, y=0.0):
    return occ.BRepPrimAPI_MakeCylinder(upright(x, y, low), radius, high - low).Shape()


def cone(bottom, top, low, high):
    return occ.BRepPrimAPI_MakeCone(upright(0, 0, low), bottom, top, high - low).Shape()


def ball(radius, z=0.0):
    return occ.BRepPrimAPI_MakeSphere(occ.gp_Pnt(0, 0, z), radius).Shape()


def ring(major, minor, z=0.0):
    return occ.BRepPrimAPI_MakeTorus(upright(0, 0, z), major, minor).Shape()


def cut(shape, *tools):
    for tool in tools:
        shape = occ.BRepAlgoAPI_Cut(shape, tool).Shape()
    return shape


def solids_of(shape):
    return [*explore(shape, "SOLID")]


def first_solid(shape):
    return solids_of(shape)[0]


def volume(shape, *accuracy):
    """mm^3; to a relative ``accuracy``, or to Open CASCADE's default."""
    properties = occ.GProp_GProps()
    occ.BRepGProp.VolumeProperties_s(shape, properties, *accuracy)
    return properties.Mass()


def bounds(shape):
    """Tight box (2, 3) of a shape, arcs taken as arcs."""
    box = occ.Bnd_Box()
    occ.BRepBndLib.AddOptimal_s(shape, box, False, False)
    return np.array([point.Coord() for point in (box.CornerMin(), box.CornerMax())])


def common_volume(a, b):
    """The volume that two shapes share, mm^3."""
    return volume(occ.BRepAlgoAPI_Common(a, b).Shape())


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
        self.document = occ.TDocStd_Document(occ.TCollection_ExtendedString("XmlOcaf"))
        occ.XCAFDoc_DocumentTool.SetLengthUnit_s(self.document, 1e-3)
        self.tool = occ.XCAFDoc_DocumentTool.ShapeTool_s(self.document.Main())

    def product(self, name, shape=None):
        label = self.tool.NewShape() if shape is None else self.tool.AddShape(shape, False)
        occ.TDataStd_Name.Set_s(label, occ.TCollection_ExtendedString(name, True))
        return label

    def put(self, parent, child, T, name="instance"):
        label = self.tool.AddComponent(parent, child, location(T))
        occ.TDataStd_Name.Set_s(label, occ.TCollection_ExtendedString(name, True))

    def write(self, path, unit="MM"):
        self.tool.UpdateAssemblies()
        writer = occ.STEPCAFControl_Writer()
        writer.SetNameMode(True)
        before = occ.Interface_Static.CVal_s("write.step.unit")
        occ.Interface_Static.SetCVal_s("write.step.unit", unit)
        try:
            assert writer.Transfer(self.document)
            writer.Write(str(path))
        finally:
            occ.Interface_Static.SetCVal_s("write.step.unit", before)
        return path


def read_step(path):
    """The solids of a STEP file, in their order."""
    reader = occ.STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    return solids_of(reader.OneShape())
