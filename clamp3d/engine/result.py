"""What a check answers: frozen dataclasses, and the same as a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from clamp3d.engine.answer import Distance
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Thresholds, Verdict
from clamp3d.errors import InputError, need

if TYPE_CHECKING:
    from clamp3d.engine.where import Locator, Overlap

BAD = (Verdict.DUPLICATE, Verdict.CONTAINED, Verdict.CLASH)
"""Verdicts of parts that overlap."""
NOT_CLEAN = (*BAD, Verdict.FAILED, Verdict.UNCERTAIN)
"""Verdicts that make a scene not clean."""
_HTML_ROWS = 30


@dataclass(frozen=True, slots=True, eq=False)
class PairResult:
    """One pair of a checked scene, at rest or in a motion.

    Attributes
    ----------
    a, b : str
        Names of the parts.
    verdict : Verdict
        What the distance means under the scene's thresholds.
    distance : Distance
        The signed distance between its bounds, points in the world. A pair that was refined no further than its
        verdict needed has wide bounds: of parts that certainly touch they may say no more than that the gap or the
        overlap is within the contact threshold. An overlap that is contact or allowed is given by minus its
        interference, the greatest depth of a point of one part in the other (a pin of 5 in a hole of 4.97: -0.03,
        though its way out is its length), that of a clash by minus its penetration depth, with ``lower`` minus
        infinity where that was not measured. In a motion: the least distance; of a clash that at ``t``, from above
        only.
    motion : str or None
        Name of the motion; None at rest.
    t, contact_at, contact_by : float or None
        In a motion: normalised time of the least distance, and of the first contact: all before ``contact_at`` is
        certainly free, and at ``contact_by`` they touch, to within the search's accuracy. These differ where the parts
        stay within that accuracy of contact, or the search's budget ended.
    reason : str
        Why a verdict is uncertain and what would decide it, or why the pair failed; else empty.
    locator : Locator or None
        Works ``where`` out.
    """

    a: str
    b: str
    verdict: Verdict
    distance: Distance
    motion: str | None = None
    t: float | None = None
    contact_at: float | None = None
    contact_by: float | None = None
    reason: str = ""
    locator: Locator | None = field(default=None, repr=False)

    @property
    def where(self) -> Overlap | None:
        """Where the parts of a clash overlap, in the world; None for another verdict. Worked out when first asked."""
        return None if self.locator is None else self.locator.overlap

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: unknown bounds are None."""
        row = {"a": self.a, "b": self.b, "verdict": self.verdict.value, **self.distance.to_dict()}
        if self.motion is not None:
            row |= {"motion": self.motion, "t": self.t, "contact_at": self.contact_at, "contact_by": self.contact_by}
        if self.reason:
            row["reason"] = self.reason
        if self.where is not None:
            row["where"] = self.where.to_dict()
        return row


