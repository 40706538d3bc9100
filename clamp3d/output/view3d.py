"""Pictures of meshes in parallel projection with hidden lines removed, drawn on matplotlib axes.

matplotlib sorts whole triangles by depth, which fails where grooves and wires reach into each other; so depth is kept
per pixel here, and edges are drawn as lines where that depth says they are seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clamp3d.geometry.pose import Array
from clamp3d.output.palette import darker, rgb
from clamp3d.output.placed import PosedMesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CREASE = math.radians(25.0)
"""Edges sharper than this are drawn; below it the facets stand for one round surface."""
_GHOST = 0.35
"""How opaque a part is that hides what is to be seen."""
_LIGHT = np.array([-0.35, 0.62, 0.70])


@dataclass(frozen=True, slots=True)
class Camera:
    """Parallel projection; ``azimuth`` turns it to the right and ``elevation`` up from the view along +Y; rad."""

    azimuth: float = math.radians(32.0)
    elevation: float = math.radians(24.0)

    def axes(self) -> Array:
        """Rows (3, 3): right, up, and towards the viewer, in the world."""
        ca, sa = math.cos(self.azimuth), math.sin(self.azimuth)
        ce, se = math.cos(self.elevation), math.sin(self.elevation)
        return np.array([[ca, sa, 0.0], [-sa * se, ca * se, ce], [sa * ce, -ca * ce, se]])

    def project(self, points: Array) -> Array:
        """World points (n, 3) to (right, up, depth towards the viewer) (n, 3) in mm."""
        return points @ self.axes().T


class Raster:
    """A window of a view in pixels, (rows, columns) from its lower left corner ``low`` (2,) mm at least to ``high``.

    ``depth`` is that of the nearest face towards the viewer, mm, -inf where there is none; ``image`` is RGBA.
    """

    def __init__(self, camera: Camera, low: Array, high: Array, pixels_per_mm: float) -> None:
        columns, rows = np.ceil((high - low) * pixels_per_mm).astype(int)
        self.camera, self.low, self.pixels_per_mm = camera, low, pixels_per_mm
        self.depth, self.image = np.full((rows, columns), -np.inf), np.zeros((rows, columns, 4))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top in mm."""
        width, height = np.array(self.depth.shape[::-1]) / self.pixels_per_mm
        return float(self.low[0]), float(self.low[0] + width), float(self.low[1]), float(self.low[1] + height)

    def pixels(self, points: Array) -> Array:
        """World points (..., 3) as (column, row, depth)."""
        pixels: Array = self.camera.project(points) - [*self.low, 0.0]
        return pixels * [self.pixels_per_mm, self.pixels_per_mm, 1.0]

    def paint(self, solid: PosedMesh) -> None:
        """Paint the faces of a solid that face the viewer, where they are nearer than what is there."""
        normals = self.camera.project(solid.mesh.face_normals @ solid.T[:3, :3].T)
        shades = np.array(rgb(solid.colour)) / 255.0 * (0.62 + 0.43 * np.maximum(0.0, normals @ _LIGHT))[:, None]
        corners = self.pixels(solid.world)[solid.mesh.faces]
        size = np.array(self.depth.shape[::-1])
        inside = (corners[..., :2].max(1) >= 0.0).all(1) & (corners[..., :2].min(1) <= size).all(1)
        for i in np.flatnonzero((normals[:, 2] > 1e-9) & inside):
            self._fill(corners[i], np.append(np.minimum(shades[i], 1.0), 1.0))

    def _fill(self, triangle: Array, colour: Array) -> None:
        (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = triangle
        twice = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if abs(twice) < 1e-9:
            return
        left, bottom = np.maximum(np.floor(triangle[:, :2].min(0)), 0).astype(int)
        right, top = np.ceil(triangle[:, :2].max(0)).astype(int) + 1
        window = self.depth[bottom:top, left:right]
        y, x = np.ogrid[bottom : bottom + window.shape[0], left : left + window.shape[1]]
        x, y = x + 0.5, y + 0.5
        b = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / twice
        c = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / twice
        z = z0 + b * (z1 - z0) + c * (z2 - z0)
        nearer = (b >= -1e-6) & (c >= -1e-6) & (b + c <= 1.0 + 1e-6) & (z > window)
        window[nearer] = z[nearer]
        self.image[bottom:top, left:right][nearer] = colour

    def seen(self, pixels: Array) -> NDArray[np.bool_]:
        """Which of these (n, 3) pixels with their depth nothing hides."""
        rows, columns = np.floor(pixels[:, 1::-1]).astype(int).T
        height, width = self.depth.shape
        nearest = self._farthest_near[rows.clip(0, height - 1), columns.clip(0, width - 1)]
        return np.asarray(pixels[:, 2] >= nearest - 0.25 / self.pixels_per_mm)

    @cached_property
    def _farthest_near(self) -> Array:
        # An edge lies between pixels of its own two faces: seen if it is not behind all the pixels around it.
        from scipy.ndimage import minimum_filter

        return np.asarray(minimum_filter(self.depth, 3, mode="nearest"))

    def visible_edges(self, solid: PosedMesh) -> list[Array]:
        """The stretches (2, 2) of creases and outlines that nothing hides, in mm."""
        view = self.pixels(solid.world)
        stretches: list[Array] = []
        for a, b in view[_edges(solid, self.camera)]:
            n = max(2, math.ceil(float(np.hypot(*(b - a)[:2]))))
            points = a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a)
            change = np.diff(np.concatenate([[False], self.seen(points), [False]]).astype(int))
            starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1
            stretches += [points[[s, e], :2] for s, e in zip(starts, ends, strict=True) if e > s]
        return [self.low + stretch / self.pixels_per_mm for stretch in stretches]


