"""The exact final state: least distance between the splints along the bolt, no overlap, both wires free to settle.

The closing path (`closing`) leads to it; Newton's method on the Karush-Kuhn-Tucker conditions takes it to rounding; and
the answer is then proven to be a local minimum: feasible, stationary with multipliers >= 0, and curved upwards along
every motion that keeps the active contacts closed (second-order condition, [Nocedal & Wright, Numerical Optimization,
2nd ed., section 12.5]). What cannot be proven is an error, never an answer. `equilibria` finds the other local minima.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import nnls

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.closing import CLOSING, STILL, STRIDE, OnContact, descend, open_start
from clamp3d.clamp.dimensions import Clamp, Pair, PartName
from clamp3d.clamp.result import HELD_ON_AXIS, Force
from clamp3d.clamp.section import HELD, SIZE, WIRES, D, Gaps, S, Section, U
from clamp3d.clamp.status import ClosingStatus, closing_status
from clamp3d.errors import InputError, SolverError
from clamp3d.geometry.pose import Array

TOLERANCE = 1e-9
"""Largest violated gap and largest optimality residual of a proven answer, in mm."""
LEVEL = 1e-6
"""Curvature in 1/mm that counts as none; chosen."""

_ACTIVE = 1e-6  # mm: a start may overlap as much as parts that touch
_ACTIVE_TRIES = (1e-6, 1e-8, 1e-10, 1e-4)
"""Gaps in the active set, mm: a wire that nearly fills its groove is within the first of contacts it lacks."""
_ATTEMPTS = 4  # chosen: each costs as much as the closing
_PERTURBATION = 1.5e-3
"""How far a restart begins from the last end, in parts of the down splint's half width: a part of a stride."""
_ONE_CONTACT = 3e-5
"""Gaps of two parts whose derivatives differ by less are one contact: face and lip where the one goes over into the
other. A wire of 1 mm that is `TOLERANCE` off the face has turned by so much about the lip."""
_NO_MULTIPLIER = 1e-9
"""Multipliers below are rounding of the least squares: a wire they hold is not held."""
_TURNED = 1e-5
"""Largest residual that may come from rounded normals: the distance is off by its square times some 10 mm, 1e-9 mm."""


@dataclass(frozen=True, slots=True)
class FinalState:
    """An equilibrium of the section, with its proof.

    Attributes
    ----------
    q : ndarray (10,)
        The state as in `section`.
    held : ndarray (10,)
        Where the path was when the down splint, closed by hand, came to rest: before the nut takes up the joints' play.
    gaps : Gaps
        All gaps at q.
    multipliers : ndarray (k,)
        Karush-Kuhn-Tucker multipliers of the gaps: contact forces as parts of the bolt force.
    violation : float
        Deepest overlap, mm.
    optimality : float
        Largest of the last Newton step, the stationarity residual over 1 mm (less what rounding turns normals by) and
        the complementarity ``sum(multiplier * |gap|)``; mm.
    loose : tuple of str
        Wires that no contact force holds.
    curvature : float
        Least second derivative of the distance along motions that keep the strongly active gaps closed and overlap
        nothing, 1/mm: > 0 proves a strict minimum, 0 a level one; inf if there is no such motion.
    """

    q: Array
    held: Array
    gaps: Gaps
    multipliers: Array
    violation: float
    optimality: float
    loose: tuple[PartName, ...]
    curvature: float

    @property
    def active(self) -> tuple[tuple[Pair, str], ...]:
        """Pair and feature of each strongly active gap: what holds the state."""
        return tuple((self.gaps.pair[k], self.gaps.feature[k]) for k in np.flatnonzero(self.multipliers))

    @property
    def residual(self) -> float:
        """Largest residual of the optimality conditions, mm; infinite if it is not a number."""
        return float(np.nan_to_num(np.maximum(self.violation, self.optimality), nan=np.inf))

    @property
    def is_proven(self) -> bool:
        """Feasible, stationary, and no saddle."""
        return self.residual <= TOLERANCE and self.curvature >= -LEVEL

    def forces(self, section: Section) -> tuple[Force, ...]:
        """The contact forces that hold the state, those on the wires first: the multipliers of its active gaps.

        >>> from clamp3d.clamp.loader import load_clamp
        >>> section = Section(load_clamp(), Cas())
        >>> [(f.a, f.b, round(f.force, 3)) for f in solve_final_state(section).forces(section)][:2]
        [('P1', 'P6', 0.541), ('P2', 'P6', 0.541)]
        """
        q, gaps, forces, total = self.q, self.gaps, [], 0.0
        for k in np.flatnonzero(self.multipliers):
            (a, b), push = gaps.pair[k], self.multipliers[k] * gaps.normal[k]
            forces.append(world_force(q, a, b, gaps.feature[k], push, gaps.point[k]))
            total += float(push[0]) * ((b == "P2") - (a == "P2"))
        if not section.clamp.joints.saddle and abs(total) > 1e-9:
            down = section.down_splint(q)
            forces.append(world_force(q, "P4", "P2", HELD_ON_AXIS, np.array([-total, 0.0]), (down.x, down.y)))
        return tuple(forces)


