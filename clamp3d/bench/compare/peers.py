"""Other libraries on the same scene, each set up as its own documentation advises and with its default tolerances.

- coal (3.0): the part as convex pieces under its own dynamic AABB tree, the wire a ``Cylinder``; its README prefers
  convex shapes, and here they are two to three times faster than ``BVHModelOBBRSS``. The tree ends at the first
  overlap, so it has no depth.
- MuJoCo (4.0): collides convex geoms only and advises to break other meshes up; the same convex pieces as mesh geoms of
  one body, lengths in metres, read by its distance sensor between two bodies (native convex collision).
- trimesh (5.2): ``CollisionManager`` takes meshes only, so the wire is one too, as finely divided as the groove.
- manifold3d (3.5): ``Manifold.min_gap`` of two meshes, the wire as finely divided as the groove. No depth.
- Open CASCADE (8.0): ``BRepExtrema_DistShapeShape`` of the true B-rep solids, nothing faceted. No depth.

MuJoCo and manifold3d are told that no distance beyond 2 mm is asked for. Convex pieces are those of
`clamp3d.baselines.wedges`, exact but for their chords: closer to the part than any decomposition of a mesh.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from clamp3d.baselines.wedges import wedge_solids
from clamp3d.bench.compare.methods import Method, Prepared
from clamp3d.bench.compare.scene import WIRE, block, chord_error, pair
from clamp3d.core.pose import Array
from clamp3d.core.profile import chord_count

PEER_ANGLES_DEG = (1.0, 5.0, 20.0)
_FARTHEST = 2.0  # mm

_Ready = tuple[Callable[[Array], float], int, bool]
"""What measures a pose in mm, the number of its pieces, and whether it has a depth."""


class _Peer(NamedTuple):
    """How a library is installed and set up: ``make`` takes the unit angle, ``needs`` are modules to import first."""

    package: str
    needs: tuple[str, ...]
    make: Callable[[float], _Ready]


def missing_peers() -> dict[str, str]:
    """Each peer that is not installed, with what to install."""
    return {
        name: f"not installed: pip install {peer.package} (or 'clamp3d[peers]')"
        for name, peer in _PEERS.items()
        if importlib.util.find_spec(peer.needs[0]) is None
    }


def load_peer(method: Method) -> None:
    """Import what the peer and its input need, so that its set-up time is its own."""
    for module in _PEERS[method.family].needs:
        importlib.import_module(module)


def prepare_peer(method: Method) -> Prepared:
    """Set a peer up for the scene of `compare.scene`, everything in the groove's frame."""
    one, pieces, depth = _PEERS[method.family].make(math.radians(method.setting or 0.0))

    def many(poses: Array) -> Array:
        return np.array([one(T) for T in poses])

    many(np.eye(4)[None])
    return Prepared(one, many, pieces, depth=depth)


def _coal(unit_angle: float) -> _Ready:
    coal: Any = importlib.import_module("coal")
    manager = coal.DynamicAABBTreeCollisionManager()
    keep = []
    for V, F in _convex_pieces(unit_angle):
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        for v in V:
            points.append(v)
        for a, b, c in F.tolist():
            triangles.append(coal.Triangle(a, b, c))
        keep.append(coal.CollisionObject(coal.Convex(points, triangles)))
        manager.registerObject(keep[-1])
    manager.setup()
    wire = coal.CollisionObject(coal.Cylinder(WIRE.radius, WIRE.length))
    callback = coal.DistanceCallBackDefault()

    def one(T: Array) -> float:
        wire.setRotation(T[:3, :3])
        wire.setTranslation(T[:3, 3])
        wire.computeAABB()
        callback.init()
        manager.distance(wire, callback)
        return float(callback.data.result.min_distance)

    one.keep = keep  # type: ignore[attr-defined]  # coal's bindings hold bare pointers
    return one, len(keep), False


