"""Compiled bounding volume tree over a solid's triangles, and what is asked of it.

Each triangle stands for a piece of a trimmed face that is within the triangle's error of it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_math import (
    OTHER,
    TORUS,
    bend,
    cut,
    height,
    height_at,
    least_height,
    longest,
    point_triangle,
    spans,
    to_frame,
    triangles,
)
from clamp3d.core.jit import formula

LEAF = 4
DEEP = 128


@formula
def _spread(box, i, C, t):
    """Let the node's box hold a triangle C[t] (3, 3)."""
    for k in range(3):
        for c in range(3):
            box[i, k] = min(box[i, k], C[t, c, k])
            box[i, 3 + k] = max(box[i, 3 + k], C[t, c, k])


@formula
def build(P, err, start, box, link, order, root):
    """Tree of triangles P (m, 3, 3), face by face, into box (n, 7: low, high, largest error); returns its size.

    ``start`` (f + 1,): first triangle of each face. An inner node has the children link[i, 0] and -link[i, 1], both
    after it; a leaf has link[i, 1] triangles, from link[i, 0] on in ``order``. root[f] is the node of face f.
    """
    m, faces = P.shape[0], len(root)
    middle = 0.5 * (
        np.minimum(np.minimum(P[:, 0], P[:, 1]), P[:, 2]) + np.maximum(np.maximum(P[:, 0], P[:, 1]), P[:, 2])
    )
    centre, chosen = np.empty((faces, 3)), np.arange(faces)
    for f in range(faces):
        for k in range(3):
            part = middle[start[f] : start[f + 1], k]
            centre[f, k] = 0.5 * (part.min() + part.max())
    for i in range(m):
        order[i] = i
    # A node is a range of faces, or of one face's triangles.
    first, count = np.zeros(2 * m + 2 * faces, np.int64), np.zeros(2 * m + 2 * faces, np.int64)
    whole = np.zeros(2 * m + 2 * faces, np.bool_)
    first[0], count[0], whole[0] = 0, faces, True
    used, i = 1, 0
    while i < used:
        if whole[i] and count[i] == 1:
            f = chosen[first[i]]
            root[f], whole[i] = i, False
            first[i], count[i] = start[f], start[f + 1] - start[f]
        s, n = first[i], count[i]
        for k in range(3):
            box[i, k], box[i, 3 + k] = np.inf, -np.inf
        box[i, 6] = 0.0
        if whole[i]:
            for c in range(s, s + n):
                for t in range(start[chosen[c]], start[chosen[c] + 1]):
                    _spread(box, i, P, t)
                    box[i, 6] = max(box[i, 6], err[t])
            items, at = chosen[s : s + n].copy(), centre
        else:
            for c in range(s, s + n):
                _spread(box, i, P, order[c])
                box[i, 6] = max(box[i, 6], err[order[c]])
            items, at = order[s : s + n].copy(), middle
        if not whole[i] and n <= LEAF:
            link[i, 0], link[i, 1] = s, n
        else:
            axis, widest = 0, -1.0
            for k in range(3):
                low, high = np.inf, -np.inf
                for t in items:
                    low, high = min(low, at[t, k]), max(high, at[t, k])
                if high - low > widest:
                    axis, widest = k, high - low
            items = items[np.argsort(at[items, axis])]
            if whole[i]:
                chosen[s : s + n] = items
            else:
                order[s : s + n] = items
            half = n // 2
            link[i, 0], link[i, 1] = used, -(used + 1)
            first[used], count[used], whole[used] = s, half, whole[i]
            first[used + 1], count[used + 1], whole[used + 1] = s + half, n - half, whole[i]
            used += 2
        i += 1
    return used


@formula
def box_distance(box, i, x, y, z):
    """Distance of a point from a node's box."""
    dx = max(0.0, box[i, 0] - x, x - box[i, 3])
    dy = max(0.0, box[i, 1] - y, y - box[i, 4])
    dz = max(0.0, box[i, 2] - z, z - box[i, 5])
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@formula
def nearest(P, err, face, box, link, order, x, y, z, cut, near):
    """Triangle nearest to a point: (index or -1, lower bound of the distance of the faces, upper bound of it).

    Nothing beyond ``cut`` is looked at. ``near`` (k,) gets the faces of the triangles last found nearest, -1 for none.
    """
    stack = np.empty(DEEP, np.int64)
    stack[0], top = 0, 1
    found, low, high = -1, cut, np.inf
    near[:] = -1
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x, y, z) - box[i, 6] > low:
            continue
        if link[i, 1] < 0:
            a, b = link[i, 0], -link[i, 1]
            if box_distance(box, a, x, y, z) < box_distance(box, b, x, y, z):
                a, b = b, a
            stack[top], stack[top + 1] = a, b
            top += 2
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            d, _, _ = point_triangle(x, y, z, P[t])
            if d + err[t] < high:
                high = d + err[t]
                found = t
            if d - err[t] <= low:
                low = min(low, d - err[t])
                for k in range(len(near)):
                    if near[k] == face[t]:
                        for l in range(k, 0, -1):  # noqa: E741
                            near[l] = near[l - 1]
                        near[0] = face[t]
                        break
                else:
                    for l in range(len(near) - 1, 0, -1):  # noqa: E741
                        near[l] = near[l - 1]
                    near[0] = face[t]
    return found, low, high


