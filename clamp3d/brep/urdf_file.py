"""Robot descriptions (URDF) as bodies named after their links, where the joints put them, by yourdfpy.

yourdfpy reads what it can of a damaged file and says nothing, so the file is parsed strictly before. Of each link the
collision shapes are taken, or the visual ones if it has no others. This runs in the process for foreign files. Needs
the extra ``urdf``.
"""

from __future__ import annotations

import io
import math
import os
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh

from clamp3d import checks
from clamp3d.brep.bodies import Drawn, Reading
from clamp3d.brep.formats import FORMATS, read
from clamp3d.brep.placing import Placer
from clamp3d.brep.worker import OUTSIDE
from clamp3d.core.mesh import Array, IntArray, Mesh, make_mesh
from clamp3d.core.pose import nearest_rigid
from clamp3d.core.shapes import MeshShape
from clamp3d.errors import InputError, missing

try:
    import yourdfpy
except ImportError:
    raise missing("yourdfpy", "URDF") from None

_SHAPES = {"box", "cylinder", "sphere", "mesh"}
_MOST_BYTES = 2**26


def read_urdf(path: Path, joints: dict[str, float]) -> Reading:
    """The shapes of a robot's links in mm, in the frame of the root link, at the values of its ``joints``.

    Values are in rad, or mm for joints that slide; without one a joint is at 0, or its nearest limit.
    Raises InputError for a file that is no whole URDF, unknown joints and values out of their limits.
    """
    checks.readable_file(path, _MOST_BYTES)
    text = ElementTree.tostring(_parsed(path))
    try:
        robot = yourdfpy.URDF.load(
            io.BytesIO(text), load_meshes=False, build_scene_graph=True, load_collision_meshes=False
        )
    except MemoryError:
        raise
    except Exception as error:  # it raises whatever its parser meets
        raise InputError(f"{path}: not a readable URDF file ({' '.join(str(error).split())})") from None
    robot.update_cfg(_joint_values(path, robot, joints))
    links = _Links(path)
    for link in robot.robot.links:
        T_link = np.asarray(robot.get_transform(link.name))
        for shape in link.collisions or link.visuals:
            T = T_link if shape.origin is None else T_link @ shape.origin
            if not np.isfinite(T).all():
                raise InputError(f"{path}: a place in link {link.name} is not finite")
            links.put(link.name, shape.geometry, T)
    if not all(link.collisions for link in robot.robot.links if link.visuals):
        links.notes.append("links without collision shapes are taken by their visual ones")
    return links.reading((joint.parent, joint.child) for joint in robot.robot.joints)


class _Links(Placer):
    """Collects the shapes of a robot's links."""

    def __init__(self, path: Path) -> None:
        super().__init__(1.0)
        self.path = path
        self._files: dict[Path, Mesh] = {}

    def put(self, name: str, geometry: Any, T: Array) -> None:
        """One more shape of the link ``name`` at ``T`` (4, 4), whose lengths are metres."""
        T = nearest_rigid(np.asarray(T, dtype=np.float64))
        T[:3, 3] *= 1000.0
        try:
            if geometry.mesh is not None:
                mesh = self._mesh(geometry.mesh.filename)
                scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
                self.place(name, mesh.name, partial(_arrays, mesh), T @ np.diag([*np.broadcast_to(scale, 3), 1.0]))
            else:
                self.add(name, _shape(geometry), T)
        except InputError as error:
            self.add(name, str(error), T)

    def _mesh(self, name: str) -> Mesh:
        """The mesh of a file, as ROS reads it: numbers without a unit are metres, and the axes of glTF stay."""
        path = _mesh_file(self.path, name)
        if path not in self._files:
            form = FORMATS.get(path.suffix.lower())
            if form is None or form.module == "step_file":
                raise InputError(f"{name}: a mesh must be one of {', '.join(FORMATS)}, without STEP")
            reading = read(path, None if form.unit else "m").complete(path)
            mesh = reading.merged(path.name)
            if form.unit == "m":
                mesh = make_mesh(mesh.vertices[:, [0, 2, 1]] * (1, 1, -1), mesh.faces, name=path.name)
            self.notes += [f"{path.name}: {note}" for note in mesh.notes]
            self._files[path] = mesh
        return self._files[path]


def _arrays(mesh: Mesh) -> tuple[Array, IntArray]:
    return mesh.vertices, mesh.faces


def _shape(geometry: Any) -> MeshShape | Drawn:
    """A box, a cylinder, or a sphere as facets, in mm. Raises InputError for sizes that are not > 0."""
    if geometry.sphere is not None:
        radius = checks.positive("radius of a sphere", 1000.0 * geometry.sphere.radius)
        facets = trimesh.creation.icosphere(4, radius)
        nearest = float(np.abs(np.einsum("ij,ij->i", facets.triangles[:, 0], facets.face_normals)).min())
        return MeshShape(make_mesh(facets.vertices, facets.faces, name="sphere"), "off", "sphere", radius - nearest)
    if geometry.box is not None:
        drawn = Drawn("box", tuple(1000.0 * float(x) for x in geometry.box.size))
    else:
        drawn = Drawn("cylinder", (1000.0 * geometry.cylinder.radius, 1000.0 * geometry.cylinder.length))
    drawn.solid  # noqa: B018  whose sizes are checked when it is made
    return drawn


