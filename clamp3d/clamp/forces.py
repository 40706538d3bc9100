"""The contact forces that hold a final state, per newton of bolt force: the multipliers of its active gaps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.section import Section
from clamp3d.geometry.pose import Array

if TYPE_CHECKING:
    from clamp3d.clamp.final_state import FinalState

HELD = "held on the bolt's axis"
"""What carries the sideways force that frictionless contacts leave, where the joints are said to have no play."""


@dataclass(frozen=True, slots=True, eq=False)
class Force:
    """A contact force: part a pushes part b.

    Attributes
    ----------
    a, b : str
        The two parts.
    feature : str
        What touches, as the section names it; `HELD` is no contact but an assumption.
    force : float
        Newton per newton of bolt force.
    point : ndarray (3,)
        Where it acts, in the world, mm.
    direction : ndarray (3,)
        Unit vector in which b is pushed, in the world.
    """

    a: PartName
    b: PartName
    feature: str
    force: float
    point: Array
    direction: Array


def contact_forces(section: Section, final: FinalState) -> tuple[Force, ...]:
    """The forces of a final state, those on the wires first; see `Force`.

    >>> from clamp3d.baselines.cas import Cas
    >>> from clamp3d.clamp.final_state import solve_final_state
    >>> from clamp3d.clamp.loader import load_clamp
    >>> section = Section(load_clamp(), Cas())
    >>> [(f.a, f.b, round(f.force, 3)) for f in contact_forces(section, solve_final_state(section))][:2]
    [('P1', 'P6', 0.541), ('P2', 'P6', 0.541)]
    """
    q, gaps = final.q, final.gaps
    forces, total = [], 0.0
    for k in np.flatnonzero(final.multipliers):
        (a, b), push = gaps.pair[k], float(final.multipliers[k])
        forces.append(world_force(q, a, b, gaps.feature[k], push * gaps.normal[k], gaps.point[k]))
        total += push * gaps.normal[k, 0] * ((b == "P2") - (a == "P2"))
    if not section.clamp.joints.saddle and abs(total) > 1e-9:
        down = section.down_splint(q)
        forces.append(world_force(q, "P4", "P2", HELD, np.array([-total, 0.0]), (down.x, down.y)))
    return tuple(forces)


def world_force(q: Array, a: PartName, b: PartName, feature: str, push: Array, at: Any) -> Force:
    """A force from what the section knows: ``push`` (2,) and ``at`` (2,) in P1's section frame at the state ``q``."""
    size = float(np.hypot(*push))
    point = np.array([at[0] - q[0], 0.0, q[1] - at[1]])
    return Force(a, b, feature, size, point, np.array([push[0], 0.0, -push[1]]) / size)
