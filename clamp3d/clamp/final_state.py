"""The exact final state: least distance between the splints along the bolt, no overlap, both wires free to settle.

The closing path (`closing`) leads to it; Newton's method on the Karush-Kuhn-Tucker conditions takes it to rounding; and
the answer is then proven to be a local minimum: feasible, stationary with multipliers >= 0, and curved upwards along
every motion that keeps the active contacts closed (second-order condition, [Nocedal & Wright, Numerical Optimization,
2nd ed., section 12.5]). What cannot be proven is an error, never an answer. `equilibria` finds the other local minima.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from clamp3d.clamp.closing import CLOSING, HELD, STILL, STRIDE, OnContact, descend, open_start
from clamp3d.clamp.curvature import LEVEL, lagrangian_hessian, least_curvature, rounding_of_normals, touched
from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.section import SIZE, WIRES, D, Gaps, S, Section, U
from clamp3d.errors import InputError, SolverError
from clamp3d.geometry.pose import Array

TOLERANCE = 1e-9
"""Largest violated gap and largest optimality residual of a proven answer, in mm."""

_ACTIVE = 1e-6
_ACTIVE_TRIES = ((1e-6, 0.0), (1e-8, 0.0), (1e-10, 0.0), (1e-4, 0.0), (1e-6, 0.1))
"""Gaps in the active set, mm: a wire that nearly fills its groove is within the first of contacts it lacks. And the
least multiplier that counts on the way: of arc and lip, 1e-8 mm apart, both seem to carry while the arc's normal is
off."""
_ATTEMPTS = 4
_PERTURBATION = 1.5e-3
"""How far a restart begins from the last end, in parts of the down splint's half width."""
_SETTLING = 300
"""Steps in which a loose wire falls; it stays where it was if that is not enough."""
_ONE_CONTACT = 3e-5
"""Gaps of two parts whose derivatives differ by less are one contact: face and lip where the one goes over into the
other. A wire of 1 mm that is `TOLERANCE` off the face has turned by so much about the lip."""
_NO_MULTIPLIER = 1e-9
"""Multipliers below are rounding of the least squares: a wire they hold is not held."""


@dataclass(frozen=True, slots=True)
class FinalState:
    """An equilibrium of the section, with its proof.

    Attributes
    ----------
    q : ndarray (10,)
        The state as in `section`.
    start : ndarray (10,)
        Where its closing began.
    held : ndarray (10,)
        Where the path was when the down splint, closed by hand, came to rest: before the nut takes up the joints' play.
    gaps : Gaps
        All gaps at q.
    multipliers : ndarray (k,)
        Karush-Kuhn-Tucker multipliers of the gaps: contact forces as parts of the bolt force.
    violation : float
        Deepest overlap, mm.
    optimality : float
        Largest of the last Newton step, the stationarity residual over 1 mm (less what rounding turns normals by, see
        `rounding_of_normals`) and the complementarity ``sum(multiplier * |gap|)``; mm.
    loose : tuple of str
        Wires that no contact force holds.
    curvature : float
        Least second derivative of the distance along motions that keep the strongly active gaps closed and overlap
        nothing, 1/mm: > 0 proves a strict minimum, 0 a level one; inf if there is no such motion.
    """

    q: Array
    start: Array
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
        rows = zip(self.gaps.pair, self.gaps.feature, self.multipliers, strict=True)
        return tuple((pair, feature) for pair, feature, multiplier in rows if multiplier > 0.0)


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
    found = _best(section, end, start, held)
    for attempt in range(_ATTEMPTS):
        if _proven(found):
            break
        # Degenerate active set or saddle point: let it slide off, or restart from a perturbed, slightly opened state.
        q = end if attempt == 0 else _perturb(section, found.q, attempt)
        again = _best(section, descend(section, q, stride=stride, at_rest=STILL), start, held)
        if _proven(again) or _kkt_residual(again) < _kkt_residual(found):
            found = again
    if _proven(found):
        return found
    raise SolverError(
        f"final state not proven: largest violated gap {found.violation:.3g} mm, optimality {found.optimality:.3g} mm, "
        f"both must be <= {TOLERANCE:g} mm; curvature {found.curvature:.3g} 1/mm, must be >= 0"
    )


def _best(section: Section, q: Array, start: Array, held: Array) -> FinalState:
    """The state at the end of a path, with the active set that proves it best."""
    best = _certify(section, q, start, held, *_ACTIVE_TRIES[0])
    for tried in _ACTIVE_TRIES[1:]:
        if _kkt_residual(best) <= TOLERANCE:
            break
        best = min(best, _certify(section, q, start, held, *tried), key=_kkt_residual)
    return best


def _proven(state: FinalState) -> bool:
    """Feasible, stationary, and no saddle."""
    return _kkt_residual(state) <= TOLERANCE and state.curvature >= -LEVEL


def _kkt_residual(state: FinalState) -> float:
    """Largest residual of the optimality conditions, mm; infinite if it is not a number."""
    residual = max(state.violation, state.optimality)
    return residual if residual == residual else np.inf


