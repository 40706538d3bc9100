"""Compiled formulas of the clamp's section: gaps with their derivatives. Import this module only when gaps are asked.

The axes of a splint are (right, down) of the paper's section; ``down`` holds the down splint's x, y, the cosine and
sine of its angle, and the first and second derivative of its lift by w (`section.Section.lift`).
"""

from __future__ import annotations

import math

from clamp3d.clamp.section import EDGE_CODE, B, D, S, U, V, W
from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_features import clip
from clamp3d.core.kernel_pieces import enter, side_pieces

_FAR = 1e3
"""Gap in mm of a piece that another one stands for."""


@formula
def _groove(groove, u, v, work, out):  # type: ignore[no-untyped-def]
    """Arc and faces of a groove for a wire along it at (u, v): gap, point, normal and feature's code, out (3, 6).

    ``groove`` (8,) is its radius, half angle and half length, the wire's radius and half length, the groove's centre
    and where its mouth looks, down (1) or up (-1); ``work`` is (3, 14).
    """
    R, half_angle, H, r, l = groove[0], groove[1], groove[2], groove[3], groove[4]  # noqa: E741
    cx, cy, mouth = groove[5], groove[6], groove[7]
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
def _end(face, r, u, v, out):  # type: ignore[no-untyped-def]
    """A splint's faces end at its outer edge: beside it (wire of radius r) that is the nearest piece in ``out`` (k, 6).

    ``face`` (4,): x of the edge, on which side the outside is (-1, 1), the face's height, and where it looks (1: down).
    Pieces that are nearer than the edge stand `_FAR` away: the groove's material has no end.
    """
    edge, side, height, looks = face[0], face[1], face[2], face[3]
    beyond = side * (u - edge)
    if beyond <= 0.0:
        return
    above = max(looks * (v - height), 0.0)
    away = math.hypot(beyond, above)
    gap = away - r
    nearest = 0
    for k in range(out.shape[0]):
        if out[k, 0] < out[nearest, 0]:
            nearest = k
    for k in range(out.shape[0]):
        if out[k, 0] < gap:
            out[k, 0] = _FAR
    row = out[nearest]
    row[0] = gap
    row[1] = edge
    row[2] = height if above > 0.0 else v
    row[3] = side * beyond / away
    row[4] = looks * above / away
    row[5] = EDGE_CODE


def _pushes(groove, face, places, force, work, out, pushes):  # type: ignore[no-untyped-def]
    """Normals of the pieces, each times its ``force`` (3,), of a wire at each of ``places`` (n, 2), into (n, 2)."""
    for k in range(places.shape[0]):
        u, v = places[k, 0], places[k, 1]
        _groove(groove, u, v, work, out)
        _end(face, groove[3], u, v, out)
        for i in range(2):
            pushes[k, i] = force[0] * out[0, 3 + i] + force[1] * out[1, 3 + i] + force[2] * out[2, 3 + i]


def _ended(face, r, u, v, out):  # type: ignore[no-untyped-def]
    """`_end`."""
    _end(face, r, u, v, out)


@formula
def _move(row, bx, by, turn, slope, lever):  # type: ignore[no-untyped-def]
    """Add to a row what it changes by with the down splint's x, y and angle, which the state moves."""
    row[D] += by
    row[S] += turn / lever
    row[B] += bx
    row[V] += bx
    row[W] += bx - slope * by
    row[U] -= by


@formula
def _put(k, gap, x, y, nx, ny, value, place):  # type: ignore[no-untyped-def]
    value[k] = gap
    place[k, 0] = x
    place[k, 1] = y
    place[k, 2] = nx
    place[k, 3] = ny


@formula
def _rows(q, down, i, p, r, up, below, value, gradient, place):  # type: ignore[no-untyped-def]
    """Gaps of the wire at columns i, i + 1 of q to both splints, whose pieces are ``up`` and ``below``, and the bolt.

    Pieces (k, 6): gap, point and normal in the splint's own axes. Into value (k,), gradient (k, 10; zeros), and point
    and normal, place (k, 4). ``p`` as of `_stops`.
    """
    px, py, c, s, slope = down[0], down[1], down[2], down[3], down[4]
    bolt_x, shank, lever = p[0], p[1], p[2]
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
    axis = bolt_x + q[B]
    gradient[n, i] = side
    gradient[n, B] = -side
    _put(n, side * (q[i] - axis) - shank - r, axis + side * shank, q[i + 1], side, 0.0, value, place)


def _wire(q, down, i, p, r, up, below, value, gradient, place):  # type: ignore[no-untyped-def]
    """`_rows`."""
    _rows(q, down, i, p, r, up, below, value, gradient, place)


def _wires(q, down, first, last, p, grooves, faces, work, pieces, value, gradient, place):  # type: ignore[no-untyped-def]
    """`_rows` of the wires ``first`` to ``last`` - 1, seven each, with the ``pieces`` (2, 2, 3, 6) of arc and faces.

    ``p`` as of `_stops`, ``grooves`` (2, 2, 8) and ``faces`` (2, 2, 4) as of `_groove` and `_end`, by wire and splint.
    """
    px, py, c, s = down[0], down[1], down[2], down[3]
    n = 0
    for k in range(first, last):
        x, y = q[2 * k], q[2 * k + 1]
        dx, dy = x - px, y - py
        r = grooves[k, 0, 3]
        for splint in range(2):
            u, v = (x, y) if splint == 0 else (dx * c - dy * s, dx * s + dy * c)
            _groove(grooves[k, splint], u, v, work, pieces[k, splint])
            _end(faces[k, splint], r, u, v, pieces[k, splint])
        up, below = pieces[k, 0], pieces[k, 1]
        rows = value[n : n + 7], gradient[n : n + 7], place[n : n + 7]
        _rows(q, down, 2 * k, p, r, up, below, rows[0], rows[1], rows[2])
        n += 7


