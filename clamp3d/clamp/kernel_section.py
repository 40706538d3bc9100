"""Compiled formulas of the clamp's section: gaps with their derivatives. Import this module only when gaps are asked.

The axes of a splint are (right, down) of the paper's section; ``down`` holds the down splint's x, y, the cosine and
sine of its angle, and the first and second derivative of its lift by w (`section.Section.lift`).
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_features import clip
from clamp3d.core.kernel_pieces import enter, side_pieces

# Columns of a state that the rows depend on, as in `section`.
_D, _S, _B, _V, _W, _U = 4, 5, 6, 7, 8, 9


def _straight(R, half_angle, H, r, l, cx, cy, mouth, u, v, work, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Arc and faces of a groove for a wire along it at (u, v): gap, point, normal and feature's code, out (3, 6).

    The groove's centre is at (cx, cy), its mouth looks down (``mouth`` 1) or up (-1); ``work`` is (3, 14).
    """
    s = R * math.sin(half_angle)
    h = -R * math.cos(half_angle)
    x = u - cx
    y = mouth * (v - cy)
    side_pieces(R, s, h, H, r, l, x, y, 0.0, 0.0, 0.0, 1.0, work)
    lo, hi = clip(h, H, y, 0.0, 0.0, 1.0, l)
    if lo <= hi:
        enter(R, s, h, H, half_angle, r, l, x, y, 0.0, 0.0, 0.0, 1.0, lo, hi, work)
    for k in range(3):
        row = work[k]
        out[k, 0] = row[0]
        out[k, 1] = row[1] + cx
        out[k, 2] = mouth * row[2] + cy
        out[k, 3] = row[4]
        out[k, 4] = mouth * row[5]
        out[k, 5] = row[7]


@formula
def _move(row, bx, by, turn, slope, lever):  # type: ignore[no-untyped-def]
    """Add to a row what it changes by with the down splint's x, y and angle, which the state moves."""
    row[_D] += by
    row[_S] += turn / lever
    row[_B] += bx
    row[_V] += bx
    row[_W] += bx - slope * by
    row[_U] -= by


@formula
def _put(k, gap, x, y, nx, ny, value, place):  # type: ignore[no-untyped-def]
    value[k] = gap
    place[k, 0] = x
    place[k, 1] = y
    place[k, 2] = nx
    place[k, 3] = ny


def _wire(q, down, i, bolt_x, shank, r, lever, up, below, value, gradient, place):  # type: ignore[no-untyped-def]
    """Gaps of the wire at columns i, i + 1 of q to both splints, whose pieces are ``up`` and ``below``, and the bolt.

    Pieces (k, 6): gap, point and normal in the splint's own axes. Into value (k,), gradient (k, 10; zeros), and point
    and normal, place (k, 4).
    """
    px, py, c, s, slope = down[0], down[1], down[2], down[3], down[4]
    n = 0
    for j in range(up.shape[0]):
        nx, ny = up[j, 3], up[j, 4]
        gradient[n, i] = nx
        gradient[n, i + 1] = ny
        _put(n, up[j, 0], up[j, 1], up[j, 2], nx, ny, value, place)
        n += 1
    for j in range(below.shape[0]):
        pu, pv, nu, nv = below[j, 1], below[j, 2], below[j, 3], below[j, 4]
        nx = nu * c + nv * s
        ny = nv * c - nu * s
        gradient[n, i] = nx
        gradient[n, i + 1] = ny
        _move(gradient[n], -nx, -ny, nv * pu - nu * pv, slope, lever)
        _put(n, below[j, 0], pu * c + pv * s + px, pv * c - pu * s + py, nx, ny, value, place)
        n += 1
    # The shank stands between the wires: each keeps to its side.
    side = -1.0 if i == 0 else 1.0
    axis = bolt_x + q[_B]
    gradient[n, i] = side
    gradient[n, _B] = -side
    _put(n, side * (q[i] - axis) - shank - r, axis + side * shank, q[i + 1], side, 0.0, value, place)


def _stops(q, down, p, hole, washer, walls, value, gradient, place):  # type: ignore[no-untyped-def]
    """Gaps of the inner faces, then what ends the down splint's tilt and slide, and carries it; as `_wire` writes them.

    Its underside on the saddle's edges, its slot (``walls`` of its ends count) on the shank (Table 2 of the paper), the
    play of hole and washer where there is any, and its round back in the saddle's arc. The splints' faces are straight:
    their gap is least at an end of their overlap.
    """
    px, py, c, s, slope, bend = down[0], down[1], down[2], down[3], down[4], down[5]
    bolt_x, shank, lever, up_half, thickness, face, slot, slot_bottom = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]
    under, saddle_half, edge_below, back, play, washer_play = p[8], p[9], p[10], p[11], p[12], p[13]
    n = 0
    for k in range(2):
        side = 2.0 * k - 1.0
        u = side * lever
        corner, edge = px + u * c + face * s, bolt_x + side * up_half
        if side * (corner - edge) <= 0.0:  # P2's corner under P1's face
            _move(gradient[n], 0.0, 1.0, px - corner, slope, lever)
            _put(n, py - u * s + face * c - thickness, corner, thickness, 0.0, 1.0, value, place)
        else:  # P1's edge over P2's face
            x, y = edge - px, thickness - py
            _move(gradient[n], s, c, y * s - x * c, slope, lever)
            _put(n, face - (x * s + y * c), edge, thickness, s, c, value, place)
        n += 1
    b, v, u = q[_B], q[_V], q[_U]
    axis = bolt_x + b
    for k in range(2):
        side = 2.0 * k - 1.0
        # The centre of the saddle's arc stands back_clearance above the state's d.
        edge, edge_y = axis + v + side * saddle_half, q[_D] + edge_below
        x, y = edge - px, edge_y - py
        gradient[n, _D] = c
        gradient[n, _B] = gradient[n, _V] = s
        _move(gradient[n], -s, -c, x * c - y * s, slope, lever)
        _put(n, x * s + y * c - under, edge, edge_y, s, c, value, place)
        n += 1
        for end in range(walls):  # the lower end, then the upper one
            deep = slot_bottom if end == 0 else face
            x, y = px + side * slot * c + deep * s, py - side * slot * s + deep * c
            gradient[n, _B] = -side
            _move(gradient[n], side, 0.0, side * (y - py), slope, lever)
            _put(n, side * (x - axis) - shank, x, y, -side, 0.0, value, place)
            n += 1
        if hole:
            gradient[n, _B] = -side
            _put(n, play - side * b, axis + side * shank, 0.5 * thickness, -side, 0.0, value, place)
            n += 1
        if washer:
            gradient[n, _V] = -side
            _put(n, washer_play - side * v, axis - side * shank, q[_D] + back, side, 0.0, value, place)
            n += 1
    upright = 1.0 / math.sqrt(1.0 + slope * slope)  # the height over the arc, square to it
    nx = slope * upright
    gradient[n, _W] = -u * slope * bend * upright**3
    gradient[n, _U] = upright
    _put(n, u * upright, px + back * nx, py + back * upright, nx, upright, value, place)


straight = entry(_straight, "void(f8,f8,f8,f8,f8,f8,f8,f8,f8,f8,f8[:,::1],f8[:,::1])")
wire = entry(_wire, "void(f8[::1],f8[::1],i8,f8,f8,f8,f8,f8[:,::1],f8[:,::1],f8[::1],f8[:,::1],f8[:,::1])")
stops = entry(_stops, "void(f8[::1],f8[::1],f8[::1],b1,b1,i8,f8[::1],f8[:,::1],f8[:,::1])")
