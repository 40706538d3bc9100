"""Families of hard poses.

First those that are hard for where the two touch: on which feature, at what angle, at which edge of it; then those for
their numbers: tiny, huge, mixed, far away, rounded.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from clamp3d.bench.stress.family import Makers
from clamp3d.bench.stress.poses import draw
from clamp3d.bench.stress.poses.cases import Cases, Extended
from clamp3d.geometry.pose import Array

MAKERS = Makers()


@MAKERS.family("random")
def _random(rng: np.random.Generator, n: int) -> Cases:
    """Any pose of any groove: parallel, tilted, crossing, clear, touching, deep."""
    shapes = draw.shapes(rng, draw.count(n))
    shape = draw.spread(n, len(shapes))
    size = (shapes.R + 0.3 * shapes.L)[shape][:, None]
    centre = rng.uniform(-1.5, 1.5, (n, 3)) * size
    direction = rng.normal(size=(n, 3)) * np.array([1.0, 1.0, 2.0])
    return draw.free(rng, shapes, shape, centre, direction)


@MAKERS.family("tangency")
def _tangency(rng: np.random.Generator, n: int) -> Cases:
    """Gaps of 0 and +-1e-15 to 1e-1 of the radius on every feature, any tilt."""
    return draw.touching(rng, n, draw.shapes(rng, draw.count(n)), (-15, -1))


@MAKERS.family("parallel tangency")
def _parallel_tangency(rng: np.random.Generator, n: int) -> Cases:
    """The same with the wire along the groove: contact along a line."""
    shapes, shape, feature = draw.setting(rng, n, draw.PARALLEL_FEATURES)
    gap = shapes.r[shape] * draw.powers(rng, n, -15, -1)
    contact = draw.contact_on(rng, shapes, shape, feature)
    contact.ends[:] = False
    return draw.place(rng, shapes, shape, contact, gap, tilt=np.zeros(n))


@MAKERS.family("equal radii")
def _equal_radii(rng: np.random.Generator, n: int) -> Cases:
    """Wire radius = groove radius (1 +- 1e-3 ... 1e-15) and equal to the last bit, nearly coaxial."""
    k = draw.count(n)
    columns = asdict(draw.shapes(rng, k))
    del columns["flat"]
    columns["r"] = columns["R"] * (1.0 + draw.powers(rng, k, -16, -3))
    shapes, shape = draw.shapes(rng, k, **columns), draw.spread(n, k)
    R = shapes.R[shape]
    offset = R[:, None] * np.stack([draw.powers(rng, n, -16, -3) for _ in range(3)], 1)
    tilt = np.stack([draw.powers(rng, n, -16, -3, 0.5) for _ in range(2)] + [np.ones(n)], 1)
    return draw.free(rng, shapes, shape, offset, tilt)


@MAKERS.family("oversize wire")
def _oversize(rng: np.random.Generator, n: int) -> Cases:
    """Wire larger than the groove: rests on both lips, level or tilted."""
    k = draw.count(n)
    R = 10.0 ** rng.uniform(0, 2, k)
    shapes = draw.shapes(rng, k, R=R, half_angle=rng.uniform(0.2, 1.57, k), r=R * (1.0 + 10.0 ** rng.uniform(-6, 1, k)))
    shape = draw.spread(n, k)
    s, h = shapes.lips(shape)
    r = np.asarray(shapes.r, Extended)[shape]
    gap = shapes.r[shape] * draw.powers(rng, n, -15, -2)
    reach = r + np.asarray(gap, Extended)
    y = h + np.sqrt(np.maximum(reach * reach - s * s, 0))
    # Tilted up in the plane of symmetry the axis keeps the same distance from both lips where it is at height y.
    tilt = draw.powers(rng, n, -12, -0.5, 0.5)
    side = shapes.R[shape] * draw.powers(rng, n, -16, -6, 0.5)
    centre = np.stack([side.astype(Extended), y, np.zeros(n, Extended)], 1)
    sideways = rng.random(n) < 0.5
    d = np.stack([np.where(sideways, tilt, 0.0), np.where(sideways, 0.0, tilt), np.ones(n)], 1)
    level = (side == 0.0) & (tilt == 0.0)
    return Cases(shapes, shape, draw.poses_from_axes(rng, centre, d), np.where(level, gap, np.nan))


@MAKERS.family("arc end points")
def _arc_ends(rng: np.random.Generator, n: int) -> Cases:
    """Contact within 1e-15 ... 1e-2 rad of where the arc ends, on either side."""
    shapes, shape, feature = draw.setting(rng, n, ("arc", "lip", "end arc", "corner"))
    a = shapes.half_angle[shape]
    past = 10.0 ** rng.uniform(-16, -2, n) * rng.choice([0.0, 1.0], n, p=[0.1, 0.9])
    side = rng.choice([-1.0, 1.0], n)
    near_arc_normal = rng.random(n) < 0.5
    cone = np.where(near_arc_normal, 1.0 - past, past)
    contact = draw.contact_on(rng, shapes, shape, feature, phi=side * np.maximum(a - past, 0.0), cone=cone)
    gap = shapes.r[shape] * draw.powers(rng, n, -15, -2)
    tilt = np.where(rng.random(n) < 0.5, 0.0, draw.powers(rng, n, -9, 0))
    return draw.place(rng, shapes, shape, contact, gap, tilt=tilt)


@MAKERS.family("nearly parallel")
def _near_parallel(rng: np.random.Generator, n: int) -> Cases:
    """Axes 1e-18 ... 1e-3 rad off parallel, contacts on every feature."""
    return draw.touching(rng, n, draw.shapes(rng, draw.count(n)), (-15, -2), tilt=(-18, -3, 0.05))


@MAKERS.family("nearly coaxial")
def _near_coaxial(rng: np.random.Generator, n: int) -> Cases:
    """Axis through the arc's centre to 1e-300 ... 1e-3, tilts 1e-18 ... 1e-1."""
    shapes, shape, _ = draw.setting(rng, n)
    R = shapes.R[shape]
    tiny = np.where(rng.random((n, 2)) < 0.2, 1e-300 * rng.normal(size=(n, 2)), 0.0)
    offset = np.stack([draw.powers(rng, n, -18, -3, 0.3) for _ in range(2)], 1) * R[:, None] + tiny
    z = rng.uniform(-1, 1, n) * shapes.L[shape] * rng.choice([0.0, 1.0], n)
    d = np.stack([draw.powers(rng, n, -18, -1, 0.3) for _ in range(2)] + [rng.choice([-1.0, 1.0], n)], 1)
    return draw.free(rng, shapes, shape, np.column_stack([offset, z]), d)


