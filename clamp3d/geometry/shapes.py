"""Shapes that a scene is made of: drawn solids (cylinders, boxes, groove blocks, clamp parts) and meshes.

Every drawn solid is outlines drawn along an axis, less holes that go right through, as the parts of a clamp are; equal
shapes are equal values, so a thousand equal bolts share one model.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import array, choice, instance, items, number, text
from clamp3d.errors import InputError
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.mesh import IntArray, Mesh, make_mesh
from clamp3d.geometry.pose import Array, norm
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc, place
from clamp3d.geometry.primitives import size as _size
from clamp3d.geometry.profile import MIN_MESH_ERROR, Arc, Profile

Fit = Literal["round", "off"]
FITS: tuple[Fit, ...] = ("round", "off")


@dataclass(frozen=True, slots=True)
class Solid:
    """Union of ``bodies`` (they touch at most) less ``holes`` (each right through, of any outline); part frame, mm.

    Equal outlines are equal solids, whatever they are called. ``title`` says in words what it is, ``volume`` is its
    volume in mm^3 where a closed form is known, ``not_modelled`` what the real part has and this one has not.
    """

    name: str = field(compare=False)
    bodies: tuple[Extrusion, ...]
    holes: tuple[Extrusion, ...] = ()
    title: str = field(default="", compare=False, kw_only=True)
    volume: float | None = field(default=None, compare=False, kw_only=True)
    not_modelled: str = field(default="", compare=False, kw_only=True)

    def __post_init__(self) -> None:
        text("name of a solid", self.name)
        for key in ("bodies", "holes"):
            checked = items(f"{key} of solid {self.name}", getattr(self, key), "extrusions")
            for item in checked:
                instance(f"{key} of solid {self.name}", item, Extrusion)
            object.__setattr__(self, key, checked)
        if not self.bodies:
            raise InputError(f"bodies of solid {self.name} must be at least one extrusion")

    @property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of the bounding box in part axes, mm; arcs taken as arcs."""
        return self.bounds_at(np.eye(4))

    def bounds_at(self, T: Array) -> Array:
        """Lower and upper corner (2, 3) of the bounding box along the target's axes, placed by ``T`` (4, 4)."""
        reach = [[max(body.support(s * axis) for body in self.bodies) for axis in T[:3, :3]] for s in (-1.0, 1.0)]
        return np.array([T[:3, 3] - reach[0], T[:3, 3] + reach[1]]) + 0.0


@dataclass(frozen=True, slots=True)
class Hole:
    """A round hole right through a solid along its ``axis`` y or z, centred at ``at``: (x, z) or (x, y) mm.

    Raises InputError for values out of range.
    """

    radius: float
    at: tuple[float, float] = (0.0, 0.0)
    axis: Literal["y", "z"] = "z"

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", _size("hole radius", self.radius))
        u, v = (place("hole at", x) for x in array("hole at", self.at, (2,)))
        object.__setattr__(self, "at", (u, v))
        choice("hole axis", self.axis, ("y", "z"))


_THINNEST = 1e-4
"""What holes leave of a part that is thinner than twice this, relative to its extent, is nothing."""
FARTHEST_OFF = 1e5
"""A mesh that may be so far (mm) from its surface says nothing of it; the bounds of much larger ones overflow."""


@dataclass(frozen=True, slots=True, eq=False)
class MeshShape:
    """A mesh, and what to make of its round surfaces.

    ``fit``: "off" takes the facets as the part; "round" takes grooves, cylinders and holes as round surfaces through
    the vertices (what a CAD export is) and adds the fit's error, and takes the facets where it finds none. ``error``
    mm: how far the true surface can be from the facets, as stated by who made them. A mesh that is not closed is
    measured as a surface: what is inside of it is not known.
    """

    mesh: Mesh
    fit: Fit = "off"
    name: str = field(default="mesh")
    error: float = 0.0

    def __post_init__(self) -> None:
        instance("mesh", self.mesh, Mesh)
        choice("fit", self.fit, FITS)
        text("name of a mesh", self.name)
        if not 0.0 <= number("error of a mesh", self.error) < FARTHEST_OFF:
            raise InputError(f"error of a mesh must be >= 0 and < {FARTHEST_OFF:g} mm, got {self.error}")


