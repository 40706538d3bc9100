"""Compiled branch and bound: the least signed distance from a solid that a point of another solid's faces has.

The signed distance from a solid has slope 1: a piece with a point at s and radius r has no point nearer than s - r.
Three better bounds, each proven for the piece as it lies:

- outside, its distance from each face is at least that of the whole surface, in closed form, and at least that of the
  face's triangles less their errors;
- where no face of the solid within a ball reaches above the surface of one of them, the solid in the ball lies below
  that surface, so the piece's signed distance is at least its least height over the surface;
- inside, the same with the surroundings in place of the solid says that a point has material all round it.

Pieces of one face are bounded together first, and looked at one by one only where that bound is the least of all.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_math import (
    CONE,
    CYLINDER,
    OTHER,
    PLANE,
    SPHERE,
    TORUS,
    band_over,
    bend,
    cut,
    height_at,
    least_height,
    longest,
    point_triangle,
    raise_by,
    spans,
    surface_point,
    to_frame,
    way_out,
)
from clamp3d.collide.faces_tree import DEEP, THIN, from_faces, mark_face, nearest, nearest_marked
from clamp3d.collide.verdict import RESOLUTION
from clamp3d.core.jit import entry, formula

NEAR = 4
"""Faces whose surfaces are tried as separating ones, those nearest to the piece."""
TRIED = 16
"""Faces tried in all, with those beside the nearest."""
RESULT = 10
"""Upper bound, points on the piece (3) and the solid (3), face, farthest distance that is certainly outside, pieces."""
_PIECES = 24
"""Pieces that may wait while one is cut to see whether it reaches above a surface."""
WORK = 3 + 2 * _PIECES
"""Triangles (3, 3) that the search takes for itself; ``SPACE``: numbers, besides one for each piece and two a node."""
SPACE = DEEP + NEAR + TRIED


@formula
def _over_triangle(kind, a, b, F, uv, x, y, z):
    """Whether the foot of a point on a surface lies in the triangle uv (3, 2) of its parameters."""
    x, y, z = x - F[0], y - F[1], z - F[2]
    X, Y = x * F[3] + y * F[4] + z * F[5], x * F[6] + y * F[7] + z * F[8]
    Z = x * F[9] + y * F[10] + z * F[11]
    u, v = X, Y
    if kind != PLANE:
        h = math.sqrt(X * X + Y * Y)
        u = math.atan2(Y, X)
        if kind == CYLINDER:
            v = Z
        elif kind == CONE:
            v = ((h - a) * math.sin(b) + Z * math.cos(b)) * math.cos(b)
        elif kind == SPHERE:
            v = math.atan2(Z, h)
        else:
            v = math.atan2(Z, h - a)
            v += 2.0 * math.pi * math.floor((uv[0, 1] - v) / (2.0 * math.pi) + 0.5)
        u += 2.0 * math.pi * math.floor((uv[0, 0] - u) / (2.0 * math.pi) + 0.5)
    one, other = True, True
    for i in range(3):
        k = (i + 1) % 3
        side = (uv[k, 0] - uv[i, 0]) * (v - uv[i, 1]) - (uv[k, 1] - uv[i, 1]) * (u - uv[i, 0])
        one = one and side >= 0.0  # NaN, a pole: neither
        other = other and side <= 0.0
    return one or other


@formula
def _witness(kind, a, b, F, P, uv, x, y, z, q):
    """A point q (3) of the surface piece of triangle P near a point; returns their distance."""
    if kind != OTHER and _over_triangle(kind, a, b, F, uv, x, y, z):
        eps, h = 1e-6, height_at(kind, a, b, F, x, y, z)
        gx = (height_at(kind, a, b, F, x + eps, y, z) - height_at(kind, a, b, F, x - eps, y, z)) / (2.0 * eps)
        gy = (height_at(kind, a, b, F, x, y + eps, z) - height_at(kind, a, b, F, x, y - eps, z)) / (2.0 * eps)
        gz = (height_at(kind, a, b, F, x, y, z + eps) - height_at(kind, a, b, F, x, y, z - eps)) / (2.0 * eps)
        q[0], q[1], q[2] = x - h * gx, y - h * gy, z - h * gz
        return abs(h)
    _, v, w = point_triangle(x, y, z, P)
    r = 1.0 - v - w
    for k in range(3):
        q[k] = r * P[0, k] + v * P[1, k] + w * P[2, k]
    if kind != OTHER and kind != PLANE:
        s, t, n = 0.0, 0.0, 0.0
        weights = (r, v, w)
        for i in range(3):
            t += weights[i] * uv[i, 1]
            if not np.isnan(uv[i, 0]):
                s += weights[i] * uv[i, 0]
                n += weights[i]
        if n > 0.0:
            surface_point(kind, a, b, F, s / n, t, q)
    return math.sqrt((x - q[0]) ** 2 + (y - q[1]) ** 2 + (z - q[2]) ** 2)


@formula
def _slopes(kind, size, frame, sense, f, g, x, y, z, between):
    """Cosine of the angle between two faces' normals at a point; their sum, of length 1, into ``between`` (3)."""
    eps, turn, length = 1e-6, 0.0, 0.0
    for i in range(3):
        dx, dy, dz = (eps if i == 0 else 0.0), (eps if i == 1 else 0.0), (eps if i == 2 else 0.0)
        a = height_at(kind[f], size[f, 0], size[f, 1], frame[f], x + dx, y + dy, z + dz)
        a -= height_at(kind[f], size[f, 0], size[f, 1], frame[f], x - dx, y - dy, z - dz)
        b = height_at(kind[g], size[g, 0], size[g, 1], frame[g], x + dx, y + dy, z + dz)
        b -= height_at(kind[g], size[g, 0], size[g, 1], frame[g], x - dx, y - dy, z - dz)
        a, b = sense[f] * a / (2.0 * eps), sense[g] * b / (2.0 * eps)
        turn += a * b
        length += (a + b) * (a + b)
        between[i] = a + b
    for i in range(3):
        between[i] /= max(math.sqrt(length), 1e-12)
    return turn


