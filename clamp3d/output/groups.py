"""Findings with one cause as one group, with an identifier that stays, and how they differ from an earlier check.

Parts whose names differ in their number only are a family: twelve rollers that overlap one race by about the same
are one group. Text, JSON, page, report and CSV list these groups.
"""

from __future__ import annotations

import base64
import getpass
import hashlib
import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from clamp3d.checks import shown
from clamp3d.clamp.loader import parse_toml, text_of
from clamp3d.engine.result import BAD, CheckResult, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Verdict
from clamp3d.errors import InputError
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.pose import inverse
from clamp3d.geometry.shapes import Shape, Solid
from clamp3d.output.files import write_text
from clamp3d.validation import validate

_JUMP, _JUMP_SHARE = 0.01, 0.2
"""A distance that differs from the next by more mm than this, and by more than this share, has a cause of its own."""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Findings with one cause.

    Attributes
    ----------
    id : str
        Identifier from the verdict, the motion, and the names, sizes and relative poses of the parts: the same when
        the file is read again, in whatever order. A finding that was accepted is open again when its parts moved.
    a, b : str
        The two families, or the names of the two parts.
    rows : tuple of PairResult
        The findings, the worst first; all with one verdict and in one motion, or at rest.
    lower, upper : float
        Every distance of the group lies between these, mm.
    """

    id: str
    a: str
    b: str
    rows: tuple[PairResult, ...]
    lower: float
    upper: float

    @property
    def worst(self) -> PairResult:
        """The finding to look at first."""
        return self.rows[0]

    @property
    def verdict(self) -> Verdict:
        """The verdict of all its findings."""
        return self.rows[0].verdict

    @property
    def motion(self) -> str | None:
        """The motion that they are in, None at rest."""
        return self.rows[0].motion

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; lengths in mm, unknown bounds are None."""
        return {
            "id": self.id,
            "a": self.a,
            "b": self.b,
            "verdict": self.verdict.value,
            "motion": self.motion,
            "count": len(self.rows),
            "at_least_mm": self.lower if math.isfinite(self.lower) else None,
            "at_most_mm": self.upper if math.isfinite(self.upper) else None,
            "pairs": [[row.a, row.b] for row in self.rows],
        }


@lru_cache(maxsize=1)
def grouped(result: CheckResult) -> tuple[Group, ...]:
    """The findings of a check by their causes: the worst verdicts first, and of one verdict what is rarest.

    A pair that clashes at rest is not listed again for the motions.

    >>> from clamp3d.engine.check import check
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.pose import translation
    >>> scene = Scene().add("rail", shapes.box((90.0, 10.0, 10.0)))
    >>> for k, height in enumerate((9.0, 9.0, 9.0, 6.0)):
    ...     scene = scene.add(f"nut-{k}", shapes.box((5.0, 5.0, 10.0)), translation(20.0 * k - 30.0, 0.0, height))
    >>> [(group.a, group.b, len(group.rows)) for group in grouped(check(scene))]
    [('rail', 'nut-3', 1), ('rail', 'nut', 3)]
    """
    clashing = {frozenset((row.a, row.b)) for row in result.pairs if row.verdict in BAD}
    family = families(result.scene)
    causes: dict[tuple[str, ...], list[PairResult]] = {}
    for row in sorted(result.findings, key=lambda row: row.distance.upper):
        if row.motion is None or frozenset((row.a, row.b)) not in clashing:
            key = (row.motion or "", *sorted((family[row.a], family[row.b])))
            causes.setdefault(key, []).append(row)
    groups = [_group(result.scene, rows, family) for cause in causes.values() for rows in _alike(cause)]
    order = {verdict: k for k, verdict in enumerate(Verdict)}
    order |= dict.fromkeys(BAD, 0)
    return tuple(sorted(groups, key=lambda group: (order[group.verdict], len(group.rows), group.upper)))


def _alike(rows: Sequence[PairResult]) -> list[list[PairResult]]:
    """Rows of one cause, in the order of their distances, by verdicts, and apart where the distance jumps."""
    alike: list[list[PairResult]] = []
    latest: dict[Verdict, list[PairResult]] = {}
    for row in rows:
        own = latest.get(row.verdict)
        if own is None or row.distance.lower > (last := own[-1].distance.upper) + max(_JUMP, _JUMP_SHARE * abs(last)):
            own = latest[row.verdict] = []
            alike.append(own)
        own.append(row)
    return alike


def _group(scene: Scene, rows: Sequence[PairResult], family: Mapping[str, str]) -> Group:
    row = rows[0]
    a, b = (family[row.a], family[row.b]) if len(rows) > 1 else (row.a, row.b)
    cause = "\n".join(sorted(_signature(scene, row) for row in rows))
    # Letters and 2 to 7: of digits and "e" a spreadsheet makes numbers.
    identifier = base64.b32encode(hashlib.blake2s(cause.encode(), digest_size=5).digest()).decode().lower()
    lower, upper = min(row.distance.lower for row in rows), max(row.distance.upper for row in rows)
    return Group(identifier, a, b, tuple(rows), lower, upper)


