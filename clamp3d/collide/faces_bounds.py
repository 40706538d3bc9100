"""Compiled bounds of the signed distance from a solid that points of one piece of a face have.

The signed distance from a solid has slope 1: a piece with a point at s and radius r has no point nearer than s - r.
Three better bounds, each proven for the piece as it lies:

- outside, its distance from each face is at least that of the whole surface, in closed form, and at least that of the
  face's triangles less their errors;
- where no face of the solid within a ball reaches above the surface of one of them, the piece's signed distance is at
  least its least height over the surface (`faces_ball`);
- inside, the same with the surroundings in place of the solid says that a point has material all round it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_ball import (
    all_above,
    below,
    clear_around,
    cosine,
    enough,
    foot_above,
    has_feet,
    way_above_both,
)
from clamp3d.collide.faces_hollow import CAPACITY, MOST_TRIED, hollow, piece_over
from clamp3d.collide.faces_math import (
    OTHER,
    PLANE,
    SPHERE,
    TORUS,
    band_over,
    bend,
    height_at,
    least_height,
    raise_by,
    spans,
    surface_point,
    to_frame,
    way_out,
)
from clamp3d.collide.faces_open import is_open
from clamp3d.collide.faces_tree import from_faces, nearest, nearest_below, nearest_marked
from clamp3d.collide.faces_witness import winding, witness
from clamp3d.core.jit import formula

NEAR = 4
"""Faces whose surfaces are tried as separating ones, those nearest to the piece."""


@formula
def piece(V, uv, g, sag, own, solid, limits, scratch, out):
    """Lower bound for one piece; a better upper bound goes into ``out``."""
    akind, asize, aframe, adeviation = own
    slack, contact, goal, tol = limits
    near, chosen, heights, over, stack, whole = scratch
    work, p, q = whole[0], whole[2, 0], whole[2, 1]
    P, err, face, box, link, order, root, buv, bsag, kind, size, frame, sense, deviation, _, beside, _, _, _ = solid
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
    outside, inside, measured, tried = -1.0, False, False, 0
    for n in range(NEAR + beside.shape[1] * MOST_TRIED):
        # The nearest faces first; then those beside them, and beside these.
        if n < NEAR:
            f = near[n]
        else:
            m = (n - NEAR) // beside.shape[1]
            if m >= tried or tried == MOST_TRIED or not (outside < 0.0 and (low > 0.0 or found < -contact)):
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
            wanted = deep > 0.0 and (rim - deep < out[0] or not inside or (rim - high < out[0] and not measured))
            if not (least - e > found or (h > t and outside < 0.0) or wanted):
                continue
            told = False
            if at < 0.0:
                at = nearest_below(P, err, box, link, order, root[f], x, y, z, stack)
            # Beyond this the inside of a torus within a ball may be in two pieces.
            reach = size[f, 0] if kind[f] == TORUS else np.inf
            if least - e > found or (h > t and outside < 0.0):
                feet, off = has_feet(kind[f], sense[f]), at
                foot_above(kind, size, frame, sense, f, t, x, y, z, q)
                if h < t and feet:
                    off = nearest_below(P, err, box, link, order, root[f], q[0], q[1], q[2], stack)
                needed = max(h, 0.0 if feet or least - e <= found else abs(least)) + rho
                most = reach if sense[f] < 0.0 else np.inf
                clear = clear_around(solid, row, 1, slack, off, q[0], q[1], q[2], needed, most, whole, stack)
                told = clear > 0.0 and found < enough(out[0], limits)
                if clear > 0.0:  # what is above the face by more than t is outside there
                    found = max(found, below(least, rho, clear, feet) - e)
                    if h > t:
                        outside = max(outside, h - t)  # the ball holds the face, so it is larger than that
            if wanted:
                most = reach if sense[f] > 0.0 else np.inf
                clear = clear_around(solid, row, 2, slack, at, x, y, z, deep, most, whole, stack)
                told = told or clear > 0.0
                inside = inside or clear > 0.0
                if clear > 0.0 and rim - max(deep, high) < out[0]:  # inside: as deep as the faces are away
                    measured = True
                    for i in range(3):
                        for c in range(3):
                            whole[1, i, c] = p[c]
                    depth = from_faces(
                        P, err, face, box, link, order, kind, size, frame, deviation, whole[1], over,
                        max(deep + t, high), work, stack,
                    )  # fmt: skip
                    depth = max(depth, deep) - rim  # as above, no more than the ball's radius
                    if -depth < out[0] and depth > 0.0:
                        out[0] = -depth
                        for k in range(3):
                            out[1 + k] = out[4 + k] = p[k]
                        out[7] = f
    # In a hollow corner the solid is below one of several surfaces. Any of them leads to the others.
    around, up, fits, seeds = chosen[MOST_TRIED:], heights[MOST_TRIED:], 0, 0
    for m in range(tried):
        f = chosen[m]
        if fits > 0 or seeds == 2 or found > min(-0.5 * contact, enough(out[0], limits)):
            break
        if not has_feet(kind[f], sense[f]) or kind[f] == SPHERE or heights[m] < found + 0.25 * tol:
            continue
        seeds += 1
        for first in (len(kind), 0):
            around[0] = f
            if fits == 0:
                fits, clear = hollow(
                    solid, around, 0, first, slack, p, found, x, y, z, rho + e, up, up[CAPACITY:], whole, stack
                )
                if fits > 0:
                    for n in range(fits):
                        up[2 * CAPACITY + n] = 0.0
                    least = piece_over(V, uv, g, rim, own, solid, fits, (near, around, up, over, stack, whole))
                    found = max(found, below(least, rho + e, clear, True))
    if found < -0.5 * contact and fits == 0:
        # In a hollow corner the solid lies below one of two surfaces. A way out of both is along both normals.
        for m in range(tried):
            f = chosen[m]
            for n in range(m):
                o = chosen[n]
                least = min(heights[m], heights[n])
                if least - e <= found or kind[f] == TORUS or kind[o] == TORUS:
                    continue
                turn = cosine(kind, size, frame, sense, f, o, x, y, z)
                if turn < -0.8:
                    continue
                step = 0.0
                if least < 0.0:
                    step = way_above_both(heights[m], heights[n], turn, kind, size, frame, sense, f, o, x, y, z, q)
                    above = False
                    for more in (1.001, 1.01, 1.1):  # round surfaces turn away from their normals at the middle
                        above = more * step + e < -found
                        for one in (f, o):
                            up = all_above(kind, size, frame, sense, one, V, q, more * step, whole) if above else 0.0
                            above = above and up > slack[one] + deviation[one]
                        if above:
                            step *= more
                            break
                    if not above:
                        continue
                    least = -step
                xs, ys, zs = x + step * q[0], y + step * q[1], z + step * q[2]
                # Where a piece of one looks over the other, what lies above both is outside.
                for one, other in ((f, o), (o, f)):
                    at, _ = nearest_marked(
                        solid, (other,), 0, root[one], 1, 1.0, slack, xs, ys, zs, np.inf, whole, stack
                    )  # fmt: skip
                    if at == np.inf:
                        continue
                    t, over_other = slack[one] + deviation[one], slack[other] + deviation[other]
                    limit = 2.0 * at + 8.0 * (t + over_other) + max(least, 0.0) + rho
                    clear, _ = nearest_marked(solid, (f, o), 0, 0, 1, -1.0, slack, xs, ys, zs, limit, whole, stack)
                    near[0], whole[1, 1, 0] = other, over_other
                    if clear > at + t and is_open(
                        solid, one, t, near[:1], whole[1, 1, :1], clear, xs, ys, zs, whole[1, 0], stack
                    ):  # fmt: skip
                        found = max(found, below(least, rho, clear, True) - e)
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
