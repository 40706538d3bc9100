"""Families of a flat-ended cylinder against finite bodies: boxes, plates with a hole, other cylinders.

Each case is a contact of two features at a small gap or overlap. The truth is an
interval of the signed distance: apart that of the branch and bound of `flat_truth`; in an overlap the depth is at least
that of the deepest point inside, and at most what parts the bodies in any of many directions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.family import Methods
from clamp3d.bench.stress.outcome import REFERENCE
from clamp3d.bench.stress.poses import draw
from clamp3d.bench.stress.poses.flat import MAX_BOXES, NARROW, FlatFamily
from clamp3d.bench.stress.poses.flat_truth import solid_truth
from clamp3d.bench.stress.worker import Measured, Measures, Rows
from clamp3d.collide.distance import distance
from clamp3d.collide.model import ModelCache
from clamp3d.core import shapes
from clamp3d.core.pose import Array, rotation
from clamp3d.core.primitives import Cylinder
from clamp3d.core.shapes import Solid
from clamp3d.testing import assert_distance, directions

_WAYS = directions(200)
_ROUNDING = 1e-9
"""What the engine's bounds may be wrong by, in parts of the bodies' size."""


@dataclass(frozen=True, slots=True)
class Solids(Rows):
    """n cases: half sizes (n, 3) of the block around each body, its ``radius`` (n,), the cylinder's sizes and pose.

    A ``hollow`` body is the block outside the circle of the radius (0: all of it), any other what is inside.
    """

    hollow: bool
    half: Array
    radius: Array
    r: Array
    length: Array
    T: Array
    shape: NDArray[np.intp]

    def scene(self) -> Array:
        """Largest length of each case (n,), mm."""
        sizes = [self.half.max(1), self.radius, self.r, self.length, np.abs(self.T[:, :3, 3]).max(1)]
        return np.asarray(np.maximum.reduce(sizes))

    def body(self, i: int) -> Solid | Cylinder:
        """The body of case i."""
        R, (x, y, z) = float(self.radius[i]), (2.0 * self.half[i]).tolist()
        if not self.hollow:
            return Cylinder(R, z)
        return shapes.box((x, y, z), holes=[shapes.Hole(R, (0.0, 0.0))] if R > 0.0 else ())

    def cylinder(self, i: int) -> Cylinder:
        """The cylinder of case i."""
        return Cylinder(float(self.r[i]), float(self.length[i]))


def _turned(rng: np.random.Generator) -> Array:
    """A pose (4, 4) turned at random: anyhow, about one axis of the body, or along its axes."""
    T = rotation(rng.normal(size=3), rng.uniform(0.0, math.pi))
    kind = rng.random()
    if kind < 2 / 3:
        T = rotation(np.eye(3)[rng.integers(3)], rng.uniform(0.0, math.pi) if kind < 1 / 3 else 0.0)
        T = T @ rotation(np.eye(3)[rng.integers(3)], 0.5 * math.pi * int(rng.integers(4)))
    return T


def _cases(rng: np.random.Generator, n: int, kind: str) -> Solids:
    """Cylinders anywhere about a body, moved along the normal that the engine tells until they are at a small gap.

    The engine only chooses where a case is: its truth is found from the bodies as they stand then.
    """
    k = draw.count(n)
    half, radius = 10.0 ** rng.uniform(0.0, 1.5, (k, 3)), np.zeros(k)
    r, length = 10.0 ** rng.uniform(0.0, 1.3, k), 10.0 ** rng.uniform(0.0, 2.0, k)
    if kind == "cylinder":
        radius = half[:, 0].copy()
        half[:, 1] = radius
    if kind == "hole":
        radius = half[:, :2].min(1) * rng.uniform(0.2, 0.9, k)
        r = radius * np.where(rng.random(k) < 0.7, rng.uniform(0.3, 0.999, k), rng.uniform(1.0, 3.0, k))
    shape = draw.spread(n, k)
    T = np.array([_turned(rng) for _ in range(n)])
    cases = Solids(kind != "cylinder", half[shape], radius[shape], r[shape], length[shape], T, shape)
    # Most cylinders at a plate are put into its hole or across its rims.
    about = np.where(rng.random(n) < 0.7, radius[shape], 0.0) if kind == "hole" else np.zeros(n)
    reach = np.where(about[:, None] > 0.0, about[:, None] * [0.3, 0.3, 0.0] + cases.half * [0.0, 0.0, 1.0], cases.half)
    T[:, :3, 3] = rng.uniform(-1.0, 1.0, (n, 3)) * (reach + np.where(about > 0.0, 0.0, r[shape])[:, None])
    gap, cache = cases.r * draw.powers(rng, n, -12, -1), ModelCache()
    for i in range(n):
        near = distance(cases.body(i), cases.cylinder(i), T[i], cache=cache)
        if near.normal is not None and math.isfinite(near.lower):
            T[i, :3, 3] += (gap[i] - near.lower) * near.normal
    return cases


class EngineMethod:
    """The pair engine, as `clamp3d.distance` answers; its bounds are good to 1e-9 of the parts' size."""

    measures: Measures = "depth"

    def measure(self, cases: Solids) -> Measured:
        """See `Method`. Where no depth is known, but only that it is not less, it is unsure."""
        cache = ModelCache()
        a, b = cases.body(0), cases.cylinder(0)
        found = np.array([(d.lower, d.upper) for d in (distance(a, b, T, cache=cache) for T in cases.T)])
        low, high = found.T
        unsure = ~np.isfinite(low)
        low = np.where(unsure, high, low)
        bound = 0.5 * np.maximum(high - low, 0.0) + _ROUNDING * cases.scene()
        return Measured(0.5 * (low + high), bound, unsure, "the depth is not bounded from above")


