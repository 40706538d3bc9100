"""MuJoCo 4: box geoms of one body, convex as it advises for other shapes; in metres, searched up to 2 mm.

Whole part: a distance sensor between two bodies (native convex collision), its wire placed where kinematics would put
it; many poses at once by `mujoco.rollout`, which runs in C++. A sector:
`mj_geomDistance` of two geoms. Contacts with a margin (`mj_collision`) take longer, and miss hits of a cylinder.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from clamp3d.bench.compare.methods import SECTOR_ANGLES_DEG, Prepared, Series, ready
from clamp3d.bench.compare.peers.pieces import boxes, sectors
from clamp3d.bench.compare.scene import WIRE
from clamp3d.geometry.pose import Array

_MM = 1e-3
_FARTHEST = 2.0  # mm


def _model(unit_angle: float, shape: str) -> tuple[Any, int]:
    """The compiled model, and how many of its geoms are the block's; then comes the wire."""
    mujoco: Any = importlib.import_module("mujoco")

    def numbers(x: Array) -> str:
        return " ".join(repr(float(v)) for v in x.ravel())

    passive = 'contype="0" conaffinity="0"'  # for the sensor alone, not for a simulation's collision detection
    pieces = boxes(unit_angle)
    geoms = [
        f'<geom type="box" size="{numbers(0.5 * _MM * size)}" pos="{numbers(_MM * T[:3, 3])}" '
        f'xyaxes="{numbers(T[:3, :2].T)}" {passive}/>'
        for size, T in pieces
    ]
    wire = f'<geom type="{shape}" size="{WIRE.radius * _MM} {WIRE.length / 2 * _MM}" {passive}/>'
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="part">{"".join(geoms)}</body>'
        f'<body name="wire" mocap="true">{wire}</body></worldbody>'
        f'<sensor><distance body1="part" body2="wire" cutoff="{_FARTHEST * _MM}"/></sensor></mujoco>'
    ), len(pieces)


def _whole(unit_angle: float, shape: str) -> Prepared:
    from scipy.spatial.transform import Rotation

    mujoco: Any = importlib.import_module("mujoco")
    rollout: Any = importlib.import_module("mujoco.rollout")
    model, wire = _model(unit_angle, shape)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    position, turn, reading = data.geom_xpos[wire], data.geom_xmat[wire], data.sensordata
    spec = int(mujoco.mjtState.mjSTATE_MOCAP_POS) | int(mujoco.mjtState.mjSTATE_MOCAP_QUAT)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)

    def one(T: Array) -> float:
        position[:] = T[:3, 3] * _MM
        turn[:] = T[:3, :3].ravel()
        mujoco.mj_sensorPos(model, data)
        return float(reading[0]) / _MM

    def many(poses: Array) -> Array:
        turn = Rotation.from_matrix(poses[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]]
        control = np.hstack([poses[:, :3, 3] * _MM, turn])[:, None]
        with rollout.Rollout(nthread=0) as pool:
            _, seen = pool.rollout(model, [data], np.zeros((len(poses), size)), control, control_spec=spec)
        return np.asarray(seen[:, 0, 0]) / _MM

    one(np.eye(4))
    return Prepared(one, many, wire)


def _sector(unit_angle: float) -> Prepared:
    mujoco: Any = importlib.import_module("mujoco")
    model, wire = _model(unit_angle, "capsule")
    data, find = mujoco.MjData(model), sectors(wire - 2)
    mujoco.mj_kinematics(model, data)
    position, turn = data.geom_xpos[wire], data.geom_xmat[wire]

    def one(T: Array) -> float:
        position[:] = T[:3, 3] * _MM
        turn[:] = T[:3, :3].ravel()
        i, j = find(T)
        d = mujoco.mj_geomDistance(model, data, i, wire, _FARTHEST * _MM, None)
        if j != i:
            d = min(d, mujoco.mj_geomDistance(model, data, j, wire, _FARTHEST * _MM, None))
        return float(d) / _MM

    return ready(one, wire - 2, depth=True)


SERIES = {
    "mujoco-cylinder": Series(lambda angle: _whole(angle, "cylinder"), "mujoco", ("mujoco", "mujoco.rollout")),
    "mujoco-capsule": Series(lambda angle: _whole(angle, "capsule"), "mujoco", ("mujoco", "mujoco.rollout")),
    "mujoco-sector": Series(_sector, "mujoco", ("mujoco",), SECTOR_ANGLES_DEG),
}
