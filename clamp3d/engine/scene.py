"""A scene as data: parts with poses, thresholds, allowed contacts and motions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance, items, shown, text
from clamp3d.engine.allowed import Allowances, Allowed, is_like
from clamp3d.engine.verdict import Thresholds
from clamp3d.errors import InputError
from clamp3d.files.bodies import Component
from clamp3d.geometry.motion import Motion, scene_pose
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import AnyShape, Shape, as_shape

_NAMED = 8
"""Parts that a scene names when it is printed."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part and where it stands: ``T_world`` (4, 4), the origin by default, kept as a copy that cannot be written to.

    Raises InputError for an empty name or one with a space or one of ``: , * ?``, for what is no shape, and for a pose
    that is not rigid. ``component`` is its place in the product tree of the file that it was read from.
    """

    name: str
    shape: Shape
    T_world: Array = field(default_factory=lambda: np.eye(4))
    component: Component | None = None

    def __post_init__(self) -> None:
        text("name of a part", self.name)
        if not self.name or any(c in self.name for c in ":,*? \t\n"):
            raise InputError(f"part name must not be empty or hold a space or one of : , * ?, got {shown(self.name)}")
        object.__setattr__(self, "shape", as_shape(self.shape))
        T = np.array(scene_pose(self.T_world, f"pose of {self.name}"), order="C")
        T.flags.writeable = False
        object.__setattr__(self, "T_world", T)

    def __reduce__(self) -> tuple[Any, ...]:
        # Made again: an array that was pickled could be written to.
        return type(self), (self.name, self.shape, self.T_world, self.component)


@dataclass(frozen=True, repr=False)
class Scene:
    """Parts in the world, what counts as contact and clearance, what may touch, and how parts move.

    ``notes`` say what was assumed, repaired or left out when the parts were read.

    >>> import math
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.primitives import SweptArc
    >>> scene = Scene(clearance=1.0)
    >>> scene = scene.add("block", shapes.groove_block(SweptArc(7.0, math.radians(60), 50.0), 40.0, 20.0))
    >>> scene = scene.add("wire", shapes.cylinder(6.935, 80.0))
    >>> from clamp3d.engine.check import check
    >>> row = check(scene).pairs[0]
    >>> row.verdict.value, round(row.distance.value, 6), row.distance.method
    ('clearance', 0.065, 'groove kernel')
    """

    parts: tuple[Part, ...] = ()
    contact: float = 0.01
    clearance: float = 0.0
    allowed: tuple[Allowed, ...] = ()
    motions: tuple[Motion, ...] = ()
    name: str = "scene"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        Thresholds(self.contact, self.clearance)
        text("name of a scene", self.name)
        kinds = {"parts": Part, "allowed": Allowed, "motions": Motion}
        for key, kind in kinds.items():
            values = items(key, getattr(self, key), f"{kind.__name__}s")
            for item in values:
                instance(f"each of {key}", item, kind)
            object.__setattr__(self, key, values)
        for k, part in enumerate(self.parts):
            if self._index[part.name] > k:
                raise InputError(f"part {part.name!r} exists already; names must differ")
        for item in self.allowed:
            self._check_allowed(item)
        for motion in self.motions:
            if not motion.parts:
                raise InputError(f"motion {motion.name!r} must name at least one part")
            for name in motion.parts:
                if name not in self._index:
                    raise InputError(f"motion {motion.name!r}: {unknown_part(name, self._index)}")

    @cached_property
    def thresholds(self) -> Thresholds:
        """What counts as contact and clearance."""
        return Thresholds(self.contact, self.clearance)

    @cached_property
    def _index(self) -> dict[str, int]:
        """Positions of the parts by name."""
        return {part.name: k for k, part in enumerate(self.parts)}

    @cached_property
    def _allowances(self) -> Allowances:
        return Allowances.of(self.allowed, self.parts)

    def _with(self, **values: object) -> Scene:
        """The scene with other values in fields, which are known to fit: nothing is checked again."""
        scene = object.__new__(type(self))
        for key in self.__dataclass_fields__:
            object.__setattr__(scene, key, values.get(key, getattr(self, key)))
        return scene

    def __repr__(self) -> str:
        names = ", ".join([part.name for part in self.parts[:_NAMED]] + ["..."] * (len(self.parts) > _NAMED))
        return f"Scene({self.name!r}; parts: {names or 'none'}; motions: {len(self.motions)})"

    @classmethod
    def of(
        cls, parts: Mapping[str, tuple[AnyShape, ArrayLike]], *, clearance: float = 0.0, contact: float = 0.01
    ) -> Scene:
        """Scene of ``{name: (shape, T_world)}``. Raises InputError for bad names, shapes or poses."""
        instance("parts", parts, Mapping)
        for name, value in parts.items():
            if not (isinstance(value, (tuple, list)) and len(value) == 2):
                raise InputError(f"part {shown(name)} must be a pair (shape, T_world), got {shown(value)}")
        placed = tuple(Part(name, as_shape(shape), T) for name, (shape, T) in parts.items())  # type: ignore[arg-type]
        return cls(placed, clearance=clearance, contact=contact)

    def add(self, part: Part | str, shape: AnyShape | None = None, T_world: ArrayLike | None = None) -> Scene:
        """The scene with one more part: a `Part`, or a name, a shape and a pose (4, 4; the origin by default).

        Raises InputError for a bad name, shape or pose, and for a name that is taken.
        """
        if not isinstance(part, Part):
            part = Part(part, as_shape(shape), np.eye(4) if T_world is None else T_world)  # type: ignore[arg-type]
        elif shape is not None or T_world is not None:
            raise InputError("add() takes a Part alone, or a name with a shape and a pose")
        if part.name in self._index:
            raise InputError(f"part {part.name!r} exists already; names must differ")
        scene = self._with(parts=(*self.parts, part))
        object.__setattr__(scene, "_index", {**self._index, part.name: len(self.parts)})
        return scene

    def with_motion(self, *motions: Motion) -> Scene:
        """The scene with more motions, each after those before it. Raises InputError for parts that it has not."""
        return replace(self, motions=(*self.motions, *items("motions", motions, "Motions")))

    def allow(self, *pairs: tuple[str, str], overlap: float = 0.0) -> Scene:
        """The scene with contact of these pairs allowed, and overlap up to ``overlap`` mm."""
        added = tuple(Allowed(a, b, overlap) for a, b in name_pairs("pairs", pairs))
        for item in added:
            self._check_allowed(item)
        return self._with(allowed=(*self.allowed, *added))

    def _check_allowed(self, item: Allowed) -> None:
        for name in (item.a, item.b):
            if name not in self._index and not any(is_like(part.name, name) for part in self.parts):
                raise InputError(f"allowed: {unknown_part(name, (part.name for part in self.parts))}")

    def moved(self, poses: Mapping[str, ArrayLike]) -> Scene:
        """The scene with parts at other poses ``{name: T_world}``."""
        instance("poses", poses, Mapping)
        for name in poses:
            self.index(name)
        parts = tuple(
            replace(p, T_world=poses[p.name]) if p.name in poses else p  # type: ignore[arg-type]
            for p in self.parts
        )
        return replace(self, parts=parts)

    def index(self, name: str) -> int:
        """Position of a part in ``parts``. Raises InputError for an unknown name."""
        if text("part", name) not in self._index:
            raise InputError(unknown_part(name, self._index))
        return self._index[name]

    def pairs_by_rule(self, pairs: Iterable[tuple[str, str]]) -> dict[Allowed, int]:
        """How many of these pairs each rule that speaks of more than one allows."""
        rules, listed = self._allowances, list(pairs)
        return {rule: sum(rules.overlap_by(rule, *pair) is not None for pair in listed) for rule in rules.rules}

    def allowance(self, a: str, b: str) -> float | None:
        """Allowed overlap of a pair in mm; None if even contact is not meant."""
        return self._allowances.overlap(a, b) if self.allowed else None


def name_pairs(name: str, pairs: object) -> list[tuple[str, str]]:
    """Pairs of part names. Raises InputError for anything else."""
    names = []
    for pair in items(name, pairs, "pairs of part names"):
        two = items(name, pair, "pairs of part names")
        if len(two) != 2:
            raise InputError(f"{name} must be pairs of part names, got {shown(pair)}")
        names.append((text("part", two[0]), text("part", two[1])))
    return names


def unknown_part(name: str, names: Iterable[str]) -> str:
    """The message for a name that is no part."""
    available = sorted(names)
    listed = ", ".join(available[:12]) + (f", ... ({len(available)} in all)" if len(available) > 12 else "")
    return f"unknown part {shown(name)}; available: {listed or 'none'}"
