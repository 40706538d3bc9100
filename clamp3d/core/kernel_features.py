"""One formula per feature of a groove: what a point or an axis is nearest to. Compiled; used by every entry point.

Notation, in the groove's frame: material ``S = {y <= h, x^2 + y^2 >= R^2, |z| <= H}``, lips at ``(-s, h)`` (M) and
``(s, h)`` (N), where ``s = R sin(half_angle)`` and ``h = -R cos(half_angle)``; the axis is ``c + t d``, ``|d| = 1``,
``|t| <= l``.

Which features can hold the least distance of the axis from S: at an inner ``t`` the distance is stationary. Over the
inside of the arc surface it is ``R - rho(t)``, concave in t; over a flat or an end face it is linear. So neither has an
inner minimum (only a constant stretch, which reaches an end of the axis or an edge). What remains: the ends of the axis
against S, and the axis' inside against the edges (lips, end arcs, end edges) and the corners.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import formula, inlined

# Codes of the features; Feature in distance.py gives them names.
ARC, LIP_M, LIP_N, FLAT_M, FLAT_N, END_FACE, END_ARC, END_EDGE_M, END_EDGE_N, CORNER_M, CORNER_N = range(11)

CONVERGED = 1e-7
"""Last relative step of a quadratic iteration: the error left is of the order of its square."""

TINY = 1e-150
"""Below this the square of a length underflows, and with it the direction of the vector."""


@inlined
def phi(g, e):  # type: ignore[no-untyped-def]
    """Signed distance from the quadrant g <= 0, e <= 0."""
    if g <= 0.0 and e <= 0.0:
        return max(g, e)
    g, e = max(g, 0.0), max(e, 0.0)
    return math.sqrt(g * g + e * e)


@inlined
def section(x, y, R, s, h):  # type: ignore[no-untyped-def]
    """Signed gap of (x, y) to the groove's section, negative inside the material, and the nearest feature.

    Inside, the gap is the smaller of the depths below the flat faces and behind the arc: the lips are never nearer, in
    minor and in major arcs. In the mouth of a major arc y <= h and rho >= R exclude each other but for the rounding
    of h; there the angle decides (nearly full circles, whose mouth is wide by the root of that rounding).
    """
    ax = abs(x)
    rho = math.sqrt(x * x + y * y)
    within = ax * -h + y * s <= 0.0  # within the angle of the arc: rho R sin(phi - half_angle) <= 0
    if rho < R and within:
        return R - rho, ARC
    solid = y <= h and rho >= R and (within or h < 0.0)
    if solid and rho - R <= h - y:
        return R - rho, ARC
    if (y > h and ax >= s) or solid:
        return y - h, FLAT_N if x >= 0.0 else FLAT_M
    return math.sqrt((ax - s) * (ax - s) + (y - h) * (y - h)), LIP_N if x >= 0.0 else LIP_M


@inlined
def section_foot(feature, x, y, R, s, h):  # type: ignore[no-untyped-def]
    """Nearest point of a section feature to (x, y), and the unit normal that leads out of the material there."""
    if feature == ARC:
        rho = math.sqrt(x * x + y * y)
        if rho < TINY:
            return 0.0, -R, 0.0, 1.0
        return x / rho * R, y / rho * R, -x / rho, -y / rho
    if feature in (FLAT_M, FLAT_N):
        return x, h, 0.0, 1.0
    sx = -s if feature == LIP_M else s
    gap = math.sqrt((x - sx) * (x - sx) + (y - h) * (y - h))
    if gap < TINY:
        return sx, h, -sx / R, -h / R
    return sx, h, (x - sx) / gap, (y - h) / gap


@inlined
def beyond_end(feature):  # type: ignore[no-untyped-def]
    """Feature of an end face that a section feature ends in."""
    if feature <= LIP_N:
        return END_ARC if feature < LIP_M else feature + (CORNER_M - LIP_M)
    return feature + (END_EDGE_M - FLAT_M)


@inlined
def lip_line(sx, h, H, cx, cy, cz, dx, dy, dz, e2, l, best2):  # type: ignore[no-untyped-def] # noqa: E741
    """Squared distance of the axis' inside from the inside of the lip at x = sx, t, z.

    It is inf if they do not face or the distance of the lines is no less than the best so far.
    """
    wx = cx - sx
    wy = cy - h
    cross = wx * dy - wy * dx
    over = 1.0 / e2
    t = -(wx * dx + wy * dy) * over
    z = cz + t * dz
    faces = cross * cross < best2 * e2 and abs(t) <= l and abs(z) <= H
    return cross * cross * over if faces else math.inf, t, z


@inlined
def end_edge(ez, s, h, cx, cy, cz, dx, dy, dz, l, best2):  # type: ignore[no-untyped-def] # noqa: E741
    """The same of the edges {y = h, z = ez, |x| >= s}: squared distance, t, x."""
    wy = cy - h
    wz = cz - ez
    f2 = dy * dy + dz * dz
    cross = wy * dz - wz * dy
    over = 1.0 / max(f2, TINY)
    t = -(wy * dy + wz * dz) * over
    x = cx + t * dx
    faces = cross * cross < best2 * f2 and abs(t) <= l and abs(x) >= s
    return cross * cross * over if faces else math.inf, t, x


@inlined
def corner(kx, ky, kz, cx, cy, cz, dx, dy, dz, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Squared distance of the axis' inside from a corner (inf if its foot is not on the axis), t.

    And whether it falls from there along the end arc, whose centre is on the groove's axis.
    """
    mx = kx - cx
    my = ky - cy
    mz = kz - cz
    t = mx * dx + my * dy + mz * dz
    mx -= t * dx
    my -= t * dy
    mz -= t * dz
    d2 = mx * mx + my * my + mz * mz if abs(t) <= l else math.inf
    return d2, t, abs(kx) * my - math.copysign(ky, kx * ky) * mx > 0.0


