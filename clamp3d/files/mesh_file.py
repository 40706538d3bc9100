"""Files with geometry: triangle meshes and CAD, as placed bodies or as one mesh, in millimetres with Z up."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from clamp3d import checks
from clamp3d.errors import InputError
from clamp3d.files.bodies import Reading
from clamp3d.files.formats import FORMATS, ROBOT, UNITS_MM
from clamp3d.files.worker import read_in_process
from clamp3d.geometry.mesh import Mesh


def load_bodies(
    path: str | Path, *, unit: str | None = None, joints: Mapping[str, float] | None = None, partial: bool = False
) -> Reading:
    """Read all bodies of a file, with their names and places.

    Parameters
    ----------
    path : str or Path
        STL, OBJ, PLY or OFF (one body), GLB or GLTF (one for each node with a mesh), 3MF (one for each object of the
        build), or STEP (one for each solid of the product tree); with ``joints`` URDF too (one for each shape of a
        link).
    unit : str, optional
        Unit of the file's lengths: mm, cm, m or in; not for STEP, 3MF and URDF, which state it. By default mm for STL,
        OBJ, PLY and OFF (which carry no unit), metres for glTF (whose Y up becomes Z up).
    joints : dict, optional
        Joint values of a robot by name: rad, or mm for joints that slide; 0, or the nearest limit, by default.
    partial : bool
        Go on with what was read where bodies are missing; a note says how many.

    Returns
    -------
    Reading
        Bodies in mm; ``notes`` say what was assumed and repaired.

    Raises
    ------
    InputError
        If the file is missing, damaged or empty, or, unless ``partial``, if a body in it could not be read.
    MissingLibraryError
        For STEP without the extra ``step``, 3MF without ``3mf``, URDF without ``urdf``.
    """
    file = checks.path("mesh", path)
    kind = file.suffix.lower()
    is_robot = kind == ROBOT and joints is not None
    if kind not in FORMATS and not is_robot:
        raise InputError(f"{file}: unknown mesh format {kind or '(none)'!r}; available: {', '.join(FORMATS)}")
    if unit is not None:
        checks.choice("unit", unit, UNITS_MM)
        if is_robot or FORMATS[kind].unit == "stated":
            raise InputError(f"unit: {kind[1:].upper()} files state their unit themselves")
    values = {str(name): checks.number(f"joint {name}", value) for name, value in (joints or {}).items()}
    return read_in_process(file, values if is_robot else unit).complete(file, partial=partial)


def load_mesh(path: str | Path, *, unit: str | None = None) -> Mesh:
    """Read a file as one mesh in mm with Z up; several bodies become one mesh.

    Parameters
    ----------
    path, unit
        As for `load_bodies`.

    Returns
    -------
    Mesh
        The mesh as `make_mesh` checks and repairs it; its ``notes`` say what was assumed.

    Raises
    ------
    InputError, MissingLibraryError
        As `load_bodies`.
    """
    return load_bodies(path, unit=unit).merged(Path(path).name)
