"""What the levels ask of a shape: its closed form, its meshes, the exact solid; each is made on first use.

There is one class for each kind of shape: drawn solids, solids from CAD, and given meshes.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.engine.closed_form import ClosedForm
from clamp3d.engine.convex import Ball, Rod
from clamp3d.engine.drawn import bodies_of
from clamp3d.engine.hull import Hull, hull, hull_error
from clamp3d.engine.near_faces import FaceMeshes
from clamp3d.engine.surface import Surface, at_edges
from clamp3d.errors import Clamp3dError
from clamp3d.files import cad_process
from clamp3d.files.faces import CONE, CYLINDER, OTHER, PLANE
from clamp3d.files.solid import CHORD, BrepSolid
from clamp3d.files.tessellation import COARSE, Tessellation
from clamp3d.geometry.mesh import IntArray, edges_of, encloses
from clamp3d.geometry.meshing import enclosed, enclosing
from clamp3d.geometry.pose import Array, to_target
from clamp3d.geometry.shapes import MeshShape, Shape, Solid, Sphere, cylinder
from clamp3d.geometry.triangles import normals_and_areas

if TYPE_CHECKING:
    from clamp3d.fit.features import FitResult

Progress = Callable[[str, int, int], None]
"""What is being done, how much of it is, and of how much."""


def ignore(*_: object) -> None:
    """Progress that nobody follows."""


_LARGE = 2000
"""Triangles of a mesh beyond which its hull is no quicker to ask than the mesh itself."""
MOST_FINE = 80_000
"""Triangles beyond which the fine mesh of a solid from CAD costs more than asking Open CASCADE."""
_CONVEX = 1e-9
"""Relative to its size: a mesh whose hull stands out of it by less is asked in its place."""
_SHARPEST = 0.02
"""Sine of the sharpest edge at which a round face of a given mesh is looked for beyond its facets, in its box."""
_FINE_CHORD = 0.005
"""Chord error (mm) of the finer meshes for depths of solids from CAD: half the usual contact threshold."""
QUICK_TRIANGLES = 15_000
"""Triangles of the fine meshes of a pair up to which Open CASCADE's answer takes longer than these."""
DRAWN_CHORDS = (0.5, 0.06, 0.008, 0.001)
"""Chord errors (mm) that drawn solids are meshed with; a pair still open at the last is uncertain."""

CAD_CHORDS = (COARSE, 0.0018)
"""Chord errors (mm) that solids from CAD are meshed with; what these leave open is asked of Open CASCADE.

Of two equal cylinders, one in the other, facets overlap by a chord error, and each adds its own: three fine ones are
less than the usual threshold of contact, 0.01 mm, with some to spare for splines.
"""

Forms = tuple[ClosedForm, ...]
"""Bodies in closed form whose union is a shape."""


@dataclass
class Counters:
    """What has been built (meshes, triangles, hulls, fits) and asked (by level) so far."""

    built: Counter[str] = field(default_factory=Counter)
    queries: Counter[str] = field(default_factory=Counter)