def draw_solids(
    ax: Axes,
    solids: Sequence[PosedMesh],
    camera: Camera,
    *,
    pixels: int = 1100,
    window: tuple[Array, Array] | None = None,
    inside: Sequence[PosedMesh] | None = None,
) -> Raster:
    """Draw the solids with shading and their visible edges, ``pixels`` along the longer side; axes in mm.

    ``window`` ((2,) least, (2,) largest, mm to the right and up) is what to show, if not all. With solids
    ``inside`` to be seen the others are ghosts: pale, each with its own visible edges. Returns what hides what.
    """
    from matplotlib.collections import LineCollection

    if window is None:
        views = np.concatenate([camera.project(solid.world)[:, :2] for solid in solids])
        margin = 5.0 * float(np.ptp(views, axis=0).max()) / pixels
        window = views.min(0) - margin, views.max(0) + margin
    ax.set_aspect("equal")
    ax.set_axis_off()
    layers = [solids] if inside is None else [*([solid] for solid in solids), inside]
    for zorder, layer in enumerate(layers):
        raster = Raster(camera, *window, pixels / float((window[1] - window[0]).max()))
        alpha = 1.0 if inside is None or layer is inside else _GHOST
        for solid in layer:
            raster.paint(solid)
        ax.imshow(
            raster.image, extent=raster.extent, origin="lower", interpolation="antialiased", alpha=alpha, zorder=zorder
        )
        for solid in layer:
            lines, colour = raster.visible_edges(solid), darker(solid.colour, 0.4)
            ax.add_collection(LineCollection(lines, colors=colour, linewidths=0.6, zorder=zorder + 0.5))
    ax.set(xlim=raster.extent[:2], ylim=raster.extent[2:])
    return raster


def _edges(solid: PosedMesh, camera: Camera) -> NDArray[np.int64]:
    """Vertex pairs (n, 2) of creases and of outlines against the view."""
    mesh = solid.mesh
    towards = mesh.face_normals @ solid.T[:3, :3].T @ camera.axes()[2]
    front = towards[mesh.face_adjacency] > 0.0
    crease = (mesh.face_adjacency_angles > _CREASE) & front.any(1)
    outline = front[:, 0] != front[:, 1]
    return np.asarray(mesh.face_adjacency_edges[crease | outline], dtype=np.int64)
