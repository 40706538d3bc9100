"""Where two parts overlap: the volume that they share between bounds, a box around it, and a point deep inside it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from clamp3d.engine.model import QUICK_TRIANGLES, CadModel, MeshModel, Model, box_corners
from clamp3d.engine.overlap import Common, common, deepest
from clamp3d.engine.surface import Surface
from clamp3d.errors import Clamp3dError
from clamp3d.files import cad_process
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.geometry.pose import Array, inverse, to_source, to_target
from clamp3d.geometry.triangles import normals_and_areas, quarters

_SHARE = 0.005
"""Relative width of the interval of the volume at which it is not refined further."""
_PIECES = 40_000
"""Triangles that those near another part are cut into at most, to bound their area."""
_EXACT = 1e-5
"""Relative accuracy taken for a volume by Open CASCADE, beside what two integrations differ by."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """Where two parts overlap.

    Attributes
    ----------
    volume : (float, float)
        The volume that they share lies between these, mm^3.
    box : ndarray (2, 3)
        Lower and upper corner of a box in the world that holds all of the overlap, mm.
    of_facets : bool
        Whether volume, box and point are those of given meshes, of which nobody says how far they are from the parts.
    point : ndarray (3,) or None
        A point of the world that lies in both parts; None where no mesh inside them overlaps.
    """

    volume: tuple[float, float]
    box: Array
    of_facets: bool = False
    point: Array | None = None

    def refined(self, finer: Overlap) -> Overlap:
        """Both answers at once; this one where the other is less: then some is lost in it."""
        point = self.point if finer.point is None else finer.point
        if finer.volume[1] < self.volume[0]:
            return self
        if finer.volume[0] > self.volume[1]:
            return replace(finer, point=point)
        low, high = max(self.volume[0], finer.volume[0]), min(self.volume[1], finer.volume[1])
        return replace(finer, volume=(low, high), point=point)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        low, high = self.volume
        return {
            "volume_at_least_mm3": low,
            "volume_at_most_mm3": high,
            "volume_of_facets": self.of_facets,
            "box_mm": self.box.tolist(),
            "point": None if self.point is None else self.point.tolist(),
        }


@dataclass(eq=False)
class Locator:
    """Two overlapping parts: ``b`` at ``T_ab`` (4, 4) in a's frame, ``a`` at ``T_a`` in the world.

    ``attested`` (3,): a point in both of them, in a's frame.
    ``thorough``: large solids from CAD get the finest meshes where Open CASCADE finds no volume, not those of depths.
    """

    a: Model
    b: Model
    T_a: Array
    T_ab: Array
    thorough: bool = False
    attested: Array | None = None

    @cached_property
    def overlap(self) -> Overlap | None:
        """Where they overlap; None if not even meshes around them do, or one has no inside that is known."""
        if not (self.a.is_simple and self.b.is_simple):
            return None
        best = None
        for overlap in self._overlaps():
            if overlap is None:
                continue
            best = overlap if best is None else best.refined(overlap)
            if best.volume[1] - best.volume[0] <= _SHARE * best.volume[1] < np.inf:
                break
        if best is not None and best.point is None and self.attested is not None:
            return replace(best, point=to_target(self.T_a, self.attested))
        return best

    def _overlaps(self) -> Iterator[Overlap | None]:
        """Where they overlap by coarse meshes, by Open CASCADE for two solids from CAD, and by finer meshes."""
        models = (self.a, self.b)
        if not all(model.chords for model in models):
            yield self._exact()
            return
        chords = sorted({chord for model in models for chord in model.chords}, reverse=True)
        exact = self._exact()
        yield self._at(chords[0], exact)
        yield exact
        solids = [] if self.thorough else [model for model in models if isinstance(model, CadModel)]
        is_large = sum(solid.fine_triangles for solid in solids) > QUICK_TRIANGLES
        finest = max(solid.fine_chord for solid in solids) if is_large else 0.0
        for chord in sorted({max(chord, finest) for chord in chords[1:]}, reverse=True):
            with suppress(Clamp3dError):  # of solids from CAD fine ones may take too long to make
                yield self._at(chord)

    def _at(self, chord: float, exact: Overlap | None = None) -> Overlap | None:
        """From meshes of one chord error (mm); without an upper bound of the volume where the ``exact`` one serves."""
        outer_a, outer_b = self.a.outer(chord), self.b.outer(chord)
        outer = common(outer_a, outer_b, self.T_ab)
        if outer is None:
            return None
        inner_a, inner_b = self.a.inner(chord), self.b.inner(chord)
        inner: Common | None = None
        if inner_a is outer_a and inner_b is outer_b:
            inner = outer
        elif inner_a is not None and inner_b is not None:
            inner = common(inner_a, inner_b, self.T_ab)
        off = outer_a.error + outer_b.error
        area = float(outer.areas[1].sum())
        rounding = 1e-11 * (outer_a.scale + outer_b.scale) * area
        slack = off * area + rounding
        low = 0.0 if inner is None else max(0.0, inner.volume - slack)
        point = None
        if inner is not None and inner_a is not None and inner_b is not None:
            depth, place = deepest(inner_a, inner_b, self.T_ab, inner)
            point = to_target(self.T_a, place) if depth > 0.0 else None
        box = self._box_around(outer, outer_a, outer_b)
        unknown_error = any(isinstance(model, MeshModel) for model in (self.a, self.b))
        high = np.inf
        if exact is None or exact.volume[1] < low:
            high = outer.volume + rounding + self._bulging(outer_a, outer_b)
        return Overlap((low, high), box, unknown_error and off == 0.0, point)

    def _bulging(self, a: Surface, b: Surface) -> float:
        """How much more (mm^3) the bodies may share than their meshes.

        What of one lies in the other is within its error of triangles that are within both errors of the other.
        """
        sides = ((a, b, self.T_ab), (b, a, inverse(self.T_ab)))
        return sum(
            own.error * _area_near(own, other, T, a.error + b.error) for own, other, T in sides if own.error > 0.0
        )

    def _box_around(self, shared: Common, a: Surface, b: Surface) -> Array:
        """Box (2, 3) in the world of all that the bodies share whose meshes share ``shared``.

        A ball that is larger by e than its mesh has the rim of a cap further out by no more than the root of e times
        its size. So has what bulges less.
        """
        off, size = a.error + b.error, min(float(np.ptp(mesh.box, axis=0).max()) for mesh in (a, b))
        boxes = [
            _box(to_target(self.T_a, shared.vertices), off + float(np.sqrt(off * size))),
            _box(to_target(self.T_a, a.vertices), a.error),
            _box(to_target(self.T_a @ self.T_ab, b.vertices), b.error),
        ]
        lows, highs = np.swapaxes(boxes, 0, 1)
        return np.array([lows.max(axis=0), highs.min(axis=0)])

    def _exact(self) -> Overlap | None:
        """From Open CASCADE, for two solids from CAD; None for others, and where it fails."""
        if not (isinstance(self.a, CadModel) and isinstance(self.b, CadModel)):
            return None
        try:
            shared = cad_process.common(self.a.shape.brep, self.b.shape.brep, self.T_ab)
        except Clamp3dError:
            return None
        if not shared.volume > 0.0:
            return None
        corners = to_target(self.T_a, box_corners(shared.box))
        low, high = shared.volumes
        return Overlap((low * (1.0 - _EXACT), high * (1.0 + _EXACT)), _box(corners, TOLERANCE))


def _area_near(surface: Surface, other: Surface, T: Array, reach: float) -> float:
    """Area (mm^2) of what of a surface may lie in another mesh, at ``T`` (4, 4), or within ``reach`` mm of it.

    Triangles are quartered until they are small beside that, or many.
    """
    pieces = to_source(T, surface.vertices[surface.faces])
    area_inside = 0.0
    while True:
        middles = pieces.mean(axis=1)
        size = np.linalg.norm(pieces - middles[:, None], axis=2).max(axis=1)
        beyond_box = np.maximum(other.box[0] - middles, middles - other.box[1]).max(axis=1)
        may_be_near = beyond_box <= reach + size
        pieces, middles, size = (x[may_be_near] for x in (pieces, middles, size))
        is_near = other.distance(middles) <= reach + size
        beyond = pieces[~is_near]
        area_inside += float(normals_and_areas(beyond[other.contains(middles[~is_near])])[1].sum())
        pieces, size = pieces[is_near], size[is_near]
        if 4 * len(pieces) > _PIECES or size.max(initial=0.0) <= reach:
            return area_inside + float(normals_and_areas(pieces)[1].sum())
        pieces = quarters(pieces)


def _box(points: Array, slack: float = 0.0) -> Array:
    """Lower and upper corner (2, 3) of a box around points (k, 3), ``slack`` mm larger."""
    return np.array([points.min(axis=0) - slack, points.max(axis=0) + slack])
