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
    bend_over,
    cut,
    height_at,
    least_height,
    longest,
    raise_by,
    slope_at,
    spans,
    surface_point,
    to_frame,
    way_out,
)
from clamp3d.collide.faces_open import is_open
from clamp3d.collide.faces_tree import PIECES, from_faces, nearest, nearest_below, nearest_marked
from clamp3d.collide.faces_witness import winding, witness
from clamp3d.core.jit import formula

NEAR = 4
"""Faces whose surfaces are tried as separating ones, those nearest to the piece."""
TRIED = 16
"""Faces tried in all, with those beside the nearest."""
MOST_OVER = 6
"""Faces at most that many pieces are bounded over together."""
WORK = 6 + 2 * PIECES
"""Triangles (3, 3) that the search takes for itself."""


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
def _clear(solid, row, bit, slack, at, x, y, z, needed, most, whole, stack):
    """How far about a point no piece has the mark ``bit`` in a row of marks; -1 if that tells nothing.

    The face is within ``at`` of the point: it has to be in that ball, by its slack. Looked at is ``needed`` past it, at
    most ``most``.
    """
    f = row % len(solid[13])
    t = slack[row] + solid[13][f]
    limit = min(needed + 2.0 * (at + t), most)
    clear = nearest_marked(solid, row, row, 0, bit, -1.0, slack, x, y, z, limit, whole, stack)
    if clear > at + t and is_open(solid, f, t, -1, 0.0, clear, x, y, z, whole[1, 0], stack):
        return clear
    return -1.0


@formula
def _enough(high, limits):
    """Lower bound above which no better one is needed, with an upper bound ``high`` of all."""
    _, contact, goal, tol = limits
    if goal < np.inf and high <= contact:  # asked for a verdict: contact or clash
        return -contact
    return min(goal, high - 0.25 * tol)


@formula
def piece(V, uv, g, sag, own, solid, limits, scratch, out):
    """Lower bound for one piece; a better upper bound goes into ``out``."""
    akind, asize, aframe, adeviation = own
    slack, contact, goal, tol = limits
    near, chosen, heights, over, stack, whole = scratch
    work, point, p, q = whole[0], whole[1], whole[2, 0], whole[2, 1]
    P, err, face, box, link, order, root, buv, bsag, kind, size, frame, sense, deviation, _, beside, _, _ = solid
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
        at, told = -1.0, True
        for row in (f, len(kind) + f):
            if not told:  # what is near with much slack is with little
                break
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
            deep = way_out(kind[f], size[f, 0], size[f, 1], sense[f], frame[f], t, x, y, z)
            wanted = deep > 0.0 and (rim - deep < out[0] or not inside)
            if not (least - e > found or (h > t and outside < 0.0) or wanted):
                continue
            told = False
            if at < 0.0:
                at = nearest_below(P, err, box, link, order, root[f], x, y, z, stack)
            # Beyond this the inside of a torus within a ball may be in two pieces.
            reach = size[f, 0] if kind[f] == TORUS else np.inf
            if least - e > found or (h > t and outside < 0.0):
                needed = max(h, abs(least) if least - e > found else 0.0) + rho
                most = reach if sense[f] < 0.0 else np.inf
                clear = _clear(solid, row, 1, slack, at, x, y, z, needed, most, whole, stack)
                told = clear > 0.0 and found < _enough(out[0], limits)
                if clear > 0.0:  # what is above the face by more than t is outside there
                    found = max(found, _below(least, rho, clear) - e)
                    if h > t:
                        outside = max(outside, min(h - t, clear))
            if wanted:
                most = reach if sense[f] > 0.0 else np.inf
                clear = _clear(solid, row, 2, slack, at, x, y, z, deep, most, whole, stack)
                told = told or clear > 0.0
                inside = inside or clear > 0.0
                if clear > 0.0 and rim - deep < out[0]:  # inside: as deep as the faces are away
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
                # Where a piece of one looks over the other, what lies above both is outside.
                for one, other in ((f, o), (o, f)):
                    at = nearest_marked(
                        solid, other, other, root[one], 1, 1.0, slack, x, y, z, np.inf, whole, stack
                    )  # fmt: skip
                    if at == np.inf:
                        continue
                    t, over_other = slack[one] + deviation[one], slack[other] + deviation[other]
                    limit = 2.0 * at + 8.0 * (t + over_other) + abs(least) + rho
                    clear = nearest_marked(solid, f, o, 0, 1, -1.0, slack, x, y, z, limit, whole, stack)
                    if clear > at + t and is_open(
                        solid, one, t, other, over_other, clear, x, y, z, whole[1, 0], stack
                    ):  # fmt: skip
                        found = max(found, _below(least, rho, clear) - e)
                        break
    unsure = low > 0.0 and found < min(out[0], goal) - tol and not inside and outside < 0.0
    if unsure and abs(winding(P, x, y, z)) < 0.1:
        # Clear of all errors: what the triangles say holds. Cracks at borders, within the errors, tell little; if more
        # of the triangles is missing this is no whole number.
        outside = low
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
def _over(V, uv, g, rim, own, solid, count, scratch):
    """Lower bound, as `least_height`, of the highest that a piece of face g is over any of the first faces chosen."""
    akind, asize, aframe, _ = own
    _, _, _, _, _, _, _, _, _, kind, size, frame, sense, _, _, _, _, _ = solid
    _, chosen, raised, raised_size, _, whole = scratch
    du, v0, v1, _, _ = spans(uv)
    high = -np.inf
    for m in range(count):
        f = chosen[m]
        to_frame(frame[f], V, whole[0])
        e = bend_over(
            akind[g], asize[g, 0], asize[g, 1], aframe[g], du, v1 - v0, v0, v1, kind[f], frame[f]
        )  # fmt: skip
        h = least_height(kind[f], raised_size[m], size[f, 1], sense[f], whole[0]) - e - rim
        if akind[g] != PLANE and akind[g] != OTHER:
            band = akind[g], asize[g, 0], asize[g, 1], aframe[g], v0, v1
            h = max(h, band_over(*band, kind[f], raised_size[m], size[f, 1], frame[f], sense[f]) - rim)
        high = max(high, h - raised[m])
    return high


