"""What the baselines make of the grooved parts, as overlays for the viewer: wedges, and the hulls of CoACD."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from clamp3d.baselines.model import check_unit_angle
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.parts import parts
from clamp3d.core.meshing import mesh
from clamp3d.core.pose import Array
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError
from clamp3d.output.viewer_scene import ConvexPiece, Overlay

MESH_ERROR = 0.05
"""Chord error in mm of the meshes that are decomposed."""


@dataclass(frozen=True, slots=True)
class Prism:
    """A wedge in its part's frame: ``vertices`` (n, 3) mm, ``faces`` (m, 3)."""

    vertices: Array
    faces: NDArray[Any]


def overlay(clamp: Clamp, text: str) -> tuple[str, Overlay]:
    """Title and pieces of an overlay: ``wedges`` or ``wedges=UNIT_ANGLE_DEG``, ``hulls`` or ``hulls=THRESHOLD_MM``.

    Raises InputError for anything else.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> title, pieces = overlay(load_clamp(), "wedges=20")
    >>> title, {name: len(p) for name, p in pieces.items()}["P3"]
    ('wedges of 20 deg', 3)
    """
    name, _, size = text.partition("=")
    if name not in _KINDS:
        raise InputError(
            f"unknown overlay {text!r}; available: {', '.join(f'{k}[={v[1]}]' for k, v in _KINDS.items())}"
        )
    make, unit, default = _KINDS[name]
    try:
        value = float(size) if size else default
    except ValueError:
        raise InputError(f"overlay {name}: {unit} must be a number, got {size!r}") from None
    return make(clamp, value)


def wedge_overlay(clamp: Clamp, unit_angle_deg: float) -> tuple[str, Overlay]:
    """Every grooved part cut into the wedges of the convex partitioning."""
    from clamp3d.baselines.wedges import part_wedges, prism

    unit_angle = check_unit_angle(math.radians(unit_angle_deg))

    def pieces(part: Solid) -> Sequence[ConvexPiece]:
        body = part.bodies[0]
        out = []
        for wedge in part_wedges(part, unit_angle):
            vertices, faces = prism(wedge.polygon, body.start, body.end)
            out.append(Prism(vertices @ body.frame.T, faces))
        return out

    return f"wedges of {unit_angle_deg:g} deg", {part.name: pieces(part) for part in _grooved(clamp)}


def hull_overlay(clamp: Clamp, threshold: float) -> tuple[str, Overlay]:
    """Every grooved part as the hulls CoACD makes of its mesh (taken from the cache if it has them)."""
    from clamp3d.baselines.decomposition import DecompositionParameters, decompose

    parameters = DecompositionParameters(threshold=threshold)

    def pieces(part: Solid) -> Sequence[ConvexPiece]:
        solid = mesh(part, MESH_ERROR)
        return decompose(solid.vertices, solid.faces, parameters, name=part.name).hulls

    return f"hulls of CoACD at {threshold:g} mm", {part.name: pieces(part) for part in _grooved(clamp)}


def _grooved(clamp: Clamp) -> list[Solid]:
    names: dict[PartName, None] = dict.fromkeys(a for a, _ in groove_pairs(clamp))
    bodies = parts(clamp)
    return [bodies[name] for name in names]


_KINDS: dict[str, tuple[Callable[[Clamp, float], tuple[str, Overlay]], str, float]] = {
    "wedges": (wedge_overlay, "UNIT_ANGLE_DEG", 10.0),
    "hulls": (hull_overlay, "THRESHOLD_MM", 2.0),
}
