"""Compiled bounding volume tree over a solid's triangles, and what is asked of it.

Each triangle stands for the piece of a trimmed face that has its parameters, and is within its error of it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_math import (
    CONE,
    OTHER,
    TORUS,
    band_over,
    bend,
    bend_over,
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
from clamp3d.core.jit import entry, formula
from clamp3d.core.mesh import IntArray
from clamp3d.core.pose import Array

LEAF = 4
DEEP = 128
NEW, OPEN = -1, 15
"""Marks not asked for yet, and of a tree node some of whose triangles have to be asked: it can be any of them."""
PIECES = 24
"""Pieces that may wait while one is cut to see whether it reaches above a surface."""


@formula
def _spread(box, i, C):
    """Let the node's box hold a triangle C (3, 3)."""
    for k in range(3):
        for c in range(3):
            box[i, k] = min(box[i, k], C[c, k])
            box[i, 3 + k] = max(box[i, 3 + k], C[c, k])


@formula
def _halve(items, s, n, at, axis):
    """Order the n items from s on so that the first half has the lesser at[item, axis]: Hoare's quickselect."""
    low, high, half = s, s + n - 1, s + n // 2
    while low < high:
        pivot, i, j = at[items[half], axis], low, high
        while i <= j:
            while at[items[i], axis] < pivot:
                i += 1
            while at[items[j], axis] > pivot:
                j -= 1
            if i <= j:
                items[i], items[j] = items[j], items[i]
                i, j = i + 1, j - 1
        if j < half:
            low = i
        if i > half:
            high = j


