"""The truth about a clamp's equilibria: curves in closed form, with neither gradients nor multipliers.

Of each wire only the envelopes count: ``over(x)``, the highest place that the up splint leaves its centre at ``x``, and
``d + under(x, tilt)``, the lowest place above the down splint (y down). A wire fits at x if ``d >= over - under``, so a
clamp may close, at a tilt, until d is the largest of the two wires' ``over - under`` and of where the faces meet.

Both envelopes are made of circular arcs and straight lines. The places where ``over - under`` can have an extremum in x
are known in closed form: where two of them meet, and where an arc of one and a piece of the other have the same slope
(``(x - a) / p = +-(x - b) / q`` for circles about a and b of radii p and q). Between two neighbouring places of that
list the function is monotone, so its minima are read from the list, exact to rounding (1e-13 of the clamp). Only the
tilt is searched. Where it is more than the saddle's edges leave, the down splint stands on one of them, off its arc: d,
where the saddle is, is larger by what it is lifted.

Grooves must be minor arcs (half angle up to 90 degrees): over others a wire can hide behind a lip. A wire may leave its
groove, over a face and round the splint's outer edge, where nothing holds it any more; the bolt stops it on the inside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.section import WIRES
from clamp3d.geometry.pose import Array


@dataclass(frozen=True, slots=True)
class _Groove:
    """A groove in its part's section coordinates: arc centre, radius, half mouth, height of the inner face."""

    x: float
    y: float
    R: float
    s: float
    face: float


def _grooves(clamp: Clamp, wire: PartName) -> tuple[_Groove, _Groove, float]:
    """Up groove in P1's coordinates, down groove in P2's, and the wire's radius."""
    side, key = (-1.0, "line_groove") if wire == "P6" else (1.0, "jumper_groove")
    grooves = []
    for part, middle, face in (
        (clamp.up_splint, clamp.up_splint.width / 2, clamp.up_splint.thickness),
        (clamp.down_splint, 0.0, clamp.down_splint.face_depth),
    ):
        g = getattr(part, key)
        to_face = abs(g.centre_depth - face)
        half_mouth = math.sqrt((g.radius - to_face) * (g.radius + to_face))
        grooves.append(_Groove(middle + side * g.offset, g.centre_depth, g.radius, half_mouth, face))
    return grooves[0], grooves[1], (clamp.line if wire == "P6" else clamp.jumper).radius


def _root(a: Array, b: Array | float) -> Array:
    """Square root of a^2 - b^2, NaN where it is none."""
    square = (b - a) * (b + a)
    return np.sqrt(np.where(square >= 0.0, square, np.nan))