@formula
def _all_above(kind, size, frame, sense, f, V, way, step, work):
    """How far above a surface the whole triangle V (3, 3) is after a step along ``way`` (3)."""
    for i in range(3):
        for c in range(3):
            work[1, i, c] = V[i, c] + step * way[c]
    to_frame(frame[f], work[1], work[0])
    return least_height(kind[f], size[f, 0], size[f, 1], sense[f], work[0])


@formula
def _below(least, rho, clear):
    """Lower bound of what is within rho of a ball's middle and ``least`` over a surface that the solid is below in it.

    Outside, nothing of the solid is nearer than the surface and the ball's edge. Inside, the way out has to end within
    the ball, for beyond it the solid may go on.
    """
    if least >= 0.0:
        return min(least, clear - rho)
    return least if rho - least <= clear else -np.inf


@formula
def _winding(P, x, y, z):
    """How often the triangles wind round a point that is on none of them: 1 inside, 0 outside."""
    total = 0.0
    for t in range(P.shape[0]):
        ax, ay, az = P[t, 0, 0] - x, P[t, 0, 1] - y, P[t, 0, 2] - z
        bx, by, bz = P[t, 1, 0] - x, P[t, 1, 1] - y, P[t, 1, 2] - z
        cx, cy, cz = P[t, 2, 0] - x, P[t, 2, 1] - y, P[t, 2, 2] - z
        a, b = math.sqrt(ax * ax + ay * ay + az * az), math.sqrt(bx * bx + by * by + bz * bz)
        c = math.sqrt(cx * cx + cy * cy + cz * cz)
        triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
        total += math.atan2(triple, a * b * c + ab * c + bc * a + ca * b)
    return total / (2.0 * math.pi)


