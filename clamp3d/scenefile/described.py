"""Clamps and scenes that are described in TOML, or built in."""

from __future__ import annotations

import os
from dataclasses import fields
from pathlib import Path

from clamp3d import checks
from clamp3d.brep.mesh_file import FORMATS
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.loader import builtin_clamps, load_clamp, parse_toml, read_text
from clamp3d.collide.scene import Scene
from clamp3d.errors import InputError
from clamp3d.scenefile.file import load_scene
from clamp3d.scenefile.parts import refuse_wires
from clamp3d.scenefile.tables import SceneTable


def load_described(path: Path, wires: dict[str, str | float]) -> Clamp | Scene:
    """A clamp by the name or the file ``path``, with its ``wires`` replaced, or the scene in a file."""
    if str(path) in builtin_clamps() or _is_clamp(path):
        return load_clamp(path, **wires)
    refuse_wires(path, "a scene", wires)
    scene = load_scene(path)
    if not scene.parts:
        raise InputError(f"{checks.short(path)}: the scene has no parts; add [parts.NAME], include or [clamp]")
    return scene


def _is_clamp(path: Path) -> bool:
    """Whether the tables of a TOML file are those of a clamp; False: those of a scene."""
    named_toml = path.suffix.lower() == ".toml"
    if not named_toml and not os.path.isfile(path):
        raise InputError(f"unknown clamp or file {checks.shown(str(path))}; {_choices()}")
    try:
        given = set(parse_toml(read_text(path), str(path)))
    except InputError:
        if named_toml:
            raise
        raise InputError(f"{checks.short(path)}: unknown kind of file; {_choices()}") from None
    of_clamp, of_scene = ({f.name for f in fields(kind)} for kind in (Clamp, SceneTable))
    as_clamp, as_scene = len(given & of_clamp - of_scene), len(given & of_scene - of_clamp)
    if not as_clamp and not as_scene:
        raise InputError(
            f"{checks.short(path)}: neither a clamp ([up_splint], [line], ...) nor a scene ([parts.NAME], [clamp], ...)"
        )
    return as_clamp > as_scene


def _choices() -> str:
    built_in = ", ".join(builtin_clamps())
    files = ", ".join((*FORMATS, ".urdf"))
    return f"built in: {built_in}; or give a clamp or scene file (.toml), a folder, or a file ({files})"