@dataclass(frozen=True, slots=True)
class Wire:
    """One wire between its two grooves; ``tilt`` is (n,), places ``x`` (n, k), n rows at once."""

    up: _Groove
    down: _Groove
    r: float
    bolt_x: float
    bolt_r: float
    half_up: float
    half_down: float

    @property
    def side(self) -> float:
        """-1 for the line, +1 for the jumper."""
        return -1.0 if self.up.x < self.bolt_x else 1.0

    @property
    def inner(self) -> float:
        """Where the wire touches the bolt."""
        return self.bolt_x + self.side * (self.bolt_r + self.r)

    @property
    def edge(self) -> float:
        """Outer edge of the up splint."""
        return self.bolt_x + self.side * self.half_up

    @property
    def window(self) -> tuple[float, float]:
        """Places from the bolt to beyond both splints."""
        out = self.bolt_x + self.side * (max(self.half_up, self.half_down) + 2.0 * self.r)
        return min(self.inner, out), max(self.inner, out)

    def over(self, x: Array) -> Array:
        """Least y of the centre at x (any shape) under the up splint; minus infinity beside it."""
        g, r = self.up, self.r
        u = x - g.x
        y = np.fmax(g.face + _root(u + g.s, r), g.face + _root(u - g.s, r))
        if r < g.R:
            arc = g.y - _root(u, g.R - r)
            y = np.fmax(y, np.where(np.abs(u) <= (g.R - r) * g.s / g.R, arc, np.nan))
        beyond = self.side * (x - self.edge)
        y = np.where((np.abs(u) >= g.s) & (beyond <= 0.0), g.face + r, y)
        corner = np.nan_to_num(g.face + _root(beyond, r), nan=-np.inf)
        return np.where(beyond > 0.0, corner, y)

    def under(self, x: Array, tilt: Array) -> Array:
        """Largest y (n, k) of the centre at x over the down splint with its origin at (bolt_x, 0)."""
        g, r = self.down, self.r
        c, s = np.cos(tilt)[:, None], np.sin(tilt)[:, None]
        y = np.full(x.shape, np.nan)
        for w in (-1.0, 1.0):
            lx, ly = self._place(g.x + w * g.s, g.face, tilt)
            # Beside the lip the centre runs r above the face; its foot lies beyond the lip.
            level = ly - (x - lx) * s / c - r / c
            beside = w * ((x - lx) + r * s) >= 0.0
            y = np.fmin(y, np.where(beside, level, ly - _root(x - lx, r)))
        if r < g.R:
            cx, cy = self._place(g.x, g.y, tilt)
            rest = _root(x - cx, g.R - r)
            along, deep = (x - cx) * c - rest * s, (x - cx) * s + rest * c
            inside = np.abs(along) * (math.sqrt((g.R - g.s) * (g.R + g.s))) <= deep * g.s
            y = np.fmin(y, np.where(inside, cy + rest, np.nan))
        ex, ey = self._place(self.side * self.half_down, g.face, tilt)
        corner = np.nan_to_num(ey - _root(x - ex, r), nan=np.inf)
        return np.where(self.side * ((x - ex) + r * s) > 0.0, corner, y)

    def least(self, x: Array, tilt: Array) -> Array:
        """Least d (n, k) with the wire's centre at x."""
        return self.over(x) - self.under(x, tilt)

    def places(self, tilt: Array) -> Array:
        """Places (n, k) in the window between which the least d is monotone, in order."""
        up, down, r = self.up, self.down, self.r
        n = len(tilt)
        s = np.sin(tilt)[:, None]
        one = np.ones((n, 1))
        lips_up = [(up.x - up.s, r), (up.x + up.s, r)]
        (lx, ly), (mx, my) = (self._place(down.x + w * down.s, down.face, tilt) for w in (-1.0, 1.0))
        cx, _ = self._place(down.x, down.y, tilt)
        ex, _ = self._place(self.side * self.half_down, down.face, tilt)
        lips_up.append((self.edge, r))
        fixed = [up.x - up.s, up.x, up.x + up.s, self.edge, *(x + w * r for x, _ in lips_up for w in (-1.0, 1.0))]
        moving = [p + w * r for p in (lx, mx, ex) for w in (-1.0, -s, 0.0, 1.0)] + [cx]
        # Where the circles about the two lips of the down splint cross: on the upright of their middle.
        half = 0.5 * np.hypot(mx - lx, my - ly)
        with np.errstate(invalid="ignore"):
            high = np.where(r >= half, np.sqrt(np.maximum(r * r - half * half, 0.0)), np.nan)
        moving.append(0.5 * (lx + mx) - high * s)
        circles_up = list(lips_up)
        circles_down = [(lx, r), (mx, r), (ex, r)]
        if r < up.R:
            reach = (up.R - r) * up.s / up.R
            fixed += [up.x - reach, up.x + reach]
            circles_up.append((up.x, up.R - r))
        if r < down.R:
            share = (down.R - r) / down.R
            moving += [cx + share * (lx - cx), cx + share * (mx - cx)]
            circles_down.append((cx, down.R - r))
        for a, p in circles_up:
            moving += [a + p * s, a - p * s]
            for b, q in circles_down:
                for sign in (1.0, -1.0):
                    total = q + sign * p
                    if total != 0.0:
                        moving.append((a * q + sign * b * p) / total)
        low, high_end = self.window
        x = np.hstack([*(one * f for f in (low, high_end, *fixed)), *(one * m for m in moving)])
        x = np.where(np.isfinite(x), x, low)
        return np.sort(np.clip(x, low, high_end), axis=1)

    def _place(self, u: float, v: float, tilt: Array) -> tuple[Array, Array]:
        """A point (n, 1) of the down splint."""
        c, s = np.cos(tilt)[:, None], np.sin(tilt)[:, None]
        return self.bolt_x + u * c + v * s, -u * s + v * c