@formula
def _mark(row, solid, marked, slack, work):
    """Fill a row of marks, if it is not yet: face f has the rows f and, with as little slack as can be, n + f."""
    if marked[row]:
        return
    P, _, face, box, link, order, _, buv, bsag, kind, size, frame, sense, deviation, group, _, marks, nodes = solid
    f = row % len(kind)
    mark_face(
        P, buv, bsag, face, box, link, order, kind, size, frame, deviation, group, f, sense[f], slack[row],
        marks[row], nodes[row], work[3 : 3 + _PIECES], work[3 + _PIECES :], work[0],
    )  # fmt: skip
    marked[row] = 1


@formula
def _clear(solid, row, other, bit, x, y, z, limit, stack):
    """How far about a point, at most ``limit``, no piece has the ``bit`` in both rows of marks, or THIN in either."""
    P, err, _, box, link, order, _, _, _, _, _, _, _, _, _, _, marks, nodes = solid
    both = (marks[row], marks[other], nodes[row], nodes[other])
    found = nearest_marked(P, err, box, link, order, 0, *both, bit, -1.0, x, y, z, limit, stack)
    for k in (row, other):
        own = (marks[k], marks[k], nodes[k], nodes[k])
        found = nearest_marked(P, err, box, link, order, 0, *own, THIN, -1.0, x, y, z, found, stack)
    return found