def world_force(q: Array, a: PartName, b: PartName, feature: str, push: Array, at: Any) -> Force:
    """A force from what the section knows: ``push`` (2,) and ``at`` (2,) in P1's section frame at the state ``q``."""
    size = float(np.hypot(*push))
    point = np.array([at[0] - q[0], 0.0, q[1] - at[1]])
    return Force(a, b, feature, size, point, np.array([push[0], 0.0, -push[1]]) / size)


def solve_final_state(
    section: Section, start: Array | None = None, *, stride: float = STRIDE, on_contact: OnContact | None = None
) -> FinalState:
    """Close the clamp from ``start`` along its path, and prove where it ends: every command's way to a final state.

    Parameters
    ----------
    section : Section
    start : ndarray (10,), optional
        Where closing begins; by default `open_start`, which every command begins from.
    stride : float
        Longest move of a step in parts of the down splint's half width.
    on_contact : callable, optional
        Called with each pair of parts and the state (10,) when the pair first carries force.

    Raises
    ------
    InputError
        If the start overlaps.
    SolverError
        If feasibility or optimality cannot be shown to `TOLERANCE`.
    """
    start = open_start(section) if start is None else np.array(start, dtype=np.float64)
    gaps = section.gaps(start)
    k = int(np.argmin(gaps.value))
    if gaps.value[k] < -_ACTIVE:
        a, b = gaps.pair[k]
        raise InputError(f"the start must be an open state: {a} and {b} overlap by {-gaps.value[k]:.4g} mm")
    held = end = descend(section, start, free=HELD, stride=stride, on_contact=on_contact)
    if section.free != HELD:
        end = descend(section, held, stride=stride, on_contact=on_contact)
    final = _best(section, end, held)
    for attempt in range(_ATTEMPTS):
        if final.is_proven:
            return final
        # Degenerate active set or saddle point: let it slide off, or restart from a perturbed, slightly opened state.
        q = end if attempt == 0 else _perturb(section, final.q, attempt)
        again = _best(section, descend(section, q, stride=stride, at_rest=STILL), held)
        if again.is_proven or again.residual < final.residual:
            final = again
    if final.is_proven:
        return final
    raise SolverError(
        f"final state not proven: largest violated gap {final.violation:.3g} mm, optimality {final.optimality:.3g} mm, "
        f"both must be <= {TOLERANCE:g} mm; curvature {final.curvature:.3g} 1/mm, must be >= 0"
    )


def closed(clamp: Clamp) -> tuple[Section, FinalState, ClosingStatus]:
    """A clamp closed with its exact arcs: its section, the proven final state, and what that has come to."""
    section = Section(clamp, Cas())
    final = solve_final_state(section)
    return section, final, closing_status(section, final)


def open_up(section: Section, q: Array, step: float) -> Array | None:
    """The state ``q`` opened in moves of ``step`` mm until nothing overlaps; None if that is not near."""
    q = q.copy()
    for _ in range(200):
        gaps = section.gaps(q)
        k = int(np.argmin(gaps.value))
        if gaps.value[k] >= -TOLERANCE:
            return q
        q[D] += step
        if gaps.pair[k][0] == "P1":  # opening does not help the wire out of the up splint
            q[:4] -= gaps.value[k] * gaps.gradient[k, :4]
        elif gaps.pair[k] == ("P2", "P3"):  # nor the down splint out of the saddle
            q[U] -= gaps.value[k]
    return None


def _best(section: Section, q: Array, held: Array) -> FinalState:
    """The state at the end of a path, with the active set that proves it best."""
    states: list[FinalState] = []
    for active in _ACTIVE_TRIES:
        states.append(_certify(section, q, held, active))
        if states[-1].residual <= TOLERANCE:
            break
    return min(states, key=lambda state: state.residual)


def _certify(section: Section, q: Array, held: Array, active: float) -> FinalState:
    """Polish a state whose active set are the gaps within ``active`` mm, settle loose wires, and measure the proof."""
    q, step = _polish(section, q, active)
    gaps = section.gaps(q)
    multipliers = _multipliers(section, gaps, active)
    bearing = {part for k in np.flatnonzero(multipliers) for part in gaps.pair[k]}
    loose = tuple(wire for wire in WIRES if wire not in bearing)
    for wire in loose:
        q = _settle_loose(section, q, wire)
    if loose:
        gaps = section.gaps(q)
    unbalanced = (CLOSING - multipliers @ gaps.gradient)[list(section.free)]
    # A wire that fills its groove turns its normal with the rounding of its place.
    turned = min(_TURNED, 4.0 * float(np.spacing(np.abs(q).max())) / max(section.least_slack, 1e-300))
    residual = float(np.abs(unbalanced).max()) - turned
    complementarity = float(multipliers @ np.abs(gaps.value))  # by this much the distance is off
    return FinalState(
        q=q,
        held=q if section.free == HELD else held,  # nothing moves while the nut turns
        gaps=gaps,
        multipliers=multipliers,
        violation=float(np.maximum(0.0, -gaps.value.min())),
        optimality=float(np.max([step, residual, complementarity])),
        loose=loose,
        curvature=_least_curvature(section, q, gaps, multipliers),
    )