def _build(P, err, start, middle, centre, chosen, box, link, order, root):
    """Tree of triangles P (m, 3, 3), face by face, into box (n, 7: low, high, largest error); returns its size.

    ``start`` (f + 1,): first triangle of each face. An inner node has the children link[i, 0] and -link[i, 1], both
    after it; a leaf has link[i, 1] triangles, from link[i, 0] on in ``order`` (m,). root[f] is the node of face f.
    Given are the numbers of all triangles in ``order`` and of all faces in ``chosen``, and the middles of their boxes.
    """
    # A node that waits is a range of faces (its error is -1), or of one face's triangles: first and how many.
    link[0, 0], link[0, 1], box[0, 6] = 0, len(chosen), -1.0
    used, i = 1, 0
    while i < used:
        s, n, whole = link[i, 0], link[i, 1], box[i, 6] < 0.0
        if whole and n == 1:
            f, whole = chosen[s], False
            root[f], s, n = i, start[f], start[f + 1] - start[f]
        for k in range(3):
            box[i, k], box[i, 3 + k] = np.inf, -np.inf
        box[i, 6] = 0.0
        for c in range(s, s + n):
            first, last = (start[chosen[c]], start[chosen[c] + 1]) if whole else (c, c + 1)
            for j in range(first, last):
                t = j if whole else order[j]
                _spread(box, i, P[t])
                box[i, 6] = max(box[i, 6], err[t])
        if whole or n > LEAF:
            items, at = (chosen, centre) if whole else (order, middle)
            axis, widest = 0, -1.0
            for k in range(3):
                low, high = np.inf, -np.inf
                for c in range(s, s + n):
                    low, high = min(low, at[items[c], k]), max(high, at[items[c], k])
                if high - low > widest:
                    axis, widest = k, high - low
            _halve(items, s, n, at, axis)
            for half in range(2):
                link[used + half, 0] = s + half * (n // 2)
                link[used + half, 1] = n // 2 if half == 0 else n - n // 2
                box[used + half, 6] = -1.0 if whole else 0.0
            s, n = used, -(used + 1)
            used += 2
        link[i, 0], link[i, 1] = s, n
        i += 1
    return used


_tree = entry(
    _build,
    "i8(f8[:,:,::1],f8[::1],i8[::1],f8[:,::1],f8[:,::1],i8[::1],f8[:,::1],i8[:,::1],i8[::1],i8[::1])",
)


def tree_of(P: Array, err: Array, start: IntArray) -> tuple[Array, IntArray, IntArray, IntArray]:
    """Boxes (n, 7) and links (n, 2) of the tree, the order (m,) of triangles P (m, 3, 3), and faces' nodes (f,).

    ``err`` (m,) are their errors, ``start`` (f + 1,) the first triangle of each face.
    """
    m, n = len(P), len(start) - 1
    box, link = np.empty((2 * m + 2 * n, 7)), np.empty((2 * m + 2 * n, 2), dtype=np.int64)
    order, root = np.arange(m), np.empty(n, dtype=np.int64)
    middle = 0.5 * (P.min(axis=1) + P.max(axis=1))
    first = np.minimum(start[:-1], m - 1)
    centre = 0.5 * (np.minimum.reduceat(middle, first) + np.maximum.reduceat(middle, first))
    used = _tree(P, err, start, middle, centre, np.arange(n), box, link, order, root)
    return box[:used].copy(), link[:used].copy(), order, root


def _bulges(kind, size, uv, face, out):
    """Into ``out`` (m,) how far each triangle and its piece of a whole surface are from each other at most."""
    for t in range(len(face)):
        g = face[t]
        du, v0, v1, _, _ = spans(uv[t])
        out[t] = bend(kind[g], size[g, 0], size[g, 1], du, v1 - v0, v0, v1)


bulges = entry(_bulges, "void(i8[::1],f8[:,::1],f8[:,:,::1],i8[::1],f8[::1])")


@formula
def box_distance(box, i, x0, y0, z0, x1, y1, z1):
    """Distance of a node's box from the box that the last six are the lower and upper corner of."""
    dx = max(0.0, box[i, 0] - x1, x0 - box[i, 3])
    dy = max(0.0, box[i, 1] - y1, y0 - box[i, 4])
    dz = max(0.0, box[i, 2] - z1, z0 - box[i, 5])
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@formula
def put_children(box, link, i, x0, y0, z0, x1, y1, z1, stack, top):
    """The children of a node onto the stack, the one that is nearer to the box last; returns how many are on it."""
    a, b = link[i, 0], -link[i, 1]
    if box_distance(box, a, x0, y0, z0, x1, y1, z1) < box_distance(box, b, x0, y0, z0, x1, y1, z1):
        a, b = b, a
    stack[top], stack[top + 1] = a, b
    return top + 2


@formula
def nearest(P, err, face, box, link, order, x, y, z, cut, near, stack):
    """Triangle nearest to a point: (index or -1, lower bound of the distance of the faces, upper bound of it).

    Nothing beyond ``cut`` is looked at. ``near`` (k,) gets the faces of the triangles last found nearest, -1 for none.
    """
    stack[0], top = 0, 1
    found, low, high = -1, cut, np.inf
    for k in range(len(near)):
        near[k] = -1
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x, y, z, x, y, z) - box[i, 6] > low:
            continue
        if link[i, 1] < 0:
            top = put_children(box, link, i, x, y, z, x, y, z, stack, top)
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            d, _, _ = point_triangle(x, y, z, P[t])
            if d + err[t] < high:
                high = d + err[t]
                found = t
            if d - err[t] <= low:
                low = min(low, d - err[t])
                last = 0  # where the face is already, or the end
                while last < len(near) - 1 and near[last] != face[t]:
                    last += 1
                for k in range(last, 0, -1):
                    near[k] = near[k - 1]
                near[0] = face[t]
    return found, low, high


@formula
def nearest_triangle(P, err, box, link, order, root, x, y, z, stack):
    """Least of distance and error of the triangles below the node ``root``, which it is, and its weights at the foot.

    The weights are those of its second and third corner.
    """
    stack[0], top = root, 1
    low, found, second, third = np.inf, 0, 0.0, 0.0
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x, y, z, x, y, z) >= low:
            continue
        if link[i, 1] < 0:
            top = put_children(box, link, i, x, y, z, x, y, z, stack, top)
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            d, v, w = point_triangle(x, y, z, P[t])
            if d + err[t] < low:
                low, found, second, third = d + err[t], t, v, w
    return low, found, second, third


