"""STEP files as placed solids: the product tree with names, placements, colours and shared instances.

The tree is read by Open CASCADE's XDE.

This runs in a process of its own (`clamp3d.files.worker`): a damaged file can end it. Needs the extra ``step``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d.checks import readable_file, shown
from clamp3d.errors import InputError
from clamp3d.files.bodies import Reading
from clamp3d.files.cad import Key, Node, bodies_of
from clamp3d.files.open_cascade import explore, matrix, occ
from clamp3d.files.part21 import Announced, announced
from clamp3d.files.worker import named_file

_OTHERS = re.compile(
    "CSG_SOLID|(EXTRUDED|REVOLVED)_AREA_SOLID|SWEPT_FACE_SOLID|SOLID_REPLICA|TESSELLATED_(SOLID|SHELL)"
)
"""Bodies that Open CASCADE does not make into solids."""
_FAULT = re.compile(
    r"Parsing|Unresolved|not a Real|\((transform_item_[12]|location|axis|ref_direction)\)|"
    r"Enumeration si_(prefix|unit_name)|\(prefix\)|\(unit\) : Entity has illegal type|"
    r"Count of Parameters is not \d+ for (axis2|cartesian|direction|item_defined)"
)
"""What Open CASCADE says of numbers, units and places that it then takes to be 0, or leaves out."""
_PLACE = "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION"


def read_step(path: Path, _: str | None = None) -> Reading:
    """The solids of a STEP file, in the order of its tree, in mm.

    Raises InputError if its text is damaged or Open CASCADE cannot read it.
    """
    document = occ.TDocStd_Document(occ.TCollection_ExtendedString("XmlOcaf"))
    occ.XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1e-3)
    contents = _contents(path)
    if not _open(path).Transfer(document):
        raise InputError("not a readable STEP file")
    products = [*_children(occ.XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).BaseLabel())]
    reading = bodies_of(_node(x, path.stem) for x in products if occ.XCAFDoc_ShapeTool.IsFree_s(x))
    reading.missing[:0] = _lost(products, contents)
    return reading


def _contents(path: Path) -> list[Announced]:
    """What a file and the files that hold its parts announce. Raises InputError unless all of them are whole."""
    contents = {path: announced(path)}
    waiting = [*contents[path].files]
    while waiting:
        name = waiting.pop()
        if (file := named_file(path, name)) in contents:
            continue
        try:
            readable_file(file)
            _open(file)
        except InputError as error:
            raise InputError(f"names {shown(name)}: {error}") from None
        contents[file] = announced(file)
        waiting += contents[file].files
    return [*contents.values()]


def _open(path: Path) -> Any:
    """A reader that has read the text of a file. Raises InputError if it is damaged."""
    reader = occ.STEPCAFControl_Reader()
    if reader.ReadFile(str(path)) != occ.IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError("not a readable STEP file, or it is cut off")
    _check_whole(reader)
    return reader


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


def _node(label: Any, otherwise: str) -> Node:
    """A label of the product tree: its name, placement and shape, or the labels below it."""
    tree = occ.XCAFDoc_ShapeTool
    product = occ.TDF_Label()
    if not tree.GetReferredShape_s(label, product):
        product = label
    name = _name(product) or _name(label) or otherwise
    T = matrix(tree.GetLocation_s(label))
    if tree.IsAssembly_s(product):
        below = (_node(child, name) for child in _children(product) if tree.IsComponent_s(child))
        return Node(name, T, None, below, _name(label), _colour(label) or _colour(product))
    parts = {Key(tree.GetShape_s(x)): x for x in (product, *_children(product)) if tree.IsShape_s(x)}
    names = {key: _name(x) for key, x in parts.items() if x is not product}
    colours = {key: colour for key, x in parts.items() if (colour := _colour(x))}
    if product is label:  # a shape that is no instance holds its place itself
        T = np.eye(4)
    return Node(name, T, tree.GetShape_s(product), (), _name(label), _colour(label), names, colours)


def _children(label: Any) -> Iterator[Any]:
    walk = occ.TDF_ChildIterator(label)
    while walk.More():
        yield walk.Value()
        walk.Next()


def _name(label: Any) -> str:
    """A label's name; none where Open CASCADE has put the label's own address, as in ``=>[0:1:1:2]``."""
    attribute = occ.TDataStd_Name()
    if not label.IsAttribute(attribute.ID()):  # FindAttribute ends the process on a label without one (a coloured face)
        return ""
    label.FindAttribute(attribute.ID(), attribute)
    name = str(attribute.Get().ToExtString()).strip()
    return "" if name.startswith("=>[") else name


def _colour(label: Any) -> str | None:
    """The colour "#RRGGBB" that a label states, of its surface before that of its curves."""
    colour, kinds = occ.Quantity_Color(), occ.XCAFDoc_ColorType
    for kind in (kinds.XCAFDoc_ColorSurf, kinds.XCAFDoc_ColorGen):
        if occ.XCAFDoc_ColorTool.GetColor_s(label, kind, colour):
            return str(occ.Quantity_Color.ColorToHex_s(colour).ToCString())
    return None


def _lost(products: list[Any], contents: list[Announced]) -> Iterator[str]:
    """Bodies and instances that the files announce and Open CASCADE has not made."""
    counts: Counter[str] = Counter()
    for content in contents:
        yield from content.lost
        counts += content.counts
    for kind, count in counts.items():
        if _OTHERS.fullmatch(kind):
            yield f"{count} {kind}, which Open CASCADE does not read"
    tree = occ.XCAFDoc_ShapeTool
    shells = {Key(shell) for product in products for shell in explore(tree.GetShape_s(product), "SHELL")}
    if (closed := counts["CLOSED_SHELL"]) > len(shells):
        yield f"{closed - len(shells)} of the file's {closed} closed shells (not readable)"
    instances = sum(tree.IsComponent_s(below) for product in products for below in _children(product))
    uses, places = (counts[kind] for kind in ("NEXT_ASSEMBLY_USAGE_OCCURRENCE", _PLACE))
    if max(uses, places) > instances or 0 < places < uses:
        yield f"{uses} instances in the tree, {places} places for them, {instances} read"
