"""What a check answers: frozen dataclasses, and the same as a table."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from clamp3d.collide.bounds import Thresholds, Verdict
from clamp3d.collide.scene import Scene, unknown_part
from clamp3d.core.pose import Array
from clamp3d.errors import InputError

BAD = (Verdict.CLASH, Verdict.CONTAINED)


@dataclass(frozen=True, slots=True, eq=False)
class PairResult:
    """A pair that the boxes could not part: its signed distance lies from ``low`` to ``high`` mm (positive apart).

    A pair that climbed no further than its verdict needed has wide bounds. ``rung`` and ``method`` gave the last word.
    ``point_a``, ``point_b`` (3,) in the world attest ``high``; None where it is infinite. For a motion, ``motion``
    names it, ``t`` (0 to 1) is the instant of the least distance and ``contact_at`` the first one of contact.
    """

    a: str
    b: str
    verdict: Verdict
    low: float
    high: float
    rung: str
    method: str
    point_a: Array | None = None
    point_b: Array | None = None
    motion: str | None = None
    t: float | None = None
    contact_at: float | None = None

    @property
    def distance(self) -> float | None:
        """Middle of the bounds in mm; None if only one is known."""
        return 0.5 * (self.low + self.high) if math.isfinite(self.low) and math.isfinite(self.high) else None

    @property
    def error_bound(self) -> float:
        """How far ``distance`` can be off, mm; infinite if only one bound is known."""
        return 0.5 * (self.high - self.low) if self.distance is not None else math.inf

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: unknown bounds are None."""

        def finite(x: float) -> float | None:
            return x if math.isfinite(x) else None

        row: dict[str, Any] = {
            "a": self.a,
            "b": self.b,
            "verdict": self.verdict.value,
            "distance_mm": self.distance,
            "error_bound_mm": finite(self.error_bound),
            "at_least_mm": finite(self.low),
            "at_most_mm": finite(self.high),
            "rung": self.rung,
            "method": self.method,
            "point_a": None if self.point_a is None else self.point_a.tolist(),
            "point_b": None if self.point_b is None else self.point_b.tolist(),
        }
        if self.motion is not None:
            row |= {"motion": self.motion, "t": self.t, "contact_at": self.contact_at}
        return row


@dataclass(frozen=True, slots=True)
class Work:
    """What an answer took. ``fixed_...``: what one fixed fidelity (all meshes at ``fixed_error`` mm, every pair) takes.

    ``queries`` by rung; ``decided`` pairs by the rung that gave the verdict. ``fixed_triangles`` is counted from the
    outlines unless the full model was built.
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
    fixed_error: float
    fixed_meshes: int
    fixed_triangles: int
    fixed_queries: int
    full: bool


@dataclass(frozen=True, slots=True, eq=False)
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
        """Whether nothing clashes."""
        return not any(row.verdict in BAD for row in self.rows)

    @property
    def counts(self) -> dict[str, int]:
        """Number of pairs at rest by verdict, the clear ones that never came near included."""
        found = Counter(row.verdict.value for row in self.pairs)
        found[Verdict.CLEAR.value] += self.work.pairs - len(self.pairs)
        return {v.value: found[v.value] for v in Verdict if found[v.value]}

    def verdict(self, a: str, b: str) -> Verdict:
        """Verdict of a pair at rest, in either order. Raises InputError for unknown names and pairs not asked for."""
        names = {p.name for p in self.scene.parts}
        for name in (a, b):
            if name not in names:
                raise InputError(unknown_part(name, names))
        if a == b or (self.asked is not None and (a, b) not in self.asked and (b, a) not in self.asked):
            raise InputError(f"pair {a}:{b} was not checked")
        for row in self.pairs:
            if {row.a, row.b} == {a, b}:
                return row.verdict
        return Verdict.CLEAR

    def table(self) -> list[dict[str, Any]]:
        """One dict per row: ``pandas.DataFrame(result.table())`` makes a frame of it."""
        return [row.to_dict() for row in self.rows]

    def frame(self) -> Any:
        """The table as a pandas DataFrame. Raises MissingLibraryError if pandas is not installed."""
        try:
            import pandas  # type: ignore[import-untyped,unused-ignore]
        except ImportError:
            from clamp3d.errors import MissingLibraryError

            raise MissingLibraryError("frame() needs pandas: pip install pandas; table() does without") from None
        return pandas.DataFrame(self.table())
