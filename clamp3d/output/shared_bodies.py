"""What clashing parts have in common, as bodies of their own for an exported file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from clamp3d.engine.result import BAD, CheckResult
from clamp3d.files.open_cascade import bounds_of, moved, occ, to_bytes, volume_of
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.shapes import MeshShape
from clamp3d.output.palette import VERDICT_COLOURS
from clamp3d.output.placed import PlacedPart, overlap, posed
from clamp3d.output.step import exact_solid


def shared_bodies(result: CheckResult, placed: Sequence[PlacedPart], mesh_error: float | None) -> list[PlacedPart]:
    """The common part of each two of the ``placed`` parts that clash at rest, in the world, in red.

    Of the facets within ``mesh_error`` mm, or with exact faces where that is None. Pairs whose common part has no
    volume are left out.
    """
    parts = {part.name: part for part in placed}
    rows = [row for row in result.pairs if row.verdict in BAD and {row.a, row.b} <= parts.keys()]
    bodies = []
    for row in rows:
        name, (a, b) = f"clash {row.a} - {row.b}", (parts[row.a], parts[row.b])
        shape = _exact(name, a, b) if mesh_error is None else _faceted(name, a, b, mesh_error)
        if shape is not None:
            bodies.append(PlacedPart(name, shape, np.eye(4), VERDICT_COLOURS["clash"]))
    return bodies


def _exact(name: str, a: PlacedPart, b: PlacedPart) -> BrepSolid | None:
    shape: Any = occ.BRepAlgoAPI_Common(*(moved(exact_solid(item), item.T) for item in (a, b))).Shape()
    volume = volume_of(shape)
    return BrepSolid(name, to_bytes(shape), bounds_of(shape), volume) if volume > 0.0 else None


def _faceted(name: str, a: PlacedPart, b: PlacedPart, mesh_error: float) -> MeshShape | None:
    common = overlap(*posed([a, b], mesh_error))
    return None if common is None else MeshShape(make_mesh(common.vertices, common.faces), name=name)
