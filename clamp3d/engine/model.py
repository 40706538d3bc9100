"""A shape's models, each made the first time somebody asks for it, kept, and counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.closed_form import ClosedForm
from clamp3d.engine.drawn import bodies_of
from clamp3d.engine.hull import Hull, hull, hull_error
from clamp3d.engine.surface import Surface, at_edges
from clamp3d.errors import Clamp3dError
from clamp3d.files.faces import CYLINDER, PLANE
from clamp3d.files.solid import CHORD, BrepSolid
from clamp3d.geometry.mesh import edges_of, is_closed
from clamp3d.geometry.meshing import enclosed, enclosing
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import MeshShape, Shape, Solid

if TYPE_CHECKING:
    from clamp3d.fit.fit import FitResult

Progress = Callable[[str, int, int], None]
"""What is being done, how much of it is, and of how much."""

_LARGE = 2000
"""Triangles of a mesh beyond which its hull is no quicker to ask than the mesh itself."""
_MOST_COARSE = 3000
"""Triangles of the coarse mesh of a solid from CAD beyond which the fine one costs more than asking Open CASCADE."""
_CONVEX = 1e-9
"""Relative to its size: a mesh whose hull stands out of it by less is asked in its place."""
Maker = Callable[[Solid, float], tuple[Array, NDArray[np.int64]] | None]

DRAWN_CHORDS = (0.5, 0.06, 0.008, 0.001)
"""Chord errors (mm) that drawn solids are meshed with; a pair still open at the last is uncertain."""

CAD_CHORDS = (0.1, 0.0025)
"""Chord errors (mm) that solids from CAD are meshed with; what these leave open is asked of Open CASCADE.

