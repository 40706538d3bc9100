"""Poses as scene files give them: a translation with one kind of turn, or a matrix."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field, model_validator
from pydantic.dataclasses import dataclass

from clamp3d.core.pose import Array, unit

FROZEN = ConfigDict(extra="forbid")
"""Of every table: a key that is not known is an error."""
_SNAP = 1e-4
Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Vector = tuple[Number, Number, Number]
Angle = Annotated[float, Field(gt=-1e5, lt=1e5, allow_inf_nan=False, strict=True)]


@dataclass(frozen=True, config=FROZEN, kw_only=True)
class Pose:
    """A pose in the world: ``matrix`` (4 rows of 4, or 3 of 4), or ``translation`` with one kind of turn.

    ``rpy_deg``: roll, pitch, yaw about the fixed axes X, Y, Z in this order (URDF). ``axis`` with ``angle_deg``.
    ``quaternion``: x, y, z, w.
    """

    translation: Vector = (0.0, 0.0, 0.0)
    rpy_deg: Vector | None = None
    axis: Vector | None = None
    angle_deg: Angle | None = None
    quaternion: tuple[Number, Number, Number, Number] | None = None
    matrix: list[tuple[Number, Number, Number, Number]] | None = None

    @model_validator(mode="after")
    def _one_turn(self) -> Pose:
        turns = [k for k in ("rpy_deg", "axis", "quaternion", "matrix") if getattr(self, k) is not None]
        if len(turns) > 1:
            raise ValueError(
                f"{turns[1]}: give one of rpy_deg, axis with angle_deg, quaternion, matrix, not {turns[0]} too"
            )
        if (self.axis is None) != (self.angle_deg is None):
            raise ValueError("axis: give axis and angle_deg together")
        if self.axis is not None and not any(self.axis):
            raise ValueError("axis: must not have length zero")
        if self.quaternion is not None and not any(self.quaternion):
            raise ValueError("quaternion: must not have length zero")
        if self.matrix is not None:
            if any(self.translation):
                raise ValueError("matrix: holds the translation already")
            rows = [list(row) for row in self.matrix]
            if len(rows) not in (3, 4) or (len(rows) == 4 and rows[3] != [0.0, 0.0, 0.0, 1.0]):
                raise ValueError("matrix: must have 3 rows of 4 numbers, or a fourth row 0, 0, 0, 1")
            R = np.array(rows)[:3, :3]
            with np.errstate(over="ignore", invalid="ignore"):
                off = float(np.abs(R @ R.T - np.eye(3)).max())
            if not off <= _SNAP or np.linalg.det(R) < 0.0:
                raise ValueError(f"matrix: must be rigid (a rotation and a translation): deviates by {off:.3g}")
        return self

    def T(self) -> Array:
        """The pose (4, 4). A typed matrix is brought to the nearest rotation: its printed digits are not exact."""
        from scipy.spatial.transform import Rotation

        T = np.eye(4)
        T[:3, 3] = self.translation
        if self.rpy_deg is not None:
            T[:3, :3] = _quarter_turns(self.rpy_deg)
        elif self.axis is not None and self.angle_deg is not None:
            axis = unit(np.array(self.axis))
            T[:3, :3] = _tidy(Rotation.from_rotvec(math.radians(self.angle_deg) * axis).as_matrix())
        elif self.quaternion is not None:
            q = np.array(self.quaternion) / max(map(abs, self.quaternion))  # its square neither overflows nor vanishes
            T[:3, :3] = _tidy(Rotation.from_quat(q).as_matrix())
        elif self.matrix is not None:
            rows = np.array(self.matrix[:3])
            u, _, vt = np.linalg.svd(rows[:, :3])
            nearest = u @ vt
            # Exact input stays exact: a product of SVD factors is not.
            T[:3, :3] = rows[:, :3] if np.abs(nearest - rows[:, :3]).max() < 1e-14 else nearest
            T[:3, 3] = rows[:, 3]
        return T


def _quarter_turns(rpy_deg: tuple[float, float, float]) -> Array:
    """Rotation (3, 3) of roll, pitch, yaw in degrees; multiples of 90 exactly."""
    R = np.eye(3)
    for k, angle in enumerate(rpy_deg):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        if angle % 90.0 == 0.0:
            c, s = round(c), round(s)
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = np.eye(3)
        turn[[i, i, j, j], [i, j, i, j]] = (c, -s, s, c)
        R = turn @ R
    return R


def _tidy(R: Array) -> Array:
    """A rotation with the rounding of its zeros and ones taken away."""
    return np.where(np.abs(R - R.round()) < 4e-16, R.round(), R)
