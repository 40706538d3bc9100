"""Export of a clamp's parts for CAD review: STL, OBJ, PLY, GLB, 3MF and STEP, with a manifest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from numpy.typing import ArrayLike

from clamp3d.checks import choice, instance, path, shown, text
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.parts import parts
from clamp3d.core.profile import check_mesh_error
from clamp3d.errors import InputError
from clamp3d.output import mesh_formats
from clamp3d.output.files import file_stem, write_files
from clamp3d.output.manifest import manifest
from clamp3d.output.mesh_formats import MILLIMETRES, Placement, placements
from clamp3d.output.placed import PlacedPart, place
from clamp3d.output.step import step

Format: TypeAlias = Literal["stl", "obj", "ply", "glb", "3mf", "step"]
Layout: TypeAlias = Literal["parts", "assembly"]
FORMATS: tuple[Format, ...] = get_args(Format)
LAYOUTS: tuple[Layout, ...] = get_args(Layout)

DEFAULT_MESH_ERROR = 0.01
"""Chord error in mm where none is chosen."""


@dataclass(frozen=True, slots=True)
class Export:
    """What `export` wrote: ``files`` in the order P1 to P7 (or the assembly), and the ``manifest`` beside them."""

    files: tuple[Path, ...]
    manifest: Path


def default_layout(format: Format) -> Layout:
    """One assembly where the format has a tree of named parts (GLB, 3MF, STEP), else one file per part."""
    return "assembly" if format in ("glb", "3mf", "step") else "parts"


def default_unit(format: Format) -> str:
    """Metres for GLB, as its specification demands; millimetres for the others."""
    return "m" if format == "glb" else "mm"


def export(
    clamp: Clamp,
    *,
    format: Format,
    output: str | Path,
    poses: Mapping[PartName, ArrayLike] | None = None,
    state: str | None = None,
    status: str | None = None,
    layout: Layout | None = None,
    mesh_error: float = DEFAULT_MESH_ERROR,
    unit: str | None = None,
    names: Iterable[PartName] | None = None,
) -> Export:
    """Write parts of ``clamp`` into the folder ``output``, and a manifest ``manifest-<format>.json`` beside them.

    ``poses`` maps part names to ``T_world_part`` (4, 4) in mm; without it every part stays in its own frame, which
    only the layout "parts" can have. ``state`` and ``status`` of the run they come from go into the manifest.
    ``mesh_error`` is the largest distance in mm of an arc from its chord (STEP has true arcs and ignores it).
    ``unit`` is one of mm, cm, m, in.
    World axes are Z up; GLB is turned to Y up. Files are written whole or not at all.

    Raises InputError for a value out of range or a folder that cannot be written, MissingLibraryError if the format
    is STEP and Open CASCADE is not installed.
    """
    instance("clamp", clamp, Clamp)
    choice("format", format, FORMATS)
    layout = default_layout(format) if layout is None else layout
    choice("layout", layout, LAYOUTS)
    unit = default_unit(format) if unit is None else unit
    if format == "glb" and not (isinstance(unit, str) and unit == "m"):
        raise InputError(f"unit of glb must be m, as glTF 2.0 demands, got {shown(unit)}")
    choice("unit", unit, MILLIMETRES)
    mesh_error = check_mesh_error(mesh_error)
    for key, value in (("state", state), ("status", status)):
        if value is not None:
            text(key, value)
    folder = path("output", output)
    if layout == "assembly" and poses is None:
        raise InputError("layout 'assembly' needs poses: without them all parts would lie on one origin")

    title = "".join(c if c.isprintable() else " " for c in clamp.name)
    placed = place(parts(clamp), poses, names)
    meshed = [] if format == "step" else placements(placed, mesh_error, unit)
    files: dict[str, tuple[bytes, Sequence[str]]] = {}
    if layout == "assembly":
        for name, data in _render(format, placed, meshed, file_stem(clamp.name), title, unit, mesh_error).items():
            files[name] = data, [item.part.name for item in placed]
    else:
        for i, item in enumerate(placed):
            one = _render(format, [item], meshed[i : i + 1], item.stem, f"{title} {item.label}", unit, mesh_error)
            files |= {name: (data, [item.part.name]) for name, data in one.items()}
    settings = {
        "clamp": clamp.name,
        "format": format,
        "layout": layout,
        "state": state,
        "status": status,
        "unit": unit,
        "up": "Y" if format == "glb" else "Z",
        "mesh_error_mm": None if format == "step" else mesh_error,
    }
    contents = {name: data for name, (data, _) in files.items()}
    contents[f"manifest-{format}.json"] = manifest(clamp, placed, meshed, files, settings)
    *paths, listing = write_files(folder, contents)
    return Export(tuple(paths), listing)


def _render(
    format: Format,
    placed: Sequence[PlacedPart],
    meshed: Sequence[Placement],
    base: str,
    title: str,
    unit: str,
    mesh_error: float,
) -> dict[str, bytes]:
    """Contents of one exported file by its name (OBJ has two)."""
    name = f"{base}.{format}"
    if format == "stl":
        return {name: mesh_formats.stl(meshed, title, unit)}
    if format == "ply":
        return {name: mesh_formats.ply(meshed, title, unit)}
    if format == "obj":
        model, materials = mesh_formats.obj(meshed, title, unit, f"{base}.mtl")
        return {name: model, f"{base}.mtl": materials}
    if format == "glb":
        return {name: mesh_formats.glb(meshed, title, {"unit": "m", "mesh_error_mm": mesh_error})}
    if format == "3mf":
        return {name: mesh_formats.three_mf(meshed, title, unit, f"chord error {mesh_error:g} mm at most")}
    return {name: step(placed, title, unit)}
