"""Make ``oracle.json``: signed distances of a cylinder from a groove to 25 digits, by search instead of formulas.

Nothing here knows which features can be nearest. The signed distance of a *point* from the groove's material follows
from the definition of its boundary (an arc and two half-lines, swept); the axis is searched for the least of it by
branch and bound with the Lipschitz constant 1 (float64), and the brackets that survive are refined by golden section
with 50 digits. Run: ``python tests/core/data/make_oracle.py [cases per class]``.
"""

from __future__ import annotations

import itertools
import json
import sys
from pathlib import Path

import mpmath as mp
import numpy as np

from clamp3d.core.primitives import SweptArc
from clamp3d.testing import body

mp.mp.dps = 50
GOLDEN = (mp.sqrt(5) - 1) / 2


def point_distance(P, R, half, H):
    """Signed distance of points (n, 3) from the material, float64."""
    return body(SweptArc(R, half, 2.0 * H)).field(P)


def exact_point_distance(x, y, z, R, half, H):
    """The same with 50 digits, written anew."""
    mx, my = R * mp.sin(half), -R * mp.cos(half)
    rho = mp.hypot(x, y)
    lips = mp.hypot(abs(x) - mx, y - my)
    arc = abs(rho - R) if mp.atan2(abs(x), -y) <= half else lips
    flat = abs(y - my) if abs(x) >= mx else lips
    edge = min(arc, flat)
    along = abs(z) - H
    if y <= my and rho >= R:
        return -min(edge, -along) if along <= 0 else along
    return mp.hypot(edge, along) if along > 0 else edge


def brackets(R, half, H, length, c, d):
    """Stretches of the axis, as (lo, hi), that may hold the least distance."""
    t = np.linspace(-length / 2, length / 2, 129)
    f = point_distance(c + t[:, None] * d, R, half, H)
    a, b, fa, fb = t[:-1], t[1:], f[:-1], f[1:]
    best = f.min()
    scale = R + length + np.abs(c).max()
    for _ in range(20):
        keep = (fa + fb - (b - a)) / 2 < best + 1e-14 * scale
        a, b, fa, fb = a[keep], b[keep], fa[keep], fb[keep]
        if len(a) > 4096:
            break
        m = (a + b) / 2
        fm = point_distance(c + m[:, None] * d, R, half, H)
        best = min(best, fm.min())
        a, b, fa, fb = np.r_[a, m], np.r_[m, b], np.r_[fa, fm], np.r_[fm, fb]
    order = np.argsort(a)
    a, b = a[order], b[order]
    # Neighbours make one stretch; a long one is cut in eight.
    cuts = np.flatnonzero(a[1:] > b[:-1] + 1e-12 * length)
    starts, stops = a[np.r_[0, cuts + 1]], b[np.r_[cuts, len(b) - 1]]
    out = []
    for lo, hi in zip(starts, stops, strict=True):
        parts = 12 if hi - lo > 1e-3 * length else 1
        edges = np.linspace(lo, hi, parts + 1)
        out += itertools.pairwise(edges)
    return out


def exact_distance(R, half, length_groove, r, length, c, d, digits=25):
    """Least signed distance of the axis, minus r. ``c`` and ``d`` are mpf triples, ``d`` a unit vector."""
    cf, df = np.array([float(v) for v in c]), np.array([float(v) for v in d])
    Rm, hm, Hm = mp.mpf(R), mp.mpf(half), mp.mpf(length_groove) / 2
    end = mp.mpf(length) / 2

    def f(t):
        return exact_point_distance(c[0] + t * d[0], c[1] + t * d[1], c[2] + t * d[2], Rm, hm, Hm)

    best = min(f(-end), f(end))
    for lo, hi in brackets(R, half, length_groove / 2, length, cf, df):
        pad = mp.mpf(max(hi - lo, 1e-9 * length)) / 4
        a, b = max(-end, mp.mpf(lo) - pad), min(end, mp.mpf(hi) + pad)
        m1, m2 = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
        f1, f2 = f(m1), f(m2)
        while b - a > mp.mpf(10) ** -20 * length:
            if f1 <= f2:
                b, m2, f2 = m2, m1, f1
                m1 = b - GOLDEN * (b - a)
                f1 = f(m1)
            else:
                a, m1, f1 = m1, m2, f2
                m2 = a + GOLDEN * (b - a)
                f2 = f(m2)
        best = min(best, f1, f2)
    return mp.nstr(best - mp.mpf(r), digits)