def _mujoco(unit_angle: float) -> _Ready:
    mujoco: Any = importlib.import_module("mujoco")
    mm = 1e-3
    assets, geoms = [], []
    for i, (V, _) in enumerate(_convex_pieces(unit_angle)):
        numbers = " ".join(repr(float(x)) for x in (V * mm).ravel())
        assets.append(f'<mesh name="w{i}" inertia="convex" vertex="{numbers}"/>')
        geoms.append(f'<geom type="mesh" mesh="w{i}"/>')
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset>{"".join(assets)}</asset><worldbody><body name="part">{"".join(geoms)}</body>'
        '<body name="wire" mocap="true">'
        f'<geom type="cylinder" size="{WIRE.radius * mm} {WIRE.length / 2 * mm}"/></body>'
        f'</worldbody><sensor><distance body1="part" body2="wire" cutoff="{_FARTHEST * mm}"/></sensor></mujoco>'
    )
    data = mujoco.MjData(model)

    def one(T: Array) -> float:
        data.mocap_pos[0] = T[:3, 3] * mm
        mujoco.mju_mat2Quat(data.mocap_quat[0], T[:3, :3].ravel())
        mujoco.mj_kinematics(model, data)
        mujoco.mj_sensorPos(model, data)
        return float(data.sensordata[0]) / mm

    return one, len(geoms), True


def _trimesh(unit_angle: float) -> _Ready:
    trimesh: Any = importlib.import_module("trimesh")
    collision: Any = importlib.import_module("trimesh.collision")
    V, F = _mesh(unit_angle)
    part, wire = collision.CollisionManager(), collision.CollisionManager()
    part.add_object("part", trimesh.Trimesh(V, F, process=False))
    wire.add_object("wire", trimesh.creation.cylinder(WIRE.radius, WIRE.length, sections=_sections(unit_angle)))

    def one(T: Array) -> float:
        wire.set_transform("wire", T)
        return float(part.min_distance_other(wire))

    return one, len(F), False


def _manifold(unit_angle: float) -> _Ready:
    import manifold3d

    V, F = _mesh(unit_angle)
    mesh = manifold3d.Mesh64(vert_properties=np.ascontiguousarray(V), tri_verts=np.ascontiguousarray(F, np.uint64))
    part = manifold3d.Manifold(mesh)
    wire = manifold3d.Manifold.cylinder(WIRE.length, WIRE.radius, WIRE.radius, _sections(unit_angle), True)

    def one(T: Array) -> float:
        return float(part.min_gap(wire.transform(T[:3]), _FARTHEST))

    return one, len(F), False


def _open_cascade(_: float) -> _Ready:
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
    from OCP.TopLoc import TopLoc_Location

    from clamp3d.core.pose import inverse
    from clamp3d.output.step import solid

    def location(T: Array) -> Any:
        transformation = gp_Trsf()
        transformation.SetValues(*T[:3].ravel().tolist())
        return TopLoc_Location(transformation)

    part = solid(block()).Moved(location(inverse(pair().T_a_groove)))
    axes = gp_Ax2(gp_Pnt(0.0, 0.0, -WIRE.length / 2), gp_Dir(0.0, 0.0, 1.0))
    wire = BRepPrimAPI_MakeCylinder(axes, WIRE.radius, WIRE.length).Shape()

    def one(T: Array) -> float:
        return float(BRepExtrema_DistShapeShape(part, wire.Moved(location(T))).Value())

    return one, 1, False


def _convex_pieces(unit_angle: float) -> list[tuple[Array, Any]]:
    """Vertices and triangles of the block's wedges in the groove's frame."""
    return [(V @ pair().T_a_groove[:3, :3], F) for _, V, F in wedge_solids(block(), unit_angle)]


def _mesh(unit_angle: float) -> tuple[Array, Any]:
    """Vertices and triangles of the block's mesh in the groove's frame."""
    from clamp3d.core.meshing import mesh

    made = mesh(block(), chord_error(unit_angle) * (1.0 + 1e-9))
    return np.asarray(made.vertices) @ pair().T_a_groove[:3, :3], np.asarray(made.faces)


def _sections(unit_angle: float) -> int:
    return max(3, chord_count(2.0 * math.pi, unit_angle))


_MESHED = ("trimesh.collision", "fcl", "manifold3d", "scipy.spatial")  # what makes the meshes
_PEERS = {
    "coal": _Peer("coal", ("coal",), _coal),
    "mujoco": _Peer("mujoco", ("mujoco",), _mujoco),
    "trimesh": _Peer("trimesh", ("trimesh", *_MESHED), _trimesh),
    "manifold3d": _Peer("manifold3d", ("manifold3d", *_MESHED), _manifold),
    "open-cascade": _Peer("cadquery-ocp-novtk", ("OCP", "OCP.BRepExtrema"), _open_cascade),
}
PEER_METHODS = (
    *(Method(peer, angle) for peer in _PEERS if peer != "open-cascade" for angle in PEER_ANGLES_DEG),
    Method("open-cascade"),
)
