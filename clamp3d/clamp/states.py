"""Moments of a run by name: open, final, or the end of a step of the sequence."""

from __future__ import annotations

from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.errors import InputError


def state(run: Assembly, name: str) -> Waypoint:
    """The waypoint of a state: ``open`` is where the run begins, a step is where it ends, ``final`` the run's end.

    Raises InputError for any other name, with the choices.

    >>> from clamp3d.clamp.assemble import assemble
    >>> from clamp3d.clamp.loader import load_clamp
    >>> from clamp3d.baselines.cas import Cas
    >>> run = assemble(load_clamp(), Cas())
    >>> state(run, "P7").label, state(run, "2").label
    ("jumper in the up splint's groove", "jumper in the up splint's groove")
    """
    if name == "open":
        return run.path[0]
    if name == "final":
        return run.path[-1]
    ends = {waypoint.step: waypoint for waypoint in run.path}
    steps = list(ends)
    step = steps[int(name) - 1] if name.isdecimal() and 1 <= int(name) <= len(steps) else name
    if step not in steps:
        numbered = ", ".join(f"{step} (or {i})" for i, step in enumerate(steps, 1))
        raise InputError(f"unknown state {name!r}; available: open, {numbered}, final")
    return ends[step]