def axis_of(T):
    """Centre and unit direction of a pose's z axis, from its float64 entries exactly."""
    c = [mp.mpf(float(v)) for v in T[:3, 3]]
    d = [mp.mpf(float(v)) for v in T[:3, 2]]
    n = mp.sqrt(sum(v * v for v in d))
    return c, [v / n for v in d]


def turned(rng, angle, axis=None):
    """Pose turned by ``angle`` about a random axis across z (or the given one), by Rodrigues' formula."""
    if axis is None:
        phi = rng.uniform(0, 2 * np.pi)
        axis = np.array([np.cos(phi), np.sin(phi), 0.0])
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    T = np.eye(4)
    T[:3, :3] += np.sin(angle) * K + 2 * np.sin(angle / 2) ** 2 * (K @ K)
    return T


def random_axis(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def case(kind, rng):
    """One groove, cylinder and pose of a class."""
    R = 10 ** rng.uniform(0, 1.5)
    half = rng.uniform(0.1, 3.1)
    L = R * 10 ** rng.uniform(-1, 1)
    r = R * rng.uniform(0.1, 1.3)
    length = R * 10 ** rng.uniform(-1, 1.2)
    angle = {
        "parallel": 0.0,
        "off parallel": 10 ** rng.uniform(-12, -3),
        "tilted": rng.uniform(0.001, 0.7),
        "crossing": rng.uniform(0.7, 1.6),
        "any": rng.uniform(0, 3.14),
    }.get(kind, rng.choice([0.0, 1e-9, 0.05, 0.5, 1.5]))
    T = turned(rng, angle, random_axis(rng) if kind == "any" else None)
    T[:3, 3] = rng.normal(size=3) * [0.6 * R, 0.6 * R, 0.5 * L]
    if kind == "in groove":
        half, r = rng.uniform(0.5, 2.9), R * rng.uniform(0.3, 0.99)
        length = L * rng.choice([0.1, 0.5, 1.5])
        T = turned(rng, rng.choice([1e-6, 0.01, 0.2]))
        T[:3, 3] = [0.3 * (R - r) * rng.normal(), -(R - r) * rng.uniform(0, 1.1), 0.3 * L * rng.normal()]
    elif kind == "through the centre":
        T[:3, 3] = [0.0, 0.0, rng.choice([0.0, L / 2, 0.3 * L])]
    elif kind == "end plane":  # the axis in or near the plane of an end face
        T = turned(rng, np.pi / 2 - rng.choice([0.0, 1e-12, 1e-6, 0.1]))
        T[:3, 3] = [R * rng.normal(), R * rng.normal(), L / 2 + rng.choice([0.0, 1e-9, 0.1 * R])]
    elif kind == "nearly equal radii":
        r = R * (1 - 10 ** rng.uniform(-9, -2))
        T[:3, 3] = [0.0, -(R - r) * rng.uniform(0, 2), 0.2 * L * rng.normal()]
        T[:3, :3] = turned(rng, rng.choice([0.0, 1e-9, 1e-5]))[:3, :3]
    elif kind == "on both lips":
        half = rng.uniform(0.2, 1.5)
        r = R * rng.uniform(1.0, 2.0)
        T[:3, 3] = [0.0, -R * np.cos(half) + np.sqrt(max(0.0, r * r - (R * np.sin(half)) ** 2)), 0.1 * L * rng.normal()]
    elif kind == "axis inside":
        T[:3, 3] = [R * rng.normal(), -R * rng.uniform(0.9, 3.0), 0.4 * L * rng.normal()]
    elif kind == "far":
        T[:3, 3] *= 10 ** rng.uniform(1, 4)
    return float(R), float(half), float(L), float(r), float(length), T


KINDS = (
    "parallel",
    "off parallel",
    "tilted",
    "crossing",
    "any",
    "in groove",
    "through the centre",
    "end plane",
    "nearly equal radii",
    "on both lips",
    "axis inside",
    "far",
)


def main(count=80, seed=20250101):
    rows = []
    for number, kind in enumerate(KINDS):
        rng = np.random.default_rng([seed, number])
        for _ in range(count):
            R, half, L, r, length, T = case(kind, rng)
            c, d = axis_of(T)
            value = exact_distance(R, half, L, r, length, c, d)
            numbers = [R, half, L, r, length, *T[:3].ravel().tolist()]
            rows.append([kind, [v.hex() for v in map(float, numbers)], value])
        print(kind, file=sys.stderr)
    Path(__file__).with_name("oracle.json").write_text("[\n" + ",\n".join(json.dumps(r) for r in rows) + "\n]\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
