"""Compiled bounds of the signed distance from a solid that points of many pieces of a face have, all at once.

Where the solid within a ball is below each of several surfaces (`faces_ball`), a point is as far from it as the highest
of its heights over them says; so the least of the highest, over all points, is a bound.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_ball import below, clear_around, enough, foot_above, has_feet
from clamp3d.collide.faces_bounds import NEAR
from clamp3d.collide.faces_hollow import CAPACITY, MOST_AROUND, MOST_TRIED, hollow, piece_over, point_over
from clamp3d.collide.faces_math import (
    OTHER,
    SPHERE,
    TORUS,
    bend,
    cut,
    height_at,
    longest,
    spans,
)
from clamp3d.collide.faces_tree import PIECES, nearest_below
from clamp3d.core.jit import formula

MOST_OVER = 6
"""Faces or hollow corners at most that many pieces are bounded over together."""
MOST_SEEDS = 6
"""Searches for hollow corners at most, two from each face."""
WORK = 6 + 2 * PIECES
"""Triangles (3, 3) that the search takes for itself."""


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
            h = point_over(pieces[k, i], solid, count, chosen, raised)
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
            low = piece_over(V, uv, g, rim, own, solid, count, scratch)
            if low >= min(high - near, wanted, found) or top + 2 > len(cuts) or left == 0:
                found = min(found, low)
                continue
            left -= 1
            du, v0, v1, _, _ = spans(uv)
            e = bend(akind[g], asize[g, 0], asize[g, 1], du, v1 - v0, v0, v1)
            bent = e > 0.25 * (min(high, wanted) - low)
            side = longest(V, uv, akind[g], asize[g, 0], asize[g, 1], bent)
            cut(V, uv, side, akind[g], asize[g, 0], asize[g, 1], aframe[g], cuts[top + 1], cut_uvs[top + 1])
            h = point_over(cuts[top + 1, side], solid, count, chosen, raised)
            if h < high:
                high = h
                _put(place, cuts[top + 1, side], cut_uvs[top + 1, side], rim - adeviation[g])
            top += 2
    return found, high


@formula
def block(pieces, uvs, sags, g, own, solid, limits, rows, known, high, scratch, place):
    """Lower bound for the pieces ``rows`` of face g, all at once, ``known`` if there is no better one.

    As for one piece, with a ball round the middle of their box, whole[2, 0], that must hold them all. Returns also how
    low one of their points is.
    """
    akind, asize, _, adeviation = own
    nearest_ones, chosen, raised, _, stack, whole = scratch
    chosen, raised = chosen[MOST_TRIED:], raised[MOST_TRIED:]
    over = (nearest_ones, chosen, raised, scratch[3], stack, whole)
    P, err, _, box, link, order, root, _, _, kind, size, frame, sense, deviation, _, beside, _, _, _ = solid
    slack, _, goal, tol = limits
    wanted = enough(high, limits)
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
    clears = raised[2 * CAPACITY :]
    count, taken, refused, seeds, k = 0, 0, 0, 0, rows[len(rows) // 2]
    _put(place, pieces[k, 0], uvs[k, 0], 0.0)
    found, lowest = -np.inf, -np.inf
    while taken < MOST_OVER and count + MOST_AROUND <= CAPACITY and found < wanted:
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
        fits, feet, middle = 0, has_feet(kind[f], sense[f]), place[2, 1]
        chosen[count] = f
        for row in (len(kind) + f, f):
            needed = rho + (0.0 if feet else max(-highest, 0.0))
            if fits == 0 and needed < most:
                foot_above(kind, size, frame, sense, f, slack[row] + deviation[f], x, y, z, middle)
                at = nearest_below(P, err, box, link, order, root[f], middle[0], middle[1], middle[2], stack)
                clear = clear_around(
                    solid, row, 1, slack, at, middle[0], middle[1], middle[2], needed + abs(highest), most, whole, stack
                )  # fmt: skip
                if clear >= needed:
                    fits, raised[count], clears[count] = 1, slack[row] + deviation[f], clear
        for first in (len(kind), 0):
            if fits == 0 and feet and kind[f] != SPHERE and seeds < MOST_SEEDS:
                fits, clear = hollow(
                    solid, chosen, count, first, slack, place[0, 0], max(known, lowest), x, y, z, rho,
                    raised, raised[CAPACITY:], whole, stack,
                )  # fmt: skip
                seeds += 1
                for m in range(fits):
                    clears[count + m] = clear if m == 0 else 0.0
        if fits == 0:
            refused += 1
            chosen[len(chosen) - refused] = f
            if refused == len(chosen) - CAPACITY:
                break
            continue
        count += fits
        taken += 1
        near = 0.25 * tol + (0.05 * abs(lowest) if -np.inf < lowest and goal < np.inf else 0.0)
        new, deep = _lowest(pieces, uvs, sags, g, rows, own, solid, count, known, wanted, near, over, place)
        # Each point of the pieces is above one of the faces by ``new``, and in the ball where that counts.
        held = new
        for m in range(count):
            if clears[m] > 0.0:
                held = min(held, below(new, rho, clears[m], has_feet(kind[chosen[m]], sense[chosen[m]])))
        found, lowest = max(found, held), deep
    return max(known, found), lowest if count > 0 else np.inf
