"""Compiled: where a face alone tells what is inside and what outside, because no other face is near.

Heights over a face are known to a little only, its slack. What is further above it is outside if a way leads there from
a point of the face that has no other surface within that slack: no wall or slit so thin that both its sides are in it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

from clamp3d.collide.faces_math import OTHER, PLANE, height_at, point_triangle, slope_at
from clamp3d.collide.faces_tree import box_distance, put_children
from clamp3d.collide.faces_witness import weighted
from clamp3d.core.jit import formula

_TRIED = 24
"""Points of a face that are tried."""


@formula
def _looks_alike(kind, size, frame, sense, f, g, x, y, z):
    """Whether the flat face g looks the way of face f but for 60 degrees: a way out crosses it, one in does not."""
    turn = 0.0
    for i in range(3):
        turn += frame[g, 9 + i] * slope_at(kind[f], size[f, 0], size[f, 1], frame[f], i, x, y, z)
    return kind[g] == PLANE and sense[f] * sense[g] * turn > 0.5


@formula
def _beside(P, err, face, box, link, order, kind, size, frame, sense, deviation, group, f, x, y, z, reach, stack):
    """Whether a piece of another surface than that of face f, which may look another way, may be near a point."""
    stack[0], top = 0, 1
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x, y, z, x, y, z) - box[i, 6] > reach:
            continue
        if link[i, 1] < 0:
            stack[top], stack[top + 1] = link[i, 0], -link[i, 1]
            top += 2
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            t = order[j]
            g = face[t]
            if group[g] == group[f]:
                continue
            d, _, _ = point_triangle(x, y, z, P[t])
            if d - err[t] > reach:
                continue
            if kind[g] == OTHER:
                return True
            near = abs(height_at(kind[g], size[g, 0], size[g, 1], frame[g], x, y, z)) - deviation[g] <= reach
            if near and not _looks_alike(kind, size, frame, sense, f, g, x, y, z):
                return True
    return False


@formula
def is_open(solid, f, t, others, least, reach, x, y, z, q, stack):
    """Whether a point of face f has no other surface so near that it could hide on which side is outside.

    From there a way of a little more than ``t`` leads straight up out of the solid to what is higher above the face
    than that, and one straight down into it; both within ``reach`` of the point x, y, z. The way up is ``least`` (k,)
    above all the faces ``others`` (k,) but f. Tried are, of the triangles nearest first, where they are nearest and on
    the way from there to their middles.
    """
    P, err, face, box, link, order, root, uv, sag, kind, size, frame, sense, deviation, group, _, _, _, _ = solid
    tree = P, err, face, box, link, order
    half, tried = len(stack) // 2, 0
    stack[0], top = root[f], 1
    while top > 0:
        top -= 1
        i = stack[top]
        if box_distance(box, i, x, y, z, x, y, z) >= reach:
            continue
        if link[i, 1] < 0:
            top = put_children(box, link, i, x, y, z, x, y, z, stack, top)
            continue
        for m in range(link[i, 0], link[i, 0] + link[i, 1]):
            j = order[m]
            # A way from the trimmed face to more than t above it is so long at most.
            way = t + sag[j] + 2.0 * deviation[f]
            _, v, w = point_triangle(x, y, z, P[j])
            length = 0.0
            for k in range(3):
                foot = P[j, 0, k] + v * (P[j, 1, k] - P[j, 0, k]) + w * (P[j, 2, k] - P[j, 0, k])
                length += ((P[j, 0, k] + P[j, 1, k] + P[j, 2, k]) / 3.0 - foot) ** 2
            length = math.sqrt(length)
            step, share = 0.0, 0.0
            while share < 1.0:
                share = min(1.0, step / length) if length > 0.0 else 1.0
                step = max(2.0 * way, 4.0 * step)
                v1, w1 = v + share * (1.0 / 3.0 - v), w + share * (1.0 / 3.0 - w)
                weighted(kind[f], size[f, 0], size[f, 1], frame[f], P[j], uv[j], v1, w1, q)
                if math.sqrt((x - q[0]) ** 2 + (y - q[1]) ** 2 + (z - q[2]) ** 2) + way > reach:
                    break
                above = True
                for n in range(len(others)):
                    g = others[n]
                    h = sense[g] * height_at(kind[g], size[g, 0], size[g, 1], frame[g], q[0], q[1], q[2])
                    above = above and (g == f or h > least[n] + way)
                if not above:
                    continue
                if not _beside(
                    *tree, kind, size, frame, sense, deviation, group, f, q[0], q[1], q[2], way, stack[half:]
                ):  # fmt: skip
                    return True
                tried += 1
                if tried == _TRIED:
                    return False
    return False