@inlined
def inverse_root(g, near):  # type: ignore[no-untyped-def]
    """1 / sqrt(g), at g near 1 by its series, whose next term is below the rounding: without waiting for a root.

    ``near``: whether g is known to be so near.
    """
    return 1.5 - 0.5 * g if near or abs(g - 1.0) <= 1e-8 else 1.0 / math.sqrt(g)


@inlined
def nearer_start(k, a, q):  # type: ignore[no-untyped-def]
    """Lower bound of the root of ``nearer_root``, and its expansion in k to the second order, exact for small tilt."""
    n2 = a * a + q * q
    n = math.sqrt(n2)
    over = 1.0 / n2
    bend = k * (a * a * over)
    low = max(q, n - k)
    return low, max(low, n - bend + 1.5 * k * bend * (q * q * over) * (n * over))


@inlined
def nearer_step(k, a, q, low, mu):  # type: ignore[no-untyped-def]
    """Newton's step of ``nearer_root``, and whether it was the last that is needed."""
    over = 1.0 / ((k + mu) * mu)
    u = mu * over
    v = (k + mu) * over
    x2 = (a * u) * (a * u)
    y2 = (q * v) * (q * v)
    g = x2 + y2
    step = (math.sqrt(g) - 1.0) * g / (x2 * u + y2 * v)
    mu = max(low, mu + step)
    # What is left is at most 3/8 k^2 step^2 / (mu^2 (k + mu)): without k the left side's root is linear.
    return mu, abs(step) * min(k, mu) <= CONVERGED * mu * mu


@formula
def nearer_root(k, a, q):  # type: ignore[no-untyped-def]
    """Root mu > 0 of (a / (k + mu))^2 + (q / mu)^2 = 1, for k, a >= 0 and q > 0 (or a > k).

    1 / norm of the left side is concave in mu (a power mean of linear functions): Newton's method on it is below the
    root after one step, climbs to it without passing it, and converges quadratically [Moré & Sorensen 1983].
    """
    low, mu = nearer_start(k, a, q)
    for _ in range(40):
        mu, done = nearer_step(k, a, q, low, mu)
        if done:
            break
    return mu


@formula
def farther_root(k, a, q):  # type: ignore[no-untyped-def]
    """Smaller root 0 < nu < k of (a / (k - nu))^2 + (q / nu)^2 = 1, for q > 0; -1 if there is none.

    Concave like ``nearer_root``, but with a maximum: a slope that is not positive means that there is no root.
    """
    if a >= k or q >= k:
        return -1.0
    nu = q
    for _ in range(60):
        x = a / (k - nu)
        y = q / nu
        g = x * x + y * y
        slope = y * y / nu - x * x / (k - nu)
        if slope <= 0.0:
            return -1.0
        step = (math.sqrt(g) - 1.0) * g / slope
        nu += step
        if nu >= k:
            return -1.0
        if step <= CONVERGED * nu:
            break
    return nu


