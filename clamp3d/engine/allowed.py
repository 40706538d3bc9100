"""Contacts that are meant: between which parts, or in which kind of fit, and how much they may overlap."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from clamp3d.checks import choice, number, text
from clamp3d.engine.relations import RELATIONS, Relation, relation
from clamp3d.errors import InputError

if TYPE_CHECKING:
    from clamp3d.engine.scene import Part


_SLACK = 1.1
"""What a fit may overlap, in parts of what its radii say: the measured overlap is certain within bounds only."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """Contact of ``a`` with ``b`` (names, or patterns with * and ?) is meant, and overlap up to ``overlap`` mm.

    With a ``relation`` ("running", "press", "thread" or "duplicate") only of parts that fit so, by default as deep as
    the radii of pin and hole say.
    """

    a: str = "*"
    b: str = "*"
    overlap: float = 0.0
    relation: str | None = None

    def __post_init__(self) -> None:
        text("allowed part", self.a)
        text("allowed part", self.b)
        if self.a == self.b and not _is_pattern(self.a):
            raise InputError(f"allowed must name two parts, got {self.a!r} twice")
        object.__setattr__(self, "overlap", number("allowed overlap", self.overlap, rule="be >= 0 mm"))
        if not self.overlap >= 0.0:
            raise InputError(f"allowed overlap must be >= 0 mm, got {self.overlap}")
        if self.relation is not None:
            choice("allowed relation", self.relation, RELATIONS)

    @property
    def is_general(self) -> bool:
        """Whether it speaks of more than one pair."""
        return self.relation is not None or _is_pattern(self.a + self.b)

    def __str__(self) -> str:
        names = "" if (self.a, self.b) == ("*", "*") else f"{self.a}:{self.b}"
        depth = f" up to {self.overlap:g} mm" if self.overlap else ""
        return " ".join(filter(None, (self.relation, names))) + depth

    def fits(self, a: str, b: str) -> bool:
        """Whether it speaks of these two names, in either order."""
        return any(is_like(x, self.a) and is_like(y, self.b) for x, y in ((a, b), (b, a)))


def is_like(name: str, pattern: str) -> bool:
    """Whether a name is the pattern, in which * stands for any characters, ? for one, and brackets for themselves.

    >>> is_like("pin[1]", "pin[1]"), is_like("pin1", "pin[1]"), is_like("pin[2]", "pin[?]")
    (True, False, True)
    """
    return fnmatchcase(name, pattern.replace("[", "[[]"))


def _is_pattern(name: str) -> bool:
    return any(c in name for c in "*?")


@dataclass(frozen=True, slots=True)
class Allowances:
    """Allowed overlaps (mm) by names in either order, and the rules for more than one pair."""

    exact: dict[tuple[str, str], float]
    rules: tuple[Allowed, ...]
    parts: Mapping[str, Part]
    _relations: dict[tuple[str, str], Relation | None] = field(default_factory=dict)

    @classmethod
    def of(cls, allowed: Iterable[Allowed], parts: Iterable[Part]) -> Allowances:
        """Sorted into names and rules."""
        exact: dict[tuple[str, str], float] = {}
        rules = []
        for item in allowed:
            if item.is_general:
                rules.append(item)
                continue
            for pair in ((item.a, item.b), (item.b, item.a)):
                exact[pair] = max(item.overlap, exact.get(pair, 0.0))
        return cls(exact, tuple(rules), {part.name: part for part in parts} if rules else {})

    def overlap(self, a: str, b: str) -> float | None:
        """Largest overlap that is allowed, mm; None if even contact is not meant."""
        depths = [self.exact.get((a, b)), *(self.overlap_by(rule, a, b) for rule in self.rules)]
        return max((depth for depth in depths if depth is not None), default=None)

    def overlap_by(self, rule: Allowed, a: str, b: str) -> float | None:
        """Overlap that one rule allows, mm; None where it does not speak of the pair."""
        if not rule.fits(a, b):
            return None
        if rule.relation is None:
            return rule.overlap
        if (a, b) not in self._relations:
            self._relations[a, b] = relation(self.parts[a], self.parts[b])
        fit = self._relations[a, b]
        return None if fit is None or fit.kind != rule.relation else rule.overlap or _SLACK * fit.overlap