@MAKERS.family("wire ends")
def _wire_ends(rng: np.random.Generator, n: int) -> Cases:
    """The wire ends where the groove ends: faces level to 0, 1e-15 ... 1e-2."""
    shapes, shape, _ = draw.setting(rng, n)
    half, H = shapes.length[shape] / 2, shapes.L[shape] / 2
    angle = rng.uniform(-np.pi, np.pi, n)
    rho = np.where(rng.random(n) < 0.7, np.maximum(shapes.R - shapes.r, 0.0)[shape], shapes.R[shape] * rng.random(n))
    off = shapes.R[shape] * draw.powers(rng, n, -15, -2)
    z = rng.choice([-1.0, 1.0], n) * (H + rng.choice([-1.0, 1.0], n) * half) + off
    tilt = np.stack([draw.powers(rng, n, -15, -1, 0.4) for _ in range(2)] + [np.ones(n)], 1)
    lift = shapes.R[shape] * draw.powers(rng, n, -15, -3)
    centre = np.stack([rho * np.sin(angle), -rho * np.cos(angle) + lift, z], 1)
    return draw.free(rng, shapes, shape, centre, tilt)


@MAKERS.family("embedded")
def _embedded(rng: np.random.Generator, n: int) -> Cases:
    """Wires wholly inside the material, or their axis inside it: contained is a hit."""
    k = draw.count(n)
    base, shape = draw.shapes(rng, k), draw.spread(n, k)
    shapes = replace(base, r=base.R * rng.uniform(0.01, 0.5, k), length=base.R * rng.uniform(0.1, 3, k))
    R, H = shapes.R[shape], shapes.L[shape] / 2
    depth = R * 10.0 ** rng.uniform(-3, 0.5, n)
    beside = rng.random(n) < 0.5
    x = np.where(beside, rng.choice([-1, 1], n) * R * rng.uniform(1, 2, n), rng.uniform(-1, 1, n) * R)
    y = np.where(beside, -R * np.cos(shapes.half_angle[shape]) - depth, -R - depth)
    d = rng.normal(size=(n, 3)) * np.where(rng.random((n, 3)) < 0.2, 1e-9, 1.0)
    d[:, 2] += np.where((d**2).sum(1) < 1e-12, 1.0, 0.0)
    return draw.free(rng, shapes, shape, np.stack([x, y, H * rng.uniform(-1, 1, n)], 1), d)


