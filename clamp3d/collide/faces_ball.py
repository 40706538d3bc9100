"""Compiled: what a ball tells in which a solid lies below the surface of one of its faces, or of two.

Where no face of a solid within a ball reaches above the surface of one of them, the solid in the ball lies below that
surface. So a point in it that is h over the surface is at least h outside, or its way out is at least -h long.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_math import (
    CYLINDER,
    PLANE,
    SPHERE,
    height_at,
    least_height,
    slope_at,
    to_frame,
)
from clamp3d.collide.faces_open import is_open
from clamp3d.collide.faces_tree import nearest_marked
from clamp3d.core.jit import formula


@formula
def cosine(kind, size, frame, sense, f, g, x, y, z):
    """Cosine of the angle between two faces' normals at a point."""
    turn = 0.0
    for i in range(3):
        a = sense[f] * slope_at(kind[f], size[f, 0], size[f, 1], frame[f], i, x, y, z)
        turn += a * sense[g] * slope_at(kind[g], size[g, 0], size[g, 1], frame[g], i, x, y, z)
    return turn


@formula
def way_above_both(high, other, turn, kind, size, frame, sense, f, g, x, y, z, way):
    """Length of the shortest step that raises a point by minus its heights ``high``, ``other`` over two planes.

    Its direction goes into ``way`` (3). ``turn`` is the cosine between their normals.
    """
    one, two = -high, -other
    if one > 0.0 and two <= one * turn:  # along the first normal, or the second, or both
        two = 0.0
    elif two > 0.0 and one <= two * turn:
        one = 0.0
    elif one <= 0.0 and two <= 0.0:
        one, two = 0.0, 0.0
    else:
        one, two = (one - two * turn) / (1.0 - turn * turn), (two - one * turn) / (1.0 - turn * turn)
    length = 0.0
    for i in range(3):
        a = sense[f] * slope_at(kind[f], size[f, 0], size[f, 1], frame[f], i, x, y, z)
        b = sense[g] * slope_at(kind[g], size[g, 0], size[g, 1], frame[g], i, x, y, z)
        way[i] = one * a + two * b
        length += way[i] * way[i]
    length = math.sqrt(length)
    for i in range(3):
        way[i] /= max(length, 1e-12)
    return length + 1e-7


@formula
def all_above(kind, size, frame, sense, f, V, way, step, work):
    """How far above a surface the whole triangle V (3, 3) is after a step along ``way`` (3)."""
    for i in range(3):
        for c in range(3):
            work[1, i, c] = V[i, c] + step * way[c]
    to_frame(frame[f], work[1], work[0])
    return least_height(kind[f], size[f, 0], size[f, 1], sense[f], work[0])


@formula
def below(least, rho, clear, feet):
    """Lower bound of what is within rho of a ball's middle and ``least`` over a surface that the solid is below in it.

    Outside, nothing of the solid is nearer than the surface and the ball's edge. Inside, the way out has to end within
    the ball, for beyond it the solid may go on: ``feet`` says that its end is within rho of the middle.
    """
    if least >= 0.0:
        return min(least, clear - rho)
    return least if rho - (0.0 if feet else least) <= clear else -np.inf


@formula
def has_feet(kind, sense):
    """Whether what is above a surface is convex and has a foot of every point: `_foot` brings no two points apart."""
    return kind == PLANE or ((kind == CYLINDER or kind == SPHERE) and sense < 0.0)


@formula
def foot_above(kind, size, frame, sense, f, t, x, y, z, foot):
    """The point (3) nearest to x, y, z of what is ``t`` or more above the surface of face f."""
    h = sense[f] * height_at(kind[f], size[f, 0], size[f, 1], frame[f], x, y, z)
    foot[0], foot[1], foot[2] = x, y, z
    if h < t and has_feet(kind[f], sense[f]):
        for i in range(3):
            foot[i] += (t - h) * sense[f] * slope_at(kind[f], size[f, 0], size[f, 1], frame[f], i, x, y, z)


@formula
def clear_around(solid, row, bit, slack, at, x, y, z, needed, most, whole, stack):
    """How far about a point no piece has the mark ``bit`` in a row of marks; -1 if that tells nothing.

    The face is within ``at`` of the point: it has to be in that ball, by its slack. Looked at is ``needed`` past it, at
    most ``most``.
    """
    f = row % len(solid[13])
    t = slack[row] + solid[13][f]
    limit = min(needed + 2.0 * (at + t), most)
    clear, _ = nearest_marked(solid, (row,), 0, 0, bit, -1.0, slack, x, y, z, limit, whole, stack)
    if clear > at + t and is_open(solid, f, t, stack[:0], slack[:0], clear, x, y, z, whole[1, 0], stack):
        return clear
    return -1.0


@formula
def enough(high, limits):
    """Lower bound above which no better one is needed, with an upper bound ``high`` of all."""
    _, contact, goal, tol = limits
    if goal < np.inf and high <= contact:  # asked for a verdict: contact or clash
        return -contact
    return min(goal, high - 0.25 * tol)
