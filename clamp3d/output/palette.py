"""Colours that mean the same in every picture, page and file.

Parts: from the light scheme of Paul Tol's "Colour schemes" (SRON/EPS/TN/09-002), distinct for colour-blind readers and
none of them a verdict's; bolt and nut are greys. Each part also carries its name, so no picture speaks by colour alone.
"""

from __future__ import annotations

from collections.abc import Sequence

PART_COLOURS: dict[str, str] = {
    "P1": "#77AADD",
    "P2": "#44BB99",
    "P3": "#EE8866",
    "P4": "#D5D9DE",
    "P5": "#AEB6C0",
    "P6": "#EEDD88",
    "P7": "#FFAABB",
}

VERDICT_COLOURS: dict[str, str] = {
    "clash": "#D32F2F",
    "contained": "#D32F2F",
    "duplicate": "#D32F2F",
    "contact": "#F2B705",
    "allowed": "#F2B705",
    "clearance": "#0088CC",
    "clear": "#8A8F98",
    "uncertain": "#8A8F98",
    "failed": "#D32F2F",
}

INK = "#20262E"
DIMENSION = "#8B1A4F"
FORCE = "#7B2D8E"


def darker(colour: str, factor: float = 0.62) -> str:
    """The same hue for lines and hatching on ``colour`` ("#RRGGBB"); ``factor`` 0 is black.

    >>> darker("#FF8000", 0.5)
    '#804000'
    """
    return "#" + "".join(f"{round(channel * factor):02X}" for channel in rgb(colour))


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of "#RRGGBB" in sRGB, 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


_CYCLE = ("#77AADD", "#44BB99", "#EEDD88", "#99DDFF", "#FFAABB", "#BBCC33", "#EE8866", "#DDDDDD")
"""The light scheme, blue first, for parts that have no colour of their own."""


def part_colours(names: Sequence[str]) -> dict[str, str]:
    """A colour for each part: its own where it is a clamp's, else one of the cycle.

    >>> part_colours(["P1", "pin"])
    {'P1': '#77AADD', 'pin': '#44BB99'}
    """
    return {name: PART_COLOURS.get(name, _CYCLE[k % len(_CYCLE)]) for k, name in enumerate(names)}
