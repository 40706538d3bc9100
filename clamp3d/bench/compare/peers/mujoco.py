"""MuJoCo 4: convex geoms of one body, as it advises for other shapes; lengths in metres, no farther than 2 mm asked.

Whole part: a distance sensor between two bodies (native convex collision), many poses at once by `mujoco.rollout`,
which runs in C++ with a thread for each `MjData`. A sector: `mj_geomDistance` of two geoms.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

import numpy as np

from clamp3d.bench.compare.methods import SECTOR_ANGLES_DEG, Prepared, Series, ready
from clamp3d.bench.compare.peers.pieces import boxes, prisms, sectors
from clamp3d.bench.compare.scene import WIRE
from clamp3d.core.pose import Array

_MM = 1e-3
_FARTHEST = 2.0  # mm


def _model(unit_angle: float, shape: str) -> tuple[Any, int]:
    """The compiled model, and how many of its geoms are prisms; then come the boxes, then the wire."""
    mujoco: Any = importlib.import_module("mujoco")

    def numbers(x: Array) -> str:
        return " ".join(repr(float(v)) for v in (x * _MM).ravel())

    passive = 'contype="0" conaffinity="0"'  # asked by the sensor alone, not by a simulation's collision detection
    solids = prisms(unit_angle)
    assets = [f'<mesh name="p{i}" inertia="convex" vertex="{numbers(V)}"/>' for i, V in enumerate(solids)]
    geoms = [f'<geom type="mesh" mesh="p{i}" {passive}/>' for i in range(len(solids))]
    geoms += [f'<geom type="box" size="{numbers(0.5 * s)}" pos="{numbers(c)}" {passive}/>' for s, c in boxes()]
    wire = f'<geom type="{shape}" size="{WIRE.radius * _MM} {WIRE.length / 2 * _MM}" {passive}/>'
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset>{"".join(assets)}</asset><worldbody><body name="part">{"".join(geoms)}</body>'
        f'<body name="wire" mocap="true">{wire}</body></worldbody>'
        f'<sensor><distance body1="part" body2="wire" cutoff="{_FARTHEST * _MM}"/></sensor></mujoco>'
    ), len(solids)


def _whole(unit_angle: float, shape: str) -> Prepared:
    from scipy.spatial.transform import Rotation

    mujoco: Any = importlib.import_module("mujoco")
    rollout: Any = importlib.import_module("mujoco.rollout")
    model, count = _model(unit_angle, shape)
    data = mujoco.MjData(model)
    spec = int(mujoco.mjtState.mjSTATE_MOCAP_POS) | int(mujoco.mjtState.mjSTATE_MOCAP_QUAT)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)

    def one(T: Array) -> float:
        data.mocap_pos[0] = T[:3, 3] * _MM
        mujoco.mju_mat2Quat(data.mocap_quat[0], T[:3, :3].ravel())
        mujoco.mj_kinematics(model, data)
        mujoco.mj_sensorPos(model, data)
        return float(data.sensordata[0]) / _MM

    def batch(poses: Array, threads: int) -> Array:
        turn = Rotation.from_matrix(poses[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]]
        control = np.hstack([poses[:, :3, 3] * _MM, turn])[:, None]
        with rollout.Rollout(nthread=threads if threads > 1 else 0) as pool:
            states = [mujoco.MjData(model) for _ in range(threads)]
            _, seen = pool.rollout(model, states, np.zeros((len(poses), size)), control, control_spec=spec)
        return np.asarray(seen[:, 0, 0]) / _MM

    one(np.eye(4))
    return Prepared(
        one,
        lambda poses: batch(poses, 1),
        count + 2,
        batched=True,
        threaded=lambda poses: batch(poses, os.cpu_count() or 1),
    )


def _sector(unit_angle: float) -> Prepared:
    mujoco: Any = importlib.import_module("mujoco")
    model, count = _model(unit_angle, "capsule")
    data, find, wire = mujoco.MjData(model), sectors(count), count + 2
    mujoco.mj_kinematics(model, data)
    at, turn = data.geom_xpos, data.geom_xmat

    def one(T: Array) -> float:
        at[wire] = T[:3, 3] * _MM
        turn[wire] = T[:3, :3].ravel()
        i, j = find(T)
        d = mujoco.mj_geomDistance(model, data, i, wire, _FARTHEST * _MM, None)
        if j != i:
            d = min(d, mujoco.mj_geomDistance(model, data, j, wire, _FARTHEST * _MM, None))
        return float(d) / _MM

    return ready(one, count, depth=True)


SERIES = {
    "mujoco-cylinder": Series(lambda angle: _whole(angle, "cylinder"), "mujoco", ("mujoco", "mujoco.rollout")),
    "mujoco-capsule": Series(lambda angle: _whole(angle, "capsule"), "mujoco", ("mujoco", "mujoco.rollout")),
    "mujoco-sector": Series(_sector, "mujoco", ("mujoco",), SECTOR_ANGLES_DEG),
}
