"""Cases of the pose families: shapes and poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.worker import Rows
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import AnyCylinder, Capsule, Cylinder, SweptArc
from clamp3d.kernel.contact_model import GroovePair

Extended = np.longdouble
"""80-bit floats where the platform has them: only there is the quick truth good enough (see `truth`)."""


@dataclass(frozen=True, slots=True)
class Shapes:
    """Grooves and wires, one row each (k,): ``R``, ``half_angle``, ``L`` of the groove, ``r``, ``length`` of the wire.

    Lengths in mm, angles in rad. The wires are capsules, or cylinders with ``flat`` ends.
    """

    R: Array
    half_angle: Array
    L: Array
    r: Array
    length: Array
    flat: bool = False

    def __len__(self) -> int:
        return len(self.R)

    def size(self) -> Array:
        """Largest length of each (k,), mm."""
        return np.asarray(np.maximum.reduce([self.R, self.L, self.r, self.length]))

    def lips(self, shape: NDArray[np.intp]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Half the mouth and height of the lips (n,) of the grooves of n cases, as long doubles."""
        R, a = (np.asarray(v, Extended) for v in (self.R, self.half_angle))
        return (R * np.sin(a))[shape], (-R * np.cos(a))[shape]

    def groove(self, k: int) -> SweptArc:
        """Groove of row k."""
        return SweptArc(float(self.R[k]), float(self.half_angle[k]), float(self.L[k]))

    def wire(self, k: int) -> AnyCylinder:
        """Wire of row k."""
        return (Cylinder if self.flat else Capsule)(float(self.r[k]), float(self.length[k]))

    def snippet(self, k: int) -> list[str]:
        """Python lines that make the groove and the wire of row k, bit by bit the same numbers."""
        shapes = {"groove": self.groove(k), "wire": self.wire(k)}
        return ["import numpy as np", "import clamp3d", *(f"{n} = clamp3d.kernel.{s!r}" for n, s in shapes.items())]

    def pair(self, k: int) -> GroovePair:
        """Row k as a pair that a contact model takes; both parts have their feature's own frame."""
        cylinder = Cylinder(float(self.r[k]), float(self.length[k]))
        return GroovePair("P1", "P6", self.groove(k), np.eye(4), cylinder, np.eye(4))


@dataclass(frozen=True, slots=True)
class Cases(Rows):
    """n cases: ``shape`` (n,) row of ``shapes``, poses ``T_groove_wire`` (n, 4, 4), and ``gap`` (n,) mm.

    ``gap`` is what a case was built for, NaN where it was not built from an answer; another place of the groove may be
    nearer.
    """

    shapes: Shapes
    shape: NDArray[np.intp]
    T_groove_wire: Array
    gap: Array

    def scene(self) -> Array:
        """Largest length of each case (n,), mm: sizes, and the distance of the two bodies' origins."""
        return np.asarray(np.maximum(self.shapes.size()[self.shape], np.abs(self.T_groove_wire[:, :3, 3]).max(axis=1)))

    def snippet(self, i: int) -> str:
        """Python lines that ask for case i alone, bit by bit the same numbers."""
        lines = [
            *self.shapes.snippet(int(self.shape[i])),
            f"T_groove_wire = np.array({self.T_groove_wire[i].tolist()})",
            "print(clamp3d.kernel.signed_distance(groove, wire, T_groove_wire))",
        ]
        return "\n".join(lines)


def unit_rows(vectors: Any) -> NDArray[Any]:
    """Vectors (n, 3) of length 1, as long doubles."""
    v = np.asarray(vectors, Extended)
    return np.asarray(v / np.sqrt((v * v).sum(1))[:, None])
