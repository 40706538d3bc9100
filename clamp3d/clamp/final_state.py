"""The exact final state: least distance between the splints along the bolt, no overlap, both wires free to settle.

scipy's SLSQP finds it from closed-form gradients; Newton's method on the Karush-Kuhn-Tucker conditions takes it to
rounding; and the answer is then proven to be a local minimum: feasible, stationary with multipliers >= 0, and curved
upwards along every motion that keeps the active contacts closed (second-order condition, [Nocedal & Wright, Numerical
Optimization, 2nd ed., section 12.5]). What cannot be proven is an error, never an answer. `equilibria` finds the other
local minima.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize, nnls

from clamp3d.clamp.curvature import LEVEL, lagrangian_hessian, least_curvature, rounding_of_normals
from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.section import WIRES, D, Gaps, S, Section, remembered
from clamp3d.core.pose import Array
from clamp3d.errors import InputError, SolverError

TOLERANCE = 1e-9
"""Largest violated gap and largest optimality residual of a proven answer, in mm."""

_ACTIVE = 1e-6
_ACTIVE_TRIES = (1e-6, 1e-8, 1e-10)
"""Gaps in the active set, mm: a wire that nearly fills its groove is within the first of contacts it lacks."""
_ATTEMPTS = 3
TRUST_RADIUS = 0.06
"""How far one descent may move any coordinate, in parts of the down splint's half width: gaps are far from linear
beyond, and wires must not jump out."""
_LEAST_RADIUS, _PERTURBATION = 1.5e-5, 1.5e-3
"""Least trust radius, and how far a restart begins from the last end, in the same parts."""
_NO_MULTIPLIER = 1e-9
"""Multipliers below are rounding of the least squares: a wire they hold is not held."""
_MAX_DESCENTS = 1000
"""A closing of the reference clamp from fully open takes about ten."""
_CLOSING = np.eye(6)[D]


@dataclass(frozen=True, slots=True)
class FinalState:
    """An equilibrium of the section, with its proof.

    Attributes
    ----------
    q : ndarray (6,)
        The state as in `section`.
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


def solve_final_state(section: Section, start: Array | None = None, trust_radius: float = TRUST_RADIUS) -> FinalState:
    """Close the clamp from ``start`` (an open state; by default straight and fully open).

    Parameters
    ----------
    section : Section
    start : ndarray (6,), optional
        Where closing begins.
    trust_radius : float
        Longest move of a descent in parts of the down splint's half width: a small one keeps to the nearest minimum.

    Raises
    ------
    InputError
        If the start overlaps.
    SolverError
        If feasibility or optimality cannot be shown to `TOLERANCE`.
    """
    q = section.open_state(section.open_distance()) if start is None else np.array(start, dtype=np.float64)
    gaps = section.gaps(q)
    k = int(np.argmin(gaps.value))
    if gaps.value[k] < -_ACTIVE:
        a, b = gaps.pair[k]
        raise InputError(f"the start must be an open state: {a} and {b} overlap by {-gaps.value[k]:.4g} mm")
    found = _solve_from(section, q, trust_radius)
    for attempt in range(_ATTEMPTS):
        if _proven(found):
            break
        # Degenerate active set or saddle point: restart from a perturbed, slightly opened state.
        again = _solve_from(section, _perturb(section, found.q, attempt), trust_radius)
        if _proven(again) or _kkt_residual(again) < _kkt_residual(found):
            found = again
    if _proven(found):
        return found
    raise SolverError(
        f"final state not proven: largest violated gap {found.violation:.3g} mm, optimality {found.optimality:.3g} mm, "
        f"both must be <= {TOLERANCE:g} mm; curvature {found.curvature:.3g} 1/mm, must be >= 0"
    )


