"""The final state put to random clamps and wires, against a search that knows neither gradients nor multipliers.

Of each wire only the envelopes count: ``f1(x)``, the highest place that the up splint leaves its centre at ``x``, and
``d + f2(x, tilt)``, the lowest place over the down splint. A wire fits if ``f1(x) <= d + f2(x, tilt)`` somewhere in its
mouth, so the least distance for a tilt is ``max over wires of min over x of f1 - f2`` (or where faces meet), and the
final state is its least value over the tilts: nothing but a function on a grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.assembly.section import WIRES, Section
from clamp3d.clamp.dimensions import Clamp, PartName, Wire
from clamp3d.clamp.loader import load_clamp
from clamp3d.geometry.pose import Array


def random_clamp(rng: np.random.Generator) -> Clamp:
    """A clamp of the reference's kind with other grooves and wires: thick, thin, equal, nearly equal ones.

    Grooves are minor arcs that differ in all four places, or in none, or by 1e-9 ... 1e-3 mm.
    """
    base = load_clamp()
    alike = rng.random() < 0.3
    close = 10.0 ** rng.uniform(-9.0, -3.0) if rng.random() < 0.3 else 0.0
    while True:
        scale = rng.uniform(0.5, 1.2)

        def vary(value: float, scale: float = scale) -> float:
            return value * scale * (1.0 + close * rng.normal() if alike else rng.uniform(0.85, 1.15))

        grooves = []
        for part, below in ((base.up_splint, True), (base.down_splint, False)):
            for key in ("line_groove", "jumper_groove"):
                groove = getattr(part, key)
                radius = vary(23.8012)
                to_face = radius * math.cos(rng.uniform(0.3, 1.3) if not alike else 0.5)
                face = base.up_splint.thickness if below else base.down_splint.face_depth
                depth = face + to_face if below else face - to_face
                offset = vary(48.0, 1.0)
                grooves.append(replace(groove, radius=radius, offset=offset, centre_depth=depth))
        diameters = rng.uniform(2.0, 60.0, 2) if rng.random() < 0.7 else np.full(2, rng.uniform(10.0, 45.0))
        if rng.random() < 0.2:
            diameters[1] = diameters[0] * (1.0 + 10.0 ** rng.uniform(-12, -3))
        if rng.random() < 0.1:  # the radius of a groove
            diameters[0] = 2.0 * grooves[0].radius * (1.0 + rng.choice([0.0, 1e-12, -1e-12, 1e-6, -1e-6]))
        try:
            return replace(
                base,
                name="random",
                line=Wire(diameter=float(diameters[0])),
                jumper=Wire(diameter=float(diameters[1])),
                up_splint=replace(
                    base.up_splint, thickness=base.up_splint.thickness, line_groove=grooves[0], jumper_groove=grooves[1]
                ),
                down_splint=replace(base.down_splint, line_groove=grooves[2], jumper_groove=grooves[3]),
            )
        except ValueError:
            continue


@dataclass(frozen=True, slots=True)
class _Groove:
    """A groove in its part's section coordinates, mouth towards +1 (down) or -1 (up): centre, radius, half mouth."""

    x: float
    y: float
    R: float
    s: float
    face: float


def _grooves(clamp: Clamp, wire: PartName) -> tuple[_Groove, _Groove, float]:
    """Up groove in P1's coordinates, down groove in P2's, and the wire's radius."""
    side, key = (-1.0, "line_groove") if wire == "P6" else (1.0, "jumper_groove")
    up, down = getattr(clamp.up_splint, key), getattr(clamp.down_splint, key)
    over_face = up.centre_depth - clamp.up_splint.thickness
    under_face = clamp.down_splint.face_depth - down.centre_depth
    return (
        _Groove(
            clamp.up_splint.width / 2 + side * up.offset,
            up.centre_depth,
            up.radius,
            math.sqrt(up.radius**2 - over_face**2),
            clamp.up_splint.thickness,
        ),
        _Groove(
            side * down.offset,
            down.centre_depth,
            down.radius,
            math.sqrt(down.radius**2 - under_face**2),
            clamp.down_splint.face_depth,
        ),
        (clamp.line if wire == "P6" else clamp.jumper).radius,
    )


def _over(x: NDArray[Any], g: _Groove, r: float) -> NDArray[Any]:
    """Least y of a wire's centre at x under the up splint (y down)."""
    u = x - g.x
    y = np.where(np.abs(u) >= g.s, g.face + r, -np.inf)
    for lip in (-g.s, g.s):
        h2 = r * r - (u - lip) ** 2
        y = np.maximum(y, np.where(h2 >= 0.0, g.face + np.sqrt(np.maximum(h2, 0.0)), -np.inf))
    if r < g.R:
        reach = (g.R - r) * g.s / g.R
        h2 = (g.R - r) ** 2 - u * u
        y = np.maximum(y, np.where(np.abs(u) <= reach, g.y - np.sqrt(np.maximum(h2, 0.0)), -np.inf))
    return y


