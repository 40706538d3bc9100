"""Access to the committed oracle data and to the search that made it."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clamp3d.core.primitives import Capsule, SweptArc

DATA = Path(__file__).parent / "data"

_spec = importlib.util.spec_from_file_location("make_oracle", DATA / "make_oracle.py")
make_oracle = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(make_oracle)


@dataclass(frozen=True)
class Case:
    kind: str
    groove: SweptArc
    cylinder: Capsule
    pose: np.ndarray
    value: str  # signed distance, 25 digits

    @property
    def size(self) -> float:
        """Largest length in the scene."""
        lengths = (self.groove.radius, self.groove.length, self.cylinder.radius, self.cylinder.length)
        return max(*lengths, float(np.abs(self.pose[:3, 3]).max()))


def load() -> list[Case]:
    cases = []
    for kind, numbers, value in json.loads((DATA / "oracle.json").read_text()):
        v = [float.fromhex(number) for number in numbers]
        pose = np.eye(4)
        pose[:3] = np.reshape(v[5:], (3, 4))
        cases.append(Case(kind, SweptArc(*v[:3]), Capsule(*v[3:5]), pose, value))
    return cases


def surface_distance(groove: SweptArc, points: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the groove's boundary."""
    return np.abs(make_oracle.point_distance(points, groove.radius, groove.half_angle, groove.length / 2))


def axis_distance(cylinder: Capsule, pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the cylinder's axis segment."""
    d = pose[:3, 2] / np.linalg.norm(pose[:3, 2])
    m = points - pose[:3, 3]
    t = np.clip(m @ d, -cylinder.length / 2, cylinder.length / 2)
    return np.linalg.norm(m - t[:, None] * d, axis=1)