class Model:
    """All that can be known of one shape; ``counters`` counts what is built."""

    shape: Shape

    def __init__(self, shape: Shape, counters: Counters) -> None:
        self.shape = shape
        self.counters = counters
        self._meshes: dict[tuple[float, bool], Surface | None] = {}
        self._failures: dict[tuple[float, bool], Clamp3dError] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return model_of, (self.shape, Counters())

    @property
    def name(self) -> str:
        """The shape's name."""
        return self.shape.name

    @property
    def closed(self) -> bool:
        """Whether it is known what is inside: not of a mesh with open or crossed edges."""
        return True

    @property
    def is_simple(self) -> bool:
        """Whether it is closed, and no triangles cross each other: those of a given mesh may be walls inside it."""
        return True

    @property
    def bracketed(self) -> bool:
        """Whether the part lies between an inner and an outer mesh; else one mesh has an error for each triangle."""
        return False

    @property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of a box that holds the true part, mm."""
        raise NotImplementedError

    @property
    def chords(self) -> tuple[float, ...]:
        """Chord errors (mm) of the meshes that are worth a question, from coarse to fine; one where a mesh is exact.

        So it is of given triangles, too.
        """
        return DRAWN_CHORDS if self.bracketed else DRAWN_CHORDS[:1]

    @property
    def fine_chord(self) -> float:
        """Chord error (mm) of the mesh that depths are measured on."""
        return self.chords[min(1, len(self.chords) - 1)]

    @cached_property
    def bodies(self) -> Forms | None:
        """The shape in closed form; None if it has none."""
        raise NotImplementedError

    def _surface(self, chord: float, inside: bool) -> Surface | None:
        """A mesh of chord error ``chord`` mm; of a bracketed part one that lies ``inside`` of it, or around it."""
        raise NotImplementedError

    def outer(self, chord: float, *, thorough: bool = False) -> Surface:
        """Mesh of chord error ``chord`` mm that holds a drawn solid; of other shapes one whose errors are known.

        Only a ``thorough`` one is finer than ``chords``, however large it is then.
        """
        mesh = self._mesh(chord if thorough else max(chord, self.chords[-1]), inside=False)
        assert mesh is not None
        return mesh

    def inner(self, chord: float) -> Surface | None:
        """Mesh of chord error ``chord`` mm that a drawn solid holds, or None; of other shapes the same as `outer`."""
        return self._mesh(max(chord, self.chords[-1]), inside=self.bracketed)

    def _mesh(self, chord: float, *, inside: bool) -> Surface | None:
        if (chord, inside) in self._failures:  # it took its time
            raise self._failures[chord, inside].with_traceback(None)
        if (chord, inside) not in self._meshes:
            try:
                mesh = self._meshes[chord, inside] = self._surface(chord, inside)
            except Clamp3dError as error:
                self._failures[chord, inside] = error
                raise
            if mesh is not None:
                self._count(mesh)
        return self._meshes[chord, inside]

    def _count(self, mesh: Surface) -> None:
        self.counters.built["meshes"] += 1
        self.counters.built["triangles"] += len(mesh.faces)

    def depth(self, points: Array) -> Array:
        """How deep (k,) mm points (k, 3) lie inside, never too much; negative outside."""
        if self.bodies is not None:
            return np.asarray(np.max([form.depth(points) - form.error for form in self.bodies], axis=0))
        mesh = self.inner(self.chords[-1])
        if mesh is None:
            return np.full(len(points), -np.inf)
        away = mesh.distance(points)
        return np.asarray(np.where(mesh.contains(points), away, -away) - mesh.error)

    @property
    def refines(self) -> bool:
        """Whether a smaller chord error gives a better mesh."""
        return len(self.chords) > 1

    @cached_property
    def enclosing(self) -> Forms:
        """The closed form, or the convex hull of a mesh that holds the part: for lower bounds alone."""
        if self.bodies is not None:
            return self.bodies
        outer = self.outer(DRAWN_CHORDS[0])
        return (ClosedForm((self._hull(outer.vertices),), error=outer.error),)

    @cached_property
    def quick_bodies(self) -> Forms | None:
        """The closed form where it is quicker to ask than the mesh; else None."""
        if self.bodies is None or all(form.surface is None for form in self.bodies):
            return self.bodies
        return None if self._is_large else self.bodies

    @cached_property
    def _is_large(self) -> bool:
        """Whether the coarsest mesh, if there is one, has too many triangles for a closed form to be quicker."""
        return bool(self.chords) and len(self.outer(self.chords[0]).faces) > _LARGE

    def _hull_of_convex(self, mesh: Surface) -> Forms | None:
        """A mesh that is its own hull, but for rounding; None if it is not, or so large that the mesh is quicker."""
        off = hull_error(mesh.vertices, mesh.faces) if len(mesh.faces) <= _LARGE else np.inf
        if off > _CONVEX * mesh.scale:
            return None
        return (ClosedForm((self._hull(mesh.vertices),), error=mesh.error + off),)

    def _hull(self, points: Array) -> Hull:
        self.counters.built["hulls"] += 1
        return hull(points)


class DrawnModel(Model):
    """A drawn solid: exact pieces, and meshes inside and around it."""

    shape: Solid

    @cached_property
    def bracketed(self) -> bool:
        """Whether it is round somewhere; else a mesh is exact."""
        return any(outline.profile.arcs for outline in (*self.shape.bodies, *self.shape.holes))

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of the part's box, mm."""
        return self.shape.bounds

    @cached_property
    def bodies(self) -> Forms | None:
        """Convex pieces less grooves and holes; None for outlines that have no such form."""
        return bodies_of(self.shape)

    def _surface(self, chord: float, inside: bool) -> Surface | None:
        mesh = enclosed(self.shape, chord) if inside else enclosing(self.shape, chord)
        return None if mesh is None else Surface(*mesh)