@dataclass(frozen=True, slots=True)
class Work:
    """What an answer took: what was built for it, how often each level was asked, and the seconds of each stage.

    ``shapes``: different ones among the parts; ``candidates``: pairs that the broad phase left; ``decided``: pairs
    at rest by the level that gave the verdict, without those that failed or are undecided.
    """

    parts: int
    shapes: int
    pairs: int
    candidates: int
    meshes: int
    triangles: int
    hulls: int
    fits: int
    queries: Mapping[str, int]
    decided: Mapping[str, int]
    seconds: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class CheckResult:
    """Verdicts of a scene. ``pairs`` holds the pairs that came near; all others of ``scene`` are clear.

    ``asked`` names the pairs that were asked for, None for all. ``motions`` has a row for each pair and motion.
    """

    scene: Scene
    pairs: tuple[PairResult, ...]
    motions: tuple[PairResult, ...]
    asked: tuple[tuple[str, str], ...] | None
    work: Work

    @property
    def thresholds(self) -> Thresholds:
        """The thresholds that the verdicts are from."""
        return self.scene.thresholds

    @property
    def rows(self) -> tuple[PairResult, ...]:
        """Pairs at rest, then those in motion."""
        return self.pairs + self.motions

    @property
    def clean(self) -> bool:
        """Whether every pair was decided and none clashes, at rest or in motion; without a pair nothing is clean."""
        return self.work.pairs > 0 and not any(row.verdict in NOT_CLEAN for row in self.rows)

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows by verdict, worst first, with the clear pairs that never came near."""
        counts = Counter(row.verdict.value for row in self.rows)
        counts[Verdict.CLEAR.value] += self.work.pairs - len(self.pairs)
        return {v.value: counts[v.value] for v in Verdict if counts[v.value]}

    @property
    def findings(self) -> tuple[PairResult, ...]:
        """Rows that ask for attention, at rest and in motion, worst first: all but the clear and the allowed ones."""
        rows = [row for row in self.rows if row.verdict not in (Verdict.CLEAR, Verdict.ALLOWED)]
        order = {verdict: k for k, verdict in enumerate(Verdict)}
        return tuple(sorted(rows, key=lambda row: (order[row.verdict], row.distance.upper)))

    def verdict(self, a: str, b: str) -> Verdict:
        """Verdict of a pair at rest, in either order. Raises InputError for unknown names and pairs not asked for."""
        pair = frozenset((self.scene.index(a), self.scene.index(b)))
        if len(pair) < 2 or (self._asked is not None and pair not in self._asked):
            raise InputError(f"pair {a}:{b} was not checked")
        return self._verdicts.get(pair, Verdict.CLEAR)

    @cached_property
    def _verdicts(self) -> dict[frozenset[int], Verdict]:
        index = self.scene.index
        return {frozenset((index(row.a), index(row.b))): row.verdict for row in self.pairs}

    @cached_property
    def _asked(self) -> set[frozenset[int]] | None:
        return None if self.asked is None else {frozenset(map(self.scene.index, pair)) for pair in self.asked}

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; lengths in mm. Pairs that are not listed are clear."""
        return {
            "scene": self.scene.name,
            "thresholds": {"contact_mm": self.thresholds.contact, "clearance_mm": self.thresholds.clearance},
            "clean": self.clean,
            "counts": self.counts,
            "findings": [row.to_dict() for row in self.findings],
            "notes": list(self.scene.notes),
            "parts": {part.name: {"T_world": part.T_world.tolist()} for part in self.scene.parts},
            "pairs": [row.to_dict() for row in self.pairs],
            "motions": [row.to_dict() for row in self.motions],
        }

    def table(self) -> list[dict[str, Any]]:
        """One dict per row: ``pandas.DataFrame(result.table())`` makes a frame of it."""
        return [row.to_dict() for row in self.rows]

    def frame(self) -> Any:
        """The table as a pandas DataFrame. Raises MissingLibraryError if pandas is not installed."""
        need("pandas", "frame(), but not table(),")
        import pandas  # type: ignore[import-untyped,unused-ignore]

        columns = PairResult("", "", Verdict.CLEAR, Distance()).to_dict()  # also where there is no row
        return pandas.DataFrame(self.table(), columns=None if self.rows else list(columns))

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.counts.items()) or "no pairs"
        return f"CheckResult({self.scene.name!r}: {'clean' if self.clean else 'not clean'}; {counts})"

    def _repr_html_(self) -> str:
        from html import escape

        head = "".join(f"<th>{name}</th>" for name in ("pair", "motion", "verdict", "distance", "by"))
        body = "".join(
            f"<tr><td>{escape(row.a)} - {escape(row.b)}</td><td>{escape(row.motion or '')}</td>"
            f"<td>{row.verdict.value}</td><td>{row.distance.text}</td><td>{escape(row.distance.method)}</td></tr>"
            for row in self.findings[:_HTML_ROWS]
        )
        more = len(self.findings) - _HTML_ROWS
        foot = f"<p>and {more} more</p>" if more > 0 else ""
        return f"<p>{escape(repr(self))}</p><table><tr>{head}</tr>{body}</table>{foot}"
