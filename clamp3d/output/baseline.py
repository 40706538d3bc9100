"""What has changed since an earlier check: groups of findings beside those of its JSON, and the parts that moved."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, TypedDict

import msgspec
import numpy as np

from clamp3d.engine.result import BAD, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Verdict
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array, check_pose_array, inverse
from clamp3d.geometry.primitives import LARGEST
from clamp3d.output.groups import Accepted, Group
from clamp3d.output.tables import csv_table

Status = Literal["new", "changed", "same", "accepted"]
Names = tuple[str, str]
_Bound = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)] | None
Key = tuple[str, str, str | None, bool]

COLUMNS = ("id", "status", "group", "a", "b", "verdict", "motion", "t", "at_least_mm", "at_most_mm", "method")
_CHANGED, _CHANGED_SHARE = 1e-3, 1e-3
"""A distance has changed since the last check if it differs by more mm than this, or by more than this share."""
_MOVED = 1e-5
"""Parts of a turn, and of a place in mm, by which two poses differ that are not one, written and read again: 3MF has
six digits. A place farther off than `_CHANGED` has moved in any case."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Groups beside those of an earlier check.

    Attributes
    ----------
    status : mapping
        Of each group by its identifier: "new" where a pair of it is, "changed" where one stands otherwise now.
    changed : mapping
        The new and changed pairs of each group.
    accepted : mapping
        What somebody has accepted, by the identifiers of groups.
    gone : tuple of dict
        The earlier groups, as the JSON has them, with the pairs that are no finding any more.
    moved : mapping
        The parts that moved against most others, with how far in mm; infinite where a part is new.
    has_baseline : bool
    """

    status: Mapping[str, Status]
    changed: Mapping[str, tuple[Names, ...]]
    accepted: Mapping[str, Accepted]
    gone: tuple[Mapping[str, Any], ...] = ()
    moved: Mapping[str, float] = field(default_factory=dict)
    has_baseline: bool = False

    def open(self, groups: Iterable[Group]) -> list[Group]:
        """The groups that count for the exit code: not accepted, and with a baseline the new ones only."""
        counting = ("new",) if self.has_baseline else ("new", "changed", "same")
        return [group for group in groups if self.status[group.id] in counting]


def compare(
    scene: Scene,
    groups: Sequence[Group],
    baseline: Path | None = None,
    accepted: Mapping[str, Accepted] | None = None,
) -> Comparison:
    """Compare groups with those of a result that ``check --json`` wrote. Raises InputError if it holds none.

    A pair is new too where it was no clash in the earlier check and is one now, whatever group it was in.
    """
    accepted = accepted or {}
    if baseline is None:
        return Comparison({g.id: "accepted" if g.id in accepted else "new" for g in groups}, {}, accepted)
    before = Baseline.read(baseline)
    keys_before = [_keys(old["pairs"], old["motion"], old["verdict"]) for old in before.groups]
    earlier = set(itertools.chain.from_iterable(keys_before))
    status: dict[str, Status] = {}
    changed: dict[str, tuple[Names, ...]] = {}
    now = set[Key]()
    for group in groups:
        pairs = [(row.a, row.b) for row in group.rows]
        keys = _keys(pairs, group.motion, group.verdict)
        now.update(keys)
        new = {pair for pair, key in zip(pairs, keys, strict=True) if key not in earlier}
        different = {(row.a, row.b) for row in group.rows if before.differs(scene, row)} - new
        is_new = len(new) == len(pairs) or (new and group.verdict in BAD)
        status[group.id] = "new" if is_new else "changed" if new or different else "same"
        if group.id in accepted:
            status[group.id] = "accepted"
        if new or different:
            changed[group.id] = tuple(pair for pair in pairs if pair in new | different)
    gone = []
    for old, keys in zip(before.groups, keys_before, strict=True):
        lost = [pair for pair, key in zip(old["pairs"], keys, strict=True) if key not in now]
        if lost:
            gone.append({**old, "pairs": lost, "count": len(lost)})
    return Comparison(status, changed, accepted, tuple(gone), before.moved(scene), True)


def _keys(pairs: Iterable[Sequence[str]], motion: str | None, verdict: str) -> list[Key]:
    """What is one finding in two checks: the names of a pair, the motion, and whether it is a clash."""
    return [(*sorted(pair), motion, verdict in BAD) for pair in pairs]  # type: ignore[misc]


class _Group(TypedDict):
    id: str
    a: str
    b: str
    verdict: Verdict
    motion: str | None
    count: int
    at_least_mm: _Bound
    at_most_mm: _Bound
    pairs: list[Names]
    status: NotRequired[str]
    changed: NotRequired[list[Names]]


class _Row(msgspec.Struct):
    a: str
    b: str
    verdict: Verdict
    at_least_mm: _Bound
    at_most_mm: _Bound
    motion: str | None = None


class _Part(msgspec.Struct):
    T_world: list[list[float]]


class Baseline(msgspec.Struct, dict=True):
    """What is compared of a result that ``check --json`` wrote: groups, rows, and where the parts stood."""

    groups: list[_Group]
    pairs: list[_Row]
    motions: list[_Row]
    parts: dict[str, _Part]

    def __post_init__(self) -> None:
        poses = check_pose_array([part.T_world for part in self.parts.values()]) if self.parts else ()
        self.poses: dict[str, Array] = dict(zip(self.parts, poses, strict=True))
        self.rows = {(*sorted((row.a, row.b)), row.motion): row for row in (*self.pairs, *self.motions)}

    @classmethod
    def read(cls, path: Path) -> Baseline:
        """From the JSON of a check. Raises InputError for a file that is none."""
        try:
            return msgspec.convert(json.loads(path.read_text(encoding="utf-8")), cls)
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, RecursionError):
            raise InputError(f"{path}: not a result of `clamp3d check --json` with groups of findings") from None

    def differs(self, scene: Scene, row: PairResult) -> bool:
        """Whether the verdict of a pair, its distance or its parts' places to each other have changed."""
        old = self.rows.get((*sorted((row.a, row.b)), row.motion))
        if old is None or old.verdict != row.verdict or row.a not in self.poses or row.b not in self.poses:
            return True
        slack = max(_CHANGED, _CHANGED_SHARE * abs(row.distance.upper))
        is_farther = old.at_most_mm is not None and row.distance.lower > old.at_most_mm + slack
        is_deeper = old.at_least_mm is not None and row.distance.upper < old.at_least_mm - slack
        if is_farther or is_deeper:
            return True
        now = inverse(_pose(scene, row.a)) @ _pose(scene, row.b)
        return not _same(now, inverse(self.poses[row.a]) @ self.poses[row.b])

    def moved(self, scene: Scene) -> dict[str, float]:
        """Parts that moved against most others, or are new, with how far their frames' origins went."""
        way = {p.name: p.T_world @ inverse(self.poses[p.name]) for p in scene.parts if p.name in self.poses}
        alike: dict[tuple[float, ...], list[str]] = {}
        for name, T in way.items():
            alike.setdefault(tuple(T[:3].round(6).ravel() + 0.0), []).append(name)
        # Where all moved alike, as one assembly, nothing has moved in it.
        common = way[max(alike.values(), key=len)[0]] if alike else np.eye(4)
        far = {part.name: math.inf for part in scene.parts if part.name not in way}
        for name in way:
            now, before = _pose(scene, name), common @ self.poses[name]
            if not _same(now, before):
                far[name] = float(np.linalg.norm(now[:3, 3] - before[:3, 3]))
        return far


def _pose(scene: Scene, name: str) -> Array:
    return scene.parts[scene.index(name)].T_world


def _same(T: Array, other: Array) -> bool:
    place = min(_CHANGED, _MOVED * max(1.0, float(np.abs(other[:3, 3]).max())))
    return bool((np.abs(T - other) <= (_MOVED, _MOVED, _MOVED, place)).all())


def groups_csv(groups: Sequence[Group], comparison: Comparison) -> str:
    """One line for each pair of each group, with a header; lengths in mm."""
    rows: list[dict[str, Any]] = []
    for group in groups:
        for row in group.rows:
            status = comparison.status[group.id]
            if status == "changed" and (row.a, row.b) not in comparison.changed.get(group.id, ()):
                status = "same"
            own = {"id": group.id, "status": status, "group": f"{group.a} and {group.b}", "verdict": row.verdict.value}
            rows.append({**row.distance.to_dict(), **own, "a": row.a, "b": row.b, "motion": row.motion, "t": row.t})
    return csv_table(rows, COLUMNS)
