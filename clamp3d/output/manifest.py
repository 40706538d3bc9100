"""The manifest beside exported files: the settings, what each file holds, and how to check it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from importlib import metadata
from itertools import zip_longest
from typing import Any

import numpy as np

from clamp3d import __version__
from clamp3d.clamp.dimensions import Clamp
from clamp3d.files.formats import UNITS_MM
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.meshing import volume_bounds
from clamp3d.geometry.shapes import Solid, Sphere
from clamp3d.output.placed import PlacedPart, PosedMesh


def manifest(
    placed: Sequence[PlacedPart],
    meshed: Sequence[PosedMesh],
    files: Mapping[str, tuple[bytes, Sequence[str]]],
    settings: Mapping[str, Any],
    clamp: Clamp | None,
) -> bytes:
    """The manifest as JSON: ``files`` maps a name to its content and the parts in it, ``settings`` come first.

    Volumes are mm^3, poses mm; ``bounds`` are in the unit and axes of the files. Of a drawn solid whose volume has no
    closed form ``volume_mm3`` is null and ``volume_bounds_mm3`` says between what it lies; of a mesh only the mesh's
    own is given. Holds no date: same input, same bytes, but for STEP, some lines of which Open CASCADE orders anew in
    each process.
    """
    libraries = ["manifold3d", "trimesh", "numpy"] if meshed else ["cadquery-ocp-novtk", "numpy"]
    if settings["format"] == "3mf":
        libraries.append("lib3mf")
    content = {
        "generator": f"clamp3d {__version__}",
        **settings,
        "files": {
            name: {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest(), "parts": list(parts)}
            for name, (data, parts) in files.items()
        },
        "parts": {item.name: _part(item, shown, settings) for item, shown in zip_longest(placed, meshed)},
        **({} if clamp is None else {"parameters": dataclasses.asdict(clamp)}),
        "libraries": versions(libraries),
    }
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode("utf-8", "backslashreplace")


def _part(item: PlacedPart, meshed: PosedMesh | None, settings: Mapping[str, Any]) -> dict[str, Any]:
    shape = item.shape
    drawn = shape if isinstance(shape, Solid) else None
    volume = drawn.volume if drawn else None
    entry: dict[str, Any] = {
        "title": getattr(shape, "title", "") or shape.name,
        "colour": item.colour,
        "T_world_part": None if item.T_world_part is None else item.T_world_part.tolist(),
        "volume_mm3": None if volume is None else round(volume, 6),
        "chord_error_mm": 0.0,
    }
    if meshed is not None:
        local = meshed.mesh
        bounds = np.array([meshed.world.min(axis=0), meshed.world.max(axis=0)])
        entry["chord_error_mm"] = round(local.metadata["chord_error"], 12)
        entry["mesh_volume_mm3"] = round(float(local.volume), 6)
        if drawn:
            # How far the mesh's volume can lie from the true one, either way.
            low, high = volume_bounds(dataclasses.replace(drawn, volume=0.0), local.metadata["mesh_error"])
            between = (volume + low, volume + high) if volume is not None else (local.volume - high, local.volume - low)
            key = "volume_bounds_mm3" if volume is None else "mesh_volume_bounds_mm3"
            entry[key] = [round(float(bound), 6) for bound in between]
        entry["triangles"] = len(local.faces)
    else:
        assert isinstance(shape, (Solid, BrepSolid, Sphere))  # a mesh has triangles
        bounds = shape.bounds_at(item.T)
    bounds = bounds / UNITS_MM[settings["unit"]]
    if settings["up"] == "Y":  # axes X, Z, -Y
        bounds = np.sort(bounds[:, [0, 2, 1]] * [1.0, 1.0, -1.0], axis=0)
    entry["bounds"] = (np.round(bounds, 9) + 0.0).tolist()
    if drawn and drawn.not_modelled:
        entry["not_modelled"] = drawn.not_modelled
    return entry


def versions(libraries: Iterable[str]) -> dict[str, str]:
    """Versions of those of ``libraries`` that are installed.

    >>> list(versions(["numpy", "no-such-library"]))
    ['numpy']
    """
    installed = {}
    for name in libraries:
        with suppress(metadata.PackageNotFoundError):
            installed[name] = metadata.version(name)
    return installed