class SolidFamily(FlatFamily):
    """A kind of body that a flat-ended cylinder touches."""

    methods: ClassVar[Methods] = {REFERENCE: ("the exact engine, with proven bounds", EngineMethod)}

    def __init__(self, kind: str, about: str) -> None:
        super().__init__(f"solid: {kind}", about, partial(_cases, kind=kind))

    def interval(self, cases: Solids, i: int, most: int = MAX_BOXES) -> tuple[float, float]:  # type: ignore[override]
        """See `FlatFamily`."""
        T, half = cases.T[i], cases.half[i]
        R, r, length = float(cases.radius[i]), float(cases.r[i]), float(cases.length[i])
        rounding = NARROW * float(cases.take([i]).scene()[0])
        low, high = solid_truth(R, cases.hollow, half, r, length, T, rounding, most)
        if low > -rounding:
            return low - rounding, high + rounding
        c, d = T[:3, 3], T[:3, 2]
        ways = np.vstack([_WAYS, np.eye(3), -np.eye(3), d, -d])
        if cases.hollow:
            own = np.abs(ways) @ half
        else:
            own = R * np.hypot(ways[:, 0], ways[:, 1]) + half[2] * np.abs(ways[:, 2])
        along = ways @ d
        other = 0.5 * length * np.abs(along) + r * np.sqrt(np.maximum(1.0 - along * along, 0.0)) - ways @ c
        shortest = float((own + other).min())
        return -shortest - rounding, high + rounding

    def difference(self, cases: Solids, truths: Array, i: int) -> float:  # type: ignore[override]
        """See `Family`; and the answer's points, normal and depth hold before an oracle of its own."""
        a, b, T = cases.body(i), cases.cylinder(i), cases.T[i]
        assert_distance(distance(a, b, T), a, b, T, tolerance=1e-6)
        return super().difference(cases, truths, i)  # type: ignore[arg-type]

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        low, high = self.interval(cases, i)
        size, R = (2.0 * cases.half[i]).tolist(), float(cases.radius[i])
        body = f"shapes.box({size}" + (f", holes=[shapes.Hole({R!r})])" if R > 0.0 else ")")
        lines = [
            "import clamp3d",
            "from clamp3d import shapes",
            f"body = {body if cases.hollow else f'clamp3d.kernel.{cases.body(i)!r}'}",
            f"wire = clamp3d.kernel.{cases.cylinder(i)!r}",
            f"print(clamp3d.distance(body, wire, {cases.T[i].tolist()}))",
            f"# truth: from {low!r} to {high!r} mm",
        ]
        return "\n".join(lines)


_FAMILIES = (
    SolidFamily("box", "features of a cylinder on faces, edges and corners of a box, gaps of +-1e-12 ... 0.1 radii"),
    SolidFamily("cylinder", "the same on another flat-ended cylinder: sides, rims, ends"),
    SolidFamily("hole", "the same in and about the hole of a plate: its wall, its rims, the plate's other faces"),
)
SOLIDS = {family.name: family for family in _FAMILIES}
