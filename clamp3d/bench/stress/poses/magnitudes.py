"""Families of poses that are hard for their numbers: tiny, huge, mixed, far away, rounded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.bench.stress.family import Makers
from clamp3d.bench.stress.poses import draw
from clamp3d.bench.stress.poses.cases import Cases

MAKERS = Makers()


@MAKERS.family("full and tiny arcs")
def _extreme_arcs(rng: np.random.Generator, n: int) -> Cases:
    """Half angles of 1e-12 ... 1e-2 rad and of pi less that."""
    k = draw.count(n)
    small = 10.0 ** rng.uniform(-12, -2, k)
    shapes = draw.shapes(rng, k, half_angle=np.where(rng.random(k) < 0.5, small, np.pi - small))
    return draw.touching(rng, n, shapes, (-14, -1), tilt=(-9, 0, 0.5))


@MAKERS.family("sizes")
def _sizes(rng: np.random.Generator, n: int) -> Cases:
    """All lengths times 1e-6 ... 1e6, gaps of 0 and 1e-15 ... 1e-1 of the radius."""
    k = draw.count(n)
    scale = 10.0 ** rng.uniform(-6, 6, k)
    base = draw.shapes(rng, k)
    shapes = replace(base, R=base.R * scale, L=base.L * scale, r=base.r * scale, length=base.length * scale)
    return draw.touching(rng, n, shapes, (-15, -1))


@MAKERS.family("mixed sizes")
def _mixed_sizes(rng: np.random.Generator, n: int) -> Cases:
    """Wire and groove, or length and radius, different by 1e-6 ... 1e6."""
    k = draw.count(n)
    R = 10.0 ** rng.uniform(-3, 3, k)
    columns = {name: R * 10.0 ** rng.uniform(-6, 6, k) for name in ("r", "L", "length")}
    shapes = draw.shapes(rng, k, R=R, **columns)
    shape, feature = draw.spread(n, k), rng.choice(draw.FEATURES, n)
    gap = np.minimum(shapes.r, shapes.R)[shape] * draw.powers(rng, n, -12, 0)
    tilt = draw.powers(rng, n, -12, 0, 0.3)
    return draw.place(rng, shapes, shape, draw.contact_on(rng, shapes, shape, feature), gap, tilt=tilt)