@inlined
def ellipse(R, cx, cy, dx, dy, e2):  # type: ignore[no-untyped-def]
    """What both ends share in ``end_arc``: tilt direction and sine, the axis' place p on the major axis, along it."""
    e = math.sqrt(e2)
    over = 1.0 / e
    ex = dx * over
    ey = dy * over
    return ex, ey, e, (cy * ex - cx * ey) * (1.0 / R), cx * ex + cy * ey


@inlined
def end_arc_reach(ez, R, cz, dz, e, p, along):  # type: ignore[no-untyped-def]
    """The axis' place v along the minor axis of the ellipse of ``end_arc``, and a lower bound on its distance."""
    v = (-dz * along - e * (ez - cz)) * (1.0 / R)
    if dz > 0.0:
        v = -v
    # The ellipse lies outside (for a point inside it) or inside (outside) its scaled copy through the point.
    return v, R * abs(abs(dz) - math.sqrt(dz * dz * p * p + v * v))


@inlined
def arc_point(C, S, near, ez, R, s, h, cx, cy, cz, dx, dy, dz, l, ex, ey, p, v):  # type: ignore[no-untyped-def] # noqa: E741
    """Squared distance of the axis' inside from a point of the end arc (inf if they do not face), qx, qy, t."""
    n = inverse_root(C * C + S * S, near)
    C *= n
    S *= n
    qx = R * (S * ex - C * ey)
    qy = R * (S * ey + C * ex)
    t = (qx - cx) * dx + (qy - cy) * dy + (ez - cz) * dz
    du = R * (C - p)
    dv = R * (abs(dz) * S - v)
    d2 = du * du + dv * dv
    if qy > h or (h > 0.0 and abs(qx) * -h + qy * s > 0.0) or abs(t) > l:
        d2 = math.inf  # in the mouth; nearly full arcs: by the angle
    return d2, qx, qy, t


@formula
def end_arc(ez, R, s, h, cx, cy, cz, dx, dy, dz, k, l, ex, ey, p, v):  # type: ignore[no-untyped-def] # noqa: E741
    """Squared distance of the axis' inside from the end arc in the plane z = ez (inf if they do not face), qx, qy, t.

    Seen along the axis the circle is an ellipse with the half axes R and R |dz| and the axis is a point. The distance
    of that point from the circle's point at angle phi is a trigonometric polynomial of degree two in phi, its
    stationary points a quartic. With C, S the cosine and sine from the major axis, they are C = p / (k + mu),
    S = q / mu, C^2 + S^2 = 1 with k = dx^2 + dy^2. Only the root mu > 0 (the least distance) and the largest mu < 0
    (the local minimum on the other side of the major axis) are minima; solving for them this way loses no digits where
    the quartic's roots run together (axis through the arc's centre, small tilt).
    """
    q = abs(dz) * v
    a = abs(p)
    if abs(q) > TINY or a > k:
        mu = nearer_root(k, a, abs(q))
        both = 1.0 / ((k + mu) * mu)
        C, S = p * (mu * both), q * ((k + mu) * both)
        first = arc_point(C, S, False, ez, R, s, h, cx, cy, cz, dx, dy, dz, l, ex, ey, p, v)
        nu = farther_root(k, a, abs(q)) if first[0] == math.inf else -1.0
        if nu <= 0.0:
            return first
        return arc_point(p / (k - nu), -q / nu, False, ez, R, s, h, cx, cy, cz, dx, dy, dz, l, ex, ey, p, v)
    C = p / k  # the point is on the major axis, within the evolute: two mirrored minima
    S = math.sqrt(max(0.0, 1.0 - C * C))
    first = arc_point(C, S, False, ez, R, s, h, cx, cy, cz, dx, dy, dz, l, ex, ey, p, v)
    second = arc_point(C, -S, False, ez, R, s, h, cx, cy, cz, dx, dy, dz, l, ex, ey, p, v)
    return second if second[0] < first[0] else first


