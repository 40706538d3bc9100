"""Signed distances of a cylinder from a groove to 25 digits, by search instead of formulas: ``oracle.json``.

Nothing here knows which features can be nearest. The signed distance of a *point* from the groove's material follows
from the definition of its boundary (an arc and two half-lines, swept); the axis is searched for the least of it by
branch and bound with the Lipschitz constant 1 (float64), and the brackets that survive are refined by golden section
with 50 digits. Run: ``python -m tests.kernel.oracle``.
"""

import itertools
import json
from dataclasses import dataclass
from pathlib import Path

import mpmath as mp
import numpy as np

from clamp3d.geometry.primitives import Capsule, SweptArc
from clamp3d.testing import body

DATA = Path(__file__).parent / "data" / "oracle.json"
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


@dataclass(frozen=True)
class Case:
    kind: str
    groove: SweptArc
    cylinder: Capsule
    pose: np.ndarray
    value: str  # signed distance, 25 digits

    @property
    def size(self) -> float:
        """Largest length in the scene."""
        lengths = (self.groove.radius, self.groove.length, self.cylinder.radius, self.cylinder.length)
        return max(*lengths, float(np.abs(self.pose[:3, 3]).max()))


def load() -> list[Case]:
    cases = []
    for kind, numbers, value in json.loads(DATA.read_text()):
        v = [float.fromhex(number) for number in numbers]
        pose = np.eye(4)
        pose[:3] = np.reshape(v[5:], (3, 4))
        cases.append(Case(kind, SweptArc(*v[:3]), Capsule(*v[3:5]), pose, value))
    return cases


def surface_distance(groove: SweptArc, points: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the groove's boundary."""
    return np.abs(point_distance(points, groove.radius, groove.half_angle, groove.length / 2))


def axis_distance(cylinder: Capsule, pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the cylinder's axis segment."""
    d = pose[:3, 2] / np.linalg.norm(pose[:3, 2])
    m = points - pose[:3, 3]
    t = np.clip(m @ d, -cylinder.length / 2, cylinder.length / 2)
    return np.linalg.norm(m - t[:, None] * d, axis=1)


def main():
    """The values anew, of the inputs that the file holds."""
    rows = json.loads(DATA.read_text())
    for row in rows:
        R, half, L, r, length, *pose = map(float.fromhex, row[1])
        row[2] = exact_distance(R, half, L, r, length, *axis_of(np.reshape(pose, (3, 4))))
    DATA.write_text("[\n" + ",\n".join(map(json.dumps, rows)) + "\n]\n")


if __name__ == "__main__":
    main()
