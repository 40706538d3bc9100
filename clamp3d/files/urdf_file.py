"""Robot descriptions (URDF) as bodies named after their links, where the joints put them, by yourdfpy.

yourdfpy reads what it can of a damaged file and says nothing, so the file is parsed strictly before. Of each link the
collision shapes are taken, or the visual ones if it has no others. This runs in the process for foreign files. Needs
the extra ``urdf``.
"""

from __future__ import annotations

import io
import math
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import networkx  # which yourdfpy needs
import numpy as np
import yourdfpy

from clamp3d import checks
from clamp3d.errors import InputError
from clamp3d.files.bodies import Reading
from clamp3d.files.formats import FORMATS, read
from clamp3d.files.placing import Placer
from clamp3d.files.worker import OUTSIDE, may_read
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array, nearest_rigid
from clamp3d.geometry.shapes import Shape, box, cylinder, sphere

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
"""Those of the URDF specification."""
_SHAPE = ("origin", "geometry", "material", "verbose", "contact", "contact_coefficients", "surface", "gazebo")
_ELEMENTS = {
    "link": ("inertial", "visual", "collision", "self_collision_checking", "contact", "sensor", "gazebo"),
    "joint": (
        *("parent", "child", "origin", "axis", "limit", "mimic", "dynamics", "calibration", "safety_controller"),
        *("safety", "joint_properties", "sensor", "gazebo"),
    ),
    "collision": _SHAPE,
    "visual": _SHAPE,
    "geometry": ("box", "cylinder", "sphere", "mesh"),
}
"""What elements that hold bodies and places may hold: the specification's, and those that simulators give them."""
_ATTRIBUTES = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz", "rpy"),  # the latter without a meaning, but it is written
    "limit": ("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"),
    "mimic": ("joint", "multiplier", "offset"),
    "mesh": ("filename", "scale"),
}
"""Attributes of elements whose attributes may be left out."""


def read_urdf(path: Path, joints: dict[str, float]) -> Reading:
    """The shapes of a robot's links in mm, in the frame of the root link, at the values of its ``joints``.

    Values are in rad, or mm for joints that slide; without one a joint is at 0, or its nearest limit.
    Raises InputError for a file that is no whole URDF, unknown joints and values out of their limits.
    """
    root = ElementTree.parse(path).getroot()
    _check_whole(root)
    robot = yourdfpy.URDF.load(
        io.BytesIO(ElementTree.tostring(root)), load_meshes=False, build_scene_graph=True, load_collision_meshes=False
    )
    robot.update_cfg(_joint_values(robot, joints))
    placer = Placer()
    for link in robot.robot.links:
        T_link = np.asarray(robot.get_transform(link.name))
        for shape in link.collisions or link.visuals:
            T = nearest_rigid(T_link if shape.origin is None else T_link @ shape.origin)
            T[:3, 3] *= 1000.0
            if shape.geometry.mesh is None:
                placer.add(link.name, _drawn(shape.geometry), T)
                continue
            file, scale = shape.geometry.mesh.filename, shape.geometry.mesh.scale
            T = T @ np.diag([*np.broadcast_to(1.0 if scale is None else scale, 3), 1.0])
            placer.place(link.name, file, partial(_triangles, path, file, placer.notes), T)
    if not all(link.collisions for link in robot.robot.links if link.visuals):
        placer.notes.append("links without collision shapes are taken by their visual ones")
    placer.joined = [(joint.parent, joint.child) for joint in robot.robot.joints]
    return placer


def _triangles(robot: Path, file: str, notes: list[str]) -> tuple[Array, IntArray]:
    """Vertices and faces of a mesh file, as ROS reads it: numbers without a unit are metres, glTF's axes stay."""
    try:
        path = _mesh_file(robot, file)
        meshes = {kind: form for kind, form in FORMATS.items() if not form.reader.startswith("step")}
        form = meshes.get(path.suffix.lower())
        if form is None:
            raise InputError(f"a mesh must be one of {', '.join(meshes)}")
        mesh = read(path, None if form.unit else "m").complete(path.name).merged(path.name)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    notes += [f"{path.name}: {note}" for note in mesh.notes]
    if form.unit == "m":
        return mesh.vertices[:, [0, 2, 1]] * (1, 1, -1), mesh.faces
    return mesh.vertices, mesh.faces


def _drawn(geometry: Any) -> Shape | str:
    """A box, a cylinder or a sphere, in mm; or which size of it is not > 0."""
    try:
        if geometry.box is not None:
            return box(tuple(1000.0 * float(x) for x in geometry.box.size))
        if geometry.cylinder is not None:
            return cylinder(1000.0 * geometry.cylinder.radius, 1000.0 * geometry.cylinder.length)
        return sphere(checks.positive("radius of a sphere", 1000.0 * geometry.sphere.radius))
    except InputError as error:
        return str(error)


