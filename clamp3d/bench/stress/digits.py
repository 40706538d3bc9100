"""The groove's signed distance at 50 digits, by a construction that shares nothing with the kernel's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from clamp3d.errors import need


def fifty_digits() -> Any:
    """mpmath's context with 50 digits. Raises MissingLibraryError without mpmath."""
    need("mpmath", "an answer of 50 digits")
    import mpmath

    mp = mpmath.mp.clone()
    mp.dps = 50
    return mp


def point_distance(mp: Any, R: Any, half_angle: Any, L: Any) -> Callable[[Any], Any]:
    """Signed distance from a groove's material as a function of a point (x, y, z), all mm and ``mp``'s numbers.

    By complex numbers: the section turned so that -y is real.
    """
    corner = mp.mpc(R * mp.cos(half_angle), R * mp.sin(half_angle))
    H = L / 2

    def distance(x: Any) -> Any:
        point = mp.mpc(-x[1], abs(x[0]))
        to_lip = abs(point - corner)
        to_arc = abs(abs(point) - R) if mp.arg(point) <= half_angle else to_lip
        to_ray = abs(point.real - corner.real) if point.imag >= corner.imag else to_lip
        g, e = min(to_arc, to_ray), abs(x[2]) - H
        if point.real >= corner.real and abs(point) >= R:
            g = -g
        return max(g, e) if g <= 0 and e <= 0 else mp.hypot(max(g, 0), max(e, 0))

    return distance


def golden(mp: Any, f: Callable[[Any], Any], lo: Any, hi: Any, goal: Any, enough: Any = None) -> Any:
    """Least value of ``f`` seen by golden section from ``lo`` to ``hi`` down to a stretch of ``goal``.

    With ``enough``, for an f of slope up to 1, it ends when f cannot get below that any more.
    """
    tau = (mp.sqrt(5) - 1) / 2
    x, y = hi - tau * (hi - lo), lo + tau * (hi - lo)
    fx, fy = f(x), f(y)
    while hi - lo > goal and (enough is None or min(fx, fy) - (hi - lo) <= enough):
        if fx < fy:
            hi, y, fy = y, x, fx
            x = hi - tau * (hi - lo)
            fx = f(x)
        else:
            lo, x, fx = x, y, fy
            y = lo + tau * (hi - lo)
            fy = f(y)
    return min(fx, fy)
