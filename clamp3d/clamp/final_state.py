"""The exact final state: least distance between the splints along the bolt, no overlap, both wires free to settle.

scipy's SLSQP finds it from closed-form gradients; Newton's method on the Karush-Kuhn-Tucker conditions takes it to
rounding; and the answer is then proven to be a local minimum: feasible, stationary with multipliers >= 0, and curved
upwards along every motion that keeps the carrying contacts closed (second-order condition, [Nocedal & Wright, Numerical
Optimization, 2nd ed., section 12.5]). What cannot be proven is an error, never an answer. Other minima that other
starts lead to are found by `equilibria`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize, nnls

from clamp3d.clamp.curvature import LEVEL, lagrangian_hessian, least_curvature, normals_turned
from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.section import WIRES, D, Gaps, S, Section
from clamp3d.core.pose import Array
from clamp3d.errors import InputError, SolverError

TOLERANCE = 1e-9
"""Largest violated gap and largest optimality residual of a proven answer, in mm."""

_ACTIVE = 1e-6
_ACTIVE_TRIES = (1e-6, 1e-8, 1e-10)
"""Gaps that count as closed, mm: a wire that nearly fills its groove is within the first of contacts it lacks."""
_ATTEMPTS = 3
STRIDE = 0.06
"""How far one descent may move any coordinate, in parts of the down splint's half width: gaps are far from linear
beyond, and wires must not jump out."""
_SHORTEST, _ASIDE = 1.5e-5, 1.5e-3
"""Shortest stride, and how far a second try begins from the first one's end, in the same parts."""
_NO_FORCE = 1e-9
"""Multipliers below are rounding of the least squares: a wire they hold is not held."""
_MOST_STRIDES = 1000
"""A closing of the reference clamp from fully open takes about ten."""
_CLOSING = np.eye(6)[D]


@dataclass(frozen=True, slots=True)
class FinalState:
    """Where the section comes to rest, with the proof.

    ``q`` (6,) as in `section`; ``gaps`` at q; ``force`` (k,) how much of the closing each gap carries (KKT multipliers,
    1 = the whole bolt force); ``violation`` mm: deepest overlap; ``optimality`` mm: largest of the last Newton step,
    the stationarity residual over 1 mm, less what rounding turns normals by (`normals_turned`), and how far what
    carries is open, weighed by its force; ``loose``: wires that no contact force holds. ``curvature`` 1/mm: least
    second derivative of the distance by motions that keep what carries closed (and overlap nothing), > 0 proves a
    strict minimum, 0 a level one; inf if there is no such motion.
    """

    q: Array
    gaps: Gaps
    force: Array
    violation: float
    optimality: float
    loose: tuple[PartName, ...]
    curvature: float


def solve_final_state(section: Section, start: Array | None = None, stride: float = STRIDE) -> FinalState:
    """Close the clamp from ``start`` (an open state; by default straight and fully open).

    ``stride`` (parts of the down splint's half width) is the longest move of a descent: short ones keep to the nearest
    place of rest.
    Raises InputError if the start overlaps, SolverError when feasibility or optimality cannot be shown to `TOLERANCE`.
    """
    q = section.open_state(section.open_distance()) if start is None else np.array(start, dtype=np.float64)
    gaps = section.gaps(q)
    k = int(np.argmin(gaps.value))
    if gaps.value[k] < -_ACTIVE:
        a, b = gaps.pair[k]
        raise InputError(f"the start must be an open state: {a} and {b} overlap by {-gaps.value[k]:.4g} mm")
    found = _closed(section, q, stride)
    for attempt in range(_ATTEMPTS):
        if _proven(found):
            break
        # A place where the closed gaps hang together badly, or a saddle: open a little, aside, and close again.
        again = _closed(section, _aside(section, found.q, attempt), stride)
        if _proven(again) or _flaw(again) < _flaw(found):
            found = again
    if _proven(found):
        return found
    raise SolverError(
        f"final state not proven: largest violated gap {found.violation:.3g} mm, optimality {found.optimality:.3g} mm, "
        f"both must be <= {TOLERANCE:g} mm; curvature {found.curvature:.3g} 1/mm, must be >= 0"
    )


def _closed(section: Section, q: Array, stride: float) -> FinalState:
    """Where closing from q ends, with the set of closed gaps that proves it best."""
    q = _descend(section, q, _CLOSING, stride=stride)
    best = _finish(section, q, _ACTIVE_TRIES[0])
    for active in _ACTIVE_TRIES[1:]:
        if _flaw(best) <= TOLERANCE:
            break
        best = min(best, _finish(section, q, active), key=_flaw)
    return best


def _proven(state: FinalState) -> bool:
    """Feasible, stationary, and no saddle."""
    return _flaw(state) <= TOLERANCE and state.curvature >= -LEVEL


def _flaw(state: FinalState) -> float:
    """What is to be below `TOLERANCE`."""
    flaw = max(state.violation, state.optimality)
    return flaw if flaw == flaw else np.inf


def _finish(section: Section, q: Array, active: float) -> FinalState:
    """Polish a state whose closed gaps are those within ``active`` mm, let loose wires fall, and measure the proof."""
    q, optimality = _polish(section, q, active)
    gaps = section.gaps(q)
    force = _multipliers(gaps, active)
    loose = _without_force(gaps, force)
    for wire in loose:
        q = _rest(section, q, wire)
    if loose:
        gaps = section.gaps(q)
    residual = max(0.0, float(np.abs(_CLOSING - force @ gaps.gradient).max()) - normals_turned(section, q))
    violation = max(0.0, -float(gaps.value.min()))
    ajar = float(force @ np.abs(gaps.value))  # what carries must be closed: the distance is off by what it is open
    curvature = least_curvature(section, q, gaps, force, TOLERANCE)
    return FinalState(q, gaps, force, violation, max(optimality, residual, ajar), loose, curvature)