def _under(x: NDArray[Any], tilt: float, bolt_x: float, g: _Groove, r: float) -> NDArray[Any]:
    """Largest y of a wire's centre at x over the down splint, whose origin is at (bolt_x, 0) and turned by ``tilt``."""
    c, s = math.cos(tilt), math.sin(tilt)

    def point(u: float, v: float) -> tuple[float, float]:
        return bolt_x + u * c + v * s, -u * s + v * c

    (cx, cy), lips = point(g.x, g.y), [point(g.x + w * g.s, g.face) for w in (-1.0, 1.0)]
    y = np.full_like(x, np.inf)
    for (lx, ly), w in zip(lips, (-1.0, 1.0), strict=True):
        h2 = r * r - (x - lx) ** 2
        y = np.minimum(y, np.where(h2 >= 0.0, ly - np.sqrt(np.maximum(h2, 0.0)), np.inf))
        # The face beside the lip: its foot lies beyond the lip, the centre r off it.
        level = ly - (x - lx) * s / c - r / c
        along = (x - lx) * c - (level - ly) * s
        y = np.minimum(y, np.where(w * along >= 0.0, level, np.inf))
    if r < g.R:
        u = x - cx
        h2 = (g.R - r) ** 2 - u * u
        rest = np.sqrt(np.maximum(h2, 0.0))
        # Direction to the resting point, seen in the splint: within the arc's span about straight down.
        along, deep = u * c - rest * s, u * s + rest * c
        half = math.asin(g.s / g.R)
        within = (h2 >= 0.0) & (np.arctan2(np.abs(along), deep) <= half)
        y = np.minimum(y, np.where(within, cy + rest, np.inf))
    return y


class Envelope:
    """The least distance d for each tilt, found on grids only."""

    def __init__(self, clamp: Clamp, points: int = 1201) -> None:
        self.clamp = clamp
        self.bolt_x = clamp.up_splint.width / 2
        self.wires = [_grooves(clamp, wire) for wire in WIRES]
        self.points = points
        self.over = []
        for up, _, r in self.wires:
            x = np.linspace(up.x - up.s, up.x + up.s, points)
            self.over.append((x, _over(x, up, r)))

    def wire(self, i: int, tilt: float) -> float:
        """Least d for wire i at a tilt: grid, then finer grids around the least place."""
        up, down, r = self.wires[i]
        x, over = self.over[i]
        value = over - _under(x, tilt, self.bolt_x, down, r)
        step = x[1] - x[0]
        best = math.inf
        for k in _lows(value):
            centre, width = x[k], step
            for _ in range(14):
                fine = np.clip(np.linspace(centre - width, centre + width, 21), x[0], x[-1])
                f = _over(fine, up, r) - _under(fine, tilt, self.bolt_x, down, r)
                centre, width = fine[int(f.argmin())], width / 8.0
                best = min(best, float(f.min()))
        return best

    def faces(self, tilt: float) -> float:
        """Least d at which the inner faces do not overlap."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        c, s, v, half = math.cos(tilt), math.sin(tilt), down.face_depth, down.width / 2
        ends = [self.bolt_x + w * half * c + v * s for w in (-1.0, 1.0)]
        places = [max(ends[0], self.bolt_x - up.width / 2), min(ends[1], self.bolt_x + up.width / 2)]
        return max(up.thickness - (v / c - (x - self.bolt_x) * s / c) for x in places)

    def least(self, tilt: float) -> float:
        """Least d at a tilt."""
        return max(self.wire(0, tilt), self.wire(1, tilt), self.faces(tilt))

    def falls(self, q: Array, reach: float = 0.02) -> float:
        """How far in mm a state is above the lowest with tilt and wires within ``reach`` mm of it (0: a minimum)."""
        lever = self.clamp.down_splint.width / 2
        limit = self.clamp.down_splint.max_tilt
        best = np.inf
        for shift in np.linspace(-reach, reach, 41):
            tilt = (q[5] + shift) / lever
            if abs(tilt) > limit * (1.0 + 1e-12):
                continue
            d = self.faces(tilt)
            for i, (up, down, r) in enumerate(self.wires):
                x = np.linspace(q[2 * i] - reach, q[2 * i] + reach, 401)
                x = x[np.abs(x - up.x) <= up.s]
                d = max(d, float((_over(x, up, r) - _under(x, tilt, self.bolt_x, down, r)).min(initial=np.inf)))
            best = min(best, d)
        return max(0.0, float(q[4] - best))

    def minima(self, count: int = 121) -> list[tuple[float, float]]:
        """Local minima (d, tilt) over the allowed tilts, the lowest first; d good to about 1e-7 mm."""
        limit = self.clamp.down_splint.max_tilt
        tilts = np.linspace(-limit, limit, count)
        values = np.array([self.least(float(t)) for t in tilts])
        found = []
        for k in _lows(values):
            centre, width = float(tilts[k]), float(tilts[1] - tilts[0])
            best = (float(values[k]), centre)
            for _ in range(24):
                fine = np.clip(np.linspace(centre - width, centre + width, 9), -limit, limit)
                f = [self.least(float(t)) for t in fine]
                j = int(np.argmin(f))
                centre, width = float(fine[j]), width / 3.0
                best = min(best, (f[j], centre))
            found.append(best)
        return sorted(found)


def _lows(values: NDArray[Any]) -> list[int]:
    """Places no higher than their neighbours; of a level run the first and the last."""
    n = len(values)
    left = np.concatenate([[np.inf], values[:-1]])
    right = np.concatenate([values[1:], [np.inf]])
    low = (values <= left) & (values <= right) & ((values < left) | (values < right)) & np.isfinite(values)
    return [int(k) for k in np.flatnonzero(low)] or ([int(np.argmin(values))] if n else [])


def starts(rng: np.random.Generator, section: Section, n: int) -> list[Array]:
    """Open states (k <= n, 6), poor ones too: far open, fully tilted, wires beside the middle or against a lip."""
    found = []
    limit = section.clamp.down_splint.max_tilt
    for _ in range(n):
        tilt = float(rng.choice([-limit, 0.0, limit, rng.uniform(-limit, limit)]))
        q = section.open_state(section.open_distance() + rng.choice([0.0, 1.0, 100.0]) * rng.random(), tilt)
        q[:4] += rng.uniform(-5.0, 5.0, 4) * rng.choice([0.0, 1.0, 3.0])
        if section.gaps(q).value.min() > 0.0:
            found.append(q)
    return found