@dataclass(frozen=True, slots=True, eq=False)
class Sphere(MeshShape):
    """A ball about the origin of ``radius`` mm, with facets whose corners lie on it for whoever needs them.

    Those of one radius and one ``error`` of their facets are equal.
    """

    radius: float = field(kw_only=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sphere) and (self.radius, self.error) == (other.radius, other.error)

    def __hash__(self) -> int:
        return hash((self.radius, self.error))

    def bounds_at(self, T: Array) -> Array:
        """Lower and upper corner (2, 3) of the bounding box along the target's axes, placed by ``T`` (4, 4)."""
        return np.array([T[:3, 3] - self.radius, T[:3, 3] + self.radius])


Shape: TypeAlias = Solid | MeshShape
AnyShape: TypeAlias = Shape | Mesh | Cylinder | Capsule | SweptArc


def _drilled(name: str, body: Extrusion, holes: Sequence[Hole], low: Array, high: Array) -> Solid:
    """A body with round holes right through its box. Raises InputError if they lie beside it or leave nothing of it."""
    extrusions = []
    for hole in items("holes", holes, "holes"):
        instance("hole", hole, Hole)
        across = [0, 2] if hole.axis == "y" else [0, 1]
        if norm(np.maximum(np.maximum(low[across] - hole.at, hole.at - high[across]), 0.0)) >= hole.radius:
            raise InputError(f"hole of radius {hole.radius:g} mm at {hole.at} lies beside the part")
        if norm(np.maximum(high[across] - hole.at, hole.at - low[across])) <= hole.radius:
            raise InputError(f"hole of radius {hole.radius:g} mm at {hole.at} leaves nothing of the part")
        if hole.axis == "z":
            extrusions.append(Extrusion(Profile.circle(hole.radius, hole.at), "Z", float(low[2]), float(high[2])))
        else:  # outlines along Y are (u, v) = (x, -z)
            centre = (hole.at[0], -hole.at[1])
            extrusions.append(Extrusion(Profile.circle(hole.radius, centre), "Y", float(low[1]), float(high[1])))
    solid = Solid(name, (body,), tuple(extrusions))
    if len(extrusions) > 1 and sum(hole.volume for hole in extrusions) >= body.volume:
        from clamp3d.geometry.meshing import enclosed

        error = max(_THINNEST * float((high - low).max()), MIN_MESH_ERROR)
        if enclosed(solid, error) is None:
            nothing = f"{len(extrusions)} holes together leave nothing of the part"
            raise InputError(f"{nothing} that is thicker than {2.0 * error:.2g} mm")
    return solid


def cylinder(radius: float, length: float, *, bore: float = 0.0, name: str = "cylinder") -> Solid:
    """Cylinder on z, centred, flat ends; ``bore`` > 0 makes it a tube. Raises InputError for sizes that are not > 0."""
    radius, half, bore = _size("radius", radius), _size("length", length) / 2, number("bore", bore)
    if bore != 0.0 and not 0.0 < bore < radius:
        raise InputError(f"bore must be between 0 and radius = {radius:g} mm, got {bore}")
    holes = (Extrusion(Profile.circle(bore), "Z", -half, half),) if bore else ()
    return Solid(name, (Extrusion(Profile.circle(radius), "Z", -half, half),), holes)