def _aside(section: Section, q: Array, attempt: int) -> Array:
    """An open state near q, another one for each attempt."""
    rng = np.random.default_rng(attempt)
    new = q.copy()
    step = _ASIDE * section.lever
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


def _without_force(gaps: Gaps, force: Array) -> tuple[PartName, ...]:
    """The wires that no force holds."""
    return tuple(w for w in WIRES if not any(w in pair and f > 0.0 for pair, f in zip(gaps.pair, force, strict=True)))


def _rest(section: Section, q: Array, wire: PartName) -> Array:
    """Where gravity leaves a loose wire: the clamp hangs on the line, the jumper lies in the down splint."""
    x, y = 2 * WIRES.index(wire), 2 * WIRES.index(wire) + 1
    goal = np.zeros(6)
    goal[y] = 1.0 if wire == "P6" else -1.0
    fallen = _descend(section, q, goal, free=(x, y))
    for _ in range(50):  # out of the overlap that the descent tolerates, not into what else is as near
        gaps = section.wire_gaps(fallen, wire)
        depth = -float(gaps.value.min())
        if depth <= 0.0:
            return fallen
        near = gaps.value < depth
        fallen = fallen.copy()
        fallen[[x, y]] -= np.linalg.lstsq(gaps.gradient[near][:, [x, y]], gaps.value[near], rcond=None)[0]
    return fallen if depth <= TOLERANCE else q


def _descend(
    section: Section, start: Array, goal: Array, free: tuple[int, ...] = tuple(range(6)), stride: float = STRIDE
) -> Array:
    """Least goal . q with no gap negative, by SLSQP; only the coordinates ``free`` move."""
    index = list(free)
    low, high = np.array(section.bounds()).T
    memo: dict[bytes, Gaps] = {}

    def gaps(q: Array) -> Gaps:
        key = q.tobytes()
        if key not in memo:
            memo.clear()
            memo[key] = section.gaps(q)
        return memo[key]

    def at(x: Array) -> Array:
        new = q.copy()
        new[index] = x
        return new

    q, stride, shortest = start, stride * section.lever, _SHORTEST * section.lever
    for _ in range(_MOST_STRIDES):
        if stride <= shortest:
            return q
        # A wire that is out of its mouth already may come back, not go further.
        near = np.maximum(np.minimum(low, q), q - stride)[index], np.minimum(np.maximum(high, q), q + stride)[index]
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
            stride *= 0.25  # lost its way: the linearised gaps of so long a stride were no guide
            continue
        advanced, moved, q = float(goal @ (q - new)), np.abs(new - q).max(), new
        if advanced < _ACTIVE or moved < 0.5 * stride:
            return q
    raise SolverError(
        f"closing takes more than {_MOST_STRIDES} strides of {stride:.3g} mm: the down splint's width "
        f"({2.0 * section.lever:.3g} mm) is too small beside the way it closes"
    )


def _multipliers(gaps: Gaps, active: float) -> Array:
    """Multipliers >= 0 (k,) of the gaps within ``active`` mm, by non-negative least squares; 0 of the others.

    A lip ends the arc and the face beside it and is in both gaps: the face's counts, for the arc's jumps to the other
    lip when that comes nearer, and its derivatives with it.
    """
    closed = np.abs(gaps.value) <= active
    for i, j in itertools.combinations(np.flatnonzero(closed), 2):
        if gaps.value[i] == gaps.value[j] and (gaps.pair[i], gaps.feature[i]) == (gaps.pair[j], gaps.feature[j]):
            closed[i] = False
    force = np.zeros(len(gaps.value))
    if closed.any():
        force[closed] = nnls(gaps.gradient[closed].T, _CLOSING)[0]
    force[force < _NO_FORCE] = 0.0
    return force


def _polish(section: Section, q: Array, active: float) -> tuple[Array, float]:
    """Newton's method on stationarity and closed gaps together; returns the state and its last step in mm.

    A gap that a step has closed too far joins the carrying ones.
    """
    step = np.inf
    for _ in range(20):
        gaps = section.gaps(q)
        force = _multipliers(gaps, active)
        overlapping = (gaps.value < -TOLERANCE) & (gaps.value >= -active)
        carrying = np.flatnonzero((force > 0.0) | overlapping)
        free = np.flatnonzero(np.abs(gaps.gradient[carrying]).max(axis=0, initial=0.0) > 0.0)
        hessian = lagrangian_hessian(section, q, carrying, force[carrying])
        A = gaps.gradient[carrying]
        k, n = len(carrying), len(free)
        kkt = np.block([[hessian[np.ix_(free, free)], -A[:, free].T], [A[:, free], np.zeros((k, k))]])
        rhs = -np.concatenate([(_CLOSING - force[carrying] @ A)[free], gaps.value[carrying]])
        move = np.zeros(6)
        move[free] = np.linalg.lstsq(kkt, rhs, rcond=1e-12)[0][:n]
        new = float(np.abs(move).max())
        if not new < step:
            break
        q, step = q + move, new
    return q, step
