"""The text of a STEP file (ISO 10303-21): whether it is whole, and what it announces.

Open CASCADE leaves out what it cannot make sense of without a word. A file whose text has lost a line shows it: a
number that is referred to and not defined, brackets that do not close, a face or a body that nothing refers to.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from clamp3d.errors import InputError

_NOISE = re.compile(r"'(?:[^']|'')*'|/\*.*?\*/", re.DOTALL)
_END = re.compile(r"ENDSEC\s*;")
_HEADER = (re.compile(r"(?<!\w)HEADER\s*;"), re.compile(r"FILE_SCHEMA\s*\("), _END)
_DATA = re.compile(r"(?<!\w)DATA\s*(?:\((?:[^;()]|\([^;()]*\))*\)\s*)?;")
_RECORD = re.compile(r"\s*#\s*0*(\d+)\s*=\s*(.+)", re.DOTALL)
_NAMES = re.compile(r"(?<![\w.])([A-Z][A-Z0-9_]*)\s*\(")
_REFERRED = re.compile(r"#\s*0*(\d+)(?!\d|\s*=)")
_LACKING = re.compile(r",\s*[,)]|\(\s*,")
_SOLIDS = frozenset({"MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP"})
_PARTS = re.compile(
    "ADVANCED_FACE|FACE_SURFACE|(CLOSED|OPEN)_SHELL|EDGE_LOOP|FACE_(OUTER_)?BOUND|ORIENTED_EDGE|MANIFOLD_SOLID_BREP|"
    "BREP_WITH_VOIDS|FACETED_BREP|SHELL_BASED_SURFACE_MODEL|PRODUCT_DEFINITION|ITEM_DEFINED_TRANSFORMATION|"
    "(ADVANCED|FACETED)_BREP_SHAPE_REPRESENTATION"
)
"""Entities that stand for nothing unless another one refers to them."""


@dataclass(frozen=True, slots=True)
class Announced:
    """What a STEP file says it holds.

    ``counts``: entities by their type in capitals. ``solids``: entities that are a solid of some type. ``orphans``:
    entities that nothing refers to, but should, in words.
    """

    counts: Counter[str]
    solids: int
    orphans: tuple[str, ...]


def announced(path: Path) -> Announced:
    """What the file announces. Raises InputError if its text is not whole, naming the first fault."""
    text = path.read_bytes().decode("latin-1")
    if "ISO-10303-21" not in text[:1000]:
        raise InputError("not a readable STEP file")
    text = _NOISE.sub(lambda m: "$" if m[0][0] == "'" else " ", text)
    if "'" in text:
        raise _damaged("a text in it does not end")
    if not re.search(r"END-ISO-10303-21\s*;", text):
        raise _damaged("its end is missing")
    position = 0
    for mark in _HEADER:
        if (match := mark.search(text, position)) is None:
            raise _damaged("its header is not whole")
        position = match.end()
    sections = list(_sections(text))
    if not sections:
        raise _damaged("it has no DATA section that ends")
    names: dict[str, list[str]] = {}
    for record in (record for section in sections for record in section.split(";") if record.strip()):
        number, content = _entity(record)
        if number in names:
            raise _damaged(f"#{number} is defined twice")
        names[number] = _NAMES.findall(content) if content[0] == "(" else [content.partition("(")[0].rstrip()]
    referred = {number for section in sections for number in _REFERRED.findall(section)}
    if dangling := referred - names.keys():
        raise _damaged(f"{len(dangling)} entities are referred to and not there, as #{min(dangling)}")
    unused = ((number, kinds[0]) for number, kinds in names.items() if number not in referred and kinds)
    return Announced(
        Counter(kind for kinds in names.values() for kind in kinds),
        sum(not _SOLIDS.isdisjoint(kinds) for kinds in names.values()),
        tuple(f"{kind} (#{number}) that belongs to nothing" for number, kind in unused if _PARTS.fullmatch(kind)),
    )


def _sections(text: str) -> Iterator[str]:
    """What is in the DATA sections that end."""
    position = 0
    while (start := _DATA.search(text, position)) and (end := _END.search(text, start.end())):
        yield text[start.end() : end.start()]
        position = end.end()


def _entity(record: str) -> tuple[str, str]:
    """Number and content of ``#number = content``."""
    entity = _RECORD.fullmatch(record)
    if entity is None:
        raise _damaged(f"no entity at {' '.join(record.split())[:60]!r}")
    number, content = entity[1], entity[2].rstrip()
    if not content.endswith(")") or content.count("(") != content.count(")") or "=" in content:
        raise _damaged(f"#{number} does not end")
    if _LACKING.search(content):
        raise _damaged(f"#{number} lacks a value")
    return number, content


def _damaged(what: str) -> InputError:
    return InputError(f"the STEP file is damaged: {what}")
