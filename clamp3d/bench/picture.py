"""The assembled clamp as a camera would see it from the wires' ends, and the end points found in such a picture.

The picture is drawn from the analytic outlines at a chosen scale with skimage, blurred and grained like a photograph.
Pixel coordinates are (x, y) with the centre of the first pixel at (0, 0), x to the right and y down.
"""

# skimage and matplotlib's canvas come without annotations.
# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Assembly
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array
from clamp3d.output.section import inner_edges, outline

Image = NDArray[np.uint8]

BACKGROUND = (236.0, 236.0, 232.0)
PAINT: dict[PartName, tuple[float, float, float]] = {
    "P4": (150.0, 154.0, 160.0),
    "P5": (128.0, 132.0, 140.0),
    "P3": (205.0, 120.0, 80.0),
    "P6": (214.0, 190.0, 90.0),
    "P7": (226.0, 150.0, 160.0),
    "P1": (70.0, 110.0, 170.0),
    "P2": (40.0, 140.0, 110.0),
}
"""Colours from back to front: the bolt stands behind the splints' faces."""

_STRAIGHT = 1.0  # px; an outline within this of a line is straight
_ROUNDED = 10.0  # px; blur rounds a corner, so edges are looked for beyond this, and fitted from 4 px on
_AROUND = 8  # px around a corner that decide where it is
_MARGIN = 8.0  # mm around the parts
_BLUR, _GRAIN = 1.0, 3.0  # px, and grey levels (one sigma)


@dataclass(frozen=True, slots=True)
class Picture:
    """``image`` (h, w, 3), and the true ``end_points`` (3, 2) in pixels.

    End points: left and right end of the up splint's inner edge, left end of the down splint's inner edge.
    ``reference`` in mm is the distance of the first two, ``distance`` that of the splints on the line side.
    """

    image: Image
    end_points: Array
    reference: float
    distance: float


def picture(run: Assembly, px_per_mm: float, *, seed: int = 0) -> Picture:
    """The final state of ``run`` at ``px_per_mm`` pixels to the millimetre, blurred and grained."""
    from skimage.filters import gaussian

    outlines = [(name, points) for name in PAINT for points in _outlines(run, name)]
    everything = np.concatenate([points for _, points in outlines])
    low, high = everything.min(0) - _MARGIN, everything.max(0) + _MARGIN
    columns, rows = np.ceil((high - low) * px_per_mm).astype(int)
    image = _paint([(name, (points - low) * px_per_mm - 0.5) for name, points in outlines], columns, rows)
    image = gaussian(image, _BLUR, channel_axis=-1, preserve_range=True)
    image = image + np.random.default_rng(seed).normal(0.0, _GRAIN, image.shape)
    (left, below), (right, _) = inner_edges(run.clamp, run.poses)
    points = (np.array([left, right, below]) - low) * px_per_mm - 0.5
    reference = run.clamp.up_splint.width
    return Picture(np.clip(np.rint(image), 0, 255).astype(np.uint8), points, reference, run.distance)


def find_end_points(image: Image) -> Array:
    """The three end points (3, 2) px of a picture whose splints have the colours of `PAINT`.

    Each is the meeting point of two lines, fitted to the splint's outline to a fraction of a pixel. Raises InputError
    if the image has no such outlines.
    """
    up, down = _contour(image, "P1"), _contour(image, "P2")
    return np.array([_corner(up, (-1.0, 1.0)), _corner(up, (1.0, 1.0)), _corner(down, (-1.0, -1.0))])