Of two equal cylinders, one in the other, facets overlap by a chord error, and each adds its own: three fine ones are
less than the usual threshold of contact, 0.01 mm.
"""

LAST_CHORDS = (CAD_CHORDS[-1], 0.0006)
"""Chord errors (mm) of meshes, however large, for pairs of which Open CASCADE does not find the common part."""


@dataclass
class Counters:
    """What has been built (meshes, triangles, hulls, fits) and asked (by level) so far."""

    built: Counter[str] = field(default_factory=Counter)
    queries: Counter[str] = field(default_factory=Counter)


class Model:
    """All that can be known of one shape; ``counters`` is told what is built."""

    def __init__(self, shape: Shape, counters: Counters) -> None:
        self.shape = shape
        self.counters = counters
        self._inner: dict[float, Surface | None] = {}
        self._outer: dict[float, Surface | None] = {}

    @property
    def name(self) -> str:
        """The shape's name."""
        return self.shape.name

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of a box that holds the true part, mm."""
        if isinstance(self.shape, (Solid, BrepSolid)):
            return self.shape.bounds
        V = self.shape.mesh.vertices
        reach = self.shape.error + (_bulge(self.shape) if self.shape.fit != "off" else 0.0)
        return np.array([V.min(axis=0) - reach, V.max(axis=0) + reach])

    @cached_property
    def bodies(self) -> tuple[ClosedForm, ...] | None:
        """The shape in closed form; None if it has none."""
        if isinstance(self.shape, Solid):
            return bodies_of(self.shape)
        if not self.closed or not self.chords:
            return None
        mesh = self._cad_mesh(CHORD) if self.exact is not None else self.raw
        if self._fit is not None and self._fit.features:
            from clamp3d.engine.fitted import bodies_of_fit

            if self.exact is not None:
                tessellation = self.exact.tessellated(CHORD)
                flat = self.exact.surfaces.kind[tessellation.face] == PLANE
                return bodies_of_fit(self._fit, mesh, chord=tessellation.errors, flat=flat)
            return bodies_of_fit(self._fit, mesh, stated=self.shape.error)
        if len(mesh.faces) > _LARGE:  # the mesh is quicker than a hull of so many faces
            return None
        off = hull_error(mesh.vertices, mesh.faces)
        if off > _CONVEX * mesh.scale:
            return None
        return (ClosedForm((self._hull(mesh.vertices),), error=mesh.error + off),)

    @property
    def forms(self) -> tuple[ClosedForm, ...]:
        """The closed form, or the hull in place of it."""
        return self.bodies if self.bodies is not None else (self.hull_body,)

    @cached_property
    def _fit(self) -> FitResult | None:
        """Round surfaces found in a mesh, or named by a CAD file; None where none are looked for."""
        if isinstance(self.shape, BrepSolid):
            if not (self.shape.surfaces.kind == CYLINDER).any():
                return None
            from clamp3d.fit.fit import fit_solid

            return fit_solid(self.shape)
        if not isinstance(self.shape, MeshShape) or self.shape.fit == "off" or not self.closed:
            return None
        from clamp3d.fit.fit import fit_mesh

        self.counters.built["fits"] += 1
        return fit_mesh(self.shape.mesh)

    @cached_property
    def simple(self) -> bool:
        """Whether closed forms, or a small hull in place of them, are quicker to ask than the mesh."""
        if isinstance(self.shape, Solid):
            return True
        small = bool(self.chords) and len(self.outer(self.chords[0]).faces) <= _LARGE
        return small or (self.bodies is not None and all(form.surface is None for form in self.bodies))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.shape, Counters())

    @property
    def drawn(self) -> bool:
        """Whether it is a drawn solid."""
        return isinstance(self.shape, Solid)

    @property
    def exact(self) -> BrepSolid | None:
        """The solid from CAD that Open CASCADE can be asked about; None for other shapes."""
        return self.shape if isinstance(self.shape, BrepSolid) else None

    @cached_property
    def hull_body(self) -> ClosedForm:
        """Convex hull of a mesh that holds the part: for lower bounds alone."""
        outer = self.outer(DRAWN_CHORDS[0])
        return ClosedForm((self._hull(outer.vertices),), error=outer.error, surface=_nowhere)

    def _hull(self, points: Array) -> Hull:
        self.counters.built["hulls"] += 1
        return hull(points)

    @property
    def chords(self) -> tuple[float, ...]:
        """Chord errors (mm) of the meshes that are worth a question, from coarse to fine; one for given triangles."""
        if isinstance(self.shape, BrepSolid):
            return self._cad_chords
        arcs = isinstance(self.shape, Solid) and any(e.profile.arcs for e in (*self.shape.bodies, *self.shape.holes))
        return DRAWN_CHORDS if arcs else DRAWN_CHORDS[:1]

    def refine_to(self, chord: float) -> bool:
        """Use meshes of chord error ``chord`` mm of a solid from CAD from now on; whether that is new."""
        if not self.chords or self.chords[-1] <= chord:
            return False
        self._cad_chords = (*self.chords, chord)
        return True

    @property
    def refines(self) -> bool:
        """Whether a smaller chord error gives a better mesh."""
        return len(self.chords) > 1

    @cached_property
    def _cad_chords(self) -> tuple[float, ...]:
        """The chord errors for a solid from CAD; none if Open CASCADE's triangles do not close: then it is asked."""
        assert isinstance(self.shape, BrepSolid)
        try:
            faces = self.shape.tessellated(CAD_CHORDS[0]).faces
        except Clamp3dError:
            return ()
        if not is_closed(faces):
            return ()
        return CAD_CHORDS if len(faces) <= _MOST_COARSE else CAD_CHORDS[:1]

    @property
    def closed(self) -> bool:
        """Whether it is known what is inside: not of a mesh with open or crossed edges."""
        return isinstance(self.shape, (Solid, BrepSolid)) or self.shape.mesh.watertight

    @property
    def between(self) -> bool:
        """Whether the part lies between an inner and an outer mesh; else one mesh has an error for each triangle."""
        return isinstance(self.shape, Solid) and self.refines

    @cached_property
    def raw(self) -> Surface:
        """The facets of a mesh; round faces are off by the error of the fit, all by what the shape states."""
        assert not isinstance(self.shape, (Solid, BrepSolid))
        V, F = self.shape.mesh.vertices, self.shape.mesh.faces
        error = np.full(len(F), self.shape.error) if self.shape.error else None
        if self._fit is not None and self._fit.features:
            error = np.zeros(len(F)) if error is None else error
            patch = np.zeros(len(F), dtype=np.int64)
            for k, feature in enumerate(self._fit.features):
                error[feature.faces] = np.maximum(error[feature.faces], feature.error_bound + self.shape.error)
                patch[feature.faces] = k + 1
            error = at_edges(V, F, error, patch)
        return self._counted(Surface(V, F, error))

    def outer(self, error: float) -> Surface:
        """Mesh of chord error ``error`` mm that holds a drawn solid; a mesh shape's own facets, whose errors it has."""
        surface = self._made(self._outer, enclosing, error)
        assert surface is not None
        return surface

    def inner(self, error: float) -> Surface | None:
        """Mesh of chord error ``error`` mm that a drawn solid holds, or None; a mesh shape's own facets."""
        return self._made(self._inner, enclosed, error)

    def _made(self, kept: dict[float, Surface | None], make: Maker, error: float) -> Surface | None:
        if isinstance(self.shape, BrepSolid):
            kept = self._inner
        elif not isinstance(self.shape, Solid):
            return self.raw
        elif not self.refines:  # outlines without arcs are exact at any chord error: one mesh serves all
            kept, error = self._inner, DRAWN_CHORDS[0]
        error = max(error, self.chords[-1])
        if error not in kept:
            if isinstance(self.shape, BrepSolid):
                kept[error] = self._cad_mesh(error)
            else:
                mesh = make(self.shape, error)
                kept[error] = None if mesh is None else self._counted(Surface(*mesh))
        return kept[error]

    def _cad_mesh(self, chord: float) -> Surface:
        assert isinstance(self.shape, BrepSolid)
        mesh = self.shape.tessellated(chord)
        return self._counted(Surface(mesh.vertices, mesh.faces, at_edges(mesh.vertices, mesh.faces, mesh.errors)))

    def _counted(self, surface: Surface) -> Surface:
        self.counters.built["meshes"] += 1
        self.counters.built["triangles"] += len(surface.faces)
        return surface