@inlined
def end_arc_soon(ez, R, s, h, cx, cy, cz, dx, dy, dz, k, l, ex, ey, p, v):  # type: ignore[no-untyped-def] # noqa: E741
    """What `end_arc` gives, by one step and without branches; and whether that is enough."""
    q = abs(dz) * v
    a = abs(p)
    low, mu = nearer_start(k, a, abs(q))
    mu, done = nearer_step(k, a, abs(q), low, mu)
    both = 1.0 / ((k + mu) * mu)
    C, S = p * (mu * both), q * ((k + mu) * both)
    d2, qx, qy, t = arc_point(C, S, True, ez, R, s, h, cx, cy, cz, dx, dy, dz, l, ex, ey, p, v)
    done = done and abs(C * C + S * S - 1.0) <= 1e-8
    # The farther minimum needs a place within the evolute, where a + |q| < k.
    return d2, qx, qy, t, done and abs(q) > TINY and (d2 < math.inf or a + abs(q) >= k)


@inlined
def clip(h, H, cy, cz, dy, dz, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Part lo <= t <= hi of the axis in the block {y <= h, |z| <= H}; lo > hi if there is none."""
    over = 1.0 / (dz if abs(dz) > TINY else TINY)
    down, up = (-H - cz) * over, (H - cz) * over
    lo, hi = max(-l, min(down, up)), min(l, max(down, up))
    at = (h - cy) / dy
    hi = min(hi, at) if dy > 0.0 else hi
    lo = max(lo, at) if dy < 0.0 else lo
    none = (dy == 0.0 and cy > h) or (abs(dz) <= TINY and abs(cz) > H)
    return lo, -math.inf if none else hi


@formula
def point_depth(x, y, z, R, h, H):  # type: ignore[no-untyped-def]
    """Distance of a point of S from the boundary of S (negative outside): min of three, and its feature."""
    rho = math.sqrt(x * x + y * y)
    depth = rho - R
    feature = ARC
    if h - y < depth:
        depth = h - y
        feature = FLAT_N if x >= 0.0 else FLAT_M
    if H - abs(z) < depth:
        depth = H - abs(z)
        feature = END_FACE
    return depth, feature


@formula
def deepest(R, h, H, cx, cy, cz, dx, dy, dz, lo, hi):  # type: ignore[no-untyped-def]
    """Deepest point of the axis in S for lo <= t <= hi: depth, t.

    The depth is the smallest of a convex function (rho - R) and three linear ones, so its maximum is at an end, where
    two linear ones cross, or where rho - R crosses a linear one (a quadratic).
    """
    best = -math.inf
    bt = lo
    for i in range(11):
        if i < 2:
            t = lo if i == 0 else hi
        elif i < 5:
            # h - y = H - z, h - y = H + z, H - z = H + z
            if i == 2:
                t = (h - cy - H + cz) / (dy - dz)
            elif i == 3:
                t = (h - cy - H - cz) / (dy + dz)
            else:
                t = -cz / dz
        else:
            j = (i - 5) // 2
            if j == 0:
                g0 = h - cy
                g1 = -dy
            elif j == 1:
                g0 = H - cz
                g1 = -dz
            else:
                g0 = H + cz
                g1 = dz
            # (R + g0 + g1 t)^2 = (cx + dx t)^2 + (cy + dy t)^2
            A = dx * dx + dy * dy - g1 * g1
            B = cx * dx + cy * dy - (R + g0) * g1
            C = cx * cx + cy * cy - (R + g0) * (R + g0)
            disc = B * B - A * C
            if disc < 0.0:
                continue
            w = -B - math.copysign(math.sqrt(disc), B)
            t = w / A if i % 2 == 1 else C / w
            for _ in range(2):  # the quadratic squares its terms: Newton's steps on the unsquared equation restore them
                x = cx + t * dx
                y = cy + t * dy
                rho = math.sqrt(x * x + y * y)
                slope = (x * dx + y * dy) / rho - g1
                if rho > 0.0 and slope != 0.0:
                    t -= (rho - R - (g0 + g1 * t)) / slope
        if not (lo <= t <= hi):
            continue
        depth, _ = point_depth(cx + t * dx, cy + t * dy, cz + t * dz, R, h, H)
        if depth > best:
            best = depth
            bt = t
    return best, bt