class CadModel(Model):
    """A solid from CAD: its named cylinders, triangles by Open CASCADE with their errors, and the solid itself."""

    shape: BrepSolid

    def __init__(self, shape: BrepSolid, counters: Counters) -> None:
        super().__init__(shape, counters)
        # Poses along a motion mostly have the same faces near: more of these meshes would fill the memory.
        self._last_near: dict[float, tuple[tuple[int, ...], Surface]] = {}

    @property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of a box that holds the solid, mm."""
        return self.shape.bounds

    @cached_property
    def chords(self) -> tuple[float, ...]:
        """The chord errors (mm) of its meshes; none if Open CASCADE's triangles do not close: then it is asked."""
        try:
            coarse = self.shape.tessellated(CAD_CHORDS[0])
        except Clamp3dError:
            return ()
        if not encloses(coarse.vertices, coarse.faces):
            return ()
        return CAD_CHORDS if self.fine_triangles <= MOST_FINE else CAD_CHORDS[:1]

    @cached_property
    def fine_chord(self) -> float:
        """Chord error (mm) of the mesh that depths are measured on: the coarse one where finer ones take too long."""
        finest = max(self.chords[-1], _FINE_CHORD)
        try:
            self.outer(finest)
        except Clamp3dError:
            return self.chords[0]
        return finest

    @cached_property
    def fine_triangles(self) -> float:
        """About how many triangles a fine mesh has."""
        return self.fine_triangles_near(np.arange(len(self.shape.surfaces.kind)))

    def fine_triangles_near(self, faces: IntArray) -> float:
        """The same of a mesh that is fine on some of its faces, from the errors of the coarse one.

        On planes, cylinders and cones the error of a triangle is as its width squared, elsewhere as its area.
        """
        coarse = self.shape.tessellated(CAD_CHORDS[0])
        finer = np.maximum(coarse.errors / CAD_CHORDS[-1], 1.0)
        one_way = self.shape.surfaces.kind[coarse.face] <= CONE
        each = np.where(one_way, np.sqrt(finer), finer)
        return float(np.where(np.isin(coarse.face, faces), each, 1.0).sum())

    def outer_near(self, faces: IntArray, chord: float) -> Surface:
        """Mesh of chord error ``chord`` mm or finer on some of its faces, numbered (k,), and coarse elsewhere.

        Raises Clamp3dError if it has gaps.
        """
        if self._is_small:
            return self.outer(CAD_CHORDS[-1], thorough=True)
        numbers = tuple(faces.tolist())
        if chord not in self._last_near or self._last_near[chord][0] != numbers:
            mesh = self._closed(cad_process.tessellate_finely(self.shape.brep, chord, numbers))
            self._count(mesh)
            self._last_near[chord] = numbers, mesh
        return self._last_near[chord][1]

    @cached_property
    def _is_small(self) -> bool:
        """Whether a fine mesh of all of it, which all pairs share, is worth more than one of some faces for each."""
        return self.fine_triangles <= QUICK_TRIANGLES

    @cached_property
    def bodies(self) -> Forms | None:
        """Bodies around the solid with the cylinders and holes that its faces name; None without any."""
        if not self.chords:
            return None
        try:
            mesh = self.outer(CHORD, thorough=True)
        except Clamp3dError:
            return None
        if not (self.shape.surfaces.kind == CYLINDER).any():
            return self._hull_of_convex(mesh)
        from clamp3d.engine.fitted import bodies_of_fit
        from clamp3d.fit.cad import fit_solid

        tessellation = self.shape.tessellated(CHORD)
        flat = self.shape.surfaces.kind[tessellation.face] == PLANE
        return bodies_of_fit(fit_solid(self.shape), mesh, chord=tessellation.errors, flat=flat)

    @cached_property
    def quick_bodies(self) -> Forms | None:
        """The closed form where it is quicker to ask than the mesh: large free-form solids are no bars."""
        return None if self.is_free_form and self._is_large else super().quick_bodies

    @cached_property
    def is_free_form(self) -> bool:
        """Whether it has splines among its faces that are no plain surfaces."""
        return bool((self.shape.surfaces.kind == OTHER).any())

    @cached_property
    def face_meshes(self) -> FaceMeshes:
        """The coarse triangles by their faces."""
        return FaceMeshes(self.outer(CAD_CHORDS[0]), self.shape.tessellated(CAD_CHORDS[0]).face)

    def depth(self, points: Array) -> Array:
        """How deep (k,) mm points (k, 3) lie inside, by Open CASCADE; negative outside or where nobody knows."""
        return cad_process.depths(self.shape.brep, points)

    def _surface(self, chord: float, inside: bool) -> Surface:
        return self._closed(self.shape.tessellated(chord))

    def _closed(self, mesh: Tessellation) -> Surface:
        if not encloses(mesh.vertices, mesh.faces):  # as coarse ones do, or nobody asks for finer ones
            raise Clamp3dError(f"the triangles of {self.name} do not close")
        return Surface(mesh.vertices, mesh.faces, mesh.errors, has_own_errors=True)


