"""What the baselines make of the grooved parts, as overlays for the viewer: wedges, and the hulls of CoACD."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from clamp3d.baselines.model import check_unit_angle
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.parts import parts
from clamp3d.core.meshing import mesh
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError

if TYPE_CHECKING:
    import trimesh

MESH_ERROR = 0.05
"""Chord error in mm of the meshes that are decomposed."""
_KINDS = {"wedges": ("UNIT_ANGLE_DEG", 10.0), "hulls": ("THRESHOLD_MM", 2.0)}


def overlay(clamp: Clamp, text: str) -> tuple[str, dict[str, list[trimesh.Trimesh]]]:
    """Title and pieces of an overlay: ``wedges`` or ``wedges=UNIT_ANGLE_DEG``, ``hulls`` or ``hulls=THRESHOLD_MM``.

    Raises InputError for anything else.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> title, pieces = overlay(load_clamp(), "wedges=20")
    >>> title, {name: len(p) for name, p in pieces.items()}["P3"]
    ('wedges of 20 deg', 3)
    """
    kind, _, size = text.partition("=")
    if kind not in _KINDS:
        raise InputError(
            f"unknown overlay {text!r}; available: {', '.join(f'{k}[={v[0]}]' for k, v in _KINDS.items())}"
        )
    unit, value = _KINDS[kind]
    try:
        value = float(size) if size else value
    except ValueError:
        raise InputError(f"overlay {kind}: {unit} must be a number, got {size!r}") from None
    solids = parts(clamp)
    names: dict[PartName, None] = dict.fromkeys(a for a, _ in groove_pairs(clamp))
    if kind == "wedges":
        unit_angle = check_unit_angle(math.radians(value))
        return f"wedges of {value:g} deg", {name: _wedges(solids[name], unit_angle) for name in names}
    return f"hulls of CoACD at {value:g} mm", {name: _hulls(solids[name], value) for name in names}


def _wedges(part: Solid, unit_angle: float) -> list[trimesh.Trimesh]:
    """The wedges of the convex partitioning of a part."""
    import trimesh

    from clamp3d.baselines.wedges import wedge_solids

    return [trimesh.Trimesh(vertices, faces) for _, vertices, faces in wedge_solids(part, unit_angle)]


def _hulls(part: Solid, threshold: float) -> list[trimesh.Trimesh]:
    """The hulls that CoACD makes of a part's mesh, taken from the cache if it has them."""
    import trimesh

    from clamp3d.baselines.decomposition import DecompositionParameters, decompose

    solid = mesh(part, MESH_ERROR)
    made = decompose(solid.vertices, solid.faces, DecompositionParameters(threshold=threshold), name=part.name)
    return [trimesh.Trimesh(hull.vertices, hull.faces) for hull in made.hulls]