def _perturb(section: Section, q: Array, attempt: int) -> Array:
    """An open state near q, another one for each attempt."""
    rng, step, new = np.random.default_rng(attempt), _PERTURBATION * section.lever, q.copy()
    new[[0, 1, 2, 3, S]] += rng.uniform(-step, step, 5)
    opened = open_up(section, new, step)
    return q if opened is None else opened


def _settle_loose(section: Section, q: Array, wire: PartName) -> Array:
    """Where gravity leaves a loose wire: the clamp hangs on the line, the jumper lies in the down splint."""
    if wire in section.escaped(q):
        return q
    y = 2 * WIRES.index(wire) + 1
    try:
        fallen = descend(section, q, np.eye(SIZE)[y] * (1.0 if wire == "P6" else -1.0), free=(y - 1, y))
    except SolverError:
        return q
    return fallen if section.wire_gaps(fallen, wire).value.min() >= -TOLERANCE else q


def _multipliers(section: Section, gaps: Gaps, active: float) -> Array:
    """Multipliers >= 0 (k,) of the gaps within ``active`` mm, by non-negative least squares; 0 of the others.

    Of gaps that are one contact the nearest counts: a lip ends the arc and the face beside it, and is in both. Of equal
    ones it is the face's, for the arc's jumps to the other lip when that comes nearer, and its derivatives with it.
    A lip beside a face that the wire lies on holds nothing back: the wire rolls over it.
    """
    in_set, free = np.abs(gaps.value) <= active, list(section.free)
    flat = [name.replace("lip", "flat") for name in gaps.feature]
    for i, j in itertools.combinations(np.flatnonzero(in_set), 2):
        beside = flat[i] == flat[j] and flat[i].startswith("flat")
        alike = beside or np.abs(gaps.gradient[i] - gaps.gradient[j]).max() <= _ONE_CONTACT
        if gaps.pair[i] == gaps.pair[j] and alike:
            in_set[i if gaps.value[i] >= gaps.value[j] else j] = False
    multipliers = np.zeros(len(gaps.value))
    if in_set.any():
        multipliers[in_set] = nnls(gaps.gradient[in_set][:, free].T, CLOSING[free])[0]
    multipliers[multipliers < _NO_MULTIPLIER] = 0.0
    return multipliers


def _polish(section: Section, q: Array, active: float) -> tuple[Array, float]:
    """Newton's method on stationarity and the active gaps together; returns the state and its last step in mm.

    A gap that a step has closed too far joins the active set.
    """
    step, free = np.inf, np.array(section.free)
    for _ in range(20):
        gaps = section.gaps(q)
        multipliers = _multipliers(section, gaps, active)
        overlapping = (gaps.value < -TOLERANCE) & (gaps.value >= -active)
        rows = np.flatnonzero((multipliers > 0.0) | overlapping)
        A, k, n = gaps.gradient[rows], len(rows), len(free)
        hessian = -section.hessian(q, gaps, multipliers)[np.ix_(free, free)]
        kkt = np.block([[hessian, -A[:, free].T], [A[:, free], np.zeros((k, k))]])
        rhs = -np.concatenate([(CLOSING - multipliers[rows] @ A)[free], gaps.value[rows]])
        move = np.zeros(SIZE)
        move[free] = np.linalg.lstsq(kkt, rhs, 1e-12)[0][:n]
        new = float(np.abs(move).max())
        if not new < step:
            break
        q, step = q + move, new
    return q, step


def _least_curvature(section: Section, q: Array, gaps: Gaps, multipliers: Array) -> float:
    """Least second derivative of the Lagrangian by unit motions of the critical cone.

    The critical cone keeps the strongly active gaps (multiplier > 0) closed and lets no weakly active one (closed to
    `TOLERANCE`, multiplier 0) overlap. It has one or two dimensions here, and is looked at in random directions.
    """
    strong, free = np.flatnonzero(multipliers), np.array(section.free)
    free = free[gaps.gradient[np.ix_(strong, free)].any(axis=0)]  # what is neither held nor driven is level
    if not len(free):
        return np.inf
    _, sizes, rows = np.linalg.svd(gaps.gradient[np.ix_(strong, free)])
    tangent = rows[int((sizes > 1e-9).sum()) :]
    if not len(tangent):
        return np.inf
    reduced = tangent @ -section.hessian(q, gaps, multipliers)[np.ix_(free, free)] @ tangent.T
    least = float(np.linalg.eigvalsh(reduced)[0])
    weak = np.flatnonzero((np.abs(gaps.value) <= TOLERANCE) & (multipliers == 0.0))
    if least >= -LEVEL or not len(weak):
        return least
    motions = np.random.default_rng(0).normal(size=(20_000, len(tangent)))
    motions /= np.maximum(np.linalg.norm(motions, axis=1), 1e-9)[:, None]
    opens = gaps.gradient[np.ix_(weak, free)] @ tangent.T @ motions.T
    motions = motions[(opens >= -1e-7).all(axis=0)]
    return float(np.einsum("ni,ij,nj->n", motions, reduced, motions).min(initial=np.inf))
