"""Scene files in TOML: a validated `Scene` comes out; every fault is one line with file, key, value and rule.

Lengths in mm, angles in degrees (keys that end in ``_deg``). See the package's documentation for every key.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from clamp3d import checks
from clamp3d.clamp.loader import parse_toml, read_text
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.scene import Part, Scene
from clamp3d.errors import Clamp3dError, InputError, escaped
from clamp3d.geometry import shapes
from clamp3d.scenefile.pose_table import Pose
from clamp3d.scenefile.read_parts import prefixed
from clamp3d.scenefile.tables import FileTable, SceneTable, part_table
from clamp3d.validation import validate


def load_scene(path: str | Path) -> Scene:
    """Read a scene file. Raises InputError for anything that is not a scene, naming file, key, value and rule.

    The scene is named after the file; one called ``scene.toml`` after its folder.
    """
    path = checks.path("scene", path)
    text = read_text(path)
    name = escaped((path.resolve().parent.name if path.stem == "scene" else "") or path.stem)
    return parse_scene(text, origin=str(path), folder=path.parent, name=name)


def parse_scene(text: str, *, origin: str = "scene", folder: Path = Path(), name: str = "scene") -> Scene:
    """A scene from the text of a scene file; files it names are looked for in ``folder``.

    >>> scene = parse_scene('''
    ... [parts.pin]
    ... shape = "cylinder"
    ... diameter = 10
    ... length = 40
    ... pose = { translation = [0, 0, 5], rpy_deg = [90, 0, 0] }
    ... ''')
    >>> scene.parts[0].T_world[:3, 3].tolist()
    [0.0, 0.0, 5.0]
    """
    table: SceneTable = validate(SceneTable, parse_toml(text, origin), origin)
    tables = {key: part_table(data, origin, f"parts.{key}") for key, data in table.parts.items()}
    parts: list[Part] = []
    allowed: list[Allowed] = []
    notes: list[str] = []
    scenes: dict[tuple[type, bytes], Scene] = {}
    where = "clamp"

    def take(scene: Scene, of: str) -> None:
        parts.extend(scene.parts)
        allowed.extend(scene.allowed)
        notes.extend(f"{of}: {note}" for note in scene.notes)

    try:
        if table.clamp is not None:
            take(table.clamp.read(folder), "clamp")
        where = "include"
        for file in [table.include] if isinstance(table.include, str) else table.include:
            take(FileTable(file=file).read(folder), file)
        for part_name, part in tables.items():
            where = f"parts.{part_name}"
            if not isinstance(part, FileTable):
                parts.append(Part(part_name, shapes.as_shape(part.make(folder)), part.pose.T()))
                continue
            same = type(part), msgspec.json.encode(msgspec.structs.replace(part, pose=Pose()))
            if same not in scenes:  # a file is read once, and its shapes are shared
                scenes[same] = part.read(folder)
            take(prefixed(scenes[same], part_name, part.pose.T()), part_name)
        where = "allowed"
        allowed += [Allowed(*(item.parts or ("*", "*")), item.overlap, item.relation) for item in table.allowed]
        where = "motions"
        names = [part.name for part in parts]
        motions = tuple(m.motion(i, names) for i, m in enumerate(table.motions, 1))
        where = ""
        return Scene(tuple(parts), table.contact, table.clearance, tuple(allowed), motions, name, tuple(notes))
    except Clamp3dError as error:
        raise InputError(f"{origin}: {where}{': ' if where else ''}{error}") from None