def box(
    size: float | Sequence[float],
    y: float | None = None,
    z: float | None = None,
    *,
    holes: Sequence[Hole] = (),
    name: str = "box",
) -> Solid:
    """Box centred in the origin, with round holes right through it.

    Parameters
    ----------
    size : float or sequence of 3 floats
        Length in mm along x, with ``y`` and ``z`` beside it; or all three lengths.
    y, z : float, optional
        Lengths in mm along y and z, where ``size`` is one number.
    holes : sequence of Hole
        Holes along y or z.
    name : str
        Name for messages.

    Returns
    -------
    Solid
        The box.

    Raises
    ------
    InputError
        If a length is not > 0, a hole lies beside the box, or the holes leave nothing of it.

    Examples
    --------
    >>> box(10, 20, 5) == box((10, 20, 5))
    True
    """
    if y is not None or z is not None:
        if y is None or z is None or np.ndim(size):
            raise InputError("size of a box must be three numbers (x, y, z) in mm, or one sequence of them")
        size = (number("size", size), number("size", y), number("size", z))
    x, y, z = (_size("size", value) for value in array("size", size, (3,)))
    corner = np.array([x, y, z]) / 2
    body = Extrusion(Profile.rectangle(x, y), "Z", -z / 2, z / 2)
    return _drilled(name, body, holes, -corner, corner)


def extrusion(outline: Profile | ArrayLike, height: float, *, name: str = "extrusion") -> Solid:
    """Outline drawn along z, from ``-height / 2`` to ``height / 2``.

    Parameters
    ----------
    outline : Profile or array_like of shape (n, 2)
        Outline of segments and arcs, or the corners (x, y) of a polygon in mm, in either turn.
    height : float
        Length in mm along z.
    name : str
        Name for messages.

    Returns
    -------
    Solid
        The prism.

    Raises
    ------
    InputError
        If the height is not > 0, or the outline encloses no area or crosses itself.

    Examples
    --------
    >>> extrusion([(0, 0), (4, 0), (0, 3)], 2.0).bounds.tolist()
    [[0.0, 0.0, -1.0], [4.0, 3.0, 1.0]]
    """
    half = _size("height", height) / 2
    if not isinstance(outline, Profile):
        points = array("outline", outline, (None, 2))
        corners = [(place("outline", a), place("outline", b)) for a, b in points]
        x, y = (points - points.mean(axis=0)).T if len(points) else np.zeros((2, 0))
        area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        if area == 0.0:
            raise InputError("outline must enclose an area > 0 mm^2")
        outline = Profile.of(*(corners if area > 0.0 else corners[::-1]))
    return Solid(name, (Extrusion(outline, "Z", -half, half),))


FINEST_SPHERE = 1e-5
"""Least error of a sphere's facets relative to its radius: a third of a million of them."""


def sphere(radius: float, *, mesh_error: float | None = None, name: str = "sphere") -> Sphere:
    """Sphere about the origin: distances are those of the true ball, its facets serve for volumes, pages and files.

    Parameters
    ----------
    radius : float
        Radius in mm.
    mesh_error : float, optional
        Largest distance in mm between a facet and the sphere; a thousandth of the radius if it is not stated.
    name : str
        Name for messages.

    Returns
    -------
    Sphere
        The ball, with a ``mesh`` that has its corners on it and lies below it by its ``error`` at most.

    Raises
    ------
    InputError
        If the radius is not > 0, or the error is less than a hundred thousandth of it.

    Examples
    --------
    >>> sphere(10.0, mesh_error=0.1).error < 0.1
    True
    """
    radius = _size("radius", radius)
    limit = radius / 1000 if mesh_error is None else number("mesh_error", mesh_error)
    if not limit >= FINEST_SPHERE * radius:
        raise InputError(f"mesh_error of a sphere must be >= {FINEST_SPHERE * radius:g} mm, got {mesh_error}")
    for subdivisions in range(9):
        vertices, faces, gap = _unit_ball(subdivisions)
        if gap * radius <= limit:
            break
    rounding = 1e-12 * radius
    mesh = Mesh(name, radius * vertices, faces, True, rounding)
    return Sphere(mesh, name=name, error=gap * radius + rounding, radius=radius)