@formula
def _piece(V, uv, g, sag, own, solid, marked, limits, scratch, out):
    """Lower bound for one piece; a better upper bound goes into ``out``."""
    akind, asize, aframe, adeviation = own
    slack, contact, goal, tol = limits
    near, chosen, heights, over, stack, whole = scratch
    work, point, p, q = whole[0], whole[1], whole[2, 0], whole[2, 1]
    P, err, face, box, link, order, root, buv, bsag, kind, size, frame, sense, deviation, _, beside, marks, nodes = (
        solid
    )
    du, v0, v1, u, v = spans(uv)
    e = bend(akind[g], asize[g, 0], asize[g, 1], du, v1 - v0, v0, v1)
    rim = max(sag[0], sag[1], sag[2]) + adeviation[g]
    e += rim
    if akind[g] == OTHER:
        for k in range(3):
            p[k] = (V[0, k] + V[1, k] + V[2, k]) / 3.0
    else:
        surface_point(akind[g], asize[g, 0], asize[g, 1], aframe[g], u, v, p)
    x, y, z = p[0], p[1], p[2]
    rho = 0.0
    for i in range(3):
        rho = max(rho, (V[i, 0] - x) ** 2 + (V[i, 1] - y) ** 2 + (V[i, 2] - z) ** 2)
    rho = math.sqrt(rho)
    j, low, high = nearest(P, err, face, box, link, order, x, y, z, np.inf, near, stack)
    found = -high - rho - e
    f = face[j]
    if high - err[j] < out[0]:
        d = _witness(kind[f], size[f, 0], size[f, 1], frame[f], P[j], buv[j], x, y, z, q)
        d += rim + bsag[j] + deviation[f]
        if d < out[0]:
            out[0] = d
            for k in range(3):
                out[1 + k], out[4 + k] = p[k], q[k]
            out[7] = f
    outside, inside, tried = -1.0, False, 0
    for n in range(NEAR + beside.shape[1] * TRIED):
        # The nearest faces first; then those beside them, and beside these.
        if n < NEAR:
            f = near[n]
        else:
            m = (n - NEAR) // beside.shape[1]
            if m >= tried or tried == TRIED or not (outside < 0.0 and (low > 0.0 or found < -contact)):
                break
            f = beside[chosen[m], (n - NEAR) % beside.shape[1]]
        if f < 0 or kind[f] == OTHER:
            continue
        known = False
        for k in range(tried):
            known = known or chosen[k] == f
        if known:
            continue
        h = sense[f] * height_at(kind[f], size[f, 0], size[f, 1], frame[f], x, y, z)
        chosen[tried] = f
        tried += 1
        for row in (f, len(kind) + f):
            t = slack[row] + deviation[f]
            to_frame(frame[f], V, work)
            a, raised = raise_by(kind[f], size[f, 0], size[f, 1], sense[f], t)
            least = least_height(kind[f], a, size[f, 1], sense[f], work)
            if akind[g] != PLANE and akind[g] != OTHER:  # as round as it is: perhaps the same surface, but for a little
                band = akind[g], asize[g, 0], asize[g, 1], aframe[g], v0, v1
                least = max(least, e - rim + band_over(*band, kind[f], a, size[f, 1], frame[f], sense[f]))
            least -= raised
            if row == f:
                heights[tried - 1] = least
            if row > f and not (rho + e < 2.0 * slack[f] and found < min(out[0], goal) - tol):
                break
            deep = way_out(kind[f], size[f, 0], size[f, 1], sense[f], frame[f], t, x, y, z)
            wanted = deep > 0.0 and (rim - deep < out[0] or not inside)
            if not (least - e > found or (h > t and outside < 0.0) or wanted):
                continue
            _mark(row, solid, marked, slack, whole)
            own_marks = (marks[row], marks[row], nodes[row], nodes[row])
            at = nearest_marked(P, err, box, link, order, root[f], *own_marks, 0, 1.0, x, y, z, np.inf, stack)
            # Beyond this the inside of a torus within a ball may be in two pieces.
            reach = size[f, 0] if kind[f] == TORUS else np.inf
            if least - e > found or (h > t and outside < 0.0):
                needed = max(h, abs(least) if least - e > found else 0.0)
                limit = min(needed + rho + 2.0 * at + t, reach if sense[f] < 0.0 else np.inf)
                clear = _clear(solid, row, row, 1, x, y, z, limit, stack)
                if clear > at + t:  # what is above the face by more than t is outside there
                    found = max(found, _below(least, rho, clear) - e)
                    if h > t:
                        outside = max(outside, min(h - t, clear))
            if wanted:
                limit = min(2.0 * at + deep + t, reach if sense[f] > 0.0 else np.inf)
                clear = _clear(solid, row, row, 2, x, y, z, limit, stack)
                inside = inside or clear > at + t
                if clear > at + t and rim - deep < out[0]:  # inside: as deep as the faces are away
                    for i in range(3):
                        for c in range(3):
                            work[i, c] = p[c]
                    depth = from_faces(
                        P, err, face, box, link, order, kind, size, frame, deviation, work, over, deep + t, point, stack
                    )
                    depth = max(depth, min(deep, clear)) - rim
                    if -depth < out[0] and depth > 0.0:
                        out[0] = -depth
                        for k in range(3):
                            out[1 + k] = out[4 + k] = p[k]
                        out[7] = f
    if found < -0.5 * contact:
        # In a hollow corner the solid lies below one of two surfaces. A way out of both is along both normals.
        for m in range(tried):
            f = chosen[m]
            for n in range(m):
                o = chosen[n]
                least = min(heights[m], heights[n])
                if least - e <= found or kind[f] == TORUS or kind[o] == TORUS:
                    continue
                turn = _slopes(kind, size, frame, sense, f, o, x, y, z, q)
                if turn < -0.8:
                    continue
                rise = 0.9 * math.sqrt(0.5 * (1.0 + turn))  # above either for a step along both normals
                if least < 0.0:
                    least /= rise
                    above = True
                    for one in (f, o):
                        up = _all_above(kind, size, frame, sense, one, V, q, -least, whole)
                        above = above and up > slack[one] + deviation[one]
                    if not above or least - e <= found:
                        continue
                _mark(f, solid, marked, slack, whole)
                _mark(o, solid, marked, slack, whole)
                # A piece of one that looks over the other: what lies above both there is outside.
                at = np.inf
                for one, other in ((f, o), (o, f)):
                    rows = (marks[other], marks[other], nodes[other], nodes[other])
                    at = nearest_marked(P, err, box, link, order, root[one], *rows, 1, 1.0, x, y, z, at, stack)
                past = at + 2.0 * max(slack[f] + deviation[f], slack[o] + deviation[o]) / rise  # of the slack of both
                limit = past + max(at, -least) + rho
                clear = _clear(solid, f, o, 1, x, y, z, limit, stack)
                if clear > past:
                    found = max(found, _below(least, rho, clear) - e)
    unsure = low > 0.0 and found < min(out[0], goal) - tol and not inside and outside < 0.0
    if unsure and _winding(P, x, y, z) < 0.5:
        outside = low  # clear of all errors: what the triangles say holds
    if outside > 0.0:
        out[8] = max(out[8], outside)
        found = max(found, low - rho - e)
        target = min(out[0], goal)
        if found < target - tol and low > e:
            d = from_faces(
                P, err, face, box, link, order, kind, size, frame, deviation, V, over, target + e + tol, work, stack
            )
            if d > e:
                found = max(found, d - e)
    return found


