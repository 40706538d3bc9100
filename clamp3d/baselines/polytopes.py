"""A part as a set of convex polytopes, each an `fcl.Convex`: what the models `wedges` and `hulls` share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from clamp3d.baselines.fcl_shapes import Shape, Wire, check_poses, distance, measure
from clamp3d.baselines.model import Pieces
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array
from clamp3d.errors import InputError

_T = TypeVar("_T")


class Polytopes:
    """Named convex shapes of one part; wires are measured against each of them.

    Depth is that of the deepest single polytope: exact for a wire that reaches into one face, and never more than
    the true way out of the union.
    """

    def __init__(self, shapes: Sequence[Shape], names: Sequence[str]) -> None:
        self.shapes = tuple(shapes)
        self.names = tuple(names)
        self._low = np.array([shape.bounds[0] for shape in shapes])
        self._high = np.array([shape.bounds[1] for shape in shapes])

    def pieces(self, wire: Wire, T_a_wire: Array) -> Pieces:
        """One gap per polytope, with the wire at a pose (4, 4) in the part's frame."""
        wire.place(check_poses(T_a_wire[None])[0])
        found = [measure(shape, wire) for shape in self.shapes]
        return Pieces(
            np.array([m.distance for m in found]),
            np.array([m.point_a for m in found]),
            np.array([m.normal for m in found]),
            self.names,
        )

    def distances(self, wire: Wire, T_a_wire: Array) -> Array:
        """Least signed distance (n,) at poses (n, 4, 4), the polytopes taken by the distance of their boxes.

        FCL's own broadphase answers the same and takes as long here: a wire's box covers most of a groove.
        """
        poses = check_poses(T_a_wire)
        # Box of the cylinder: half extents |axis| L/2 + r sqrt(1 - axis^2) per coordinate.
        axis, middle = poses[:, :3, 2], poses[:, :3, 3]
        reach = np.abs(axis) * wire.cylinder.length / 2 + wire.cylinder.radius * np.sqrt(np.maximum(0.0, 1.0 - axis**2))
        below = self._low - (middle + reach)[:, None]
        above = (middle - reach)[:, None] - self._high
        apart = np.linalg.norm(np.maximum(0.0, np.maximum(below, above)), axis=2)
        out = np.empty(len(poses))
        for i, order in enumerate(np.argsort(apart, axis=1)):
            wire.place(poses[i])
            least = np.inf
            for k in order:
                if apart[i, k] > max(least, 0.0):
                    break
                least = min(least, distance(self.shapes[k], wire))
            out[i] = least
        return out


class Wires:
    """FCL cylinders by size, made once."""

    def __init__(self) -> None:
        self._made: dict[object, Wire] = {}

    def of(self, pair: GroovePair) -> Wire:
        """The wire of a pair."""
        if pair.cylinder not in self._made:
            self._made[pair.cylinder] = Wire(pair.cylinder)
        return self._made[pair.cylinder]


class PerPart(Mapping[str, _T]):
    """Something made for a part when it is first asked for. Raises InputError for a part that is not there."""

    def __init__(self, names: Sequence[str], make: Callable[[str], _T]) -> None:
        self._names, self._make, self._made = tuple(names), make, dict[str, _T]()

    @property
    def made(self) -> int:
        """How many have been asked for so far."""
        return len(self._made)

    def __getitem__(self, name: str) -> _T:
        if name not in self._made:
            if name not in self._names:
                raise InputError(f"unknown part {name!r}; available: {', '.join(self._names)}")
            self._made[name] = self._make(name)
        return self._made[name]

    def __iter__(self):  # type: ignore[no-untyped-def]
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)