@MAKERS.family("ties")
def _ties(rng: np.random.Generator, n: int) -> Cases:
    """Two features equally near to 0, 1e-16 ... 1e-6: both lips, both walls, arc and lip."""
    shapes, shape, _ = draw.setting(rng, n)
    R, r = shapes.R[shape], shapes.r[shape]

    def off() -> Array:
        return R * draw.powers(rng, n, -16, -6, 0.4)

    kind = rng.integers(3, size=n)
    y = np.select([kind == 0, kind == 1], [rng.uniform(-0.2, 1.5, n) * R + r, off()], rng.uniform(-1, 1, n) * R)
    z = np.where(kind == 2, rng.choice([-1, 1], n) * shapes.L[shape] / 2, 0.0)
    angle = rng.choice([0.0, np.pi / 2, np.pi / 4, 1.0], n)
    lean = rng.choice([0.0, 1e-9, 1e-3, 0.3, 1.5707963267948966], n) + draw.powers(rng, n, -16, -9)
    d = np.stack([np.sin(lean) * np.cos(angle), np.sin(lean) * np.sin(angle), np.cos(lean)], 1)
    return draw.free(rng, shapes, shape, np.stack([off(), y, z + off()], 1), d)


@MAKERS.family("crossed")
def _crossed(rng: np.random.Generator, n: int) -> Cases:
    """Wire square to the groove, across its lips or end edges, in the plane of a face to 1e-16."""
    shapes, shape, _ = draw.setting(rng, n)
    R, r, H = shapes.R[shape], shapes.r[shape], shapes.L[shape] / 2
    h = -R * np.cos(shapes.half_angle[shape])

    def small() -> Array:
        return R * draw.powers(rng, n, -16, -2)

    over = rng.random(n) < 0.5
    y = np.where(over, h + r, rng.uniform(-2, 1, n) * R) + small()
    z = np.where(over, rng.choice([-1, 0, 1], n) * H, rng.choice([-1, 1], n) * (H + r)) + small()
    x = R * rng.uniform(-2, 2, n)
    d = np.stack([np.ones(n), *(draw.powers(rng, n, -16, -2, 0.4) for _ in range(2))], 1)
    return draw.free(rng, shapes, shape, np.stack([x, y, z], 1), d)


@MAKERS.family("through two points")
def _two_points(rng: np.random.Generator, n: int) -> Cases:
    """Axis through two points of faces, edges or corners to 0, 1e-16 ... 1e-9; also along an edge."""
    shapes, shape, feature = draw.setting(rng, n)
    other = np.where(rng.random(n) < 0.3, feature, rng.choice(draw.FEATURES, n))  # along an edge, or across a face
    a, b = draw.contact_on(rng, shapes, shape, feature), draw.contact_on(rng, shapes, shape, other)
    R = shapes.R[shape].astype(Extended)
    p, q = ((c.q + (R * draw.powers(rng, n, -16, -9, 0.5))[:, None] * c.normal) for c in (a, b))
    d = q - p
    same = (d * d).sum(1) == 0
    d[same] = (0, 0, 1)
    norm = np.sqrt((d * d).sum(1))[:, None]
    ahead = np.where(rng.random(n) < 0.3, 0.5, rng.uniform(-0.5, 0.5, n)) * shapes.length[shape]
    centre = p + ahead.astype(Extended)[:, None] * d / norm
    return draw.free(rng, shapes, shape, centre, d)


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