@formula
def nearest_below(P, err, box, link, order, root, x, y, z, stack):
    """Upper bound of a point's distance from the pieces below the node ``root``."""
    return nearest_triangle(P, err, box, link, order, root, x, y, z, stack)[0]


@formula
def from_faces(P, err, face, box, link, order, kind, size, frame, deviation, V, over, limit, work, stack):
    """Lower bound of the flat triangle V's distance from all pieces, at most ``limit``.

    ``over`` (n,) keeps V's least distance from each whole surface, NaN where it was not asked yet.
    """
    stack[0], top = 0, 1
    low = limit
    x0, x1 = min(V[0, 0], V[1, 0], V[2, 0]), max(V[0, 0], V[1, 0], V[2, 0])
    y0, y1 = min(V[0, 1], V[1, 1], V[2, 1]), max(V[0, 1], V[1, 1], V[2, 1])
    z0, z1 = min(V[0, 2], V[1, 2], V[2, 2]), max(V[0, 2], V[1, 2], V[2, 2])
    for f in range(len(over)):
        over[f] = np.nan
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x0, y0, z0, x1, y1, z1) - box[i, 6] >= low:
            continue
        if link[i, 1] < 0:
            top = put_children(box, link, i, x0, y0, z0, x1, y1, z1, stack, top)
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
            apart = 0.0
            for k in range(3):
                c = max(min(V[0, k], V[1, k], V[2, k]) - max(P[t, 0, k], P[t, 1, k], P[t, 2, k]), 0.0)
                c = max(min(P[t, 0, k], P[t, 1, k], P[t, 2, k]) - max(V[0, k], V[1, k], V[2, k]), c)
                apart += c * c
            if math.sqrt(apart) - err[t] >= low:
                continue
            d = triangles(V, P[t]) - err[t]
            if kind[f] != OTHER:
                d = max(d, over[f])
            low = min(low, d)
    return low


@formula
def _reaches(V, uv, g, rim, kind, size, frame, f, sense, slack, left, pieces, uvs, work):
    """Whether a piece of face g may reach above the surface of face f (with ``sense`` turned: below) by ``slack``.

    The piece is cut until its own bend no longer matters, at most so often that the stack ``pieces`` (n, 3, 3) is full.
    """
    for i in range(3):
        for k in range(3):
            pieces[0, i, k] = V[i, k]
        uvs[0, i, 0], uvs[0, i, 1] = uv[i, 0], uv[i, 1]
    top = 1
    while top > 0:
        top -= 1
        to_frame(frame[f], pieces[top], work)
        high = -least_height(kind[f], size[f, 0], size[f, 1], -sense, work)
        if high + rim > slack:  # no part that has a corner as high as this will stay below
            for i in range(3):
                if sense * height(kind[f], size[f, 0], size[f, 1], work[i, 0], work[i, 1], work[i, 2]) + rim > slack:
                    return True
        du, v0, v1, _, _ = spans(uvs[top])
        e = bend_over(kind[g], size[g, 0], size[g, 1], frame[g], du, v1 - v0, v0, v1, kind[f], frame[f])
        band = kind[g], size[g, 0], size[g, 1], frame[g], v0, v1
        most = min(high + e, -band_over(*band, kind[f], size[f, 0], size[f, 1], frame[f], -sense))
        if most + rim <= slack:
            continue
        left -= 1
        # Over a torus, and in the hole of a cone, ``high`` is only a bound; over the others it is reached.
        attained = kind[f] != TORUS and (kind[f] != CONE or sense > 0.0)
        reached = attained and high + rim > slack and e < 0.1 * (high + rim - slack)
        if left < 0 or top + 2 > len(pieces) or reached:
            return True
        bent = e > 0.25 * (high + e + rim - slack)
        side = longest(pieces[top], uvs[top], kind[g], size[g, 0], size[g, 1], bent)
        cut(pieces[top], uvs[top], side, kind[g], size[g, 0], size[g, 1], frame[g], pieces[top + 1], uvs[top + 1])
        top += 2
    return False