class MeshModel(Model):
    """Given triangles, with the round surfaces that a fit finds in them."""

    shape: MeshShape

    @property
    def closed(self) -> bool:
        """Whether it is known what is inside: not of a mesh with open or crossed edges."""
        return self.shape.mesh.watertight

    @cached_property
    def is_simple(self) -> bool:
        """Whether it is closed, and no triangles cross each other: then each has the part on one side."""
        return self.closed and not self.shape.mesh.crosses_itself()

    @property
    def bracketed(self) -> bool:
        """Whether the fit says that it is a cylinder: then meshes lie inside and around that."""
        return self._cylinder is not None

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of a box that holds the true part, mm."""
        V = self.shape.mesh.vertices
        reach = self.shape.error + (_bulge(self.shape) if self.shape.fit != "off" else 0.0)
        return np.array([V.min(axis=0) - reach, V.max(axis=0) + reach])

    @cached_property
    def bodies(self) -> Forms | None:
        """Bodies around the mesh with the cylinders, grooves and holes of the fit, or its hull if it is convex."""
        if not self.is_simple:
            return None
        mesh = self._facets
        if self._fit is None or not self._fit.features:
            return self._hull_of_convex(mesh)
        from clamp3d.engine.fitted import bodies_of_fit

        return bodies_of_fit(self._fit, mesh, stated=self.shape.error)

    @cached_property
    def _fit(self) -> FitResult | None:
        """Round surfaces found in the mesh; None where none are looked for."""
        if self.shape.fit == "off" or not self.is_simple:
            return None
        from clamp3d.fit.fit import fit_mesh

        self.counters.built["fits"] += 1
        return fit_mesh(self.shape.mesh)

    @cached_property
    def _cylinder(self) -> tuple[Rod, float] | None:
        """The cylinder that the fit takes all of the mesh for, and its error (mm); None if some is something else."""
        match self.bodies if self._fit is not None else None:
            case (ClosedForm(outers=(Rod() as rod,), bores=(), error=error, surface=None),):
                return rod, error
        return None

    def _surface(self, chord: float, inside: bool) -> Surface | None:
        if self._cylinder is None:
            return self._facets
        rod, error = self._cylinder
        mesh = (enclosed if inside else enclosing)(cylinder(rod.radius, rod.length), chord)
        if mesh is None:
            return None
        vertices, faces = mesh
        return Surface(to_target(rod.T, vertices), faces, np.full(len(faces), error))

    @cached_property
    def _facets(self) -> Surface:
        """The triangles; round faces are off by the error of the fit, all by what the shape states."""
        V, F = self.shape.mesh.vertices, self.shape.mesh.faces
        error = np.full(len(F), self.shape.error)
        patch = np.zeros(len(F), dtype=np.int64)
        for k, feature in enumerate(self._fit.features if self._fit is not None else ()):
            error[feature.faces] = np.maximum(error[feature.faces], feature.error_bound + self.shape.error)
            patch[feature.faces] = k + 1
        return Surface(V, F, at_edges(V, F, error, patch) if patch.any() else error, self.is_simple)


class SphereModel(MeshModel):
    """A ball, and facets with their corners on it."""

    shape: Sphere

    @property
    def is_simple(self) -> bool:
        """It is: nobody has to look for triangles that cross each other."""
        return True

    @property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of the ball's box, mm."""
        return np.outer([-self.shape.radius, self.shape.radius], np.ones(3))

    @cached_property
    def bodies(self) -> Forms | None:
        """The ball itself."""
        return (ClosedForm((Ball(self.shape.radius, np.eye(4)),)),)


