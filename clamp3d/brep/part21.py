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

MOST_ENTITIES = 20_000_000
_NOISE = re.compile(r"'(?:[^']|'')*'|/\*.*?\*/", re.DOTALL)
_END = re.compile(r"ENDSEC\s*;")
_HEADER = (re.compile(r"(?<!\w)HEADER\s*;"), re.compile(r"FILE_SCHEMA\s*\("), _END)
_DATA = re.compile(r"(?<!\w)DATA\s*(?:\((?:[^;()]|\([^;()]*\))*\)\s*)?;")
_RECORD = re.compile(r"\s*#\s*(\d+)\s*=\s*(.*)", re.DOTALL)
_NAMES = re.compile(r"(?<![\w.])([A-Z][A-Z0-9_]*)\s*\(")
_REFERRED = re.compile(r"#\s*(\d+)(?!\d|\s*=)")
_LACKING = re.compile(r",\s*[,)]|\(\s*,")
_SOLIDS = frozenset({"MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP"})
_PARTS = {
    "ADVANCED_FACE": "a face",
    "FACE_SURFACE": "a face",
    "CLOSED_SHELL": "a shell",
    "OPEN_SHELL": "a shell",
    "EDGE_LOOP": "a face's outline",
    "FACE_BOUND": "a face's outline",
    "FACE_OUTER_BOUND": "a face's outline",
    "ORIENTED_EDGE": "an edge",
    "MANIFOLD_SOLID_BREP": "a solid",
    "BREP_WITH_VOIDS": "a solid",
    "FACETED_BREP": "a solid",
    "SHELL_BASED_SURFACE_MODEL": "a surface",
    "PRODUCT_DEFINITION": "a product",
    "ITEM_DEFINED_TRANSFORMATION": "a placement",
    "ADVANCED_BREP_SHAPE_REPRESENTATION": "a shape",
    "FACETED_BREP_SHAPE_REPRESENTATION": "a shape",
}
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
    at = 0
    for mark in _HEADER:
        if (found := mark.search(text, at)) is None:
            raise _damaged("its header is not whole")
        at = found.end()
    sections = list(_sections(text))
    if not sections:
        raise _damaged("it has no DATA section that ends")
    every: list[str] = []
    solids = 0
    kinds: dict[int, str] = {}
    referred = {_number(number) for section in sections for number in _REFERRED.findall(section)}
    for record in (record for section in sections for record in section.split(";") if record.strip()):
        number, content = _entity(record)
        if number in kinds:
            raise _damaged(f"#{number} is defined twice")
        if content[0] == "(":
            names = _NAMES.findall(content)
            kinds[number] = names[0] if names else ""
            every += names
            solids += not _SOLIDS.isdisjoint(names)
        else:
            kinds[number] = name = content[: content.index("(")].rstrip()
            every.append(name)
            solids += name in _SOLIDS
        if len(kinds) > MOST_ENTITIES:
            raise InputError(f"more than {MOST_ENTITIES} entities")
    dangling = referred - kinds.keys()
    if dangling:
        more = f" (and {len(dangling) - 1} more)" if len(dangling) > 1 else ""
        raise _damaged(f"#{min(dangling)} is referred to and not there{more}")
    alone = [(number, kind) for number, kind in kinds.items() if kind in _PARTS and number not in referred]
    orphans = tuple(f"{_PARTS[kind]} (#{number}) that belongs to nothing" for number, kind in alone)
    return Announced(Counter(every), solids, orphans)


def _sections(text: str) -> Iterator[str]:
    """What is in the DATA sections that end."""
    at = 0
    while (start := _DATA.search(text, at)) and (end := _END.search(text, start.end())):
        yield text[start.end() : end.start()]
        at = end.end()


def _entity(record: str) -> tuple[int, str]:
    """Number and content of ``#number = content``."""
    found = _RECORD.match(record)
    if found is None:
        raise _damaged(f"no entity at {' '.join(record.split())[:60]!r}")
    number, content = _number(found[1]), found[2].rstrip()
    if not content.endswith(")") or content.count("(") != content.count(")") or "=" in content:
        raise _damaged(f"#{number} does not end")
    if _LACKING.search(content):
        raise _damaged(f"#{number} lacks a value")
    return number, content


def _number(digits: str) -> int:
    try:
        return int(digits)
    except ValueError:  # Python reads 4300 digits
        raise _damaged(f"#{digits[:20]}... has {len(digits)} digits") from None


def _damaged(what: str) -> InputError:
    return InputError(f"the STEP file is damaged: {what}")