@lru_cache(maxsize=9)
def _unit_ball(subdivisions: int) -> tuple[Array, IntArray, float]:
    """Corners (n, 3) and triangles (m, 3) of an icosahedron in the unit sphere, subdivided, and how far it is below."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    gap = 1.0 - float((ball.triangles[:, 0] * ball.face_normals).sum(axis=1).min())
    vertices, faces = np.array(ball.vertices), np.array(ball.faces)
    faces.flags.writeable = False  # all spheres share them
    return vertices, faces, gap


def groove_block(
    groove: SweptArc,
    width: float,
    height: float,
    *,
    others: Sequence[tuple[float, float, float]] = (),
    holes: Sequence[Hole] = (),
    name: str = "groove block",
) -> Solid:
    """Block with a groove, in the groove's own frame: axis on z, arc about the origin centred on -y, mouth to +y.

    ``width`` mm along x, centred on the groove; ``height`` mm from the face with the mouth down to the back. ``others``
    are more grooves in the same face: (offset x mm, radius mm, half angle rad). Raises InputError if a groove leaves
    the block or meets another one.

    >>> block = groove_block(SweptArc(7.0, math.radians(60), 50.0), 40.0, 20.0)
    >>> block.bounds.tolist()
    [[-20.0, -23.5, -25.0], [20.0, -3.5, 25.0]]
    """
    instance("groove", groove, SweptArc)
    width, height = _size("width", width), _size("height", height)
    sides = [
        tuple(array("others", other, (3,)).tolist()) for other in items("others", others, "(x, radius, half angle)")
    ]
    face = -groove.radius * math.cos(groove.half_angle)
    arcs = []
    for x, radius, half in sorted([(0.0, groove.radius, groove.half_angle), *sides], reverse=True):
        SweptArc(radius, half, groove.length)
        centre = face + radius * math.cos(half)
        reach = radius * math.sin(min(half, math.pi / 2))
        if abs(x) + reach >= width / 2:
            raise InputError(f"groove at x = {x:g} mm leaves the block: width must be > {2 * (abs(x) + reach):g} mm")
        if face - height >= centre - radius:
            raise InputError(f"groove at x = {x:g} mm cuts the back: height must be > {face - centre + radius:g} mm")
        arcs.append((x, reach, Arc((x, centre), radius, -math.pi / 2 + half, -math.pi / 2 - half)))
    for (x0, r0, _), (x1, r1, _) in itertools.pairwise(arcs):
        if x0 - r0 <= x1 + r1:
            raise InputError(f"grooves at x = {x1:g} and {x0:g} mm meet: they must be > {r0 + r1:g} mm apart")
    w, back, half_length = width / 2, face - height, groove.length / 2
    outline = Profile.of((-w, face), (-w, back), (w, back), (w, face), *(arc for _, _, arc in arcs))
    low, high = np.array([-w, back, -half_length]), np.array([w, face, half_length])
    return _drilled(name, Extrusion(outline, "Z", -half_length, half_length), holes, low, high)


def as_shape(shape: Any) -> Shape:
    """The shape that a scene works on: a bare cylinder as a solid, a mesh as its facets (mm), others as they are.

    Raises InputError for a `SweptArc` (it has no outer faces), for a `Capsule` and for anything that is no shape.
    """
    if isinstance(shape, (Solid, MeshShape)):
        return shape
    if isinstance(shape, Cylinder):
        return cylinder(shape.radius, shape.length)
    if isinstance(shape, Mesh):
        return MeshShape(shape)
    if isinstance(shape, Capsule):
        raise InputError(
            "a Capsule is measured against a SweptArc only (kernel.signed_distance, first_contact, min_clearance); "
            "make a part of a Solid, MeshShape or Cylinder"
        )
    if isinstance(shape, SweptArc):
        raise InputError("a SweptArc has no outer faces: make a part of it with groove_block(groove, width, height)")
    if type(shape).__module__.startswith("trimesh") and hasattr(shape, "faces"):
        return MeshShape(make_mesh(shape.vertices, shape.faces))
    raise InputError(
        f"a part's shape must be a Solid, MeshShape, Mesh, Cylinder or a mesh of trimesh, got {type(shape).__name__}"
    )