@formula
def _block(pieces, uvs, sags, g, own, solid, marked, slack, rows, near, known, stack, whole):
    """Lower bound for the pieces ``rows`` of face g, all at once, ``known`` if there is no better one; and the lowest.

    As for one piece, with a ball round the middle of their box, whole[2, 0], that must hold them all.
    """
    akind, asize, aframe, adeviation = own
    P, err, _, box, link, order, root, _, _, kind, size, frame, sense, deviation, _, _, marks, nodes = solid
    work, p = whole[0], whole[2, 0]
    x, y, z = p[0], p[1], p[2]
    rho, rim, bent, low, high = 0.0, 0.0, 0.0, np.inf, -np.inf
    for k in rows:
        for i in range(3):
            rho = max(rho, (pieces[k, i, 0] - x) ** 2 + (pieces[k, i, 1] - y) ** 2 + (pieces[k, i, 2] - z) ** 2)
            rim = max(rim, sags[k, i])
        du, v0, v1, _, _ = spans(uvs[k])
        low, high = min(low, v0), max(high, v1)
        bent = max(bent, bend(akind[g], asize[g, 0], asize[g, 1], du, v1 - v0, v0, v1))
    rim += adeviation[g]
    rho = math.sqrt(rho) + bent + rim
    found, best = known, rows[0]
    for f in near:
        if f < 0 or kind[f] == OTHER:
            continue
        t, least = slack[f] + deviation[f], -np.inf
        a, raised = raise_by(kind[f], size[f, 0], size[f, 1], sense[f], t)
        if akind[g] != PLANE and akind[g] != OTHER:
            band = akind[g], asize[g, 0], asize[g, 1], aframe[g], low, high
            least = band_over(*band, kind[f], a, size[f, 1], frame[f], sense[f]) - rim
        flat = np.inf
        for k in rows:
            if flat <= max(least, found + raised):
                break
            du, v0, v1, _, _ = spans(uvs[k])
            to_frame(frame[f], pieces[k], work)
            e = bend(akind[g], asize[g, 0], asize[g, 1], du, v1 - v0, v0, v1) + rim
            h = least_height(kind[f], a, size[f, 1], sense[f], work) - e
            if h < flat:
                flat, best = h, k
        least = max(least, flat) - raised
        if least <= found:
            continue
        _mark(f, solid, marked, slack, whole)
        own_marks = (marks[f], marks[f], nodes[f], nodes[f])
        at = nearest_marked(P, err, box, link, order, root[f], *own_marks, 0, 1.0, x, y, z, np.inf, stack)
        # Beyond ``reach`` the inside of a torus within a ball may be in two pieces.
        reach = size[f, 0] if kind[f] == TORUS and sense[f] < 0.0 else np.inf
        limit = min(rho + abs(least) + 2.0 * (at + t), reach)
        clear = _clear(solid, f, f, 1, x, y, z, limit, stack)
        if clear <= at + t:
            continue
        found = max(found, _below(least, rho, clear))
    return found, best


