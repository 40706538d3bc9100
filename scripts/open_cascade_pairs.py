"""What a user of Open CASCADE writes for pairs of a STEP file, and nothing else: ``FILE [[i, j], ...]``.

Each pair's distance and, where that is 0, the common volume, of the file's solids in their order.
"""

import gc
import json
import os
import sys

gc.disable()  # what it loads and makes is no garbage

from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer

reader = STEPControl_Reader()
reader.ReadFile(sys.argv[1])
reader.TransferRoots()
solids, explorer = [], TopExp_Explorer(reader.OneShape(), TopAbs_ShapeEnum.TopAbs_SOLID)
while explorer.More():
    solids.append(explorer.Current())
    explorer.Next()
for i, j in json.loads(sys.argv[2]):
    if BRepExtrema_DistShapeShape(solids[i], solids[j]).Value() <= 1e-7:
        BRepGProp.VolumeProperties_s(BRepAlgoAPI_Common(solids[i], solids[j]).Shape(), GProp_GProps())
os._exit(0)  # to take it all down costs time and serves nobody
