"""Export of parts for CAD review: STL, OBJ, PLY, GLB, 3MF and STEP, with a manifest."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, cast, get_args

import numpy as np

from clamp3d import checks
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly
from clamp3d.engine.result import BAD, CheckResult
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.files.bodies import printable
from clamp3d.files.formats import UNITS_MM
from clamp3d.files.open_cascade import moved, occ, volume_of
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.profile import check_mesh_error
from clamp3d.geometry.shapes import MeshShape
from clamp3d.output import mesh_formats
from clamp3d.output.files import file_stem, write_files
from clamp3d.output.manifest import manifest
from clamp3d.output.palette import VERDICT_COLOURS
from clamp3d.output.placed import PlacedPart, PosedMesh, overlap, place, posed
from clamp3d.output.step import exact_solid, step
from clamp3d.scenefile.check import opened

Format: TypeAlias = Literal["stl", "obj", "ply", "glb", "3mf", "step"]
Layout: TypeAlias = Literal["parts", "assembly"]
FORMATS: tuple[Format, ...] = get_args(Format)

DEFAULT_MESH_ERROR = 0.01
"""Chord error in mm where none is chosen."""


@dataclass(frozen=True, slots=True)
class Export:
    """What `export` wrote: ``files`` in the order of the parts (or the assembly), and the ``manifest`` beside them."""

    files: tuple[Path, ...]
    manifest: Path


def destination(path: str | Path, format: str | None) -> tuple[Format, Path | None]:
    """Format of an export, and the file if ``path`` names one: by its suffix. None: ``path`` is a folder.

    Raises InputError if neither says what format it shall be, or they contradict each other.
    """
    path = checks.path("output", path)
    suffix = {"stp": "step"}.get(path.suffix.lower()[1:], path.suffix.lower()[1:])
    is_file = suffix in FORMATS and not path.is_dir()
    if format is None and not is_file:
        raise InputError(f"output must end in one of {', '.join(FORMATS)}, or be a folder with a format; got {path}")
    chosen = suffix if format is None else format
    checks.choice("format", chosen, FORMATS)
    if is_file and chosen != suffix:
        raise InputError(f"output {path.name} and format {chosen} contradict each other")
    return cast("Format", chosen), path if is_file else None


def default_layout(format: Format) -> Layout:
    """One assembly where the format has a tree of named parts (GLB, 3MF, STEP), else one file per part."""
    return "assembly" if format in ("glb", "3mf", "step") else "parts"


def export(
    source: Any,
    path: str | Path,
    *,
    format: Format | None = None,
    layout: Layout | None = None,
    state: str | None = None,
    mesh_error: float = DEFAULT_MESH_ERROR,
    unit: str | None = None,
    names: Iterable[str] | None = None,
) -> Export:
    """Write parts into a file or a folder, and a manifest beside them.

    Parameters
    ----------
    source
        What `check` takes, or an assembled clamp at one of its states; the parts of a `Clamp` stay in their own frames.
        Of a `CheckResult` also what clashing parts have in common, as red bodies named ``clash A - B``.
    path
        A file, whose suffix is the format (``out.step``), or a folder, which needs ``format``.
    format
        One of stl, obj, ply, glb, 3mf, step.
    layout
        "parts": a file for each part; "assembly": one file. By default an assembly for a named file and for glb, 3mf
        and step, whose files hold a tree of named parts.
    state
        Of an assembly: "open", "final" (default) or a step of its sequence by name or number.
    mesh_error
        Largest distance of an arc from its chord, mm. STEP has true arcs and ignores it, a mesh keeps its facets.
    unit
        Unit of the file: mm, cm, m or in. Default mm; glb is in metres, as its specification demands.
    names
        Names of the parts to write; all by default.

    Returns
    -------
    Export
        The paths written. World axes are Z up; GLB is turned to Y up.

    Raises
    ------
    InputError
        For a value out of range, a mesh in STEP, or a place that cannot be written to. Nothing is written then.
    MissingLibraryError
        For STEP without Open CASCADE.

    Examples
    --------
    >>> import tempfile
    >>> from clamp3d.engine.scene import Scene
    >>> from clamp3d.geometry import shapes
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = export(Scene().add("pin", shapes.cylinder(5.0, 40.0)), folder + "/pin.stl")
    ...     [path.name for path in (*written.files, written.manifest)]
    ['pin.stl', 'pin.stl.manifest.json']
    """
    result = source if isinstance(source, CheckResult) else None
    if not isinstance(source, Clamp):
        source = opened(source if result is None else result.scene)
    mesh_error = check_mesh_error(mesh_error)
    chosen, file = destination(path, format)
    settings = _settings(chosen, file, layout, unit, mesh_error)
    if settings["layout"] == "assembly" and isinstance(source, Clamp):
        raise InputError("layout assembly needs poses: assemble the clamp first, or its parts would lie on one origin")
    shown, state_settings = _at_state(source, state)
    placed = tuple(_coloured(place(shown, names), result))
    if result is not None:
        placed += tuple(_shared_bodies(result, placed, settings["mesh_error_mm"]))
    meshed = [] if settings["format"] == "step" else posed(placed, mesh_error)
    clamp = source if isinstance(source, Clamp) else source.clamp if isinstance(source, Assembly) else None
    files = _files(settings, file, source.name if clamp is None else clamp.name, placed, meshed)
    contents = {key: data for key, (data, _) in files.items()}
    listing = f"{file.name}.manifest.json" if file else f"manifest-{settings['format']}.json"
    contents[listing] = manifest(placed, meshed, files, settings | state_settings, clamp)
    *paths, listed = write_files(file.parent if file else Path(path), contents)
    return Export(tuple(paths), listed)


def _settings(
    format: Format, file: Path | None, layout: Layout | None, unit: str | None, mesh_error: float
) -> dict[str, Any]:
    """The choices of an export into a ``file`` (None: a folder) with their defaults, as the manifest says them first.

    Raises InputError for those that do not go together.
    """
    if layout is None:
        layout = "assembly" if file else default_layout(format)
    checks.choice("layout", layout, get_args(Layout))
    if unit is None:
        unit = "m" if format == "glb" else "mm"
    checks.choice("unit", unit, UNITS_MM)
    if format == "glb" and unit != "m":
        raise InputError(f"unit of glb must be m, as glTF 2.0 demands, got {checks.shown(unit)}")
    if file is not None and layout == "parts":
        raise InputError(f"layout parts needs a folder, got the file {file}")
    error = None if format == "step" else mesh_error
    up = "Y" if format == "glb" else "Z"
    return {"format": format, "layout": layout, "unit": unit, "up": up, "mesh_error_mm": error}


def _at_state(source: Clamp | Scene | Assembly, state: str | None) -> tuple[Clamp | Scene, dict[str, Any]]:
    """What is written, an assembly at a state of its way, and what the manifest says of that."""
    if not isinstance(source, Assembly):
        if state is not None:
            raise InputError("state goes with an assembled clamp")
        kind = "clamp" if isinstance(source, Clamp) else "scene"
        return source, {kind: source.name, "state": None, "status": None}
    state = state or "final"
    scene = source.scene_at(source.waypoint(state))
    # The last bits of an optimum differ between machines: equal clamps are equal files, to 1e-9 mm and 1e-12 rad.
    digits = np.full((4, 4), 12)
    digits[:3, 3] = 9
    poses = {part.name: np.vectorize(round)(part.T_world, digits) + 0.0 for part in scene.parts}
    return scene.moved(poses), {"clamp": source.clamp.name, "state": state, "status": source.status}


def _coloured(placed: Iterable[PlacedPart], result: CheckResult | None) -> Iterator[PlacedPart]:
    """The parts in the colours that their files state, those that clash in the program's.

    Where a file states none, equal parts have one colour.
    """
    clashes = [row for row in (result.rows if result else ()) if row.verdict in BAD]
    clashing = {name for row in clashes for name in (row.a, row.b)}
    colours: dict[int, str] = {}
    for item in placed:
        component = item.component
        if component is None:
            yield item
        elif item.name in clashing:
            yield replace(item, component=replace(component, face_colours={}))
        else:
            yield replace(item, colour=component.colour or colours.setdefault(id(item.shape), item.colour))


def _shared_bodies(result: CheckResult, placed: Sequence[PlacedPart], mesh_error: float | None) -> Iterator[PlacedPart]:
    """The common part of each two of the ``placed`` parts that clash at rest, in the world, in red.

    Of the facets within ``mesh_error`` mm, or with exact faces where that is None. Pairs whose common part has no
    volume are left out.
    """
    parts = {part.name: part for part in placed}
    for row in result.pairs:
        if row.verdict in BAD and {row.a, row.b} <= parts.keys():
            name = f"clash {row.a} - {row.b}"
            shape = _common(name, (parts[row.a], parts[row.b]), mesh_error)
            if shape is not None:
                yield PlacedPart(name, shape, np.eye(4), VERDICT_COLOURS["clash"])


def _common(name: str, pair: tuple[PlacedPart, PlacedPart], mesh_error: float | None) -> BrepSolid | MeshShape | None:
    """The common part of two parts as a body of its own."""
    if mesh_error is None:
        exact: Any = occ.BRepAlgoAPI_Common(*(moved(exact_solid(item), item.T) for item in pair)).Shape()
        return BrepSolid.of(exact, name) if volume_of(exact) > 0.0 else None
    common = overlap(*posed(pair, mesh_error))
    return None if common is None else MeshShape(make_mesh(common.vertices, common.faces), name=name)


def _files(
    settings: dict[str, Any], file: Path | None, name: str, placed: Sequence[PlacedPart], meshed: Sequence[PosedMesh]
) -> dict[str, tuple[bytes, Sequence[str]]]:
    """Contents of each file by its name, and the parts in it."""
    title = printable(name)
    files: dict[str, tuple[bytes, Sequence[str]]] = {}
    if settings["layout"] == "assembly":
        stem = file.stem if file else file_stem(name)
        for key, data in _render(settings, placed, meshed, stem, title).items():
            files[key if file is None or files else file.name] = data, [item.name for item in placed]
        return files
    for i, (item, stem) in enumerate(zip(placed, _stems(placed), strict=True)):
        one = _render(settings, [item], meshed[i : i + 1], stem, f"{title} {item.label}")
        files |= {key: (data, [item.name]) for key, data in one.items()}
    return files


def _stems(placed: Sequence[PlacedPart]) -> Iterator[str]:
    """File names of the parts, with a number where two would be the same."""
    taken: set[str] = set()
    for item in placed:
        stem = file_stem(item.label, "part")
        numbered = (stem if k == 1 else f"{stem}-{k}" for k in itertools.count(1))
        name = next(name for name in numbered if name.lower() not in taken)
        taken.add(name.lower())
        yield name


def _render(
    settings: dict[str, Any], placed: Sequence[PlacedPart], meshed: Sequence[PosedMesh], stem: str, title: str
) -> dict[str, bytes]:
    """Contents of one exported file by its name (OBJ has two)."""
    format, unit = settings["format"], settings["unit"]
    if format == "step":
        return {f"{stem}.step": step(placed, title, unit)}
    if format == "obj":
        model, materials = mesh_formats.obj(meshed, title, unit, f"{stem}.mtl")
        return {f"{stem}.obj": model, f"{stem}.mtl": materials}
    write = {"stl": mesh_formats.stl, "ply": mesh_formats.ply, "glb": mesh_formats.glb, "3mf": mesh_formats.three_mf}
    return {f"{stem}.{format}": write[format](meshed, title, unit, settings["mesh_error_mm"])}
