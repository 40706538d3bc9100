"""Contacts that are meant: between which parts, and how much they may overlap."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

from clamp3d.checks import number, text
from clamp3d.errors import InputError


@dataclass(frozen=True, slots=True)
class Allowed:
    """Contact of ``a`` with ``b`` (names, or patterns with * and ?) is meant, and overlap up to ``overlap`` mm."""

    a: str
    b: str
    overlap: float = 0.0

    def __post_init__(self) -> None:
        text("allowed part", self.a)
        text("allowed part", self.b)
        if self.a == self.b and not _is_pattern(self.a):
            raise InputError(f"allowed must name two parts, got {self.a!r} twice")
        object.__setattr__(self, "overlap", number("allowed overlap", self.overlap, rule="be >= 0 mm"))
        if not self.overlap >= 0.0:
            raise InputError(f"allowed overlap must be >= 0 mm, got {self.overlap}")

    def fits(self, a: str, b: str) -> bool:
        """Whether it speaks of these two, in either order."""
        return any(fnmatchcase(x, self.a) and fnmatchcase(y, self.b) for x, y in ((a, b), (b, a)))


def _is_pattern(name: str) -> bool:
    return any(c in name for c in "*?[")


@dataclass(frozen=True, slots=True)
class Allowances:
    """Allowed overlaps (mm) by names in either order, and those that are given with patterns."""

    exact: dict[tuple[str, str], float]
    patterns: tuple[Allowed, ...]

    @classmethod
    def of(cls, allowed: Iterable[Allowed]) -> Allowances:
        """Sorted into names and patterns."""
        exact: dict[tuple[str, str], float] = {}
        patterns = []
        for item in allowed:
            if _is_pattern(item.a + item.b):
                patterns.append(item)
                continue
            for pair in ((item.a, item.b), (item.b, item.a)):
                exact[pair] = max(item.overlap, exact.get(pair, 0.0))
        return cls(exact, tuple(patterns))

    def overlap(self, a: str, b: str) -> float | None:
        """Largest overlap that is allowed, mm; None if even contact is not meant."""
        overlaps = [item.overlap for item in self.patterns if item.fits(a, b)]
        if (a, b) in self.exact:
            overlaps.append(self.exact[a, b])
        return max(overlaps) if overlaps else None