@formula
def nearest_marked(P, err, box, link, order, mark, other, nodes, rest, bit, x, y, z, cut):
    """Lower bound of a point's distance from the pieces marked with ``bit`` in both rows of marks, at most ``cut``.

    ``mark`` and ``other`` (m,) are rows of triangles, ``nodes`` and ``rest`` (n,) the same for the tree's nodes.
    """
    stack = np.empty(DEEP, np.int64)
    stack[0], top = 0, 1
    low = cut
    while top > 0:
        top -= 1
        i = stack[top]
        if not (nodes[i] & rest[i] & bit) or box_distance(box, i, x, y, z) - box[i, 6] >= low:
            continue
        if link[i, 1] < 0:
            a, b = link[i, 0], -link[i, 1]
            if box_distance(box, a, x, y, z) < box_distance(box, b, x, y, z):
                a, b = b, a
            stack[top], stack[top + 1] = a, b
            top += 2
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            if mark[t] & other[t] & bit:
                d, _, _ = point_triangle(x, y, z, P[t])
                low = min(low, d - err[t])
    return low


@formula
def nearest_on(P, err, box, link, order, root, mark, x, y, z):
    """Upper bound of a point's distance from the face whose node is ``root``: from those of its pieces that are marked
    1 in ``mark`` (m,), all of them where that is empty."""
    stack = np.empty(DEEP, np.int64)
    stack[0], top = root, 1
    low = np.inf
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x, y, z) >= low:
            continue
        if link[i, 1] < 0:
            a, b = link[i, 0], -link[i, 1]
            if box_distance(box, a, x, y, z) < box_distance(box, b, x, y, z):
                a, b = b, a
            stack[top], stack[top + 1] = a, b
            top += 2
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            if len(mark) == 0 or mark[t] & 1:
                d, _, _ = point_triangle(x, y, z, P[t])
                low = min(low, d + err[t])
    return low


@formula
def _boxes(one, i, other, j):
    """Distance of two boxes."""
    s = 0.0
    for k in range(3):
        d = max(0.0, one[i, k] - other[j, 3 + k], other[j, k] - one[i, 3 + k])
        s += d * d
    return math.sqrt(s)


@formula
def _box_triangle(one, P):
    """Distance of a box from the box of a triangle."""
    s = 0.0
    for k in range(3):
        d = max(0.0, one[0, k] - max(P[0, k], P[1, k], P[2, k]), min(P[0, k], P[1, k], P[2, k]) - one[0, 3 + k])
        s += d * d
    return math.sqrt(s)


@formula
def from_faces(P, err, face, box, link, order, kind, size, frame, deviation, V, over, limit, work):
    """Lower bound of the flat triangle V's distance from all pieces, at most ``limit``.

    ``over`` (n,) keeps V's least distance from each whole surface, NaN where it was not asked yet.
    """
    stack = np.empty(DEEP, np.int64)
    stack[0], top = 0, 1
    low = limit
    own = np.empty((1, 6))
    own[0, :3], own[0, 3:] = np.inf, -np.inf
    for k in range(3):
        for c in range(3):
            own[0, k] = min(own[0, k], V[c, k])
            own[0, 3 + k] = max(own[0, 3 + k], V[c, k])
    over[:] = np.nan
    while top > 0:
        top -= 1
        i = stack[top]
        if _boxes(own, 0, box, i) - box[i, 6] >= low:
            continue
        if link[i, 1] < 0:
            a, b = link[i, 0], -link[i, 1]
            if _boxes(own, 0, box, a) < _boxes(own, 0, box, b):
                a, b = b, a
            stack[top], stack[top + 1] = a, b
            top += 2
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            f = face[t]
            if kind[f] != OTHER:
                if np.isnan(over[f]):
                    to_frame(frame[f], V, work)
                    up = least_height(kind[f], size[f, 0], size[f, 1], 1.0, work)
                    down = least_height(kind[f], size[f, 0], size[f, 1], -1.0, work)
                    over[f] = max(up, down, 0.0) - deviation[f]
                if over[f] >= low:
                    continue
            if _box_triangle(own, P[t]) - err[t] >= low:
                continue
            d = triangles(V, P[t]) - err[t]
            if kind[f] != OTHER:
                d = max(d, over[f])
            low = min(low, d)
    return low