def _certify(section: Section, q: Array, start: Array, held: Array, active: float, least: float) -> FinalState:
    """Polish a state whose active set are the gaps within ``active`` mm, settle loose wires, and measure the proof."""
    q, optimality = _polish(section, q, active, least)
    gaps = section.gaps(q)
    multipliers = _multipliers(section, gaps, active)
    loose = _not_held(gaps, multipliers)
    for wire in loose:
        q = _settle_loose(section, q, wire)
    if loose:
        gaps = section.gaps(q)
    unbalanced = (CLOSING - multipliers @ gaps.gradient)[list(section.free)]
    residual = max(0.0, float(np.abs(unbalanced).max()) - rounding_of_normals(section, q))
    violation = max(0.0, -float(gaps.value.min()))
    complementarity = float(multipliers @ np.abs(gaps.value))  # by this much the distance is off
    curvature = least_curvature(section, q, gaps, multipliers, TOLERANCE)
    optimality = max(optimality, residual, complementarity)
    if section.free == HELD:  # nothing moves while the nut turns
        held = q
    return FinalState(q, start, held, gaps, multipliers, violation, optimality, loose, curvature)


def _perturb(section: Section, q: Array, attempt: int) -> Array:
    """An open state near q, another one for each attempt."""
    rng = np.random.default_rng(attempt)
    new = q.copy()
    step = _PERTURBATION * section.lever
    new[:4] += rng.uniform(-step, step, 4)
    new[S] += rng.uniform(-step, step)
    for _ in range(200):
        gaps = section.gaps(new)
        k = int(np.argmin(gaps.value))
        if gaps.value[k] >= 0.0:
            break
        new[D] += step
        if gaps.pair[k][0] == "P1":  # opening does not help the wire out of the up splint
            new[:4] -= gaps.value[k] * gaps.gradient[k, :4]
        elif gaps.pair[k] == ("P2", "P3"):  # nor the down splint out of the saddle
            new[U] -= gaps.value[k]
    return new


def _not_held(gaps: Gaps, multipliers: Array) -> tuple[PartName, ...]:
    """The wires that no contact force holds."""
    held = {wire for pair, force in zip(gaps.pair, multipliers, strict=True) if force > 0.0 for wire in pair}
    return tuple(wire for wire in WIRES if wire not in held)


def _settle_loose(section: Section, q: Array, wire: PartName) -> Array:
    """Where gravity leaves a loose wire: the clamp hangs on the line, the jumper lies in the down splint."""
    if wire in section.escaped(q):
        return q
    x, y = 2 * WIRES.index(wire), 2 * WIRES.index(wire) + 1
    goal = np.zeros(SIZE)
    goal[y] = 1.0 if wire == "P6" else -1.0
    try:
        fallen = descend(section, q, goal, free=(x, y), most=_SETTLING)
    except SolverError:
        return q
    depth = np.inf
    for _ in range(50):  # out of the overlap that the descent tolerates, not into what else is as near
        gaps = section.wire_gaps(fallen, wire)
        depth = -float(gaps.value.min())
        if depth <= 0.0:
            return fallen
        near = gaps.value < depth
        fallen = fallen.copy()
        fallen[[x, y]] -= np.linalg.lstsq(gaps.gradient[near][:, [x, y]], gaps.value[near])[0]
    return fallen if depth <= TOLERANCE else q


def _multipliers(section: Section, gaps: Gaps, active: float) -> Array:
    """Multipliers >= 0 (k,) of the gaps within ``active`` mm, by non-negative least squares; 0 of the others.

    Of gaps that are one contact the nearest counts: a lip ends the arc and the face beside it, and is in both. Of equal
    ones it is the face's, for the arc's jumps to the other lip when that comes nearer, and its derivatives with it.
    A lip beside a face that the wire lies on holds nothing back: the wire rolls over it.
    """
    in_set, free = np.abs(gaps.value) <= active, list(section.free)
    flat = [name.replace("lip", "flat") for name in gaps.feature]
    for i, j in itertools.combinations(np.flatnonzero(in_set), 2):
        if gaps.pair[i] != gaps.pair[j]:
            continue
        beside = flat[i] == flat[j] and flat[i].startswith("flat")
        if beside or np.abs(gaps.gradient[i] - gaps.gradient[j]).max() <= _ONE_CONTACT:
            in_set[i if gaps.value[i] >= gaps.value[j] else j] = False
    multipliers = np.zeros(len(gaps.value))
    if in_set.any():
        multipliers[in_set] = nnls(gaps.gradient[in_set][:, free].T, CLOSING[free])[0]
    multipliers[multipliers < _NO_MULTIPLIER] = 0.0
    return multipliers


def _polish(section: Section, q: Array, active: float, least: float) -> tuple[Array, float]:
    """Newton's method on stationarity and the active gaps together; returns the state and its last step in mm.

    A gap that a step has closed too far joins the active set; multipliers below ``least`` do not count.
    """
    step = np.inf
    for _ in range(20):
        gaps = section.gaps(q)
        multipliers = _multipliers(section, gaps, active)
        multipliers[multipliers < least] = 0.0
        overlapping = (gaps.value < -TOLERANCE) & (gaps.value >= -active)
        rows = np.flatnonzero((multipliers > 0.0) | overlapping)
        free = touched(section, gaps, rows)
        if step > _ACTIVE:  # nearer it does not change any more
            hessian = lagrangian_hessian(section, q, gaps, multipliers)
        A = gaps.gradient[rows]
        k, n = len(rows), len(free)
        kkt = np.block([[hessian[np.ix_(free, free)], -A[:, free].T], [A[:, free], np.zeros((k, k))]])
        rhs = -np.concatenate([(CLOSING - multipliers[rows] @ A)[free], gaps.value[rows]])
        move = np.zeros(SIZE)
        move[free] = np.linalg.lstsq(kkt, rhs, 1e-12)[0][:n]
        new = float(np.abs(move).max())
        if not new < step:
            break
        q, step = q + move, new
    return q, step
