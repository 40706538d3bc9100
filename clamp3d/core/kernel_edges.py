"""Least signed distance of a flat-ended cylinder's points along an edge of a groove: a line, or an end arc.

A cylinder with flat ends is convex, so its signed distance ``f(q) = phi(w - r, |t| - l)`` is a convex function of the
point q: w is q's distance from the axis, t its place along it, phi the signed distance from a quadrant. Outside f is
the distance, inside it is minus the depth. Along a line it has one minimum. Along an arc it may have several: stretches
of the arc are halved until each is proven to hold nothing lower, or exactly one minimum.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import formula, inlined
from clamp3d.core.kernel_features import phi

STRETCHES = 400
"""Stretches of an arc that are looked at; then the search ends with a wider bound, which it tells."""


@inlined
def from_axis(x, y, z, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Distance of a point, given from the middle of a unit axis, from that axis, and its place along it."""
    t = x * dx + y * dy + z * dz
    x -= t * dx
    y -= t * dy
    z -= t * dz
    return math.sqrt(x * x + y * y + z * z), t


@formula
def on_line(r, l, kx, ky, kz, ux, uz, dx, dy, dz, lo, hi, limit):  # type: ignore[no-untyped-def] # noqa: E741
    """Least f at ``k + s u``, lo <= s <= hi, and s; k is given from the cylinder's middle, u is x or z, square to k.

    What cannot be below ``limit`` is not looked for: then the value is inf.

    Between the point nearest to the axis and the one nearest to the middle plane w and |t| go opposite ways.
    """
    along = ux * dx + uz * dz
    across2 = dy * dy + (uz * dx) ** 2 + (ux * dz) ** 2
    t0 = kx * dx + ky * dy + kz * dz
    k2 = kx * kx + ky * ky + kz * kz
    a = math.inf
    if across2 > 0.0:
        a = min(max(along * t0 / across2, lo), hi)
    b = min(max(-t0 / along, lo), hi) if along != 0.0 else a
    if a == math.inf:
        a = b
    w, t = from_axis(kx + a * ux, ky, kz + a * uz, dx, dy, dz)
    ga, ea = w - r, abs(t) - l
    if ea <= min(ga, 0.0) or a == b:
        return phi(ga, ea), a
    w, t = from_axis(kx + b * ux, ky, kz + b * uz, dx, dy, dz)
    gb, eb = w - r, abs(t) - l
    if phi(ga, eb) > limit:
        return math.inf, a
    if gb <= min(eb, 0.0):
        return eb, b
    _, t = from_axis(kx + 0.5 * (a + b) * ux, ky, kz + 0.5 * (a + b) * uz, dx, dy, dz)
    side = 1.0 if t >= 0.0 else -1.0
    best, at = (phi(ga, ea), a) if phi(ga, ea) <= phi(gb, eb) else (phi(gb, eb), b)
    for rim in range(2):  # where side and end are equally far, which is the least inside; then the rim from outside
        if rim == 0 and not (ga <= ea and gb >= eb):
            continue
        p, q = a, b
        tried = False
        s = 0.5 * (a + b)
        if rim == 1 and along != 0.0:  # just beyond the end, where it begins to pull against the side
            near = (side * l * (1.0 + 1e-6) - t0) / along
            s = near if min(a, b) < near < max(a, b) else s
        for _ in range(60):
            x = kx + s * ux
            z = kz + s * uz
            t = x * dx + ky * dy + z * dz
            vx = x - t * dx
            vy = ky - t * dy
            vz = z - t * dz
            w = math.sqrt(vx * vx + vy * vy + vz * vz)
            g, e = w - r, side * t - l
            rate = (ux * vx + uz * vz) / w if w > 0.0 else 0.0
            if rim == 0:
                f = g - e
                slope = rate - side * along
                rising = f > 0.0
            else:
                g, e = max(g, 0.0), max(e, 0.0)
                f = g * rate + e * side * along
                slope = (rate * rate if g > 0.0 else 0.0) + (along * along if e > 0.0 else 0.0)
                slope += g * (across2 - rate * rate) / w if w > 0.0 else 0.0
                rising = f * (b - a) > 0.0
            if f == 0.0:
                break
            if rising:
                q = s
            else:
                p = s
            step = f / slope if slope != 0.0 else math.inf
            if abs(step) <= 1e-16 * (abs(s) + math.sqrt(k2)):
                break
            new = s - step
            if not min(p, q) < new < max(p, q):
                # At an end of the line, often: it is tried, once.
                new = (p if rising else q) if rim == 1 and not tried else 0.5 * (p + q)
                tried = True
            if new == s:
                break
            s = new
        w, t = from_axis(kx + s * ux, ky, kz + s * uz, dx, dy, dz)
        f = phi(w - r, abs(t) - l)
        if f < best:
            best, at = f, s
        if rim == 0 and f <= 0.0:
            break
    return best, at