def _nowhere(points: Array) -> Array:
    """Depth of points (k, 3) in a part whose hull stands for it: what of the hull is material the meshes know."""
    return np.full(len(points), -np.inf)


def _bulge(shape: MeshShape) -> float:
    """How far round surfaces through the vertices can stand out of the facets, mm, from widths and bends alone."""
    V, F = shape.mesh.vertices, shape.mesh.faces
    edges, pairs, _ = edges_of(F, 2)
    normals = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])[pairs]
    twice_area = np.linalg.norm(normals, axis=2)
    across = np.linalg.norm(np.cross(normals[:, 0], normals[:, 1]), axis=1)
    angles = np.arctan2(across, np.einsum("ij,ij->i", normals[:, 0], normals[:, 1]))
    length = np.linalg.norm(V[edges[:, 1]] - V[edges[:, 0]], axis=1)
    wide = twice_area.max(axis=1) / np.maximum(length, 1e-300)
    smooth = (angles > 1e-6) & (angles < np.radians(65.0))
    # A chord w that turns by t has the sagitta w / 2 tan(t / 4).
    return float((0.5 * wide * np.sin(0.25 * angles) / np.cos(0.25 * angles))[smooth].max(initial=0.0))


class ModelCache:
    """The models of a scene's shapes, shared by equal shapes, kept as long as it lives."""

    def __init__(self) -> None:
        self.counters = Counters()
        self._models: dict[Shape, Model] = {}

    def model(self, shape: Shape) -> Model:
        """The one model of a shape and its equals."""
        if shape not in self._models:
            self._models[shape] = Model(shape, self.counters)
        return self._models[shape]
