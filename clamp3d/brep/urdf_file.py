"""Robot descriptions (URDF): the shapes of each link where the joints put them, by yourdfpy.

yourdfpy reads what it can of a damaged file and says nothing, so the file is parsed strictly before, and the links,
shapes and joints in it are counted. This runs in the process for foreign files. Needs the extra ``urdf``.
"""

from __future__ import annotations

import io
import math
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh
import yourdfpy

from clamp3d import checks
from clamp3d.brep.bodies import MOST_BODIES
from clamp3d.core.mesh import Array, make_mesh
from clamp3d.core.pose import nearest_rigid
from clamp3d.errors import InputError

_SHAPES = {"box", "cylinder", "sphere", "mesh"}


def read_urdf(path: str, joints: dict[str, float]) -> dict[str, Any]:
    """The shapes of a robot's links in mm, in the frame of the root link, at the values of its ``joints``.

    Returns
    -------
    dict
        ``shapes``: a dict for each, with its ``link``, ``kind``, place ``T`` (4, 4), and ``size`` of a box, ``radius``
        and ``length`` of a cylinder, ``mesh`` and ``error`` of a sphere, ``file`` and ``scale`` of a mesh file, or the
        ``reason`` why it cannot be read.
        ``joined``: the pairs of links that a joint connects. ``notes``: what was assumed.

    Raises InputError for a file that is no whole URDF, unknown joints and values out of their limits.
    """
    file = Path(path)
    root = _parsed(file)
    try:
        robot = yourdfpy.URDF.load(
            io.BytesIO(ElementTree.tostring(root)),
            load_meshes=False,
            build_scene_graph=True,
            load_collision_meshes=False,
        )
    except Exception as error:  # it raises whatever its parser meets
        raise InputError(f"{file}: not a readable URDF file ({' '.join(str(error).split())})") from None
    robot.update_cfg(_joint_values(file, robot, joints))
    shapes = []
    for link in robot.robot.links:
        T_link = np.asarray(robot.get_transform(link.name))
        for item in link.collisions or link.visuals:
            T = T_link if item.origin is None else T_link @ item.origin
            if not np.isfinite(T).all():
                raise InputError(f"{file}: a place in link {link.name} is not finite")
            shapes.append({"link": link.name, "T": _in_mm(T), **_shape(item.geometry)})
    notes = []
    if not all(link.collisions for link in robot.robot.links if link.visuals):
        notes.append("links without collision shapes are taken by their visual ones")
    joined = [(joint.parent, joint.child) for joint in robot.robot.joints]
    return {"shapes": shapes, "joined": joined, "notes": notes}


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
        for name, count in Counter(names).items():
            if count > 1:
                raise InputError(f"{path}: {count} of its {kind}s are called {checks.shown(name)}")
    links = {str(link.get("name")): link for link in root.findall("link")}
    for name, link in links.items():
        if any(link.find(f".//{inner}") is not None for inner in ("link", "joint")):
            raise InputError(f"{path}: link {checks.shown(name)} holds another link or joint")
        for item in (*link.findall("collision"), *link.findall("visual")):
            kinds = [shape.tag for shape in item.findall("geometry/*")]
            if len(kinds) != 1 or kinds[0] not in _SHAPES:
                raise InputError(
                    f"{path}: a shape of link {checks.shown(name)} must be one of {', '.join(sorted(_SHAPES))}, "
                    f"got {', '.join(kinds) or 'none'}"
                )
    if len(root.findall("link/*/geometry")) > MOST_BODIES:
        raise InputError(f"{path}: more than {MOST_BODIES} bodies")
    _check_tree(path, root, set(links))
    return root


def _check_tree(path: Path, root: ElementTree.Element, links: set[str]) -> None:
    """Raise InputError unless every link but one hangs on it by joints."""
    above: dict[str, str] = {}
    for joint in root.findall("joint"):
        name = checks.shown(joint.get("name"))
        parent, child = (
            "" if end is None else end.get("link", "") for end in (joint.find("parent"), joint.find("child"))
        )
        for end, link in (("parent", parent), ("child", child)):
            if link not in links:
                raise InputError(f"{path}: the {end} of joint {name} must be a link, got {checks.shown(link)}")
        if child in above:
            raise InputError(f"{path}: link {checks.shown(child)} is the child of more than one joint")
        above[child] = parent
    roots = sorted(links - above.keys())
    if len(roots) > 1:
        listed = ", ".join(roots[:4])
        raise InputError(f"{path}: {len(roots)} links hang on no joint: {listed}; all but one must be a joint's child")
    reached = set(roots)
    while grown := {child for child, parent in above.items() if parent in reached} - reached:
        reached |= grown
    if lost := sorted(links - reached):
        raise InputError(f"{path}: no path of joints from the root to link {checks.shown(lost[0])}")


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
        low, high = -math.inf, math.inf
        if joint.type != "continuous" and joint.limit is not None:
            low = -math.inf if joint.limit.lower is None else joint.limit.lower
            high = math.inf if joint.limit.upper is None else joint.limit.upper
        value = min(max(0.0, low), high)
        if name in values:
            value = checks.number(f"joint {name}", values[name]) / factor
            if not low - 1e-9 <= value <= high + 1e-9:
                raise InputError(
                    f"joint {name} must be from {low * factor:g} to {high * factor:g} {unit}, got {value * factor:g}"
                )
        configuration[name] = value
    return configuration


def _shape(geometry: Any) -> dict[str, Any]:
    if geometry.box is not None:
        return {"kind": "box", "size": [1000.0 * float(x) for x in geometry.box.size]}
    if geometry.cylinder is not None:
        radius, length = geometry.cylinder.radius, geometry.cylinder.length
        return {"kind": "cylinder", "radius": 1000.0 * radius, "length": 1000.0 * length}
    if geometry.sphere is not None:
        try:
            mesh, error = _ball(1000.0 * geometry.sphere.radius)
        except InputError as problem:
            return {"kind": "unreadable", "reason": str(problem)}
        return {"kind": "sphere", "mesh": mesh, "error": error}
    scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
    scales = np.broadcast_to(np.asarray(scale, dtype=np.float64), (3,))
    return {"kind": "mesh", "file": geometry.mesh.filename, "scale": scales.tolist()}


def _ball(radius: float) -> tuple[Any, float]:
    """A sphere as facets, and how far (mm) they are from it."""
    checks.positive("radius of a sphere", radius)
    made = trimesh.creation.icosphere(4, radius)
    corners = np.asarray(made.triangles)
    nearest = float(np.abs(np.einsum("ij,ij->i", corners[:, 0], made.face_normals)).min())
    return make_mesh(made.vertices, made.faces, name="sphere"), radius - nearest


def _in_mm(T: Array) -> Array:
    pose = nearest_rigid(np.asarray(T, dtype=np.float64))
    pose[:3, 3] *= 1000.0
    return pose
