"""Compiled branch and bound: the least signed distance from a solid that a point of another solid's faces has.

Pieces of one face are bounded together first, and looked at one by one only where that bound is the least of all.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_block import WORK, block
from clamp3d.collide.faces_bounds import NEAR, piece
from clamp3d.collide.faces_hollow import TRIED
from clamp3d.collide.faces_math import bend, cut, longest, spans
from clamp3d.collide.faces_tree import DEEP, nearest
from clamp3d.collide.verdict import RESOLUTION
from clamp3d.core.jit import entry, formula

RESULT = 11
"""Upper bound, points on the piece (3) and the solid (3), face, farthest distance that is certainly outside, pieces.

Then the least bound of what is no longer looked at.
"""
SPACE = DEEP + NEAR + TRIED
"""Numbers that it takes, besides one for each piece and two a node."""


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
    pieces, uvs, faces, sags, bounds, first, bbox, blink, border, broot, T,
    akind, asize, aframe, adeviation,
    P, err, face, box, link, order, root, buv, bsag, kind, size, frame, sense, deviation, group, neighbours,
    marks, nodes, spread, slack, contact, clearance, tol, most, looks, other, over, whole, space, state, out,
):  # fmt: skip
    # At most ``most`` pieces are added in all, and few more than ``looks`` looked at.
    # ``state``: how many pieces there are, how many items wait, and whether the search has begun: it can be taken up
    # again, with the same thresholds and width, where it stopped.
    own = (akind, asize, aframe, adeviation)
    solid = (
        P, err, face, box, link, order, root, buv, bsag, kind, size, frame, sense, deviation, group, neighbours,
        marks, nodes, spread,
    )  # fmt: skip
    inner, near, chosen = space[:DEEP], space[DEEP : DEEP + NEAR], space[DEEP + NEAR : SPACE]
    # What waits, that with the least bound first: pieces, and after their numbers the nodes of their tree.
    after = len(faces)
    owner, heap = space[SPACE : SPACE + len(bbox)], space[SPACE + len(bbox) :]
    heights, over, p, q = over[:TRIED], over[TRIED:], whole[2, 0], whole[2, 1]
    place = whole[WORK - 3 :]
    scratch = (near, chosen, heights, over, inner, whole)
    verdict = tol < 0.0
    goal = max(contact, clearance) + 2.0 * RESOLUTION if verdict else np.inf
    tol = abs(tol)
    limits = (slack, contact, goal, tol)
    if state[2] == 0:
        for i in range(len(bbox)):
            owner[i] = -1  # of several faces
        for g in range(len(broot)):
            owner[broot[g]] = g
        state[0], state[1], state[2] = first, 1, 1
        heap[0], bounds[after], out[10] = after, -np.inf, np.inf
    looked, floor, n, waiting = out[9], out[10], state[0], state[1]
    while waiting:
        low, high = bounds[heap[0]], out[0]
        known = high - low <= tol or low >= other
        if verdict:
            known = (
                known
                or low > goal
                or high < -contact - 2.0 * RESOLUTION
                or (low >= -contact and high <= contact)
                or (low > contact + 2.0 * RESOLUTION and high < clearance - 2.0 * RESOLUTION)
            )
        if known or looked > looks or (heap[0] < after and (n >= len(faces) or n - first >= most)):
            break
        item = _pop(heap, waiting, bounds)
        waiting -= 1
        if item >= after:
            i = item - after
            if blink[i, 1] > 0:
                for j in range(blink[i, 0], blink[i, 0] + blink[i, 1]):
                    k = border[j]
                    new = piece(pieces[k], uvs[k], faces[k], sags[k], own, solid, limits, scratch, out)
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
                    if piece(pieces[k], uvs[k], faces[k], sags[k], own, solid, limits, scratch, out) > 0.0:
                        floor = min(floor, away - radius)
                        continue
                new, g = low, owner[child]
                if g >= 0:
                    rows = border[blink[start, 0] : blink[end, 0] + blink[end, 1]]
                    high = out[0]
                    new, deep = block(pieces, uvs, sags, g, own, solid, limits, rows, low, high, scratch, place)
                    if deep < min(goal, high):  # the lowest point of it is wanted too
                        piece(place[0], place[1], g, place[2, 0], own, solid, limits, scratch, out)
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
        # The piece keeps the half at corner ``side``. The cut is no border, but one that begins on a border is off
        # by its sag there.
        for c in range(3):
            sags[n, c] = sags[i, c]
        sags[n, (side + 2) % 3] = sags[i, side]
        sags[i, (side + 1) % 3] = sags[i, side]
        for k in (i, n):
            new = piece(pieces[k], uvs[k], g, sags[k], own, solid, limits, scratch, out)
            bounds[k] = max(low, new)
            _push(heap, waiting, bounds, k)
            waiting += 1
        n += 1
        looked += 2
    out[9], out[10], state[0], state[1] = looked, floor, n, waiting
    return min(floor, bounds[heap[0]]) if waiting else floor


_SOLID = (
    "f8[:,:,::1],f8[::1],i8[::1],f8[:,::1],i8[:,::1],i8[::1],i8[::1],f8[:,:,::1],f8[::1],"
    "i8[::1],f8[:,::1],f8[:,::1],f8[::1],f8[::1],i8[::1],i8[:,::1],i1[:,::1],i1[:,::1],f8[::1]"
)
descend = entry(
    _descend,
    "f8(f8[:,:,::1],f8[:,:,::1],i8[::1],f8[:,::1],f8[::1],i8,f8[:,::1],i8[:,::1],i8[::1],i8[::1],f8[:,::1],"
    f"i8[::1],f8[:,::1],f8[:,::1],f8[::1],{_SOLID},"
    "f8[::1],f8,f8,f8,i8,i8,f8,f8[::1],f8[:,:,::1],i8[::1],i8[::1],f8[::1])",
)
