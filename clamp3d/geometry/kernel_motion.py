"""March along a motion of a cylinder without missing a contact: conservative advancement on the exact distance.

A motion is ``x(s) = p + turn(u, s angle) (x0 - p) + s v`` for 0 <= s <= 1, with v along u if angle != 0. Between s and
s + step the distance falls by no more than the axis' points move, so ``(distance - level) / speed`` is a step that
cannot jump over the level. That step is short where a cylinder slides close to a surface; longer ones are proven by
supersets of the material that a sliding motion does not approach: the half-spaces y <= h, |z| <= H, everything outside
the full cylinder of the arc, and the groove without ends; and by the axis without ends.
"""

from __future__ import annotations

import math
from typing import Any

from clamp3d.geometry.jit import entry, formula, source_stamp
from clamp3d.geometry.kernel_distance import nearest

END, BELOW, DIP, LIMIT = range(4)
"""Why a march stopped: at the end, at or below the level, behind a local minimum close to it, out of evaluations."""


@formula
def turn(x, y, z, ux, uy, uz, sine, versine):  # type: ignore[no-untyped-def]
    """Vector turned about the unit vector u (Rodrigues); versine = 1 - cos, formed without cancellation."""
    kx = uy * z - uz * y
    ky = uz * x - ux * z
    kz = ux * y - uy * x
    return (
        x + sine * kx + versine * (uy * kz - uz * ky),
        y + sine * ky + versine * (uz * kx - ux * kz),
        z + sine * kz + versine * (ux * ky - uy * kx),
    )


@formula
def clear_of_supersets(step, R, s, h, H, l, level, bend, c, d, w, v):  # type: ignore[no-untyped-def] # noqa: E741
    """Whether one superset of S stays farther than level from the axis' ends (so from the axis) over the step.

    An end point leaves its tangent by no more than bend step^2 / 2. All four tests are monotone between the start of
    the step, where they hold by the caller's distance or fail here, and its end.
    """
    sag = 0.5 * bend * step * step
    above = top = bottom = within = True
    for i in range(2):
        t = -l if i == 0 else l
        x0, y0, z0 = c[0] + t * d[0], c[1] + t * d[1], c[2] + t * d[2]
        x1 = x0 + step * (v[0] + t * w[0])
        y1 = y0 + step * (v[1] + t * w[1])
        z1 = z0 + step * (v[2] + t * w[2])
        above = above and y0 - h > level and y1 - sag - h > level
        top = top and z0 - H > level and z1 - sag - H > level
        bottom = bottom and -z0 - H > level and -z1 - sag - H > level
        within = within and R - math.sqrt(x0 * x0 + y0 * y0) > level and R - math.sqrt(x1 * x1 + y1 * y1) - sag > level
    return above or top or bottom or within


def _entry(stamp: str) -> Any:
    def march(R, half_angle, H, r, l, m, start, target, stop, slack, near, limit, out):  # type: ignore[no-untyped-def] # noqa: E741
        """m: c (3), d (3), p (3), u (3), v (3), angle. Fills out with s of the last three samples; status, count."""
        stamp  # noqa: B018
        s = R * math.sin(half_angle)
        h = -R * math.cos(half_angle)
        px, py, pz, ux, uy, uz = m[6], m[7], m[8], m[9], m[10], m[11]
        vx, vy, vz, angle = m[12], m[13], m[14], m[15]
        # Greatest distance of the axis segment from the axis of rotation: at one of its ends.
        reach = 0.0
        span = l + abs(m[0]) + abs(m[1]) + abs(m[2]) + 2.0 * (abs(px) + abs(py) + abs(pz)) + abs(vx) + abs(vy) + abs(vz)
        for i in range(2):
            t = -l if i == 0 else l
            x, y, z = m[0] + t * m[3] - px, m[1] + t * m[4] - py, m[2] + t * m[5] - pz
            kx, ky, kz = uy * z - uz * y, uz * x - ux * z, ux * y - uy * x
            reach = max(reach, math.sqrt(kx * kx + ky * ky + kz * kz))
        turning = abs(angle) * reach
        speed = math.sqrt(turning * turning + vx * vx + vy * vy + vz * vz)
        across = turning + math.sqrt(vx * vx + vy * vy)
        bend = abs(angle) * turning
        now = start
        before = start
        last = math.inf
        last2 = math.inf
        count = 0
        while True:
            sine = math.sin(now * angle)
            half = math.sin(0.5 * now * angle)
            ox, oy, oz = turn(m[0] - px, m[1] - py, m[2] - pz, ux, uy, uz, sine, 2.0 * half * half)
            cx, cy, cz = px + ox + now * vx, py + oy + now * vy, pz + oz + now * vz
            dx, dy, dz = turn(m[3], m[4], m[5], ux, uy, uz, sine, 2.0 * half * half)
            g = nearest(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz)[0]
            count += 1
            out[0] = out[1]
            out[1] = out[2]
            out[2] = now
            if g <= stop:
                return BELOW, count
            if last < target + near and last < last2 and last <= g and count > 2:
                return DIP, count
            last2 = last
            last = g
            if now >= 1.0:
                return END, count
            if count >= limit:
                return LIMIT, count
            gap = g - target + slack
            left = 1.0 - now
            step = gap / speed if gap < speed * left else left
            if step < 1e-3 and step < left:
                level = target - slack + r
                c = (cx, cy, cz)
                d = (dx, dy, dz)
                w = (angle * (uy * dz - uz * dy), angle * (uz * dx - ux * dz), angle * (ux * dy - uy * dx))
                v = (
                    vx + angle * (uy * oz - uz * oy),
                    vy + angle * (uz * ox - ux * oz),
                    vz + angle * (ux * oy - uy * ox),
                )
                trial = left
                while trial > 2.0 * step:
                    if clear_of_supersets(trial, R, s, h, H, l, level, bend, c, d, w, v):
                        step = trial
                        break
                    trial *= 0.5
                if step < 1e-3 and across < 0.5 * speed:
                    endless = nearest(R, s, h, 8.0 * (span + H), r, l, cx, cy, cz, dx, dy, dz)[0] - target + slack
                    if endless >= across * left:
                        step = left
                    elif endless > 0.0:
                        step = max(step, endless / across)
                if step < 1e-3 and angle == 0.0:
                    along = vx * dx + vy * dy + vz * dz
                    fx, fy, fz = vx - along * dx, vy - along * dy, vz - along * dz
                    aside = math.sqrt(fx * fx + fy * fy + fz * fz)
                    if aside < 0.5 * speed:
                        t = 0.5 * along * left
                        x, y, z = cx + t * dx, cy + t * dy, cz + t * dz
                        endless = nearest(R, s, h, H, r, l + abs(t), x, y, z, dx, dy, dz)[0] - target + slack
                        if endless >= aside * left:
                            step = left
                        elif endless > 0.0:
                            step = max(step, endless / aside)
            before = now
            now = min(1.0, now + step)
            if now <= before:
                now = min(1.0, before + 2.0**-50)

    signature = "UniTuple(i8,2)(f8,f8,f8,f8,f8,f8[::1],f8,f8,f8,f8,f8,i8,f8[::1])"
    return entry(march, signature)


march = _entry(source_stamp())