def _mesh_file(path: Path, name: str) -> Path:
    """A mesh beside the description or in the folder above, or, of a package, in any folder above it."""
    bare = name.removeprefix("file://")
    if bare.startswith("package://"):
        inside = Path(bare.removeprefix("package://"))
        for folder in path.resolve().parents:
            for choice in (folder / inside, folder / Path(*inside.parts[1:])):
                if choice.is_file() and _within(choice, folder):
                    return choice
        raise InputError(f"{name}: no such file in a folder above {path.name}")
    file = path.parent / bare
    if not _within(file, path.resolve().parent.parent):
        raise InputError(f"{name}: is outside of the robot's folder and the one above; {OUTSIDE}=1 allows that")
    checks.readable_file(file)
    return file


def _within(file: Path, folder: Path) -> bool:
    return os.environ.get(OUTSIDE) == "1" or file.resolve().is_relative_to(folder.resolve())


def _parsed(path: Path) -> ElementTree.Element:
    """The XML of a robot whose links and joints make one tree. Raises InputError."""
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: not a readable URDF file ({error})") from None
    if root.tag != "robot":
        raise InputError(f"{path}: not a readable URDF file (it holds <{root.tag}>, not <robot>)")
    for kind in ("link", "joint"):
        names = [item.get("name") for item in root.findall(kind)]
        if None in names:
            raise InputError(f"{path}: {kind} {names.index(None) + 1} has no name")
        name, count = max(Counter(names).items(), key=lambda item: item[1], default=("", 0))
        if count > 1:
            raise InputError(f"{path}: {count} of its {kind}s are called {checks.shown(name)}")
    for link in root.findall("link"):
        name = checks.shown(link.get("name"))
        if any(link.find(f".//{inner}") is not None for inner in ("link", "joint")):
            raise InputError(f"{path}: link {name} holds another link or joint")
        for item in (*link.findall("collision"), *link.findall("visual")):
            kinds = [shape.tag for shape in item.findall("geometry/*")]
            if len(kinds) != 1 or kinds[0] not in _SHAPES:
                listed = ", ".join(sorted(_SHAPES))
                raise InputError(
                    f"{path}: a shape of link {name} must be one of {listed}, got {', '.join(kinds) or 'none'}"
                )
    _check_tree(path, root)
    return root


def _check_tree(path: Path, root: ElementTree.Element) -> None:
    """Raise InputError unless every link but one hangs on it by joints."""
    links = [str(link.get("name")) for link in root.findall("link")]
    above: dict[str, str] = {}
    for joint in root.findall("joint"):
        parent, child = (joint.find(end) for end in ("parent", "child"))
        ends = ["" if end is None else end.get("link", "") for end in (parent, child)]
        for kind, link in zip(("parent", "child"), ends, strict=True):
            if link not in links:
                name = checks.shown(joint.get("name"))
                raise InputError(f"{path}: the {kind} of joint {name} must be a link, got {checks.shown(link)}")
        if ends[1] in above:
            raise InputError(f"{path}: link {checks.shown(ends[1])} is the child of more than one joint")
        above[ends[1]] = ends[0]
    root_link = next((link for link in links if link not in above), "")
    reached = {root_link}
    while grown := {child for child, parent in above.items() if parent in reached} - reached:
        reached |= grown
    if lost := [link for link in links if link not in reached]:
        raise InputError(
            f"{path}: no path of joints from link {checks.shown(root_link)} to link {checks.shown(lost[0])}"
        )


def _joint_values(path: Path, robot: Any, values: dict[str, float]) -> dict[str, float]:
    """Value of each actuated joint: as given, else 0 or the nearest limit; m for those that slide."""
    joints = {name: robot.joint_map[name] for name in robot.actuated_joint_names}
    for name in values:
        if name not in joints:
            listed = ", ".join(list(joints)[:12]) or "none"
            raise InputError(f"{path}: unknown joint {checks.shown(name)}; available: {listed}")
    configuration = {}
    for name, joint in joints.items():
        factor, unit = (1000.0, "mm") if joint.type == "prismatic" else (1.0, "rad")
        limit = None if joint.type == "continuous" else joint.limit
        low = -math.inf if limit is None or limit.lower is None else limit.lower
        high = math.inf if limit is None or limit.upper is None else limit.upper
        value = min(max(0.0, low), high)
        if name in values:
            value = checks.number(f"joint {name}", values[name]) / factor
            if not low - 1e-9 <= value <= high + 1e-9:
                raise InputError(
                    f"joint {name} must be from {low * factor:g} to {high * factor:g} {unit}, got {value * factor:g}"
                )
        configuration[name] = value
    return configuration