@formula
def _state(solid, row, slack, i):
    """What marks the triangles of a tree node can have in a row, all of them together; `OPEN` where it is not known."""
    _, _, _, box, link, _, _, _, _, kind, size, frame, sense, _, _, _, _, nodes, _ = solid
    known = nodes[row]
    if known[i] == NEW:
        f = row % len(kind)
        x, y, z = 0.5 * (box[i, 0] + box[i, 3]), 0.5 * (box[i, 1] + box[i, 4]), 0.5 * (box[i, 2] + box[i, 5])
        half = (box[i, 3] - box[i, 0]) ** 2 + (box[i, 4] - box[i, 1]) ** 2 + (box[i, 5] - box[i, 2]) ** 2
        radius = 0.5 * math.sqrt(half) + box[i, 6]
        h = sense[f] * height_at(kind[f], size[f, 0], size[f, 1], frame[f], x, y, z)
        known[i] = OPEN
        if h - radius > slack[row]:
            known[i] = 1
        elif h + radius < -slack[row]:
            known[i] = 2
    if known[i] == OPEN and link[i, 1] < 0:
        one, two = known[link[i, 0]], known[-link[i, 1]]
        if one != NEW and one != OPEN and two != NEW and two != OPEN:
            known[i] = one | two
    return known[i]


@formula
def _mark(solid, row, slack, state, t, whole):
    """Mark of a triangle, in a node with such a state, against the surface of face f = ``row``, or ``row`` - n.

    1 for a piece that reaches above it by the row's slack, 2 for one that reaches below, both for one that does either.
    """
    P, _, face, _, _, _, _, uv, sag, kind, size, frame, sense, deviation, group, _, marks, _, _ = solid
    known = marks[row]
    if known[t] == NEW:
        f, g = row % len(kind), face[t]
        known[t] = 0
        if group[g] != group[f]:
            known[t] = state
            if state == OPEN:
                rim, mark = sag[t] + deviation[g], 0
                for bit in range(1, 3):
                    way = sense[f] if bit == 1 else -sense[f]
                    if _reaches(
                        P[t], uv[t], g, rim, kind, size, frame, f, way, slack[row], 400 if row == f else 24,
                        whole[3 : 3 + PIECES], whole[3 + PIECES :], whole[0],
                    ):  # fmt: skip
                        mark |= bit
                known[t] = mark
    return known[t]


@formula
def nearest_marked(solid, rows, shift, root, bit, side, slack, x, y, z, cut, whole, stack):
    """Bound of a point's distance, at most ``cut``, from marked pieces below the node ``root``; which is nearest.

    Of those that have the ``bit`` in all rows of marks ``shift`` + ``rows`` (k,); -1 if there is none. ``side`` -1 for
    a lower bound, 1 for an upper one. Marks are found out where the search comes to, and kept.
    """
    P, _, _, box, link, order, _, _, _, _, _, _, _, _, _, _, marks, nodes, spread = solid
    stack[0], top = root, 1
    low, found = cut, -1
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x, y, z, x, y, z) + min(side, 0.0) * box[i, 6] >= low:
            continue
        mark = bit
        for m in range(len(rows)):
            mark &= _state(solid, shift + rows[m], slack, i)
        if mark == 0:
            continue
        if link[i, 1] < 0:
            top = put_children(box, link, i, x, y, z, x, y, z, stack, top)
            continue
        first, end = link[i, 0], link[i, 0] + link[i, 1]
        for j in range(first, end):
            t = order[j]
            mark, known = bit, True
            for m in range(len(rows)):
                one = marks[shift + rows[m], t]
                if one == NEW:
                    known = False
                else:
                    mark &= one
            if mark == 0:
                continue
            d, _, _ = point_triangle(x, y, z, P[t])
            if d + side * spread[t] >= low:
                continue
            if not known:
                for m in range(len(rows)):
                    if mark:
                        row = shift + rows[m]
                        mark &= _mark(solid, row, slack, nodes[row, i], t, whole)
            if mark:
                low, found = d + side * spread[t], t
        for m in range(len(rows)):
            row = shift + rows[m]
            if nodes[row, i] == OPEN:
                together = 0
                for j in range(first, end):
                    one = marks[row, order[j]]
                    together |= OPEN if one == NEW else one
                nodes[row, i] = together
    return low, found
