"""Tuples that grow item by item: a longer one refers to the shorter, and nothing is copied before it is read."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeAlias, TypeVar

Item = TypeVar("Item")


class Link(Generic[Item]):
    """What was there ``before``, and ``last`` one more; never changed, so that any number of others may refer to it."""

    __slots__ = ("before", "last")

    def __init__(self, before: Linked[Item], last: Item) -> None:
        self.before, self.last = before, last


Linked: TypeAlias = tuple[Item, ...] | Link[Item]


def linked(before: Linked[Item], items: Iterable[Item]) -> Linked[Item]:
    """``before`` with more items behind it."""
    for item in items:
        before = Link(before, item)
    return before


def as_tuple(items: Linked[Item]) -> tuple[Item, ...]:
    """All of them, the first one first."""
    found: list[Item] = []
    while isinstance(items, Link):
        found.append(items.last)
        items = items.before
    return (*items, *reversed(found)) if found else items
