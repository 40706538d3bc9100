"""Compiled bounds of the signed distance from a solid that points of one piece of a face have, or of many pieces.

The signed distance from a solid has slope 1: a piece with a point at s and radius r has no point nearer than s - r.
Three better bounds, each proven for the piece as it lies:

- outside, its distance from each face is at least that of the whole surface, in closed form, and at least that of the
  face's triangles less their errors;
- where no face of the solid within a ball reaches above the surface of one of them, the solid in the ball lies below
  that surface, so the piece's signed distance is at least its least height over the surface;
- inside, the same with the surroundings in place of the solid says that a point has material all round it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_math import (
    OTHER,
    PLANE,
    TORUS,
    band_over,
    bend,
    height_at,
    least_height,
    raise_by,
    slope_at,
    spans,
    surface_point,
    to_frame,
    way_out,
)
from clamp3d.collide.faces_open import is_open, mark_open
from clamp3d.collide.faces_tree import from_faces, mark_face, nearest, nearest_marked
from clamp3d.collide.faces_witness import winding, witness
from clamp3d.core.jit import formula

NEAR = 4
"""Faces whose surfaces are tried as separating ones, those nearest to the piece."""
TRIED = 16
"""Faces tried in all, with those beside the nearest."""
PIECES = 24
"""Pieces that may wait while one is cut to see whether it reaches above a surface."""


@formula
def _slopes(kind, size, frame, sense, f, g, x, y, z, between):
    """Cosine of the angle between two faces' normals at a point; their sum, of length 1, into ``between`` (3)."""
    turn, length = 0.0, 0.0
    for i in range(3):
        a = sense[f] * slope_at(kind[f], size[f, 0], size[f, 1], frame[f], i, x, y, z)
        b = sense[g] * slope_at(kind[g], size[g, 0], size[g, 1], frame[g], i, x, y, z)
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
def _mark(row, solid, marked, slack, work, stack):
    """Fill a row of marks, if it is not yet: face f has the rows f and, with as little slack as can be, n + f."""
    if marked[row]:
        return
    P, _, face, box, link, order, _, buv, bsag, kind, size, frame, sense, deviation, group, _, marks, nodes = solid
    f = row % len(kind)
    mark_face(
        P, buv, bsag, face, box, link, order, kind, size, frame, deviation, group, f, sense[f], slack[row],
        marks[row], nodes[row], work[3 : 3 + PIECES], work[3 + PIECES :], work[0],
    )  # fmt: skip
    mark_open(solid, row, f, slack[row] + deviation[f], work[2, 1], stack)
    marked[row] = 1


@formula
def _clear(solid, row, other, bit, x, y, z, limit, stack):
    """How far about a point, at most ``limit``, no piece has the ``bit`` in both rows of marks."""
    P, err, _, box, link, order, _, _, _, _, _, _, _, _, _, _, marks, nodes = solid
    both = (marks[row], marks[other], nodes[row], nodes[other])
    found, _ = nearest_marked(P, err, box, link, order, 0, *both, bit, -1.0, x, y, z, limit, stack)
    return found


@formula
def piece(V, uv, g, sag, own, solid, marked, limits, scratch, out):
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
        d = witness(kind[f], size[f, 0], size[f, 1], frame[f], P[j], buv[j], x, y, z, q)
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
            _mark(row, solid, marked, slack, whole, stack)
            own_marks = (marks[row], marks[row], nodes[row], nodes[row])
            at, _ = nearest_marked(P, err, box, link, order, root[f], *own_marks, 0, 1.0, x, y, z, np.inf, stack)
            # Beyond this the inside of a torus within a ball may be in two pieces.
            reach = size[f, 0] if kind[f] == TORUS else np.inf
            if least - e > found or (h > t and outside < 0.0):
                needed = max(h, abs(least) if least - e > found else 0.0)
                limit = min(needed + rho + 2.0 * at + t, reach if sense[f] < 0.0 else np.inf)
                clear = _clear(solid, row, row, 1, x, y, z, limit, stack)
                if clear > at + t and is_open(solid, row, f, t, -1, 0.0, clear, x, y, z, q, stack):
                    # What is above the face by more than t is outside there.
                    found = max(found, _below(least, rho, clear) - e)
                    if h > t:
                        outside = max(outside, min(h - t, clear))
            if wanted:
                limit = min(2.0 * at + deep + t, reach if sense[f] > 0.0 else np.inf)
                clear = _clear(solid, row, row, 2, x, y, z, limit, stack)
                within = clear > at + t and is_open(solid, row, f, t, -1, 0.0, clear, x, y, z, q, stack)
                inside = inside or within
                if within and rim - deep < out[0]:  # inside: as deep as the faces are away
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
                _mark(f, solid, marked, slack, whole, stack)
                _mark(o, solid, marked, slack, whole, stack)
                # Where a piece of one looks over the other, what lies above both is outside.
                for one, other in ((f, o), (o, f)):
                    rows = (marks[other], marks[other], nodes[other], nodes[other])
                    at, j = nearest_marked(P, err, box, link, order, root[one], *rows, 1, 1.0, x, y, z, np.inf, stack)
                    if j < 0:
                        continue
                    t, over_other = slack[one] + deviation[one], slack[other] + deviation[other]
                    clear = _clear(solid, f, o, 1, x, y, z, 2.0 * at + 8.0 * (t + over_other) - least + rho, stack)
                    if clear > at + t and is_open(solid, one, one, t, other, over_other, clear, x, y, z, q, stack):
                        found = max(found, _below(least, rho, clear) - e)
                        break
    unsure = low > 0.0 and found < min(out[0], goal) - tol and not inside and outside < 0.0
    if unsure and abs(winding(P, x, y, z)) < 1e-6:
        outside = low  # clear of all errors: what the triangles say holds; if they do not close it is no whole number
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
def block(pieces, uvs, sags, g, own, solid, marked, slack, rows, near, known, stack, whole):
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
        _mark(f, solid, marked, slack, whole, stack)
        own_marks = (marks[f], marks[f], nodes[f], nodes[f])
        at, _ = nearest_marked(P, err, box, link, order, root[f], *own_marks, 0, 1.0, x, y, z, np.inf, stack)
        # Beyond ``reach`` the inside of a torus within a ball may be in two pieces.
        reach = size[f, 0] if kind[f] == TORUS and sense[f] < 0.0 else np.inf
        limit = min(rho + abs(least) + 2.0 * (at + t), reach)
        clear = _clear(solid, f, f, 1, x, y, z, limit, stack)
        if clear <= at + t or not is_open(solid, f, f, t, -1, 0.0, clear, x, y, z, whole[2, 1], stack):
            continue
        found = max(found, _below(least, rho, clear))
    return found, best