@formula
def _push(heap, count, key, item):
    """One more item on a heap of ``count``, that with the least key first."""
    k = count
    while k > 0 and key[heap[(k - 1) // 2]] > key[item]:
        heap[k] = heap[(k - 1) // 2]
        k = (k - 1) // 2
    heap[k] = item


@formula
def _pop(heap, count, key):
    """Take the first item off a heap of ``count``."""
    first, last, k = heap[0], heap[count - 1], 0
    while 2 * k + 1 < count - 1:
        j = 2 * k + 1
        if j + 1 < count - 1 and key[heap[j + 1]] < key[heap[j]]:
            j += 1
        if key[heap[j]] >= key[last]:
            break
        heap[k] = heap[j]
        k = j
    heap[k] = last
    return first


def _descend(
    pieces, uvs, faces, sags, bounds, n, bbox, blink, border, broot, T,
    akind, asize, aframe, adeviation,
    P, err, face, box, link, order, root, buv, bsag, kind, size, frame, sense, deviation, group, neighbours,
    marks, nodes, marked, slack, contact, clearance, tol, most, over, whole, space, out,
):  # fmt: skip
    own = (akind, asize, aframe, adeviation)
    solid = (
        P, err, face, box, link, order, root, buv, bsag, kind, size, frame, sense, deviation, group, neighbours,
        marks, nodes,
    )  # fmt: skip
    inner, near, chosen = space[:DEEP], space[DEEP : DEEP + NEAR], space[DEEP + NEAR : SPACE]
    # What waits, that with the least bound first: pieces, and after their numbers the nodes of their tree.
    after, first = len(faces), n
    owner, heap = space[SPACE : SPACE + len(bbox)], space[SPACE + len(bbox) :]
    heights, over, p, q = over[:TRIED], over[TRIED:], whole[2, 0], whole[2, 1]
    scratch = (near, chosen, heights, over, inner, whole)
    verdict = tol < 0.0
    goal = max(contact, clearance) + 2.0 * RESOLUTION if verdict else np.inf
    tol = abs(tol)
    limits = (slack, contact, goal, tol)
    for i in range(len(bbox)):
        owner[i] = -1  # of several faces
    for g in range(len(broot)):
        owner[broot[g]] = g
    looked, floor, waiting = 0, np.inf, 1
    heap[0], bounds[after] = after, -np.inf
    while waiting:
        low = bounds[heap[0]]
        high = out[0]
        known = high - low <= tol
        if verdict:
            known = (
                known
                or low > goal
                or high < -contact - 2.0 * RESOLUTION
                or (low >= -contact and high <= contact)
                or (low > contact + 2.0 * RESOLUTION and high < clearance - 2.0 * RESOLUTION)
            )
        if known or (heap[0] < after and (n >= len(faces) or n - first >= most)):
            break
        item = _pop(heap, waiting, bounds)
        waiting -= 1
        if item >= after:
            i = item - after
            if blink[i, 1] > 0:
                for j in range(blink[i, 0], blink[i, 0] + blink[i, 1]):
                    k = border[j]
                    new = _piece(pieces[k], uvs[k], faces[k], sags[k], own, solid, marked, limits, scratch, out)
                    bounds[k] = max(low, new)
                    _push(heap, waiting, bounds, k)
                    waiting += 1
                    looked += 1
                continue
            for child in (blink[i, 0], -blink[i, 1]):
                if owner[child] < 0:
                    owner[child] = owner[i]
                start, end = child, child
                while blink[start, 1] < 0:
                    start = blink[start, 0]
                while blink[end, 1] < 0:
                    end = -blink[end, 1]
                radius = 0.0
                for c in range(3):
                    q[c] = 0.5 * (bbox[child, c] + bbox[child, 3 + c])
                    radius += 0.25 * (bbox[child, 3 + c] - bbox[child, c]) ** 2
                for c in range(3):
                    p[c] = T[c, 0] * q[0] + T[c, 1] * q[1] + T[c, 2] * q[2] + T[c, 3]
                radius = math.sqrt(radius) + bbox[child, 6]
                target = max(min(goal, out[0]), 0.0) + radius + contact
                _, away, _ = nearest(P, err, face, box, link, order, p[0], p[1], p[2], target, near, inner)
                if away - radius > max(min(goal, out[0]), 0.0):  # no face is in it: outside if one of its pieces is
                    k = border[blink[start, 0]]
                    looked += 1
                    if _piece(pieces[k], uvs[k], faces[k], sags[k], own, solid, marked, limits, scratch, out) > 0.0:
                        floor = min(floor, away - radius)
                        continue
                new, g = low, owner[child]
                if g >= 0:
                    rows = border[blink[start, 0] : blink[end, 0] + blink[end, 1]]
                    new, k = _block(pieces, uvs, sags, g, own, solid, marked, slack, rows, near, low, inner, whole)
                    if low < new < min(goal, out[0]):  # some point of it is wanted too
                        _piece(pieces[k], uvs[k], g, sags[k], own, solid, marked, limits, scratch, out)
                        looked += 1
                bounds[after + child] = new
                _push(heap, waiting, bounds, after + child)
                waiting += 1
            continue
        i = item
        g = faces[i]
        du, v0, v1, _, _ = spans(uvs[i])
        e = bend(akind[g], asize[g, 0], asize[g, 1], du, v1 - v0, v0, v1)
        length = 0.0
        for k in range(3):
            for c in range(3):
                length = max(length, abs(pieces[i, k, c] - pieces[i, k - 1, c]))
        if length + e < 0.1 * tol + 0.05 * max(sags[i, 0], sags[i, 1], sags[i, 2]):
            floor = min(floor, low)  # what is left is not the piece's size: to cut it tells no more
            continue
        bent = e > 0.25 * (min(high, goal) - low)
        side = longest(pieces[i], uvs[i], akind[g], asize[g, 0], asize[g, 1], bent)
        faces[n] = g
        cut(
            pieces[i], uvs[i], side, akind[g], asize[g, 0], asize[g, 1], aframe[g], pieces[n], uvs[n]
        )  # fmt: skip
        # The piece keeps the half at corner ``side``; the cut itself is no border.
        for c in range(3):
            sags[n, c] = sags[i, c]
        sags[n, (side + 2) % 3] = 0.0
        sags[i, (side + 1) % 3] = 0.0
        for k in (i, n):
            new = _piece(pieces[k], uvs[k], g, sags[k], own, solid, marked, limits, scratch, out)
            bounds[k] = max(low, new)
            _push(heap, waiting, bounds, k)
            waiting += 1
        n += 1
        looked += 2
    out[9] = looked
    return min(floor, bounds[heap[0]]) if waiting else floor


_SOLID = (
    "f8[:,:,::1],f8[::1],i8[::1],f8[:,::1],i8[:,::1],i8[::1],i8[::1],f8[:,:,::1],f8[::1],"
    "i8[::1],f8[:,::1],f8[:,::1],f8[::1],f8[::1],i8[::1],i8[:,::1],i1[:,::1],i1[:,::1]"
)
descend = entry(
    _descend,
    "f8(f8[:,:,::1],f8[:,:,::1],i8[::1],f8[:,::1],f8[::1],i8,f8[:,::1],i8[:,::1],i8[::1],i8[::1],f8[:,::1],"
    f"i8[::1],f8[:,::1],f8[:,::1],f8[::1],{_SOLID},"
    "i1[::1],f8[::1],f8,f8,f8,i8,f8[::1],f8[:,:,::1],i8[::1],f8[::1])",
)
