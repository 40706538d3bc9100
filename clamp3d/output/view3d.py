"""Pictures of meshes in parallel projection with hidden lines removed, drawn on matplotlib axes.

matplotlib sorts whole triangles by depth, which fails where grooves and wires reach into each other; so depth is kept
per pixel here, and edges are drawn as lines where that depth says they are seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
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

    def view(self, solid: PosedMesh) -> Array:
        """The solid's vertices as `project` gives them."""
        return self.project(solid.world)


def draw_solids(
    ax: Axes,
    solids: Sequence[PosedMesh],
    camera: Camera,
    *,
    pixels: int = 1100,
    window: tuple[Array, Array] | None = None,
    zorder: float = 1.0,
) -> None:
    """Draw the solids with shading and their visible edges, ``pixels`` along the longer side; axes in mm.

    ``window`` ((2,) least, (2,) largest, mm to the right and up) is what to show, if not all.
    """
    from matplotlib.collections import LineCollection

    views = [camera.view(s) for s in solids]
    if window is None:
        low, high = np.min([v.min(0) for v in views], axis=0)[:2], np.max([v.max(0) for v in views], axis=0)[:2]
        margin = 5.0 * float((high - low).max()) / pixels
        low, high = low - margin, high + margin
    else:
        low, high = window
        margin = 0.0
    pixels_per_mm = pixels / float((high - low).max() - 2.0 * margin)
    size = np.ceil((high - low) * pixels_per_mm).astype(int)
    high = low + size / pixels_per_mm
    depth = np.full((size[1], size[0]), -np.inf)
    image = np.zeros((size[1], size[0], 4))
    for solid, view in zip(solids, views, strict=True):
        normals = solid.mesh.face_normals @ solid.T[:3, :3].T @ camera.axes().T
        shades = np.minimum(
            np.array(rgb(solid.colour)) / 255.0 * (0.62 + 0.43 * np.maximum(0.0, normals @ _LIGHT))[:, None], 1.0
        )
        corners = ((view - [*low, 0.0]) * [pixels_per_mm, pixels_per_mm, 1.0])[solid.mesh.faces]
        inside = (corners[..., :2].max(1) >= 0.0).all(1) & (corners[..., :2].min(1) <= size).all(1)
        for i in np.flatnonzero((normals[:, 2] > 1e-9) & inside):
            _fill(depth, image, corners[i], np.append(shades[i], 1.0))
    ax.set_aspect("equal")
    ax.set_axis_off()
    extent = (low[0], high[0], low[1], high[1])
    ax.imshow(image, extent=extent, origin="lower", interpolation="antialiased", zorder=zorder)
    for solid, view in zip(solids, views, strict=True):
        lines = _visible(_edges(solid, camera), view, depth, low, pixels_per_mm)
        ax.add_collection(LineCollection(lines, colors=darker(solid.colour, 0.4), linewidths=0.6, zorder=zorder + 1))
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])


def _fill(depth: Array, image: Array, triangle: Array, colour: Array) -> None:
    """Paint a triangle (3, 3) of pixel coordinates and depth where it is nearer than what is there."""
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = triangle
    twice = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if abs(twice) < 1e-9:
        return
    left, right = max(0, math.floor(min(x0, x1, x2))), min(depth.shape[1], math.ceil(max(x0, x1, x2)) + 1)
    bottom, top = max(0, math.floor(min(y0, y1, y2))), min(depth.shape[0], math.ceil(max(y0, y1, y2)) + 1)
    x, y = np.arange(left, right) + 0.5, (np.arange(bottom, top) + 0.5)[:, None]
    b = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / twice
    c = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / twice
    z = z0 + b * (z1 - z0) + c * (z2 - z0)
    window = depth[bottom:top, left:right]
    nearer = (b >= -1e-6) & (c >= -1e-6) & (b + c <= 1.0 + 1e-6) & (z > window)
    window[nearer] = z[nearer]
    image[bottom:top, left:right][nearer] = colour


def _edges(solid: PosedMesh, camera: Camera) -> NDArray[np.int64]:
    """Vertex pairs (n, 2) of creases and of outlines against the view."""
    mesh = solid.mesh
    towards = mesh.face_normals @ solid.T[:3, :3].T @ camera.axes()[2]
    front = towards[mesh.face_adjacency] > 0.0
    crease = (mesh.face_adjacency_angles > _CREASE) & front.any(1)
    outline = front[:, 0] != front[:, 1]
    return np.asarray(mesh.face_adjacency_edges[crease | outline], dtype=np.int64)


def _visible(edges: NDArray[np.int64], view: Array, depth: Array, low: Array, pixels_per_mm: float) -> list[Array]:
    """The stretches (2, 2) of the edges that nothing hides, in mm."""
    from scipy.ndimage import minimum_filter

    # An edge lies between pixels of its own two faces: seen if it is not behind all the pixels around it.
    farthest = minimum_filter(depth, 3, mode="nearest")
    stretches: list[Array] = []
    for i, j in edges:
        a, b = view[i], view[j]
        n = max(2, math.ceil(float(np.hypot(*(b - a)[:2])) * pixels_per_mm))
        points = a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a)
        column, row = (((points[:, :2] - low) * pixels_per_mm).astype(int)).T
        around = farthest[np.clip(row, 0, depth.shape[0] - 1), np.clip(column, 0, depth.shape[1] - 1)]
        seen = points[:, 2] >= around - 0.25 / pixels_per_mm
        seen &= (column >= 0) & (row >= 0) & (column <= depth.shape[1]) & (row <= depth.shape[0])
        starts = np.flatnonzero(seen & ~np.append(False, seen[:-1]))
        ends = np.flatnonzero(seen & ~np.append(seen[1:], False))
        stretches += [points[[s, e], :2] for s, e in zip(starts, ends, strict=True) if e > s]
    return stretches
