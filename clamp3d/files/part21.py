"""What the text of a STEP file (ISO 10303-21) announces.

Open CASCADE leaves out what it cannot make sense of without a word, so its answer is compared with the text.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clamp3d.errors import InputError

_NOISE = re.compile(r"'(?:[^']|'')*'|/\*.*?\*/", re.DOTALL)
_RECORD = re.compile(r"#\s*0*(\d+)\s*=\s*([^;]+)")
_TYPES = re.compile(r"(?<![\w.])([A-Z][A-Z0-9_]*)\s*\(")
_OPERATOR = "CARTESIAN_TRANSFORMATION_OPERATOR_3D"
_NUMBER = re.compile(r"-?\d[\d.]*(?:E[-+]?\d+)?", re.IGNORECASE)
_REFERENCE = re.compile(r"#\s*0*(\d+)(?!\d|\s*=)")
_UNIT = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*\$\s*,\s*#\s*0*(\d+)")
_FILE = re.compile(r"DOCUMENT_FILE\s*\(\s*'([^']+\.(?:stp|step))'", re.IGNORECASE)
_PARTS = re.compile(
    "ADVANCED_FACE|FACE_SURFACE|(CLOSED|OPEN)_SHELL|EDGE_LOOP|FACE_(OUTER_)?BOUND|ORIENTED_EDGE|MANIFOLD_SOLID_BREP|"
    "BREP_WITH_VOIDS|FACETED_BREP|SHELL_BASED_SURFACE_MODEL|PRODUCT_DEFINITION|ITEM_DEFINED_TRANSFORMATION|"
    "(ADVANCED|FACETED)_BREP_SHAPE_REPRESENTATION"
)
"""Entities that stand for nothing unless another one refers to them."""


@dataclass(frozen=True, slots=True)
class Announced:
    """What a STEP file says it holds.

    ``counts``: entities by their type in capitals. ``lost``, in words: entities that nothing refers to, but should, and
    placements that mirror, of which Open CASCADE makes turns. ``files``: names of other STEP files that hold its parts.
    """

    counts: Counter[str]
    lost: tuple[str, ...]
    files: tuple[str, ...]


def announced(path: Path) -> Announced:
    """What the file announces.

    Raises InputError for entities of one number, with which Open CASCADE may not end, and units made of what is no
    length or angle, whose size it takes to be 1.
    """
    raw = path.read_bytes().decode("latin-1")
    text = _NOISE.sub(lambda m: "$" if m[0][0] == "'" else " ", raw)
    records = _RECORD.findall(text)
    (number, count), *_ = [*Counter(number for number, _ in records).most_common(1), ("", 0)]
    if count > 1:
        raise InputError(f"the STEP file is damaged: #{number} is defined {count} times")
    types = {
        number: _TYPES.findall(content) if content[0] == "(" else [content.partition("(")[0].rstrip()]
        for number, content in records
    }
    for number in _UNIT.findall(text):
        if not any(kind.endswith("MEASURE_WITH_UNIT") for kind in types.get(number, ())):
            raise InputError(f"the STEP file is damaged: #{number}, which a unit is made of, is no measure")
    contents = dict(records)
    unused = types.keys() - set(_REFERENCE.findall(text))
    return Announced(
        Counter(kind for kinds in types.values() for kind in kinds),
        (
            *(
                f"{kinds[0]} (#{number}) that belongs to nothing"
                for number, kinds in types.items()
                if number in unused and kinds and _PARTS.fullmatch(kinds[0])
            ),
            *(
                f"{_OPERATOR} (#{number}), a placement that mirrors"
                for number, kinds in types.items()
                if kinds == [_OPERATOR] and _mirrors(contents[number], contents)
            ),
        ),
        tuple(_FILE.findall(raw)),
    )


def _mirrors(operator: str, contents: dict[str, str]) -> bool:
    """Whether the axes of a CARTESIAN_TRANSFORMATION_OPERATOR_3D are left-handed (ISO 10303-42).

    Its last arguments are axis 1, axis 2, origin, scale and axis 3; an axis that is left out is that of the frame.
    """
    arguments = operator.rstrip(" )\r\n").split(",")
    axes = np.eye(3)
    for k, argument in enumerate(arguments[-5:-3] + arguments[-1:]):
        if number := _REFERENCE.search(argument):
            numbers = _NUMBER.findall(contents.get(number[1], "").partition(",")[2])
            if len(numbers) == len(axes):
                axes[k] = [float(x) for x in numbers]
    return bool(np.linalg.det(axes) < 0.0)