@formula
def _point_over(point, solid, count, chosen, raised):
    """How high a point (3) is over the highest of the first faces chosen, as they are raised."""
    _, _, _, _, _, _, _, _, _, kind, size, frame, sense, _, _, _, _, _ = solid
    high = -np.inf
    for m in range(count):
        f = chosen[m]
        h = sense[f] * height_at(kind[f], size[f, 0], size[f, 1], frame[f], point[0], point[1], point[2])
        high = max(high, h - raised[m])
    return high


@formula
def _put(place, point, uv, sag):
    """A point, its parameters and the sag there as a piece without size."""
    for i in range(3):
        for c in range(3):
            place[0, i, c] = point[c]
        place[1, i, 0], place[1, i, 1], place[2, 0, i] = uv[0], uv[1], sag


@formula
def _lowest(pieces, uvs, sags, g, rows, own, solid, count, known, wanted, near, scratch, place):
    """Lower bound of the highest that any point of the pieces ``rows`` of face g is over the first faces chosen.

    The pieces are cut, with no other question to the solid, until that is ``wanted``, or a point, into ``place``
    (3, 3, 3), is that low but for ``near``. Its parameters are next in ``place``, and the sag where it is. Less than
    ``known`` is not wanted either. Returns also how low that point is.
    """
    akind, asize, aframe, adeviation = own
    _, chosen, raised, _, _, whole = scratch
    cuts, cut_uvs = whole[3 : 3 + PIECES], whole[3 + PIECES : 3 + 2 * PIECES]
    high = np.inf
    for k in rows:
        for i in range(3):
            h = _point_over(pieces[k, i], solid, count, chosen, raised)
            if h < high:
                high = h
                _put(place, pieces[k, i], uvs[k, i], 0.0)
    if high <= known:
        return known, high
    found, left = np.inf, 64 + 2 * len(rows)
    for k in rows:
        rim = max(sags[k, 0], sags[k, 1], sags[k, 2]) + adeviation[g]
        for i in range(3):
            for c in range(3):
                cuts[0, i, c] = pieces[k, i, c]
            cut_uvs[0, i, 0], cut_uvs[0, i, 1] = uvs[k, i, 0], uvs[k, i, 1]
        top = 1
        while top > 0:
            top -= 1
            V, uv = cuts[top], cut_uvs[top]
            low = _over(V, uv, g, rim, own, solid, count, scratch)
            if low >= min(high - near, wanted, found) or top + 2 > len(cuts) or left == 0:
                found = min(found, low)
                continue
            left -= 1
            du, v0, v1, _, _ = spans(uv)
            e = bend(akind[g], asize[g, 0], asize[g, 1], du, v1 - v0, v0, v1)
            bent = e > 0.25 * (min(high, wanted) - low)
            side = longest(V, uv, akind[g], asize[g, 0], asize[g, 1], bent)
            cut(V, uv, side, akind[g], asize[g, 0], asize[g, 1], aframe[g], cuts[top + 1], cut_uvs[top + 1])
            h = _point_over(cuts[top + 1, side], solid, count, chosen, raised)
            if h < high:
                high = h
                _put(place, cuts[top + 1, side], cut_uvs[top + 1, side], rim - adeviation[g])
            top += 2
    return found, high


