"""From the round surfaces fitted to a mesh to a body that encloses it, for the same closed forms as designed parts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.closed_form import Bore, ClosedForm
from clamp3d.engine.convex import Rod
from clamp3d.engine.hull import hull
from clamp3d.engine.surface import SMOOTH, Surface, at_edges
from clamp3d.fit.features import FitResult, FittedSurface
from clamp3d.geometry.pose import Array, to_source, to_target, translation
from clamp3d.geometry.triangles import distances_from_segments

Faces = NDArray[np.int64]
_AROUND = math.sqrt(3.0) * np.concatenate([np.eye(3), -np.eye(3)])
"""Corners (6, 3) of an octahedron that holds the unit ball."""


def bodies_of_fit(
    result: FitResult,
    model: Surface,
    *,
    stated: float = 0.0,
    chord: Array | None = None,
    flat: NDArray[np.bool_] | None = None,
) -> tuple[ClosedForm, ...]:
    """Bodies around the fitted mesh, whose true surface can be ``stated`` mm from its facets besides.

    Of a solid from CAD the cylinders are exact, ``chord`` (m,) mm says how far its triangles are from the true faces,
    and ``flat`` (m,) which of them are off by that along their borders only.

    A groove or hole counts where no part of the mesh lies in its circle, over the whole length of the mesh; else the
    mesh is asked. Where the mesh is nothing but a round bar (a wire, a shank, a step of a turned part) it becomes a
    cylinder with flat ends; the rest keeps its hull.
    """
    V, F = model.vertices, model.faces
    chord = np.zeros(len(F)) if chord is None else chord
    flat = np.zeros(len(F), dtype=bool) if flat is None else flat
    error = max((feature.fit_error for feature in result.features), default=0.0)
    hollow = (*result.grooves, *result.holes)
    bores, through = [], np.zeros(len(F), dtype=bool)
    for feature in hollow:
        bore = _bore(feature, hollow, V, F, error, feature.error_bound + float(chord[feature.faces].max()))
        if bore is not None:
            bores.append(bore)
            through[feature.faces] = True
    depth = _FittedDepth(result, model, chord, flat)
    rods, rest, beyond = _rods(result, V, F, through)
    bodies = [ClosedForm((rod,), tuple(bores), error=error + stated + beyond) for rod in rods]
    if not rest:
        return tuple(bodies)
    points, tips = _outside(result, V, F, chord), _tips(result, V, F, chord)
    off = error + stated + max(beyond, depth.bulging)
    for index in rest:
        own = index[tips[index] > 0.0]
        around = np.concatenate([points[index], (V[own, None] + tips[own, None, None] * _AROUND).reshape(-1, 3)])
        bodies.append(ClosedForm((hull(around),), tuple(bores), error=off, surface=depth))
    return tuple(bodies)


def _outside(result: FitResult, V: Array, F: Faces, chord: Array) -> Array:
    """The vertices (n, 3), those of convex cylinders moved out to where tangents are, not chords."""
    points = V.copy()
    for convex in result.cylinders:
        own = np.unique(F[convex.faces])
        T = convex.T_part_feature
        local = to_source(T, V[own])
        out = np.hypot(local[:, 0], local[:, 1])
        sagitta = _sagitta(convex, chord)
        reach = convex.radius / (1.0 - sagitta / convex.radius) + convex.fit_error
        local[:, :2] *= (np.maximum(reach, out) / out)[:, None]
        points[own] = to_target(T, local)
    return points


def _sagitta(convex: FittedSurface, chord: Array) -> float:
    """How far (mm) a convex cylinder is off its chords, by the fit or by what ``chord`` (m,) says of its triangles."""
    return max(convex.chord_error, float(chord[convex.faces].max()))


def _tips(result: FitResult, V: Array, F: Faces, chord: Array) -> Array:
    """How far (n,) mm the tips of convex cylinders can be from each vertex, more than their facets' sagitta.

    They are at acute edges, as those of a slanting end.
    """
    error, patch = np.zeros(len(F)), np.zeros(len(F), dtype=np.int64)
    for k, convex in enumerate(result.cylinders, 1):
        error[convex.faces] = _sagitta(convex, chord) + convex.fit_error
        patch[convex.faces] = k
    widened = at_edges(V, F, error, patch, SMOOTH)
    reach = np.zeros(len(V))
    np.maximum.at(reach, F.reshape(-1), np.repeat(np.where(widened > error, widened, 0.0), 3))
    return reach


class _FittedDepth:
    """Depth of points in a fitted mesh, never too much: 0 on what is certainly the part's surface.

    ``bulging`` (mm): how far faces that are neither flat nor fitted can stand out of their triangles.
    """

    def __init__(self, result: FitResult, model: Surface, chord: Array, flat: NDArray[np.bool_]) -> None:
        self._result, self._model = result, model
        self._owner = np.full(len(model.faces), -1)
        for k, feature in enumerate(result.features):
            self._owner[feature.faces] = k
        self._error = max([float(chord.max()), *(feature.error_bound for feature in result.features)])
        self._slack = 1e-9 * model.scale
        self.bulging = float(chord[(self._owner < 0) & ~flat].max(initial=0.0))
        # Where all other faces are cylinders, what is said of those below corrects the borders of the flat ones.
        self._is_exact = (chord <= self._slack) | (flat & (self.bulging == 0.0))

    def __call__(self, x: Array) -> Array:
        """Depth (k,) mm of points (k, 3); negative outside."""
        away, face, foot = self._model.nearest(x)
        on = (away <= self._slack) & (self._owner[face] < 0) & self._is_exact[face]
        on |= self._on_fitted(x, face, foot)
        on &= ~self._in_hollow(x, face)
        depth = np.where(on, 0.0, -self._error - away)
        # Nearer to the facets than their own error a point proves nothing; further in it does.
        far = np.flatnonzero(~on & (away > self._error))
        within = far[self._model.contains(x[far])]
        depth[within] = away[within] - self._error
        return depth

    def _on_fitted(self, x: Array, face: Faces, foot: Array) -> NDArray[np.bool_]:
        """Which points lie on a fitted surface over a facet of its own; elsewhere it may have a window."""
        aside = np.linalg.norm(np.cross(x - foot, self._model.normals[face]), axis=1)
        on = np.zeros(len(x), dtype=bool)
        for k, surface in enumerate(self._result.features):
            local = to_source(surface.T_part_feature, x)
            out, z = np.hypot(local[:, 0], local[:, 1]) - surface.radius, np.abs(local[:, 2]) - 0.5 * surface.length
            turned = np.abs(np.arctan2(local[:, 0], -local[:, 1])) - surface.half_angle
            # Over a facet of its own the fitted surface is the part's, within the error of the fit.
            over = (self._owner[face] == k) & (aside <= surface.fit_error + self._slack)
            on |= over & (np.abs(out) <= self._slack) & (z <= self._slack) & (turned <= 1e-9)
        return on

    def _in_hollow(self, x: Array, face: Faces) -> NDArray[np.bool_]:
        """Which points lie in a groove or hole, where facets beside it fill what is between its chords and the arc."""
        inside = np.zeros(len(x), dtype=bool)
        for surface in (*self._result.grooves, *self._result.holes):
            local = to_source(surface.T_part_feature, x)
            cut = np.hypot(local[:, 0], local[:, 1]) < surface.radius - self._slack
            # At its ends: faces that look out of it, not the floor or step that it ends at; a slanting one all along.
            outward = (self._model.normals[face] @ surface.T_part_feature[:3, 2]) * np.sign(local[:, 2])
            further = np.where(outward > 1e-6, np.where(outward < 1.0 - 1e-9, np.inf, self._slack), -self._slack)
            cut &= np.abs(local[:, 2]) < 0.5 * surface.length + further
            inside |= cut & (np.abs(np.arctan2(local[:, 0], -local[:, 1])) <= surface.half_angle)
        return inside


def _bore(
    feature: FittedSurface, hollow: Sequence[FittedSurface], V: Array, F: Faces, error: float, sagitta: float
) -> Bore | None:
    """The groove or hole as a bore of the whole mesh; None if the mesh reaches into its circle by more than ``error``.

    ``sagitta`` (mm) is what chords of the feature may.
    Its own triangles, and those of other ``hollow`` surfaces on the same cylinder, may lie in the circle by their
    sagitta, their neighbours as deep as the edges that they share with them, and flat ends as deep as both.
    """
    local = to_source(feature.T_part_feature, V)
    own = np.zeros(len(F), dtype=bool)
    for other in hollow:
        own[other.faces] |= other is feature or _on_cylinder(local[np.unique(F[other.faces])], feature.radius, error)
    least, edges = _nearest_to_axis(local[:, :2][F])
    if least[own].min() < feature.radius - sagitta - 1e-9 * feature.radius:
        return None
    limit = np.full(F.shape, feature.radius - error)
    after = np.roll(F, -1, axis=1)
    sides = np.minimum(F, after) * len(V) + np.maximum(F, after)
    limit = np.where(np.isin(sides, sides[own]), np.minimum(limit, edges), limit).min(axis=1)
    # Faces square to the axis fill what is between chords and arc; a shoulder among them ends in others that do not.
    square = np.ptp(local[:, 2][F], axis=1) <= 1e-9 * feature.radius
    limit[square] = np.minimum(limit[square], feature.radius - sagitta)
    if (least < limit - 1e-9 * feature.radius)[~own].any():
        return None
    low, high, top = float(local[:, 2].min()), float(local[:, 2].max()), float(local[:, 1].max())
    half = math.pi
    if feature.half_angle < math.pi:
        if top > feature.radius * (1.0 - 1e-9):
            return None  # the part rises above the groove's circle: the mesh says more than a groove without walls
        # The mouth's plane goes through the part's highest point: all of it lies behind.
        half = max(feature.half_angle, math.acos(max(-1.0, -top / feature.radius)))
    T = feature.T_part_feature @ translation(0.0, 0.0, 0.5 * (low + high))
    return Bore(feature.radius, half, high - low, T)


def _on_cylinder(points: Array, radius: float, error: float) -> bool:
    """Whether points (k, 3) lie on the cylinder of this radius about z, within ``error``."""
    return bool(np.abs(np.hypot(points[:, 0], points[:, 1]) - radius).max() <= error + 1e-9 * radius)


def _nearest_to_axis(flat: Array) -> tuple[Array, Array]:
    """Least distance (k,) of triangles (k, 3, 2), and of their edges (k, 3), from the origin of their plane."""
    a, b = flat, np.roll(flat, -1, axis=1)
    edges = distances_from_segments(np.zeros(2), a, b)
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    encloses = (cross > 0.0).all(axis=1) | (cross < 0.0).all(axis=1)
    return np.where(encloses, 0.0, edges.min(axis=1)), edges


def _rods(result: FitResult, V: Array, F: Faces, through: NDArray[np.bool_]) -> tuple[list[Rod], list[Faces], float]:
    """Stretches along the first full cylinder's axis where the mesh is a round bar, and the vertices of the others.

    Last how far (mm) ends stand out of their bars. ``through`` (m,): the triangles of holes and grooves that are bores
    of the whole mesh.
    """
    full = [f for f in result.cylinders if f.full]
    everything = [np.unique(F)], 0.0
    if not full:
        return [], *everything
    local = to_source(full[0].T_part_feature, V)
    z, out = local[:, 2], np.hypot(local[:, 0], local[:, 1])
    rods: list[Rod] = []
    taken: list[tuple[float, float]] = []
    others = ~through
    for feature in full:
        own = np.unique(F[feature.faces])
        low, high = float(z[own].min()), float(z[own].max())
        slack = feature.fit_error + 1e-9 * (high - low)
        coaxial = np.abs(out[own] - feature.radius).max() <= 10.0 * slack
        # Between the ends there must be nothing but this surface, and the bores.
        between = (z[F].min(axis=1) < high - slack) & (z[F].max(axis=1) > low + slack)
        between[feature.faces] = False
        if not coaxial or (between & ~through).any() or any(low < b and a < high for a, b in taken):
            continue
        heights = to_source(feature.T_part_feature, V[own])[:, 2]
        place = feature.T_part_feature @ translation(0.0, 0.0, 0.5 * float(heights.min() + heights.max()))
        rods.append(Rod(feature.radius, high - low, place))
        taken.append((low, high))
        others[feature.faces] = False
    if not rods:
        return [], *everything
    rest, beyond, flat = [], 0.0, 1e-6 * (1.0 + float(np.ptp(z)))
    spans = sorted(taken)
    between_spans = np.searchsorted([0.5 * sum(span) for span in spans], z[F].mean(axis=1))
    for k in range(len(spans) + 1):
        index = np.unique(F[others & (between_spans == k)])
        if len(index) and np.ptp(z[index]) > flat:
            rest.append(index)
        elif len(index):  # the end of the stretch before or behind it
            heights = z[index]
            out_of = [max(float(heights.max()) - b, a - float(heights.min())) for a, b in spans[max(0, k - 1) : k + 1]]
            beyond = max(beyond, min(out_of))
    return rods, rest, beyond
