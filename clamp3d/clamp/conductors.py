"""The conductor catalogue: overall diameters of stranded wires by designation."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from clamp3d.errors import InputError


@dataclass(frozen=True, slots=True)
class Conductor:
    """A catalogue entry: ``diameter`` in mm over all strands, with the standard and source it is taken from."""

    designation: str
    diameter: float
    standard: str
    source: str


@lru_cache(maxsize=1)
def catalogue() -> dict[str, Conductor]:
    """All conductors of the package by designation.

    >>> catalogue()["LJ-630"].diameter
    32.67
    """
    text = Path(__file__).with_name("data").joinpath("conductors.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return {
        r["designation"]: Conductor(r["designation"], float(r["diameter_mm"]), r["standard"], r["source"]) for r in rows
    }


def conductor(designation: str) -> Conductor:
    """The conductor of that designation, upper and lower case alike. Raises InputError naming the nearest ones.

    >>> conductor("LJ-121")
    Traceback (most recent call last):
    clamp3d.errors.InputError: unknown conductor 'LJ-121'; nearest: LJ-210, LJ-120, LJ-25 (all 51: clamp3d conductors)
    """
    folded = designation.strip().casefold()
    entry = next((entry for name, entry in catalogue().items() if name.casefold() == folded), None)
    if entry is None:
        import difflib

        near = difflib.get_close_matches(designation, catalogue(), n=3, cutoff=0.0)
        raise InputError(
            f"unknown conductor {designation!r}; nearest: {', '.join(near)} "
            f"(all {len(catalogue())}: clamp3d conductors)"
        )
    return entry
