"""What a contact model is: a way to measure the gap between a groove and the cylinder that lies in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from clamp3d.geometry.pose import Array, inverse
from clamp3d.geometry.primitives import Cylinder, SweptArc


@dataclass(frozen=True, slots=True)
class GroovePair:
    """A groove and the cylinder that is meant to lie in it (type 3 of the connection matrix).

    ``T_a_groove`` and ``T_b_cylinder`` (4, 4) place them in the frames of their parts ``a`` and ``b``;
    ``T_groove_a`` is the first one's inverse.
    """

    a: str
    b: str
    groove: SweptArc
    T_a_groove: Array
    cylinder: Cylinder
    T_b_cylinder: Array
    T_groove_a: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_groove_a", inverse(self.T_a_groove))


@dataclass(frozen=True, slots=True)
class Pieces:
    """Signed gaps (k,) mm from each piece of a grooved part to the cylinder, in the frame of the grooved part.

    A model cuts the groove into pieces (an arc and two faces, chords, hulls); the least is the pair's distance.
    ``point`` (k, 3) mm lies on the groove, ``normal`` (k, 3) is unit from groove to cylinder, ``feature``
    names the piece.
    Each gap is continuous in the pose, so a solver takes every piece as a constraint of its own.
    """

    distance: Array
    point: Array
    normal: Array
    feature: tuple[str, ...]


@runtime_checkable
class ContactModel(Protocol):
    """One way to measure a `GroovePair`; all models answer the same questions on the same parts."""

    @property
    def name(self) -> str:
        """What the user calls it: 'cas', 'chords', ..."""

    @property
    def limits(self) -> tuple[str, ...]:
        """What the model cannot do, in words for the user: 'no depth', 'surface only', ..."""

    @property
    def meshes_built(self) -> int:
        """How many parts had to be meshed so far."""

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps of all pieces of ``pair`` with part b at ``T_a_b`` (4, 4) in part a's frame."""

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Signed distances (n,) mm for poses (n, 4, 4)."""
