"""Poses as scene files give them: a translation with one kind of turn, or a matrix."""

from __future__ import annotations

import math
import sys
import warnings
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from clamp3d.geometry.pose import UNIT_TOLERANCE, Array, PoseWarning, check_pose, rotation, turn_of

Number = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
Vector = tuple[Number, Number, Number]
Angle = Annotated[float, Meta(gt=-1e5, lt=1e5)]


class Table(Struct, forbid_unknown_fields=True):
    """A table of a scene file: a key that is not known is an error."""


class Pose(Table):
    """A pose in the world: ``matrix`` (4 rows of 4, or 3 of 4), or ``translation`` with one kind of turn.

    ``rpy_deg``: roll, pitch, yaw about the fixed axes X, Y, Z in this order (URDF). ``axis`` with ``angle_deg``.
    ``quaternion``: x, y, z, w.
    """

    translation: Vector = (0.0, 0.0, 0.0)
    rpy_deg: Vector | None = None
    axis: Vector | None = None
    angle_deg: Angle | None = None
    quaternion: tuple[Number, Number, Number, Number] | None = None
    matrix: Annotated[list[tuple[Number, Number, Number, Number]], Meta(min_length=3, max_length=4)] | None = None

    def __post_init__(self) -> None:
        turns = [k for k in ("rpy_deg", "axis", "quaternion", "matrix") if getattr(self, k) is not None]
        if len(turns) > 1:
            raise ValueError(
                f"{turns[1]}: give one of rpy_deg, axis with angle_deg, quaternion, matrix, not {turns[0]} too"
            )
        if (self.axis is None) != (self.angle_deg is None):
            raise ValueError("axis: give axis and angle_deg together")
        if self.axis is not None and not any(self.axis):
            raise ValueError("axis: must not have length zero")
        if self.quaternion is not None and not abs((size := math.hypot(*self.quaternion)) - 1.0) <= UNIT_TOLERANCE:
            raise ValueError(f"quaternion: must have length 1, got {size:.6g}")
        if self.matrix is not None:
            if any(self.translation):
                raise ValueError("matrix: holds the translation already")
            self.T()

    def T(self) -> Array:
        """The pose (4, 4). A typed matrix is brought to the nearest rotation: its printed digits are not exact."""
        if self.matrix is not None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PoseWarning)
                return check_pose([*self.matrix[:3], *(self.matrix[3:] or [(0, 0, 0, 1)])], "matrix:")
        T = np.eye(4)
        T[:3, 3] = self.translation
        if self.rpy_deg is not None:
            roll, pitch, yaw = map(math.radians, self.rpy_deg)
            R = (rotation([0, 0, 1], yaw) @ rotation([0, 1, 0], pitch) @ rotation([1, 0, 0], roll))[:3, :3]
        elif self.axis is not None and self.angle_deg is not None:
            R = rotation(self.axis, math.radians(self.angle_deg))[:3, :3]
        elif self.quaternion is not None:
            R = turn_of(*self.quaternion)
        else:
            return T
        # Without the rounding of zeros and ones: quarter turns are exact.
        T[:3, :3] = np.where(np.abs(R - R.round()) < 1e-14, R.round(), R)
        return T
