"""A shape's models, each made the first time somebody asks for it, kept, and counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.body import ClosedForm
from clamp3d.collide.convex import Hull, hull
from clamp3d.collide.drawn import bodies_of
from clamp3d.collide.facets import Facets
from clamp3d.collide.surface import Surface
from clamp3d.core.meshing import chord_error, mesh
from clamp3d.core.pose import Array
from clamp3d.core.shapes import MeshShape, Shape, Solid

Progress = Callable[[str, int, int], None]
"""What is being done, how much of it is, and of how much."""

FINEST = 0.001
"""Smallest chord error (mm) that a mesh is made with; a pair still open then is uncertain."""


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
        self._meshes: dict[float, Surface] = {}
        self._fit_error = 0.0
        self._round_faces: NDArray[np.int64] = np.empty(0, dtype=np.int64)

    @property
    def name(self) -> str:
        """The shape's name."""
        return self.shape.name

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of a box that holds the true part, mm."""
        if isinstance(self.shape, Solid):
            return self.shape.bounds
        V = self.shape.mesh.vertices
        reach = _bulge(self.shape) if self.shape.fit != "off" else 0.0
        return np.array([V.min(axis=0) - reach, V.max(axis=0) + reach])

    @cached_property
    def bodies(self) -> tuple[ClosedForm, ...] | None:
        """The shape in closed form; None if it has none."""
        if isinstance(self.shape, Solid):
            return bodies_of(self.shape)
        if self.shape.fit != "off":
            from clamp3d.collide.fitted import bodies_of_fit
            from clamp3d.fit.fit import fit_mesh

            self.counters.built["fits"] += 1
            result = fit_mesh(self.shape.mesh)
            if result.features:
                self._round_faces = np.concatenate([feature.faces for feature in result.features])
                made, self._fit_error = bodies_of_fit(result, self.raw, round_=self.shape.fit == "round")
                return made
        raw = self.raw
        volume = float(raw.manifold.volume())
        if abs(float(raw.manifold.hull().volume()) - volume) <= 1e-9 * volume:
            return (ClosedForm((self._hull(self.shape.mesh.vertices),)),)
        return None

    @property
    def drawn(self) -> bool:
        """Whether the shape is drawn with outlines, not a mesh."""
        return isinstance(self.shape, Solid)

    @property
    def exact(self) -> bool:
        """Whether it is known which points are material: by a drawn part's closed form, or as a mesh taken as is."""
        return self.bodies is not None if isinstance(self.shape, Solid) else self.shape.fit == "off"

    @property
    def forms(self) -> tuple[ClosedForm, ...]:
        """The closed form, or the hull in place of it."""
        return self.bodies if self.bodies is not None else (self.hull_body,)

    @cached_property
    def facets(self) -> Facets | None:
        """Facets of a mesh shape, flat and round ones apart; None for a drawn solid."""
        if not isinstance(self.shape, MeshShape):
            return None
        _ = self.bodies
        return Facets.of(self.raw, self._round_faces, self._fit_error)

    @cached_property
    def hull_body(self) -> ClosedForm:
        """Convex hull of the part, with its mesh to tell what of it is material."""
        made = self.mesh(0.5)
        return ClosedForm((self._hull(made.vertices),), error=made.error, surface=made.depth)

    def _hull(self, points: Array) -> Hull:
        self.counters.built["hulls"] += 1
        return hull(points)

    @property
    def refines(self) -> bool:
        """Whether a smaller chord error gives a better mesh: true of drawn solids with arcs."""
        return isinstance(self.shape, Solid) and any(e.profile.arcs for e in (*self.shape.bodies, *self.shape.holes))

    @property
    def raw(self) -> Surface:
        """The facets of a mesh shape as they are."""
        assert isinstance(self.shape, MeshShape)
        if 0.0 not in self._meshes:
            source = self.shape.mesh
            self._meshes[0.0] = self._counted(Surface(source.vertices, source.faces, 0.0))
        return self._meshes[0.0]

    def mesh(self, error: float) -> Surface:
        """Mesh within ``error`` mm, or as near as the shape allows; its own ``error`` says how near."""
        if isinstance(self.shape, MeshShape):
            raw = self.raw
            if self.shape.fit != "off":
                _ = self.bodies
                raw.error = self._fit_error
            return raw
        # Outlines without arcs are exact at any chord error: one mesh serves all.
        key = error if self.refines else 0.0
        if key not in self._meshes:
            made = mesh(self.shape, error)
            # Where two curved surfaces cross, the edge strays further than either.
            factor = 2.0 if self.shape.holes else 1.0
            model = Surface(np.array(made.vertices), np.array(made.faces, dtype=np.int64), 0.0)
            model.error = factor * chord_error(self.shape, error)
            self._meshes[key] = self._counted(model)
        return self._meshes[key]

    def _counted(self, made: Surface) -> Surface:
        self.counters.built["meshes"] += 1
        self.counters.built["triangles"] += len(made.faces)
        return made


def _bulge(shape: MeshShape) -> float:
    """How far round surfaces through the vertices can stand out of the facets, mm, from widths and bends alone."""
    import trimesh

    facets = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)
    angles, pairs, edges = facets.face_adjacency_angles, facets.face_adjacency, facets.face_adjacency_edges
    length = np.linalg.norm(np.diff(facets.vertices[edges], axis=1)[:, 0], axis=1)
    wide = 2.0 * facets.area_faces[pairs].max(axis=1) / np.maximum(length, 1e-300)
    smooth = (angles > 1e-6) & (angles < np.radians(65.0))
    # A chord w that turns by t has the sagitta w / 2 tan(t / 4).
    return float((0.5 * wide * np.tan(0.25 * angles))[smooth].max(initial=0.0))


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