@inlined
def fall(slope, bend, third, reach):  # type: ignore[no-untyped-def]
    """By how much a function with this slope, second and largest third derivative falls within ``reach`` at most."""
    a = abs(slope)
    drop = third * reach * reach * reach / 6.0
    if bend > 0.0 and a < bend * reach:
        return drop + 0.5 * a * a / bend
    return drop + a * reach - 0.5 * bend * reach * reach


@formula
def arc_terms(phi_, R, kx, ky, kz, off, dx, dy, dz):  # type: ignore[no-untyped-def]
    """w, t and their first and second rates by the angle at a point of an end arc; the rates of w are inf on the axis.

    k leads from the axis' point nearest to the arc's centre to that centre, ``off`` is that point's place on the axis.
    """
    sine = R * math.sin(phi_)
    cosine = R * math.cos(phi_)
    x = sine + kx
    y = -cosine + ky
    t = x * dx + y * dy + kz * dz
    vx = x - t * dx
    vy = y - t * dy
    vz = kz - t * dz
    w = math.sqrt(vx * vx + vy * vy + vz * vz)
    t1 = cosine * dx + sine * dy
    t2 = cosine * dy - sine * dx
    if w == 0.0:
        return w, t + off, math.inf, t1, math.inf, t2
    w1 = (vx * cosine + vy * sine) / w
    w2 = (R * R - t1 * t1 + vy * cosine - vx * sine - w1 * w1) / w
    return w, t + off, w1, t1, w2, t2


@formula
def settle(kind, r, l, side, middle, half, R, kx, ky, kz, off, dx, dy, dz):  # type: ignore[no-untyped-def] # noqa: E741
    """Root of a monotone function within ``middle`` +- ``half``, or the end of the stretch beyond which it lies.

    Kind 0: rate of the squared distance from the rim; 1: of w; 2: of the end's distance; 3: side and end equally far;
    4: t.
    """
    lo, hi = middle - half, middle + half
    at = middle
    for k in range(60):
        w, t, w1, t1, w2, t2 = arc_terms(at, R, kx, ky, kz, off, dx, dy, dz)
        g, e, e1, e2 = w - r, side * t - l, side * t1, side * t2
        if kind == 0:
            f = g * w1 + e * e1
            slope = w1 * w1 + g * w2 + e1 * e1 + e * e2
        elif kind == 1:
            f, slope = w1, w2
        elif kind == 2:
            f, slope = e1, e2
        elif kind == 3:
            f, slope = g - e, w1 - e1
        else:
            f, slope = t, t1
        if f == 0.0:
            break
        if (f > 0.0) == (kind < 3 or slope > 0.0):
            hi = at
        else:
            lo = at
        if k == 0:  # the end that it leads to is tried first: often the root is beyond it
            end = lo if hi == at else hi
            w, t, w1, t1, w2, t2 = arc_terms(end, R, kx, ky, kz, off, dx, dy, dz)
            g, e, e1 = w - r, side * t - l, side * t1
            there = (
                g * w1 + e * e1 if kind == 0 else w1 if kind == 1 else e1 if kind == 2 else g - e if kind == 3 else t
            )
            if (there > 0.0) == (f > 0.0):
                return end
        step = f / slope if slope != 0.0 else math.inf
        if abs(step) <= 2e-16:
            break
        new = at - step
        if not lo < new < hi:
            new = 0.5 * (lo + hi)
        if new == at:
            break
        at = new
    return at