def model_of(shape: Shape, counters: Counters) -> Model:
    """The model of a shape, by its kind."""
    if isinstance(shape, Solid):
        return DrawnModel(shape, counters)
    if isinstance(shape, Sphere):
        return SphereModel(shape, counters)
    return CadModel(shape, counters) if isinstance(shape, BrepSolid) else MeshModel(shape, counters)


def _bulge(shape: MeshShape) -> float:
    """How far round surfaces through the vertices can stand out of the facets, mm, from widths and bends alone."""
    V, F = shape.mesh.vertices, shape.mesh.faces
    edges, pairs, _ = edges_of(F, 2)
    normals, areas = (of_each[pairs] for of_each in normals_and_areas(V[F]))
    across = np.linalg.norm(np.cross(normals[:, 0], normals[:, 1]), axis=1)
    angles = np.arctan2(across, np.einsum("ij,ij->i", normals[:, 0], normals[:, 1]))
    length = np.linalg.norm(V[edges[:, 1]] - V[edges[:, 0]], axis=1)
    wide = 2.0 * areas.max(axis=1) / np.maximum(length, 1e-300)
    smooth = (angles > 1e-6) & (angles < np.radians(65.0))
    # A chord w that turns by t has the sagitta w / 2 tan(t / 4).
    sagitta = np.where(smooth, 0.5 * wide * np.tan(0.25 * angles), 0.0)
    bulge, knife = np.zeros(len(F)), angles > 0.5 * np.pi
    np.maximum.at(bulge, pairs.reshape(-1), np.repeat(sagitta, 2))
    tips = bulge[pairs[knife]].sum(axis=1) / np.maximum(np.sin(angles[knife]), _SHARPEST)  # as `at_edges` has it
    return float(max(sagitta.max(initial=0.0), tips.max(initial=0.0)))


def box_corners(bounds: Array) -> Array:
    """Corners (8, 3) of a box (2, 3)."""
    return np.array(list(itertools.product(*bounds.T)))


class ModelCache:
    """The models of a scene's shapes, shared by equal shapes, kept as long as it lives."""

    def __init__(self) -> None:
        self.counters = Counters()
        self._models: dict[Shape, Model] = {}

    def model(self, shape: Shape) -> Model:
        """The one model of a shape and its equals."""
        if shape not in self._models:
            self._models[shape] = model_of(shape, self.counters)
        return self._models[shape]