class Envelope:
    """The least distance d that a clamp's parts allow."""

    def __init__(self, clamp: Clamp) -> None:
        self.clamp = clamp
        self.bolt_x = clamp.up_splint.width / 2
        self.lever = clamp.down_splint.width / 2
        self.limit = clamp.tilt_stops["the slot"]
        sizes = self.bolt_x, clamp.bolt.diameter / 2, clamp.up_splint.width / 2, self.lever
        self.wires = [Wire(*_grooves(clamp, wire), *sizes) for wire in WIRES]

    def faces(self, tilt: Array) -> Array:
        """Least d (n,) at which the inner faces do not overlap."""
        up, down = self.clamp.up_splint, self.clamp.down_splint
        c, s, v, half = np.cos(tilt), np.sin(tilt), down.face_depth, down.width / 2
        left = np.maximum(self.bolt_x - half * c + v * s, self.bolt_x - up.width / 2)
        right = np.minimum(self.bolt_x + half * c + v * s, self.bolt_x + up.width / 2)
        return np.maximum(*(up.thickness - (v / c - (x - self.bolt_x) * s / c) for x in (left, right)))

    def lifted(self, tilt: Array) -> Array:
        """How far (n,) a saddle's edge holds the round back off the saddle's arc."""
        saddle, back = self.clamp.saddle, self.clamp.down_splint.back_radius
        half = saddle.width / 2
        edge = math.sqrt(saddle.radius**2 - half**2) - (saddle.radius - back)  # below the back's centre, when seated
        below = half * np.abs(np.sin(tilt)) + self.clamp.down_splint.underside_depth  # so far the edge must be, upright
        return np.asarray(np.maximum(below / np.cos(tilt) - edge, 0.0))

    def overlap(self, q: Array) -> float:
        """Deepest overlap in mm of a state of `section`, measured along y (beside a splint: or x); 0 if none."""
        tilt = np.array([q[5] / self.lever])
        down = float(q[4] - q[9])
        worst = [float(self.faces(tilt)[0]) - down, abs(float(q[5])) - self.lever * self.limit]
        worst.append(float(self.lifted(tilt)[0] - q[9]))
        for i, wire in enumerate(self.wires):
            x, y = np.array([[q[2 * i]]]), float(q[2 * i + 1])
            corner = float(wire._place(wire.side * wire.half_down, wire.down.face, tilt)[0][0, 0])
            beyond = wire.side * (float(q[2 * i]) - corner)
            below = y - down - float(wire.under(x, tilt)[0, 0])
            worst += [float(wire.over(x)[0, 0]) - y, min(below, wire.r - beyond) if beyond > 0.0 else below]
            worst.append(wire.side * (wire.inner - float(q[2 * i])))
        return max(0.0, *worst) if not any(map(math.isnan, worst)) else math.inf

    def falls(self, q: Array, reach: float = 0.02, barrier: float = 1e-9) -> float:
        """How far in mm a state is above the lowest that it can slide to within ``reach`` mm; 0: it is at rest.

        It slides where nothing on its way is more than ``barrier`` mm higher than itself. Tilts are tried at distances
        from 1e-9 mm to ``reach``; for each, the wires' best places are exact. It never tells more than the truth.
        """
        steps = np.concatenate([[0.0], np.geomspace(1e-9, reach, 60)])
        best = math.inf
        for side in (-1.0, 1.0):
            tilts = (q[5] + side * steps) / self.lever
            tilts = tilts[np.abs(tilts) <= self.limit * (1.0 + 1e-12)]
            if not len(tilts):
                continue
            level, lifted = self.faces(tilts), self.lifted(tilts)
            for i, wire in enumerate(self.wires):
                level = np.maximum(level, _slide(wire, tilts, float(q[2 * i]), float(q[4]) + barrier - lifted, reach))
            level = level + lifted
            stop = np.flatnonzero(level > q[4] + barrier)
            level = level[: stop[0]] if len(stop) else level
            best = min(best, float(level.min(initial=math.inf)))
        return max(0.0, float(q[4]) - best)


def _slide(wire: Wire, tilts: Array, x: float, level: Array, reach: float) -> Array:
    """Lowest d (n,) at each tilt that a wire at x gets to within ``reach`` without rising above ``level`` (n,)."""
    places = wire.places(tilts)
    n = len(tilts)
    here = np.clip(np.array([[x, x - reach, x + reach]]), *wire.window)
    places = np.sort(np.hstack([places, np.repeat(here, n, 0)]), axis=1)
    values = wire.least(places, tilts)
    # Of each row the unblocked stretch around x, which the walls of the window end.
    column = np.arange(places.shape[1])
    start = (places < here[0, 0]).sum(1)[:, None]
    blocked = ~(values <= level[:, None]) | (places < here[0, 1]) | (places > here[0, 2])
    first = np.where(blocked & (column < start), column, -1).max(1)[:, None]
    last = np.where(blocked & (column > start), column, len(column)).min(1)[:, None]
    return np.asarray(np.fmin.reduce(np.where((column > first) & (column < last), values, np.nan), axis=1))
