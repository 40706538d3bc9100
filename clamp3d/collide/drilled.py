"""Penetration depth of a pin, a flat-ended cylinder, and a box or cylinder with round holes through it.

Moved out of the overlap the pin is either off the plate, its holes filled, or what of it lies between the plate's two
faces is in one hole. Each is a search of its own with a proof, and the depth is the shorter of the two ways.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.body import Bore, ClosedForm, bore_rod, face_to_face
from clamp3d.collide.convex import Rod
from clamp3d.collide.hull import MEMBER, Hull
from clamp3d.collide.zonoid import zonoid_distance
from clamp3d.core.linear import cross, dot, norm
from clamp3d.core.pose import Array, inverse

_SAME = 1e-12
"""Relative to the size: lengths and directions that differ by less are one."""
_TOLERANCE = 1e-9
"""Width of a depth that is asked for, relative to the size."""
_STRETCHES, _WAITING = 5000, 1000
"""Stretches of translations along a hole that are looked at before a wider bound is told, and that may wait."""


def is_drilled(a: ClosedForm, b: ClosedForm) -> bool:
    """Whether `drilled_depth` knows the depth of the two."""
    return _is_pin(b) and _is_plate(a)


def _is_pin(form: ClosedForm) -> bool:
    one = len(form.outers) == 1 and isinstance(form.outers[0], Rod)
    return one and not form.bores and form.error == 0.0 and form.surface is None


def _is_plate(form: ClosedForm) -> bool:
    """A box or a cylinder whose bores are holes from face to face, within its sides and clear of each other."""
    if len(form.outers) != 1 or not form.bores or form.error != 0.0 or form.surface is not None:
        return False
    outer = form.outers[0]
    if outer.sum is None:
        return False
    z = form.bores[0].T[:3, 2]
    along = dot(outer.sum.lines, z)
    across = np.linalg.norm(outer.sum.lines - along[:, None] * z, axis=1)
    thick = np.abs(along) > across
    size = float(np.abs(form.bounds).max())
    if thick.sum() != 1 or np.where(thick, across, np.abs(along)).max() > _SAME * size:
        return False
    half = float(np.abs(along[thick][0]))
    for bore in form.bores:
        off = bore.T[:3, 3] - outer.sum.centre
        level = abs(float(dot(off, z))) + abs(0.5 * bore.length - half) <= _SAME * size
        if bore.half_angle != np.pi or norm(cross(bore.T[:3, 2], z)) > _SAME or not level:
            return False
        if isinstance(outer, Hull):
            sides = outer.planes[np.abs(dot(outer.planes[:, :3], z)) < 0.5]
            inside = -float((dot(sides[:, :3], bore.T[:3, 3]) + sides[:, 3]).max())
        else:
            inside = outer.radius - norm(cross(off, z))
        if not bore.radius < inside - _SAME * size:
            return False
    P, r = np.array([bore.T[:3, 3] for bore in form.bores]), np.array([bore.radius for bore in form.bores])
    clear = np.sqrt(((P[:, None] - P) ** 2).sum(axis=2)) - r - r[:, None]
    return bool((clear > _SAME * size)[~np.eye(len(P), dtype=bool)].all())


def drilled_depth(a: ClosedForm, b: ClosedForm, T: Array) -> Distance | None:
    """Depth of the pin b at ``T`` (4, 4) in the plate a as a signed distance; None for other bodies.

    Of bodies that are apart its ``upper`` is not known.
    """
    if not is_drilled(a, b):
        return None
    plate, rod = a.outers[0], b.outers[0]
    assert plate.sum is not None
    assert isinstance(rod, Rod)
    found = zonoid_distance(plate.sum, rod.sum.at(T)).labelled("depth", "convex")
    if found.lower >= 0.0:
        return replace(found, upper=np.inf)
    p, n = found.point_a, found.normal
    if p is not None and n is not None and a.depth(p[None])[0] < -MEMBER * (1.0 + float(np.abs(p).max())):
        # On what fills a hole: beside it the faces meet as well.
        out = T.copy()
        out[:3, 3] -= found.lower * n
        at = face_to_face(Distance(0.0, 0.0, normal=n), plate, rod, a, b, out)
        q = None if at.point_b is None else at.point_b + found.lower * n
        found = replace(found, point_a=at.point_a, point_b=q)
    for bore in a.bores:
        low, t = _into_hole(bore, rod, T, -found.lower)
        shortest = min(-found.upper, low)
        for more in (1.0, 1.0 + 1e-9, 1.0 + 1e-6):
            out, length = T.copy(), more * norm(t)
            if not 0.0 < length < -found.lower:
                break
            out[:3, 3] += more * t
            at = bore_rod(bore, rod, out)
            if at.lower > 0.0 and at.point_b is not None:  # the kernel finds it in the hole
                q = at.point_b - more * t
                found = Distance(-length, 0.0, at.point_a, q, more * t / length, None, "depth", "hole")
                break
        found = replace(found, upper=-shortest)
    return found if found.upper < 0.0 else replace(found, upper=np.inf)


def _into_hole(bore: Bore, rod: Rod, T: Array, limit: float) -> tuple[float, Array]:
    """Lower bound of the length of translations shorter than ``limit`` mm into the hole, and the shortest (3,)."""
    from clamp3d.core.kernel_hole import CUTS, hole

    local = dot(dot(inverse(bore.T), T), rod.T)
    d = local[:3, 2] if local[2, 2] >= 0.0 else -local[:3, 2]
    lean = float(np.hypot(d[0], d[1]))
    e = d[:2] / lean if lean > 0.0 else np.array([1.0, 0.0])
    R = np.array([[e[0], e[1], 0.0], [-e[1], e[0], 0.0], [0.0, 0.0, 1.0]])
    pin = np.array([*dot(R, local[:3, 3]), lean, d[2], rod.radius, 0.5 * rod.length])
    pin[3:5] /= np.hypot(pin[3], pin[4])
    size = float(np.abs(pin).sum()) + bore.radius + bore.length
    heap, rows, out = np.empty((_WAITING, 5)), np.empty((4, CUTS)), np.empty(5)
    work = (rows, np.empty(4), *np.empty((4, CUTS)), np.empty((4, CUTS + 1)), np.empty(4))
    hole(pin, bore.radius, 0.5 * bore.length, limit, _TOLERANCE * size, _STRETCHES, heap, *work, out)
    return float(out[0]), dot(dot(bore.T[:3, :3], R.T), out[2:])
