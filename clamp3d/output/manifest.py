"""The manifest beside exported files: what was asked for, what each file holds, and how to check it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import Any

import numpy as np

from clamp3d import __version__
from clamp3d.clamp.dimensions import Clamp
from clamp3d.core.meshing import volume_bounds
from clamp3d.core.pose import Array
from clamp3d.output.mesh_formats import MILLIMETRES, Placement
from clamp3d.output.placed import PlacedPart


def manifest(
    clamp: Clamp,
    placed: Sequence[PlacedPart],
    meshed: Sequence[Placement],
    files: Mapping[str, tuple[bytes, Sequence[str]]],
    settings: Mapping[str, Any],
) -> bytes:
    """The manifest as JSON: ``files`` maps a name to its content and the parts in it, ``settings`` come first.

    Volumes are mm^3, poses mm; ``bounds`` are in the unit and axes of the files. Holds no date: same input, same bytes.
    """
    by_name = {item.placed.part.name: item for item in meshed}
    libraries = ("manifold3d", "trimesh", "numpy") if meshed else ("cadquery-ocp-novtk", "numpy")
    content = {
        "generator": f"clamp3d {__version__}",
        **settings,
        "files": {
            name: {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest(), "parts": list(parts)}
            for name, (data, parts) in files.items()
        },
        "parts": {
            item.part.name: _part(item, by_name.get(item.part.name), settings["unit"], settings["up"])
            for item in placed
        },
        "parameters": dataclasses.asdict(clamp),
        "libraries": {name: _version(name) for name in libraries},
    }
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode("utf-8")


def _part(item: PlacedPart, meshed: Placement | None, unit: str, up: str) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "title": item.part.title,
        "colour": "#{:02X}{:02X}{:02X}".format(*item.colour),
        "T_world_part": None if item.T_world_part is None else item.T_world_part.tolist(),
        "volume_mm3": None if item.part.volume is None else round(item.part.volume, 6),
        "chord_error_mm": 0.0,
    }
    bounds = item.part.bounds_at(item.T) / MILLIMETRES[unit]
    if meshed is not None:
        local = meshed.local
        bounds = np.array([meshed.vertices.min(axis=0), meshed.vertices.max(axis=0)])
        entry["chord_error_mm"] = round(local.metadata["chord_error"], 12)
        entry["mesh_volume_mm3"] = round(float(local.volume), 6)
        entry["mesh_volume_bounds_mm3"] = [
            round(bound, 6) for bound in volume_bounds(item.part, local.metadata["mesh_error"])
        ]
        entry["triangles"] = len(local.faces)
    entry["bounds"] = (np.round(bounds if up == "Z" else _y_up(bounds), 9) + 0.0).tolist()
    if item.part.not_modelled:
        entry["not_modelled"] = item.part.not_modelled
    return entry


def _y_up(bounds: Array) -> Array:
    """Box in axes X, Z, -Y."""
    (x0, y0, z0), (x1, y1, z1) = bounds
    return np.array([[x0, z0, -y1], [x1, z1, -y0]])


def _version(library: str) -> str:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "unknown"
