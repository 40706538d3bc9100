"""Triangle meshes of the parts, made only when asked for; the chord error is chosen, computed and stated.

Chords are inscribed: convex arcs (wires, shank, round back) lose material, grooves and holes gain it. Nothing else
differs from the analytic part, so the volume lies within bounds that are computed from the chords themselves.
`enclosing` and `enclosed` meshes take tangents where chords would lie on the wrong side: a part lies between the two
whatever its faces cut, at any angle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.checks import instance
from clamp3d.errors import Clamp3dError
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.manifolds import arrays_of, as_manifold
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import Profile, Side, check_mesh_error
from clamp3d.geometry.shapes import Solid

if TYPE_CHECKING:
    import trimesh
    from shapely import Polygon

_THROUGH = 1.0  # mm by which a hole's tool stands out at both ends, so that no two faces coincide
_SLIVER = 1e-9
"""Width, relative to an outline's extent, of what rounding may leave between two lines that coincide."""


def mesh(part: Solid, mesh_error: float = 0.01) -> trimesh.Trimesh:
    """Watertight triangle mesh of a part in its own frame, wound outward.

    Parameters
    ----------
    part : Solid
        Part of a clamp, or another one of outlines drawn along an axis.
    mesh_error : float
        Largest distance in mm between an arc and its chord.

    Returns
    -------
    trimesh.Trimesh
        The mesh in mm; its ``metadata`` hold ``part``, ``mesh_error`` as asked for and ``chord_error`` as it is.

    Raises
    ------
    InputError
        For a bad error, or what is no `Solid`.
    Clamp3dError
        If one of the part's sizes vanishes beside the others.

    Examples
    --------
    >>> from clamp3d.clamp.loader import load_clamp
    >>> from clamp3d.clamp.parts import parts
    >>> nut = mesh(parts(load_clamp())["P5"], 0.1)
    >>> nut.is_watertight, nut.units, round(nut.metadata["chord_error"], 4)
    (True, 'mm', 0.0856)
    """
    import trimesh

    mesh_error = check_mesh_error(mesh_error)
    instance("part", part, Solid)
    V, F = arrays_of(_solid(part, mesh_error, "chords"))
    out = trimesh.Trimesh(
        vertices=V,
        faces=F,
        process=False,
        metadata={"part": part.name, "mesh_error": mesh_error, "chord_error": chord_error(part, mesh_error)},
    )
    out.units = "mm"
    return out


def enclosed(part: Solid, mesh_error: float) -> tuple[Array, NDArray[np.int64]] | None:
    """Vertices (n, 3) mm and faces (m, 3) of a closed mesh that lies wholly in the part; None where nothing is left."""
    solid = _solid(part, mesh_error, "inner")
    return None if solid.is_empty() else arrays_of(solid)


def enclosing(part: Solid, mesh_error: float) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 3) mm and faces (m, 3) of a closed mesh that the part lies wholly in."""
    return arrays_of(_solid(part, mesh_error, "outer"))


def chord_error(part: Solid, mesh_error: float) -> float:
    """Largest distance in mm between an arc of the part and its chords in ``mesh(part, mesh_error)``."""
    return max(shape.profile.chord_error(mesh_error) for shape in (*part.bodies, *part.holes))


def volume_bounds(part: Solid, mesh_error: float) -> tuple[float, float]:
    """Least and largest volume in mm^3 that ``mesh(part, mesh_error)`` can have, from its chords.

    Each arc's chords cut off an area; times the length it is drawn along, that is the most a body loses on a convex
    arc and gains on a concave one. A hole is the other way round.
    """
    assert part.volume is not None  # of a clamp's parts it is known in closed form
    low = high = part.volume
    for body in part.bodies:
        lost, gained = body.profile.chord_areas(mesh_error)
        low -= lost * body.length
        high += gained * body.length
    for hole in part.holes:
        lost, gained = hole.profile.chord_areas(mesh_error)
        low -= gained * hole.length
        high += lost * hole.length
    return low, high


def _solid(part: Solid, mesh_error: float, side: Side) -> Any:
    import manifold3d

    solid = manifold3d.Manifold()
    for body in part.bodies:
        solid += _extrude(body, mesh_error, side)
    tool: dict[Side, Side] = {"chords": "chords", "inner": "outer", "outer": "inner"}
    for hole in part.holes:
        solid -= _extrude(hole, mesh_error, tool[side], _THROUGH)
    if solid.status() != manifold3d.Error.NoError:
        raise Clamp3dError(f"mesh of {part.name}: manifold3d reports {solid.status().name}")
    if solid.is_empty() and side != "inner":
        raise Clamp3dError(f"mesh of {part.name} is empty: one of its sizes vanishes beside the others")
    return solid


def _extrude(shape: Extrusion, mesh_error: float, side: Side, overlap: float = 0.0) -> Any:
    """Closed prism over the outline, caps without new vertices."""
    import manifold3d
    from shapely.geometry.polygon import orient

    ends = shape.start - overlap, shape.end + overlap
    solid = manifold3d.Manifold()
    for outline in map(orient, _polygons(shape.profile, mesh_error, side)):
        rings = [np.array(ring.coords)[:-1] for ring in (outline.exterior, *outline.interiors)]
        corners = np.concatenate(rings)
        n = len(corners)
        caps = np.asarray(manifold3d.triangulate(rings))
        first = np.arange(n)
        starts = np.cumsum([len(ring) for ring in rings])[:-1]
        second = np.concatenate([np.roll(part, -1) for part in np.split(first, starts)])
        sides = [np.stack([first, second, second + n], axis=1), np.stack([first, second + n, first + n], axis=1)]
        points = np.concatenate([np.column_stack([corners, np.full(n, end)]) for end in ends])
        faces = np.concatenate([caps[:, ::-1], caps + n, *sides])
        # Not by trimesh: it takes 0.4 s to import, merges vertices, and its booleans round them to single precision.
        solid += as_manifold(points @ shape.frame.T, faces)
    return solid


def _polygons(profile: Profile, mesh_error: float, side: Side) -> list[Polygon]:
    """The outline as polygons: one, or where it crosses itself the pieces that are left, or that are to be joined."""
    from shapely import Polygon, make_valid, union_all

    whole = Polygon(profile.polygon(mesh_error, side))
    if whole.is_valid:
        return [whole]
    # Tangents cross a neighbour, or chords do in a thin wall: there the outline of chords is wrong only in the lenses
    # between chords and tangents. These are added or taken away by themselves, of all arcs.
    chords = make_valid(Polygon(profile.polygon(mesh_error)))
    lenses = []
    for arc in profile.arcs:
        corners = [*arc.chords(mesh_error, arc.start), arc.end]
        lenses.append(Polygon([*corners, *reversed(arc.tangents(mesh_error, arc.start))]).buffer(0.0))
    if side == "chords":
        polygons = [chords]
    elif side == "outer":  # their union in the plane would have cracks along the chords: `_extrude` joins the prisms
        polygons = [chords, *lenses]
    else:  # taken away a little wider, else slivers are left along chords of concave arcs, which lie outside
        width = _SLIVER * float(np.ptp(profile.bounds, axis=0).max())
        polygons = [chords.difference(union_all(lenses).buffer(width, join_style="mitre"))]
    parts = [part for some in polygons for part in getattr(some, "geoms", [some])]
    return [part for part in parts if part.geom_type == "Polygon" and not part.is_empty]