def _solve_from(section: Section, q: Array, trust_radius: float) -> FinalState:
    """Where closing from q ends, with the active set that proves it best."""
    q = _slsqp(section, q, _CLOSING, trust_radius=trust_radius)
    best = _certify(section, q, _ACTIVE_TRIES[0])
    for active in _ACTIVE_TRIES[1:]:
        if _kkt_residual(best) <= TOLERANCE:
            break
        best = min(best, _certify(section, q, active), key=_kkt_residual)
    return best


def _proven(state: FinalState) -> bool:
    """Feasible, stationary, and no saddle."""
    return _kkt_residual(state) <= TOLERANCE and state.curvature >= -LEVEL


def _kkt_residual(state: FinalState) -> float:
    """Largest residual of the optimality conditions, mm; infinite if it is not a number."""
    residual = max(state.violation, state.optimality)
    return residual if residual == residual else np.inf


def _certify(section: Section, q: Array, active: float) -> FinalState:
    """Polish a state whose active set are the gaps within ``active`` mm, settle loose wires, and measure the proof."""
    q, optimality = _polish(section, q, active)
    gaps = section.gaps(q)
    multipliers = _multipliers(gaps, active)
    loose = _not_held(gaps, multipliers)
    for wire in loose:
        q = _settle_loose(section, q, wire)
    if loose:
        gaps = section.gaps(q)
    residual = max(0.0, float(np.abs(_CLOSING - multipliers @ gaps.gradient).max()) - rounding_of_normals(section, q))
    violation = max(0.0, -float(gaps.value.min()))
    complementarity = float(multipliers @ np.abs(gaps.value))  # by this much the distance is off
    curvature = least_curvature(section, q, gaps, multipliers, TOLERANCE)
    optimality = max(optimality, residual, complementarity)
    return FinalState(q, gaps, multipliers, violation, optimality, loose, curvature)


def _perturb(section: Section, q: Array, attempt: int) -> Array:
    """An open state near q, another one for each attempt."""
    rng = np.random.default_rng(attempt)
    new = q.copy()
    step = _PERTURBATION * section.lever
    new[:4] += rng.uniform(-step, step, 4)
    new[S] += rng.uniform(-step, step)
    low, high = np.array(section.bounds()).T
    limit = section.lever * section.clamp.down_splint.max_tilt
    new = np.clip(new, low, high)
    new[S] = min(max(new[S], -limit), limit)
    for _ in range(200):
        gaps = section.gaps(new)
        k = int(np.argmin(gaps.value))
        if gaps.value[k] >= 0.0:
            break
        new[D] += step
        if gaps.pair[k][0] == "P1":  # opening does not help the wire out of the up splint
            new[:4] -= gaps.value[k] * gaps.gradient[k, :4]
    return new


def _not_held(gaps: Gaps, multipliers: Array) -> tuple[PartName, ...]:
    """The wires that no contact force holds."""
    held = {wire for pair, force in zip(gaps.pair, multipliers, strict=True) if force > 0.0 for wire in pair}
    return tuple(wire for wire in WIRES if wire not in held)


def _settle_loose(section: Section, q: Array, wire: PartName) -> Array:
    """Where gravity leaves a loose wire: the clamp hangs on the line, the jumper lies in the down splint."""
    x, y = 2 * WIRES.index(wire), 2 * WIRES.index(wire) + 1
    goal = np.zeros(6)
    goal[y] = 1.0 if wire == "P6" else -1.0
    fallen = _slsqp(section, q, goal, free=(x, y))
    for _ in range(50):  # out of the overlap that the descent tolerates, not into what else is as near
        gaps = section.wire_gaps(fallen, wire)
        depth = -float(gaps.value.min())
        if depth <= 0.0:
            return fallen
        near = gaps.value < depth
        fallen = fallen.copy()
        fallen[[x, y]] -= np.linalg.lstsq(gaps.gradient[near][:, [x, y]], gaps.value[near], rcond=None)[0]
    return fallen if depth <= TOLERANCE else q


