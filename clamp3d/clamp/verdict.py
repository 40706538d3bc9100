"""Verdicts from absolute thresholds: what a distance with its error bound means for a pair of parts."""

from __future__ import annotations

from typing import Literal

from clamp3d.checks import number
from clamp3d.errors import InputError

Verdict = Literal["clear", "clearance", "contact", "clash", "contained", "allowed", "uncertain"]

VERDICTS: tuple[Verdict, ...] = ("clash", "contained", "uncertain", "contact", "allowed", "clearance", "clear")
"""All verdicts, the worst first."""

CLEARANCE = 5.0
"""Gap in mm from which a pair counts as clear, unless the user says otherwise."""


def verdict(
    distance: float, *, error_bound: float = 0.0, contact: float, clearance: float = CLEARANCE, allowed: bool = False
) -> Verdict:
    """Verdict on a signed ``distance`` in mm, positive apart.

    Within ``contact`` mm of zero parts touch, deeper they clash; up to ``clearance`` mm apart they are too near to be
    clear. A contact that is meant to be (``allowed``) is no finding. It is 'uncertain' if the true distance, within
    ``error_bound`` of the measured one, may lie on the other side of a threshold.
    Raises InputError unless 0 <= contact <= clearance.

    >>> verdict(-0.2, contact=1e-6), verdict(0.0, contact=1e-6, allowed=True), verdict(2.0, contact=1e-6)
    ('clash', 'allowed', 'clearance')
    >>> verdict(0.01, error_bound=0.02, contact=1e-6)
    'uncertain'
    """
    clearance = number("clearance", clearance)
    if not 0.0 <= contact <= clearance:
        raise InputError(f"clearance must be >= the contact tolerance = {contact:g} mm, got {clearance:g}")

    def plain(d: float) -> Verdict:
        if d < -contact:
            return "clash"
        if d <= contact:
            return "allowed" if allowed else "contact"
        return "clearance" if d <= clearance else "clear"

    answer = plain(distance)
    if plain(distance - error_bound) != answer or plain(distance + error_bound) != answer:
        return "uncertain"
    return answer
