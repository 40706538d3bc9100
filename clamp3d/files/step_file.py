"""STEP files as placed solids: the product tree with names, placements, colours and shared instances.

The tree is read by Open CASCADE's XDE.

This runs in a process of its own (`clamp3d.files.worker`): a damaged file can end it. Needs the extra ``step``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d.checks import readable_file, shown
from clamp3d.errors import InputError
from clamp3d.files.bodies import Reading
from clamp3d.files.cad import Key, Node, bodies_of, matrix
from clamp3d.files.open_cascade import explore, require_open_cascade
from clamp3d.files.part21 import Announced, announced
from clamp3d.files.worker import OUTSIDE, may_read

_OTHERS = re.compile(
    "CSG_SOLID|(EXTRUDED|REVOLVED)_AREA_SOLID|SWEPT_FACE_SOLID|SOLID_REPLICA|TESSELLATED_(SOLID|SHELL)"
)
"""Bodies that Open CASCADE does not make into solids."""
_FAULT = re.compile("Parsing|Unresolved")
_PLACE = "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION"


def read_step(path: Path, _: str | None = None) -> Reading:
    """The solids of a STEP file, in the order of its tree, in mm.

    Raises InputError if its text is damaged or Open CASCADE cannot read it.
    """
    require_open_cascade()
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1e-3)
    reader = STEPCAFControl_Reader()
    contents = _contents(path)
    _open(reader, path)
    if not reader.Transfer(document):
        raise InputError("not a readable STEP file")
    reading = bodies_of(_roots(document, path.stem))
    return replace(reading, missing=(*_lost(document, [*contents.values()]), *reading.missing))


def _contents(path: Path) -> dict[Path, Announced]:
    """What a file and the files that hold its parts announce. Raises InputError unless all of them are whole."""
    from OCP.STEPCAFControl import STEPCAFControl_Reader

    contents = {path: announced(path)}
    waiting = [*contents[path].files]
    while waiting:
        name = waiting.pop()
        if (file := path.parent / name) in contents:
            continue
        if not may_read(file, path.parent):
            raise InputError(f"names {shown(name)}, which is outside of its folder; {OUTSIDE}=1 allows that")
        try:
            readable_file(file)
            _open(STEPCAFControl_Reader(), file)
        except InputError as error:
            raise InputError(f"names {shown(name)}: {error}") from None
        contents[file] = announced(file)
        waiting += contents[file].files
    return contents


def _open(reader: Any, path: Path) -> None:
    """Read the text of a file. Raises InputError if it is damaged."""
    from OCP.IFSelect import IFSelect_ReturnStatus

    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError("not a readable STEP file, or it is cut off")
    _check_whole(reader)


def _check_whole(reader: Any) -> None:
    """Raise InputError for faults that Open CASCADE finds in the text, and reads on after them.

    What it says of values that it only expects otherwise, as of a name that is no text, is no such fault.
    """
    checks = reader.Reader().WS().ModelCheckList(True)
    checks.Start()
    while checks.More():
        check = checks.Value()
        for k in range(1, check.NbFails() + 1):
            if _FAULT.search(fault := str(check.CFail(k, True))):
                raise InputError(f"the STEP file is damaged: {fault}")
        checks.Next()


def _roots(document: Any, stem: str) -> Iterator[Node]:
    from OCP.XCAFDoc import XCAFDoc_DocumentTool
    from OCP.XCAFDoc import XCAFDoc_ShapeTool as Tool

    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    for label in _children(tool.BaseLabel()):
        if Tool.IsShape_s(label) and Tool.IsFree_s(label):
            yield _node(label, stem)


def _node(label: Any, otherwise: str) -> Node:
    """A label of the product tree: its name, placement and shape, or the labels below it."""
    from OCP.TDF import TDF_Label
    from OCP.XCAFDoc import XCAFDoc_ShapeTool as Tool

    product = TDF_Label()
    if not Tool.GetReferredShape_s(label, product):
        product = label
    name = _name(product) or _name(label) or otherwise
    T = matrix(Tool.GetLocation_s(label))
    if Tool.IsAssembly_s(product):
        below = (_node(child, name) for child in _children(product) if Tool.IsComponent_s(child))
        return Node(name, T, None, below, _name(label), _colour(label) or _colour(product))
    parts = {Key(Tool.GetShape_s(x)): x for x in (product, *_children(product)) if Tool.IsShape_s(x)}
    names = {key: _name(x) for key, x in parts.items() if x is not product}
    colours = {key: colour for key, x in parts.items() if (colour := _colour(x))}
    if product is label:  # a shape that is no instance holds its place itself
        T = np.eye(4)
    return Node(name, T, Tool.GetShape_s(product), (), _name(label), _colour(label), names, colours)


def _children(label: Any) -> Iterator[Any]:
    from OCP.TDF import TDF_ChildIterator

    walk = TDF_ChildIterator(label)
    while walk.More():
        yield walk.Value()
        walk.Next()


def _name(label: Any) -> str:
    """A label's name; none where Open CASCADE has put the label's own address, as in ``=>[0:1:1:2]``."""
    from OCP.TDataStd import TDataStd_Name

    key = TDataStd_Name.GetID_s()
    if not label.IsAttribute(key):  # FindAttribute ends the process on a label without one (a coloured face)
        return ""
    attribute = TDataStd_Name()
    label.FindAttribute(key, attribute)
    name = str(attribute.Get().ToExtString()).strip()
    return "" if name.startswith("=>[") else name


def _colour(label: Any) -> str | None:
    """The colour "#RRGGBB" that a label states, of its surface before that of its curves."""
    from OCP.Quantity import Quantity_Color
    from OCP.XCAFDoc import XCAFDoc_ColorTool, XCAFDoc_ColorType

    colour = Quantity_Color()
    for kind in (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen):
        if XCAFDoc_ColorTool.GetColor_s(label, kind, colour):
            return str(Quantity_Color.ColorToHex_s(colour).ToCString())
    return None


def _lost(document: Any, contents: Iterable[Announced]) -> Iterator[str]:
    """Bodies and instances that the files announce and Open CASCADE has not made."""
    from OCP.XCAFDoc import XCAFDoc_DocumentTool
    from OCP.XCAFDoc import XCAFDoc_ShapeTool as Tool

    counts: Counter[str] = Counter()
    for content in contents:
        yield from content.orphans
        counts += content.counts
    for kind, count in counts.items():
        if _OTHERS.fullmatch(kind):
            yield f"{count} {kind}, which Open CASCADE does not read"
    products = [*_children(XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).BaseLabel())]
    shells = {Key(shell) for product in products for shell in explore(Tool.GetShape_s(product), "SHELL")}
    if (closed := counts["CLOSED_SHELL"]) > len(shells):
        yield f"{closed - len(shells)} of the file's {closed} closed shells (not readable)"
    instances = sum(Tool.IsComponent_s(below) for product in products for below in _children(product))
    uses, places = (counts[kind] for kind in ("NEXT_ASSEMBLY_USAGE_OCCURRENCE", _PLACE))
    if max(uses, places) > instances or 0 < places < uses:
        yield f"{uses} instances in the tree, {places} places for them, {instances} read"
