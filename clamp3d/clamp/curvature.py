"""Second derivatives of the active gaps at a final state: whether the distance falls along a feasible motion.

The second-order condition of a constrained minimum [Nocedal & Wright, Numerical Optimization, 2nd ed., section 12.5].
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from clamp3d.clamp.section import SIZE, SPLINTS, WIRES, Gaps, Section
from clamp3d.geometry.pose import Array

LEVEL = 1e-6
"""Curvature in 1/mm that counts as none: rounding of the differences that it is taken from."""
_TURNED = 1e-5
"""Largest residual that may come from rounded normals: the distance is off by its square times some 10 mm, 1e-9 mm."""


def least_curvature(section: Section, q: Array, gaps: Gaps, multipliers: Array, tolerance: float) -> float:
    """Least second derivative of the Lagrangian by unit motions of the critical cone.

    The critical cone keeps the strongly active gaps (multiplier > 0) closed and lets no weakly active one (closed to
    ``tolerance`` mm, multiplier 0) overlap. It has one or two dimensions here (a plane is looked at degree by degree);
    more are looked at by random directions.
    """
    strong = np.flatnonzero(multipliers)
    A = gaps.gradient[strong]
    free = touched(section, gaps, strong)
    if not len(free):
        return np.inf
    _, sizes, rows = np.linalg.svd(A[:, free])
    tangent = rows[int((sizes > 1e-9).sum()) :]
    if not len(tangent):
        return np.inf
    hessian = lagrangian_hessian(section, q, gaps, multipliers)[np.ix_(free, free)]
    reduced = tangent @ hessian @ tangent.T
    least = float(np.linalg.eigvalsh(reduced)[0])
    weak = np.flatnonzero((np.abs(gaps.value) <= tolerance) & (multipliers == 0.0))
    if least >= -LEVEL or not len(weak):
        return least
    m = len(tangent)
    if m == 1:
        motions = np.array([[1.0], [-1.0]])
    elif m == 2:
        angle = np.linspace(0.0, 2.0 * np.pi, 721)
        motions = np.column_stack([np.cos(angle), np.sin(angle)])
    else:
        motions = np.random.default_rng(0).normal(size=(20_000, m))
        motions /= np.linalg.norm(motions, axis=1)[:, None]
    opens = gaps.gradient[np.ix_(weak, free)] @ tangent.T @ motions.T
    motions = motions[(opens >= -1e-7).all(axis=0)]
    return float(np.einsum("ni,ij,nj->n", motions, reduced, motions).min(initial=np.inf))


def touched(section: Section, gaps: Gaps, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """The free coordinates that any of the gaps ``rows`` depends on."""
    free = np.array(section.free)
    return np.asarray(free[np.abs(gaps.gradient[np.ix_(rows, free)]).max(axis=0, initial=0.0) > 0.0])


def lagrangian_hessian(section: Section, q: Array, gaps: Gaps, force: Array) -> Array:
    """Second derivatives (10, 10) of goal - ``force`` . ``gaps`` at q, by central differences of closed-form gradients.

    The saddle's arc is left out: its gap is straight in u, and w does not change it where it is closed.
    """
    # A wire that nearly fills its groove turns its normal within R - r: the step must be short beside that.
    h = min(1e-4, max(1e-8, 0.03 * section.least_slack))
    H, others = np.zeros((SIZE, SIZE)), np.append(force[:-1] != 0.0, False)
    for pair in itertools.product(SPLINTS, WIRES):
        own = np.array([p == pair for p in gaps.pair])
        if force[own].any():
            H -= section.wire_curvature(q, *pair, force[own], h)
        others &= ~own
    rows = np.flatnonzero(others)
    for j in touched(section, gaps, rows):
        e = np.zeros(SIZE)
        e[j] = h
        H[j] -= force[rows] @ (section.gaps(q + e).gradient[rows] - section.gaps(q - e).gradient[rows]) / (2.0 * h)
    return 0.5 * (H + H.T)


def rounding_of_normals(section: Section, q: Array) -> float:
    """How far rounding of the coordinates turns the normal of the wire that fills its groove best, rad."""
    return min(_TURNED, 4.0 * float(np.spacing(np.abs(q).max())) / max(section.least_slack, 1e-300))
