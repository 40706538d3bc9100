"""Compiled: where a face alone tells what is inside and what outside, because no other face is near.

Heights over a face are known to a little only, its slack. What is further above it is outside if a way leads there from
a point of the face that has no other surface within that slack: no wall or slit so thin that both its sides are in it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

from clamp3d.collide.faces_math import OTHER, PLANE, height_at, point_triangle, slope_at
from clamp3d.collide.faces_tree import box_distance, nearest_marked
from clamp3d.collide.faces_witness import weighted
from clamp3d.core.jit import formula

OPEN = 4
"""Mark of the triangles of the face itself whose middle has no other surface within the slack."""


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
def _place(solid, f, j, v, w, room, q, stack):
    """Put q (3) on face f where its triangle j has the weights v, w; whether no other surface is within ``room``."""
    P, err, face, box, link, order, _, uv, _, kind, size, frame, sense, deviation, group, _, _, _ = solid
    weighted(kind[f], size[f, 0], size[f, 1], frame[f], P[j], uv[j], v, w, q)
    tree = P, err, face, box, link, order
    return not _beside(*tree, kind, size, frame, sense, deviation, group, f, q[0], q[1], q[2], room, stack)


@formula
def mark_open(solid, row, f, t, q, stack):
    """Marks of face f's own triangles in a row that is for heights of more than ``t`` over it."""
    face, link, order, sag, deviation, marks, nodes = (
        solid[2], solid[4], solid[5], solid[8], solid[13], solid[16], solid[17],
    )  # fmt: skip
    for i in range(len(link) - 1, -1, -1):
        if link[i, 1] < 0:
            nodes[row, i] |= (nodes[row, link[i, 0]] | nodes[row, -link[i, 1]]) & OPEN
            continue
        for j in range(link[i, 0], link[i, 0] + link[i, 1]):
            k = order[j]
            if face[k] == f and _place(solid, f, k, 1.0 / 3.0, 1.0 / 3.0, _room(t, sag[k], deviation[f]), q, stack):
                marks[row, k] |= OPEN
                nodes[row, i] |= OPEN


@formula
def _room(t, sag, deviation):
    """How far from a point of a face's piece a way from the trimmed face to more than ``t`` above it can lead."""
    return t + sag + 2.0 * deviation


@formula
def is_open(solid, row, f, t, other, least, reach, x, y, z, q, stack):
    """Whether a point of face f has no other surface so near that it could hide on which side is outside.

    From there a way of a little more than ``t`` leads straight up out of the solid to what is higher above the face
    than that, and one straight down into it; both within ``reach`` of the point x, y, z. The way up is ``least``
    above the face ``other``, if that is not negative. Tried are the triangle that is nearest, where it is nearest and
    on the way from there to its middle, and the nearest with an open middle.
    """
    P, err, _, box, link, order, root, _, sag, kind, size, frame, sense, deviation, _, _, marks, nodes = solid
    own = (marks[row], marks[row], nodes[row], nodes[row])
    for bit in (0, OPEN):
        _, j = nearest_marked(P, err, box, link, order, root[f], *own, bit, 1.0, x, y, z, reach, stack)
        if j < 0:
            return False
        room = _room(t, sag[j], deviation[f])
        _, v, w = point_triangle(x, y, z, P[j])
        length = 0.0
        for k in range(3):
            foot = P[j, 0, k] + v * (P[j, 1, k] - P[j, 0, k]) + w * (P[j, 2, k] - P[j, 0, k])
            length += ((P[j, 0, k] + P[j, 1, k] + P[j, 2, k]) / 3.0 - foot) ** 2
        length = math.sqrt(length)
        step, share = 0.0, 0.0
        while share < 1.0:
            share = min(1.0, step / length) if length > 0.0 else 1.0
            free = _place(solid, f, j, v + share * (1.0 / 3.0 - v), w + share * (1.0 / 3.0 - w), room, q, stack)
            if math.sqrt((x - q[0]) ** 2 + (y - q[1]) ** 2 + (z - q[2]) ** 2) + room > reach:
                break
            if free and (
                other < 0
                or sense[other] * height_at(kind[other], size[other, 0], size[other, 1], frame[other], q[0], q[1], q[2])
                > least + room
            ):
                return True
            step = max(2.0 * room, 4.0 * step)
    return False