@formula
def _faces(down, p, value, gradient, place):  # type: ignore[no-untyped-def]
    """The first two rows: gaps of the splints' inner faces, which are straight, so least at an end of their overlap."""
    px, py, c, s, slope = down[0], down[1], down[2], down[3], down[4]
    bolt_x, lever, up_half, thickness, face = p[0], p[2], p[3], p[4], p[5]
    for n in range(2):
        side = 2.0 * n - 1.0
        u = side * lever
        corner, edge = px + u * c + face * s, bolt_x + side * up_half
        if side * (corner - edge) <= 0.0:  # P2's corner under P1's face
            _move(gradient[n], 0.0, 1.0, px - corner, slope, lever)
            _put(n, py - u * s + face * c - thickness, corner, thickness, 0.0, 1.0, value, place)
        else:  # P1's edge over P2's face
            x, y = edge - px, thickness - py
            _move(gradient[n], s, c, y * s - x * c, slope, lever)
            _put(n, face - (x * s + y * c), edge, thickness, s, c, value, place)


def _face_gaps(tilts, down, p, value, gradient, place, out):  # type: ignore[no-untyped-def]
    """Least gap of the inner faces at each tilt (n,) into ``out`` (n,); ``down`` without it; workspace of two rows."""
    for k in range(tilts.shape[0]):
        down[2], down[3] = math.cos(tilts[k]), math.sin(tilts[k])
        _faces(down, p, value, gradient, place)
        out[k] = min(value[0], value[1])


def _stops(q, down, p, hole, washer, walls, value, gradient, place):  # type: ignore[no-untyped-def]
    """Gaps of the inner faces, then what ends the down splint's tilt and slide, and carries it; as `_rows` writes them.

    Its underside on the saddle's edges, its slot (``walls`` of its ends count) on the shank (Table 2 of the paper), the
    play of hole and washer where there is any, and its round back in the saddle's arc.
    """
    px, py, c, s, slope, bend = down[0], down[1], down[2], down[3], down[4], down[5]
    bolt_x, shank, lever, thickness, face, slot, slot_bottom = p[0], p[1], p[2], p[4], p[5], p[6], p[7]
    under, saddle_half, edge_below, back, play, washer_play = p[8], p[9], p[10], p[11], p[12], p[13]
    _faces(down, p, value, gradient, place)
    n = 2
    b, v, u = q[B], q[V], q[U]
    axis = bolt_x + b
    for k in range(2):
        side = 2.0 * k - 1.0
        # The centre of the saddle's arc stands back_clearance above the state's d.
        edge, edge_y = axis + v + side * saddle_half, q[D] + edge_below
        x, y = edge - px, edge_y - py
        gradient[n, D] = c
        gradient[n, B] = gradient[n, V] = s
        _move(gradient[n], -s, -c, x * c - y * s, slope, lever)
        _put(n, x * s + y * c - under, edge, edge_y, s, c, value, place)
        n += 1
        for end in range(walls):  # the lower end, then the upper one
            deep = slot_bottom if end == 0 else face
            x, y = px + side * slot * c + deep * s, py - side * slot * s + deep * c
            gradient[n, B] = -side
            _move(gradient[n], side, 0.0, side * (y - py), slope, lever)
            _put(n, side * (x - axis) - shank, x, y, -side, 0.0, value, place)
            n += 1
        if hole:
            gradient[n, B] = -side
            _put(n, play - side * b, axis + side * shank, 0.5 * thickness, -side, 0.0, value, place)
            n += 1
        if washer:
            gradient[n, V] = -side
            _put(n, washer_play - side * v, axis - side * shank, q[D] + back, side, 0.0, value, place)
            n += 1
    upright = 1.0 / math.sqrt(1.0 + slope * slope)  # the height over the arc, square to it
    nx = slope * upright
    gradient[n, W] = -u * slope * bend * upright**3
    gradient[n, U] = upright
    _put(n, u * upright, px + back * nx, py + back * upright, nx, upright, value, place)


end = entry(_ended, "void(f8[::1],f8,f8,f8,f8[:,::1])")
wire = entry(_wire, "void(f8[::1],f8[::1],i8,f8[::1],f8,f8[:,::1],f8[:,::1],f8[::1],f8[:,::1],f8[:,::1])")
wires = entry(
    _wires,
    "void(f8[::1],f8[::1],i8,i8,f8[::1],f8[:,:,::1],f8[:,:,::1],f8[:,::1],f8[:,:,:,::1],f8[::1],f8[:,::1],f8[:,::1])",
)
pushes = entry(_pushes, "void(f8[::1],f8[::1],f8[:,::1],f8[::1],f8[:,::1],f8[:,::1],f8[:,::1])")
face_gaps = entry(_face_gaps, "void(f8[::1],f8[::1],f8[::1],f8[::1],f8[:,::1],f8[:,::1],f8[::1])")
stops = entry(_stops, "void(f8[::1],f8[::1],f8[::1],b1,b1,i8,f8[::1],f8[:,::1],f8[:,::1])")