@formula
def block(pieces, uvs, sags, g, own, solid, limits, rows, known, high, scratch, place):
    """Lower bound for the pieces ``rows`` of face g, all at once, ``known`` if there is no better one.

    As for one piece, with a ball round the middle of their box, whole[2, 0], that must hold them all. Where the solid
    in the ball is below each of several surfaces, a point is as far from it as the highest of its heights over them
    says; so the least of the highest, over all points, is a bound. Returns also how low one of their points is.
    """
    akind, asize, _, adeviation = own
    nearest_ones, chosen, raised, raised_size, stack, whole = scratch
    P, err, _, box, link, order, root, _, _, kind, size, frame, sense, deviation, _, beside, _, _ = solid
    slack, _, goal, tol = limits
    wanted = _enough(high, limits)
    x, y, z = whole[2, 0, 0], whole[2, 0, 1], whole[2, 0, 2]
    rho, rim, bent = 0.0, 0.0, 0.0
    for k in rows:
        for i in range(3):
            rho = max(rho, (pieces[k, i, 0] - x) ** 2 + (pieces[k, i, 1] - y) ** 2 + (pieces[k, i, 2] - z) ** 2)
            rim = max(rim, sags[k, i])
        du, v0, v1, _, _ = spans(uvs[k])
        bent = max(bent, bend(akind[g], asize[g, 0], asize[g, 1], du, v1 - v0, v0, v1))
    rho = math.sqrt(rho) + bent + rim + adeviation[g]
    # From the nearest face on, those are taken in that the lowest point of the pieces, over those so far, is above.
    count, refused, k = 0, 0, rows[len(rows) // 2]
    _put(place, pieces[k, 0], uvs[k, 0], 0.0)
    found, lowest = -np.inf, -np.inf
    while count < MOST_OVER and found < wanted:
        f, highest = -1, lowest + 0.1 * tol
        for n in range(NEAR + (NEAR + count) * beside.shape[1]):
            m = n if n < NEAR else (n - NEAR) // beside.shape[1]
            one = nearest_ones[m] if m < NEAR else chosen[m - NEAR]
            if n >= NEAR and one >= 0:
                one = beside[one, (n - NEAR) % beside.shape[1]]
            if one < 0 or kind[one] == OTHER:
                continue
            h = sense[one] * height_at(
                kind[one], size[one, 0], size[one, 1], frame[one], place[0, 0, 0], place[0, 0, 1], place[0, 0, 2]
            )
            for m in range(len(chosen)):
                if chosen[m] == one and (m < count or m >= len(chosen) - refused):
                    h = -np.inf
            if h > highest:
                f, highest = one, h
        if f < 0 or max(lowest, highest) <= known:
            break
        most = size[f, 0] if kind[f] == TORUS and sense[f] < 0.0 else np.inf  # as for one piece
        fits, at = False, nearest_below(P, err, box, link, order, root[f], x, y, z, stack)
        for row in (len(kind) + f, f):
            needed = rho + max(-highest, 0.0)
            if not fits and needed < most:
                clear = _clear(solid, row, 1, slack, at, x, y, z, needed + abs(highest), most, whole, stack)
                if clear >= needed:
                    fits = True
                    t = slack[row] + deviation[f]
                    raised_size[count], raised[count] = raise_by(kind[f], size[f, 0], size[f, 1], sense[f], t)
                    whole[2, 1 + count // 3, count % 3] = clear
        if not fits:
            refused += 1
            chosen[len(chosen) - refused] = f
            if refused == len(chosen) - MOST_OVER:
                break
            continue
        chosen[count] = f
        near = 0.25 * tol + (0.05 * abs(lowest) if -np.inf < lowest and goal < np.inf else 0.0)
        new, deep = _lowest(
            pieces, uvs, sags, g, rows, own, solid, count + 1, known, wanted, near, scratch, place
        )  # fmt: skip
        # Each point of the pieces is above one of the faces by ``new``, and in the ball where that counts.
        held = new
        for m in range(count + 1):
            clear = whole[2, 1 + m // 3, m % 3]
            if clear - rho < -min(new, 0.0):
                held = -np.inf
            held = min(held, max(clear - rho, 0.0)) if new >= 0.0 else held
        found, lowest = max(found, held), deep
        count += 1
    return max(known, found), lowest if count > 0 else np.inf