@formula
def _reaches(V, uv, g, rim, kind, size, frame, f, sense, slack, pieces, uvs, work):
    """Whether a piece of face g may reach above the surface of face f (with ``sense`` turned: below) by ``slack``.

    The piece is cut until its own bend no longer matters, at most so often that the stack ``pieces`` (n, 3, 3) is full.
    """
    pieces[0], uvs[0], top = V, uv, 1
    left = 400
    while top > 0:
        top -= 1
        to_frame(frame[f], pieces[top], work)
        high = -least_height(kind[f], size[f, 0], size[f, 1], -sense, work)
        if high > slack:
            for i in range(3):
                if sense * height(kind[f], size[f, 0], size[f, 1], work[i, 0], work[i, 1], work[i, 2]) > slack:
                    return True
        du, v0, v1, _, _ = spans(uvs[top])
        e = bend(kind[g], size[g, 0], size[g, 1], du, v1 - v0, v0, v1) if kind[g] != OTHER else 0.0
        if high + e + rim <= slack:
            continue
        left -= 1
        # Over a torus ``high`` is only a bound, over the others it is reached.
        reached = kind[f] != TORUS and high + rim > slack and e < 0.1 * (high + rim - slack)
        if left < 0 or top + 2 > len(pieces) or reached:
            return True
        bent = e > 0.25 * (high + e + rim - slack)
        side = longest(pieces[top], uvs[top], kind[g], size[g, 0], size[g, 1], bent)
        cut(pieces[top], uvs[top], side, kind[g], size[g, 0], size[g, 1], frame[g], pieces[top + 1], uvs[top + 1])
        top += 2
    return False


@formula
def mark_face(
    P, uv, sag, face, box, link, order, kind, size, frame, deviation, group, f, sense, slack, mark, nodes, work
):
    """Marks of the triangles (m,) and tree nodes (n,) against the surface of face f: 1 for pieces that reach above it,
    2 for those that reach below."""
    pieces, uvs = np.empty((24, 3, 3)), np.empty((24, 3, 2))
    # What is known of a node's triangles goes down with it: bits 1 and 2 as in the marks, 4 and 8 where they are open.
    nodes[0] = 12
    for i in range(len(nodes)):
        state = nodes[i]
        if state & 12:
            x, y, z = 0.5 * (box[i, 0] + box[i, 3]), 0.5 * (box[i, 1] + box[i, 4]), 0.5 * (box[i, 2] + box[i, 5])
            half = (box[i, 3] - box[i, 0]) ** 2 + (box[i, 4] - box[i, 1]) ** 2 + (box[i, 5] - box[i, 2]) ** 2
            radius = 0.5 * math.sqrt(half) + box[i, 6]
            h = sense * height_at(kind[f], size[f, 0], size[f, 1], frame[f], x, y, z)
            if h - radius > slack:
                state = 1
            elif h + radius < -slack:
                state = 2
            elif abs(h) + radius <= slack:
                state = 0
        nodes[i] = state
        if link[i, 1] < 0:
            nodes[link[i, 0]] = nodes[-link[i, 1]] = state
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            g = face[t]
            mark[t] = state & 3
            if group[g] == group[f]:
                mark[t] = 0
            elif state & 12:
                rim = sag[t] + deviation[g]
                if _reaches(P[t], uv[t], g, rim, kind, size, frame, f, sense, slack, pieces, uvs, work):
                    mark[t] |= 1
                if _reaches(P[t], uv[t], g, rim, kind, size, frame, f, -sense, slack, pieces, uvs, work):
                    mark[t] |= 2
    for i in range(len(nodes) - 1, -1, -1):
        nodes[i] = 0
        if link[i, 1] < 0:
            nodes[i] = nodes[link[i, 0]] | nodes[-link[i, 1]]
        else:
            for j in range(link[i, 0], link[i, 0] + link[i, 1]):
                nodes[i] |= mark[order[j]]