def _signature(scene: Scene, row: PairResult) -> str:
    """Verdict, motion, names, sizes and relative pose of two parts, in whatever order the file has them."""
    a, b = (scene.parts[scene.index(name)] for name in sorted((row.a, row.b)))
    corners = [
        part.shape.bounds if isinstance(part.shape, (Solid, BrepSolid)) else part.shape.mesh.vertices for part in (a, b)
    ]
    sizes = [np.ptp(points, axis=0) for points in corners]
    # Steps of 1e-3 mm; what a file says with a few decimals lies on no border between two.
    place = np.floor(1e3 * np.concatenate([*sizes, (inverse(a.T_world) @ b.T_world)[:3].ravel()]) + 0.37)
    return " ".join([row.verdict.value, row.motion or "", a.name, b.name, *map(str, place.astype(int))])


def families(scene: Scene) -> dict[str, str]:
    """The family of each part: its name without the number, if another part differs from it in the number only.

    A number without a separator before it counts for parts of one shape only.

    >>> from clamp3d.geometry import shapes
    >>> ball, pin = shapes.cylinder(2.0, 4.0), shapes.cylinder(1.0, 4.0)
    >>> scene = Scene().add("ball", ball).add("ball_2", pin).add("P1", ball).add("P2", ball).add("P3", pin)
    >>> list(families(scene).values())
    ['ball', 'ball', 'P', 'P', 'P3']
    """
    kinds: dict[str, tuple[str, Shape | None]] = {}
    for part in scene.parts:
        numbered = re.fullmatch(r"(.*?[^\W_])([\W_]*)\d+", part.name)
        stem, separator = numbered.groups() if numbered else (part.name, "-")
        kinds[part.name] = (stem, None if separator else part.shape)
    count = Counter(kinds.values())
    return {name: kind[0] if count[kind] > 1 else name for name, kind in kinds.items()}


class Accepted(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A finding that somebody has accepted: its identifier, why, by whom and on what day. Raises InputError."""

    id: str
    why: str
    who: str = ""
    when: str = ""

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z2-7]{8}", self.id):
            rule = "id of a finding must be 8 characters of a-z and 2-7, as check prints it at the end of its line"
            raise InputError(f"{rule}, got {shown(self.id)}")
        if not self.why.strip():
            raise InputError(f"why must not be empty, got {shown(self.why)}")

    def __str__(self) -> str:
        return f"accepted by {self.who} on {self.when} ({self.why})"


class _AcceptedFile(msgspec.Struct, forbid_unknown_fields=True):
    accepted: list[Accepted] = []


def accepted_file(source: str) -> Path:
    """The file with the accepted findings of an input: beside a file or folder, else in the current folder.

    It is named after the file without its ending, and after the whole name of a folder.

    >>> accepted_file("parts/hinge.step").as_posix()
    'parts/hinge.accepted.toml'
    """
    path = Path(source) if Path(source).name not in ("", "..") else Path(source).resolve()
    return path.parent / f"{path.name if path.is_dir() else path.stem}.accepted.toml"


def read_accepted(path: Path) -> dict[str, Accepted]:
    """The accepted findings by their identifiers; none where there is no file. Raises InputError for a bad file."""
    if not path.is_file():
        return {}
    data = msgspec.to_builtins(parse_toml(text_of(path), str(path)))  # a date of TOML becomes its text
    file = validate(_AcceptedFile, data, f"{path}: must hold [[accepted]] with id, who, when and why")
    return {entry.id: entry for entry in file.accepted}


def accept(path: Path, identifiers: Sequence[str], *, why: str, who: str = "") -> list[Accepted]:
    """Add findings to the file of accepted ones, and return what was added.

    Raises InputError for a bad identifier, and without a reason.
    """
    if not why.strip():
        raise InputError(f"the reason (--why) must not be empty, got {why!r}")
    present = read_accepted(path)
    who, when = who or getpass.getuser(), date.today().isoformat()
    entries = [Accepted(i, why, who, when) for i in dict.fromkeys(identifiers)]
    entries = [entry for entry in entries if entry.id not in present]
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    text += "" if text.endswith("\n") else "\n"  # an editor may have left the last line open
    for entry in entries:
        keys = ("id", "who", "when", "why")  # TOML has no surrogate pairs, which ASCII alone would need
        fields = (f"{key} = {json.dumps(getattr(entry, key), ensure_ascii=False)}\n" for key in keys)
        text += "[[accepted]]\n" + "".join(fields) + "\n"
    if entries:
        write_text(path, text)
    return entries
