"""A groove and the cylinder that lies in it, each placed in its part: what every contact model measures."""

from __future__ import annotations

from dataclasses import dataclass, field

from clamp3d.core.pose import Array, inverse
from clamp3d.core.primitives import Cylinder, SweptArc


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