def _slsqp(
    section: Section,
    start: Array,
    goal: Array,
    free: tuple[int, ...] = tuple(range(6)),
    trust_radius: float = TRUST_RADIUS,
) -> Array:
    """Least goal . q with no gap negative, by SLSQP in a trust region; only the coordinates ``free`` move."""
    index = list(free)
    low, high = np.array(section.bounds()).T
    gaps = remembered(section.gaps)

    def at(x: Array) -> Array:
        new = q.copy()
        new[index] = x
        return new

    q, radius = start, trust_radius * section.lever
    for _ in range(_MAX_DESCENTS):
        if radius <= _LEAST_RADIUS * section.lever:
            return q
        # A wire that is out of its mouth already may come back, not go further.
        near = np.maximum(np.minimum(low, q), q - radius)[index], np.minimum(np.maximum(high, q), q + radius)[index]
        found = minimize(
            lambda x: goal[index] @ x,
            q[index],
            jac=lambda x: goal[index],
            bounds=np.column_stack(near),
            constraints={
                "type": "ineq",
                "fun": lambda x: gaps(at(x)).value,
                "jac": lambda x: gaps(at(x)).gradient[:, index],
            },
            method="SLSQP",
            options={"maxiter": 100, "ftol": 1e-13},
        )
        new = at(np.clip(found.x, *near))
        if gaps(new).value.min() < -_ACTIVE or goal @ new > goal @ q:
            radius *= 0.25  # step rejected: shrink the trust region
            continue
        advanced, moved, q = float(goal @ (q - new)), np.abs(new - q).max(), new
        if advanced < _ACTIVE or moved < 0.5 * radius:
            return q
    raise SolverError(
        f"closing takes more than {_MAX_DESCENTS} descents of {radius:.3g} mm: the down splint's width "
        f"({2.0 * section.lever:.3g} mm) is too small beside the way it closes"
    )


def _multipliers(gaps: Gaps, active: float) -> Array:
    """Multipliers >= 0 (k,) of the gaps within ``active`` mm, by non-negative least squares; 0 of the others.

    A lip ends the arc and the face beside it and is in both gaps: the face's counts, for the arc's jumps to the other
    lip when that comes nearer, and its derivatives with it.
    """
    in_set = np.abs(gaps.value) <= active
    for i, j in itertools.combinations(np.flatnonzero(in_set), 2):
        if gaps.value[i] == gaps.value[j] and (gaps.pair[i], gaps.feature[i]) == (gaps.pair[j], gaps.feature[j]):
            in_set[i] = False
    multipliers = np.zeros(len(gaps.value))
    if in_set.any():
        multipliers[in_set] = nnls(gaps.gradient[in_set].T, _CLOSING)[0]
    multipliers[multipliers < _NO_MULTIPLIER] = 0.0
    return multipliers


def _polish(section: Section, q: Array, active: float) -> tuple[Array, float]:
    """Newton's method on stationarity and the active gaps together; returns the state and its last step in mm.

    A gap that a step has closed too far joins the active set.
    """
    step = np.inf
    for _ in range(20):
        gaps = section.gaps(q)
        multipliers = _multipliers(gaps, active)
        overlapping = (gaps.value < -TOLERANCE) & (gaps.value >= -active)
        rows = np.flatnonzero((multipliers > 0.0) | overlapping)
        free = np.flatnonzero(np.abs(gaps.gradient[rows]).max(axis=0, initial=0.0) > 0.0)
        hessian = lagrangian_hessian(section, q, rows, multipliers[rows])
        A = gaps.gradient[rows]
        k, n = len(rows), len(free)
        kkt = np.block([[hessian[np.ix_(free, free)], -A[:, free].T], [A[:, free], np.zeros((k, k))]])
        rhs = -np.concatenate([(_CLOSING - multipliers[rows] @ A)[free], gaps.value[rows]])
        move = np.zeros(6)
        move[free] = np.linalg.lstsq(kkt, rhs, rcond=1e-12)[0][:n]
        new = float(np.abs(move).max())
        if not new < step:
            break
        q, step = q + move, new
    return q, step