@formula
def on_arc(ez, R, half_angle, r, l, cx, cy, cz, dx, dy, dz, best, slack, eps, work, found):  # type: ignore[no-untyped-def] # noqa: E741
    """Minima of f on the end arc z = ez that are below ``best + slack``: their number, and what may lie below.

    Their angles from the deepest line go to the first column of ``found``, of the best alone if ``slack`` is 0.
    """
    off = (ez - cz) * dz - cx * dx - cy * dy
    kx = -cx - off * dx
    ky = -cy - off * dy
    kz = ez - cz - off * dz
    tilt2 = dx * dx + dy * dy
    T = R * math.sqrt(tilt2)
    # Largest derivatives of w^2 by the angle; t is at most T from off.
    N = 2.0 * R * math.sqrt(kx * kx + ky * ky)
    W1, W2, W3 = N + T * T, N + 2.0 * T * T, N + 4.0 * T * T
    M = R * math.sqrt(cx * cx + cy * cy)  # the same of half the squared distance from the cylinder's middle
    count = 0
    left = math.inf
    cuts = 4
    top = cuts
    for i in range(cuts):
        work[i, 0] = half_angle * ((2.0 * i + 1.0) / cuts - 1.0)
        work[i, 1] = half_angle / cuts
    looked = 0
    while top > 0:
        top -= 1
        at, half = work[top, 0], work[top, 1]
        looked += 1
        w, t, w1, t1, w2, t2 = arc_terms(at, R, kx, ky, kz, off, dx, dy, dz)
        side = 1.0 if t >= 0.0 else -1.0
        g, e, e1, e2 = w - r, side * t - l, side * t1, side * t2
        f = phi(g, e)
        if f < best:
            best = f
            if slack == 0.0:
                found[0, 0] = at
                count = 1
        limit = best + slack - eps
        low = math.sqrt(max(w * w - W1 * half, 0.0))
        low = max(low, w - R * half)
        by = R if low <= 0.0 else min(R, 0.5 * W1 / low)
        g_low = max(g - by * half, -r)
        e_low = max(e - T * half, -l)
        if phi(g_low, e_low) >= limit:
            continue
        done = False
        bound = max(f - R * half, phi(g_low, e_low))
        if low > 0.0:
            bend = (0.5 * W2 + by * by) / low
            third = (0.5 * W3 + 3.0 * by * bend) / low
            bound = max(bound, g - fall(w1, w2, third, half), e - fall(e1, e2, T, half))
            if f > 0.0:
                u, v = max(g, 0.0) / f, max(e, 0.0) / f
            elif (w1 > 0.0) != (e1 > 0.0):
                u, v = e1 / (e1 - w1), w1 / (w1 - e1)
            else:
                u, v = (1.0, 0.0) if g > e else (0.0, 1.0)
            bound = max(bound, u * g + v * e - fall(u * w1 + v * e1, u * w2 + v * e2, u * third + v * T, half))
            if bound >= limit:
                continue
            g_high, e_high = g + by * half, e + T * half
            split = abs(t) <= T * half  # the sign of t may change
            if split and f < 0.0 and abs(t1) > T * half:
                new = settle(4, r, l, side, at, half, R, kx, ky, kz, off, dx, dy, dz)
                w, u, _, _, _, _ = arc_terms(new, R, kx, ky, kz, off, dx, dy, dz)
                new_f = phi(w - r, abs(u) - l)
                if new_f < best:
                    best, limit = new_f, new_f + slack - eps
                    if slack == 0.0:
                        found[0, 0] = new
                        count = 1
            kind = -1
            falling = 0.0  # slope, where it has one sign over the whole stretch
            if g_low > 0.0 and e_low > 0.0:  # all of it beyond the rim
                G1 = g * w1 + e * e1
                G2 = w1 * w1 + g * w2 + e1 * e1 + e * e2
                G3 = 3.0 * by * bend + g_high * third + 3.0 * T * T + e_high * T
                G3 = min(G3, M + r * third + l * T)
                if limit > 0.0 and 0.5 * (g * g + e * e) - fall(G1, G2, G3, half) >= 0.5 * limit * limit:
                    continue
                if G3 * half < G2:
                    kind = 0
                elif abs(G1) > (abs(G2) + 0.5 * G3 * half) * half:
                    falling = G1
            elif e_high <= min(g_low, 0.0):  # all of it beside the side
                if w2 > third * half:
                    kind = 1
                elif abs(w1) > bend * half:
                    falling = w1
            elif g_high <= min(e_low, 0.0) and not split:
                if e2 > T * half:
                    kind = 2
                elif abs(e1) > T * half:
                    falling = e1
            elif not split and abs(w1) > bend * half and abs(e1) > T * half:
                if (w1 > 0.0) == (e1 > 0.0):
                    falling = w1
                else:
                    kind = 3
            if falling != 0.0:
                at = at - half if falling > 0.0 else at + half
                done = True
            if kind >= 0:
                new = settle(kind, r, l, side, at, half, R, kx, ky, kz, off, dx, dy, dz)
                w, t, _, _, _, _ = arc_terms(new, R, kx, ky, kz, off, dx, dy, dz)
                done = kind < 3 or phi(w - r, abs(t) - l) <= 0.0
                if done:
                    at = new
        if done:
            w, t, _, _, _, _ = arc_terms(at, R, kx, ky, kz, off, dx, dy, dz)
            f = phi(w - r, abs(t) - l)
            if slack > 0.0:
                if f <= best + slack and count < len(found):
                    found[count, 0] = at
                    count += 1
            elif f < best:
                found[0, 0] = at
                count = 1
            best = min(best, f)
            continue
        if looked >= STRETCHES or half <= 1e-13:
            left = min(left, bound)
            continue
        half *= 0.5
        # The end that it falls to is looked at first.
        down = g * w1 + e * e1 if f > 0.0 else (w1 if g > e else e1)
        ahead = half if down > 0.0 else -half
        work[top, 0], work[top, 1] = at + ahead, half
        work[top + 1, 0], work[top + 1, 1] = at - ahead, half
        top += 2
    return count, left