def _mesh_file(path: Path, name: str) -> Path:
    """A mesh beside the description or in the folder above, or, of a package, in any folder above it."""
    bare = name.removeprefix("file://")
    files = [(path.parent / bare, path.resolve().parent.parent)]
    if bare.startswith("package://"):
        inside = Path(bare.removeprefix("package://"))
        inner = (inside, Path(*inside.parts[1:]))
        files = [(folder / part, folder) for folder in path.resolve().parents for part in inner]
    for file, folder in files:
        if may_read(file, folder) and file.is_file():
            return file
    raise InputError(f"no such file in the robot's folder, the one above or its package; {OUTSIDE}=1 allows others")


def _check_whole(root: ElementTree.Element) -> None:
    """Raise InputError for what yourdfpy would pass over, and unless links and joints make one tree."""
    if root.tag != "robot":
        raise InputError(f"not a readable URDF file (it holds <{root.tag}>, not <robot>)")
    if any("xacro}" in item.tag for item in root.iter()):
        raise InputError("it holds macros: expand them first (xacro robot.urdf.xacro > robot.urdf)")
    if root.find("link") is None:
        raise InputError("no links in the file")
    for item in root:
        if item.tag not in ("link", "gazebo") and item.find(".//geometry") is not None:
            raise InputError(f"not a readable URDF file (a body is in <{item.tag}>, not in <link>)")
    for kind in ("link", "joint"):
        counts = Counter(item.get("name") for item in root.findall(kind))
        for name, count in counts.most_common(1):
            if count > 1:
                raise InputError(f"{count} of its {kind}s are called {checks.shown(name)}")
        if root.find(f"link//{kind}") is not None:
            raise InputError(f"a link holds another {kind}")
    for item in (*root.iterfind("link/collision"), *root.iterfind("link/visual")):
        if (count := len(item.findall("geometry/*"))) != 1:
            raise InputError(f"each {item.tag} of a link must have 1 shape, got {count}")
    for joint in root.findall("joint"):
        checks.choice(f"type of joint {joint.get('name')}", joint.get("type"), JOINT_TYPES)
        for mimic in joint.findall("mimic"):
            joints = [other.get("name", "") for other in root.findall("joint")]
            checks.choice(f"joint that {joint.get('name')} follows", mimic.get("joint"), joints)
    tree: Any = networkx.MultiDiGraph()
    tree.add_nodes_from(link.get("name") for link in root.findall("link"))
    count = len(tree)
    ends = zip(root.iterfind("joint/parent"), root.iterfind("joint/child"), strict=True)
    tree.add_edges_from((parent.get("link"), child.get("link")) for parent, child in ends)
    if len(tree) > count:
        raise InputError(f"a joint must connect links, got {checks.shown([*tree][count])}")
    if not networkx.is_arborescence(tree):
        raise InputError("the joints must make one tree of all links, in which none is the child of two")
    for item in (*root.findall("link"), *root.findall("joint")):
        _check_known(item)


def _check_known(item: ElementTree.Element) -> None:
    """Raise InputError for elements and attributes that would be passed over; those of a namespace may be."""
    below = [*item] if item.tag in _ELEMENTS else []
    for names, known in (
        ([*item.attrib], _ATTRIBUTES.get(item.tag)),
        ([child.tag for child in below], _ELEMENTS.get(item.tag)),
    ):
        for name in names:
            if known and name not in known and not name.startswith("{"):
                raise InputError(
                    f"not a readable URDF file (<{item.tag}> has {checks.shown(name)}, not one of {', '.join(known)})"
                )
    for child in below:
        _check_known(child)


def _joint_values(robot: Any, values: dict[str, float]) -> dict[str, float]:
    """Value of each actuated joint: as given, else 0 or the nearest limit; m for those that slide."""
    joints = {name: robot.joint_map[name] for name in robot.actuated_joint_names}
    for name in values:
        checks.choice("joint", name, joints)
    configuration = {}
    for name, joint in joints.items():
        factor, unit = (1000.0, "mm") if joint.type == "prismatic" else (1.0, "rad")
        limit = None if joint.type == "continuous" else joint.limit
        low = -math.inf if limit is None or limit.lower is None else limit.lower
        high = math.inf if limit is None or limit.upper is None else limit.upper
        value = values[name] / factor if name in values else min(max(0.0, low), high)
        if not low - 1e-9 <= value <= high + 1e-9:
            raise InputError(
                f"joint {name} must be from {low * factor:g} to {high * factor:g} {unit}, got {value * factor:g}"
            )
        configuration[name] = value
    return configuration
