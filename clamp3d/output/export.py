"""Export of parts for CAD review: STL, OBJ, PLY, GLB, 3MF and STEP, with a manifest."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, cast, get_args

import numpy as np

from clamp3d import checks
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly
from clamp3d.clamp.states import state as find_state
from clamp3d.engine.result import BAD, CheckResult
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.files.formats import UNITS_MM
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import check_mesh_error
from clamp3d.output import mesh_formats
from clamp3d.output.files import file_stem, write_files
from clamp3d.output.manifest import manifest
from clamp3d.output.placed import PlacedPart, PosedMesh, place, posed
from clamp3d.output.shared_bodies import shared_bodies
from clamp3d.output.step import step
from clamp3d.scenefile.check import opened

Format: TypeAlias = Literal["stl", "obj", "ply", "glb", "3mf", "step"]
Layout: TypeAlias = Literal["parts", "assembly"]
FORMATS: tuple[Format, ...] = get_args(Format)
LAYOUTS: tuple[Layout, ...] = get_args(Layout)

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
    target = _target(source, path, format, layout, unit, check_mesh_error(mesh_error))
    shown, settings = _at_state(source, state)
    placed = tuple(_coloured(place(shown, names), result))
    if result is not None:
        placed += tuple(shared_bodies(result, placed, None if target.format == "step" else target.mesh_error))
    meshed = [] if target.format == "step" else posed(placed, target.mesh_error)
    files = _files(target, source.clamp.name if isinstance(source, Assembly) else source.name, placed, meshed)
    contents = {key: data for key, (data, _) in files.items()}
    listing = f"{target.file.name}.manifest.json" if target.file else f"manifest-{target.format}.json"
    clamp = source if isinstance(source, Clamp) else source.clamp if isinstance(source, Assembly) else None
    contents[listing] = manifest(placed, meshed, files, target.settings() | settings, clamp)
    *paths, listed = write_files(target.file.parent if target.file else Path(path), contents)
    return Export(tuple(paths), listed)


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


def _at_state(source: Clamp | Scene | Assembly, state: str | None) -> tuple[Clamp | Scene, dict[str, Any]]:
    """What is written, an assembly at a state of its way, and what the manifest says of that."""
    if not isinstance(source, Assembly):
        if state is not None:
            raise InputError("state goes with an assembled clamp")
        kind = "clamp" if isinstance(source, Clamp) else "scene"
        return source, {kind: source.name, "state": None, "status": None}
    state = state or "final"
    scene = source.scene_at(find_state(source, state))
    scene = replace(scene, parts=tuple(replace(part, T_world=_rounded(part.T_world)) for part in scene.parts))
    return scene, {"clamp": source.clamp.name, "state": state, "status": source.status}


@dataclass(frozen=True, slots=True)
class _Target:
    """How an export is written; ``file`` None: into a folder."""

    format: Format
    file: Path | None
    layout: Layout
    unit: str
    mesh_error: float

    def settings(self) -> dict[str, Any]:
        """What the manifest says of it first."""
        return {
            "format": self.format,
            "layout": self.layout,
            "unit": self.unit,
            "up": "Y" if self.format == "glb" else "Z",
            "mesh_error_mm": None if self.format == "step" else self.mesh_error,
        }


def _target(
    source: Clamp | Scene | Assembly,
    path: str | Path,
    format: str | None,
    layout: Layout | None,
    unit: str | None,
    mesh_error: float,
) -> _Target:
    """The choices of an export with their defaults. Raises InputError for those that do not go together."""
    chosen, file = destination(path, format)
    if layout is None:
        layout = "assembly" if file else default_layout(chosen)
    checks.choice("layout", layout, LAYOUTS)
    if unit is None:
        unit = "m" if chosen == "glb" else "mm"
    checks.choice("unit", unit, UNITS_MM)
    if chosen == "glb" and unit != "m":
        raise InputError(f"unit of glb must be m, as glTF 2.0 demands, got {checks.shown(unit)}")
    if file is not None and layout == "parts":
        raise InputError(f"layout parts needs a folder, got the file {file}")
    if layout == "assembly" and isinstance(source, Clamp):
        raise InputError("layout assembly needs poses: assemble the clamp first, or its parts would lie on one origin")
    return _Target(chosen, file, layout, unit, mesh_error)


def _files(
    target: _Target, name: str, placed: Sequence[PlacedPart], meshed: Sequence[PosedMesh]
) -> dict[str, tuple[bytes, Sequence[str]]]:
    """Contents of each file by its name, and the parts in it."""
    title = "".join(c if c.isprintable() else " " for c in name)
    files: dict[str, tuple[bytes, Sequence[str]]] = {}
    if target.layout == "assembly":
        stem = target.file.stem if target.file else file_stem(name)
        for key, data in _render(target, placed, meshed, stem, title).items():
            files[key if target.file is None or files else target.file.name] = data, [item.name for item in placed]
        return files
    for i, (item, stem) in enumerate(zip(placed, _stems(placed), strict=True)):
        one = _render(target, [item], meshed[i : i + 1], stem, f"{title} {item.label}")
        files |= {key: (data, [item.name]) for key, data in one.items()}
    return files


def _rounded(T: Array) -> Array:
    """The last bits of an optimum differ between machines: equal clamps are equal files, to 1e-9 mm and 1e-12 rad."""
    T = np.array(T)
    T[:3, :3], T[:3, 3] = np.round(T[:3, :3], 12), np.round(T[:3, 3], 9)
    return T + 0.0


def _stems(placed: Sequence[PlacedPart]) -> list[str]:
    """File names of the parts, with a number where two would be the same."""
    out: list[str] = []
    for item in placed:
        stem = name = file_stem(item.label)
        count = 1
        while name.lower() in (other.lower() for other in out):
            count += 1
            name = f"{stem}-{count}"
        out.append(name)
    return out


def _render(
    target: _Target, placed: Sequence[PlacedPart], meshed: Sequence[PosedMesh], base: str, title: str
) -> dict[str, bytes]:
    """Contents of one exported file by its name (OBJ has two)."""
    if target.format == "obj":
        model, materials = mesh_formats.obj(meshed, title, target.unit, f"{base}.mtl")
        return {f"{base}.obj": model, f"{base}.mtl": materials}
    content = {
        "stl": lambda: mesh_formats.stl(meshed, title, target.unit),
        "ply": lambda: mesh_formats.ply(meshed, title, target.unit),
        "glb": lambda: mesh_formats.glb(meshed, title, target.mesh_error),
        "3mf": lambda: mesh_formats.three_mf(meshed, title, target.unit, target.mesh_error),
        "step": lambda: step(placed, title, target.unit),
    }[target.format]()
    return {f"{base}.{target.format}": content}
