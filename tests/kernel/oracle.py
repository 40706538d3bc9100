"""Signed distances of a cylinder from a groove to 25 digits, by search instead of formulas: ``oracle.json``.

The search is that of ``clamp3d stress``, which does not know which features can be nearest. Another search of the same
kind made the file. Values anew: ``python -m tests.kernel.oracle``.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import mpmath as mp
import numpy as np

from clamp3d.bench.stress.poses.cases import Cases, Shapes
from clamp3d.bench.stress.poses.truth import truth_50_digits
from clamp3d.geometry.primitives import Capsule, SweptArc
from clamp3d.testing import body

DATA = Path(__file__).parent / "data" / "oracle.json"
mp.mp.dps = 50


def point_distance(P, R, half, H):
    """Signed distance of points (n, 3) from the material, float64."""
    return body(SweptArc(R, half, 2.0 * H)).field(P)


def cases_of(groove, wire, poses):
    """A case for each pose (n, 4, 4), of which only the place and the z axis count."""
    shapes = Shapes(*np.array([[groove.radius, groove.half_angle, groove.length, wire.radius, wire.length]]).T)
    return Cases(shapes, np.zeros(len(poses), dtype=int), np.asarray(poses), np.full(len(poses), np.nan))


def exact_distance(groove, wire, T):
    """The signed distance with 50 digits."""
    return mp.mpf(truth_50_digits(cases_of(groove, wire, [T]), 0))


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
    for kind, numbers, value in json.loads(DATA.read_text()):
        v = [float.fromhex(number) for number in numbers]
        pose = np.eye(4)
        pose[:3] = np.reshape(v[5:], (3, 4))
        cases.append(Case(kind, SweptArc(*v[:3]), Capsule(*v[3:5]), pose, value))
    return cases


def surface_distance(groove: SweptArc, points: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the groove's boundary."""
    return np.abs(point_distance(points, groove.radius, groove.half_angle, groove.length / 2))


def axis_distance(cylinder: Capsule, pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the cylinder's axis segment."""
    d = pose[:3, 2] / np.linalg.norm(pose[:3, 2])
    m = points - pose[:3, 3]
    t = np.clip(m @ d, -cylinder.length / 2, cylinder.length / 2)
    return np.linalg.norm(m - t[:, None] * d, axis=1)


def main():
    """The values anew, of the inputs that the file holds."""
    rows = json.loads(DATA.read_text())
    for row, case in zip(rows, load(), strict=True):
        row[2] = mp.nstr(exact_distance(case.groove, case.cylinder, case.pose), 25)
    DATA.write_text("[\n" + ",\n".join(map(json.dumps, rows)) + "\n]\n")


if __name__ == "__main__":
    main()