def load_image(path: str | Path) -> Image:
    """A photograph (h, w, 3) as a viewer shows it, turned as its EXIF tag says. Raises InputError if it is none."""
    from PIL import Image as Pillow
    from PIL import ImageOps, UnidentifiedImageError

    try:
        with Pillow.open(path) as opened:
            return np.asarray(ImageOps.exif_transpose(opened).convert("RGB"))
    except UnidentifiedImageError:
        raise InputError(f"{path}: not a picture that can be read (PNG, JPEG, TIFF, BMP, WebP, ...)") from None
    except (OSError, ValueError, Pillow.DecompressionBombError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: cannot be read: {reason}") from None


def snap_marks(image: Image, marks: Array, radius: float) -> Array:
    """The ``marks`` (n, 2) px moved to the strongest corner within ``radius`` px, to a fraction of a pixel.

    Harris' measure finds the corner, Foerstner's fit refines it. Raises InputError for a mark outside of the image or
    one without a corner near it.
    """
    from skimage.color import rgb2gray
    from skimage.feature import corner_harris, corner_subpix

    if not (math.isfinite(radius) and radius >= 2.0):
        raise InputError(f"snap radius must be >= 2 px, got {radius}")
    corners = []
    reach = math.ceil(radius) + _AROUND
    for x, y in check_marks(image, marks):
        left, top = max(0, round(float(x)) - reach), max(0, round(float(y)) - reach)
        grey = rgb2gray(image[top : round(float(y)) + reach + 1, left : round(float(x)) + reach + 1])
        rows, columns = np.mgrid[: grey.shape[0], : grey.shape[1]]
        near = np.hypot(columns + left - x, rows + top - y) <= radius
        strength = np.where(near, corner_harris(grey, sigma=1.5), -np.inf)
        peak = np.unravel_index(np.argmax(strength), grey.shape)
        if np.ptp(grey[near]) < 0.1 or strength[peak] <= 0.0:
            raise InputError(f"no corner within {radius:g} px of the mark ({x:g}, {y:g}); mark it without snapping")
        fine = corner_subpix(grey, np.array([peak]), window_size=2 * _AROUND - 3)[0]
        row, column = fine if np.isfinite(fine).all() and math.dist(fine, peak) <= radius else peak
        corners.append((float(column) + left, float(row) + top))
    return np.array(corners)


def check_marks(image: Image, marks: Array) -> Array:
    """Return ``marks`` (n, 2) px if all lie in the image, else raise InputError."""
    height, width = image.shape[:2]
    for x, y in marks:
        if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
            raise InputError(f"mark ({x:g}, {y:g}) must lie in the picture, which is {width} x {height} px")
    return marks


def _contour(image: Image, name: PartName) -> Array:
    """Outline (n, 2) px, closed, of the largest region that has the part's colour."""
    from skimage.filters import gaussian
    from skimage.measure import find_contours, label, regionprops
    from skimage.morphology import dilation, disk

    pixels = gaussian(image[..., :3].astype(np.float64), 0.7, channel_axis=-1, preserve_range=True)  # less grain
    paints = np.array([*PAINT.values(), BACKGROUND])
    nearest = np.argmin([((pixels - paint) ** 2).sum(-1) for paint in paints], axis=0)
    regions = regionprops(label(nearest == list(PAINT).index(name)))
    if not regions:
        raise InputError(f"no region of the colour of {name} in the picture; mark the end points by hand")
    largest = max(regions, key=lambda region: region.area)
    nearby = np.zeros(nearest.shape, dtype=bool)
    nearby[tuple(largest.coords.T)] = True
    nearby = dilation(nearby, disk(3))
    # Share of the part's colour against the background: 1/2 on the edge, whatever the blur.
    towards = np.subtract(PAINT[name], BACKGROUND)
    share = np.where(nearby, (pixels - BACKGROUND) @ towards / (towards @ towards), 0.0)
    contour: Array = max(find_contours(share, 0.5), key=len)
    return contour[:, ::-1]


def _corner(contour: Array, towards: tuple[float, float]) -> Array:
    """The outline's corner furthest in a direction, as the meeting point of the two straight edges beside it."""
    from skimage.measure import approximate_polygon

    polygon = approximate_polygon(contour, _STRAIGHT)[:-1]
    i = int(np.argmax(polygon @ np.array(towards)))
    polygon = np.roll(polygon, -i, axis=0)
    beside = [p for p in polygon if math.dist(p, polygon[0]) > _ROUNDED]
    lines = []
    for a, b in ((polygon[0], beside[0]), (polygon[0], beside[-1])):
        length = math.dist(a, b)
        along = (contour - a) @ (b - a) / length
        across = np.abs((contour - a) @ np.array([a[1] - b[1], b[0] - a[0]])) / length
        chosen = contour[(along > 4.0) & (along < 0.85 * length) & (across < 2.0 * _STRAIGHT)]
        if len(chosen) < 4:
            raise InputError("an edge beside an end point is too short in the picture; mark the end points by hand")
        middle = chosen.mean(axis=0)
        lines.append((middle, np.linalg.svd(chosen - middle)[2][0]))  # total least squares
    (p, u), (q, v) = lines
    s, _ = np.linalg.solve(np.column_stack([u, -v]), q - p)
    corner: Array = p + s * u
    return corner


def _paint(outlines: list[tuple[PartName, Array]], columns: int, rows: int) -> Array:
    """Filled outlines (px) one over the other, (rows, columns, 3) in grey levels; edges by their share of a pixel."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    figure = Figure(figsize=(columns / 100, rows / 100), dpi=100, facecolor=_rgb(BACKGROUND))
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set_xlim(-0.5, columns - 0.5)
    ax.set_ylim(rows - 0.5, -0.5)
    for name, points in outlines:
        ax.add_patch(Polygon(points, fc=_rgb(PAINT[name]), ec="none", lw=0.0, snap=False))
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(np.float64)


def _rgb(paint: tuple[float, float, float]) -> tuple[float, float, float]:
    r, g, b = (level / 255.0 for level in paint)
    return r, g, b


def _outlines(run: Assembly, name: PartName) -> Iterator[Array]:
    """Outlines (n, 2) of the part's bodies in the section where they stand, seen along the wires."""
    for body in parts(run.clamp)[name].bodies:
        yield np.array([run.poses[name].point(float(u), float(v)) for u, v in outline(body).polygon(0.001)])
