"""All families of hard poses: what has broken collision code, each with a seeded generator."""

from __future__ import annotations

from clamp3d.bench.stress.poses import features, magnitudes
from clamp3d.bench.stress.poses.family import PoseFamily

POSES: dict[str, PoseFamily] = {**features.FAMILIES, **magnitudes.FAMILIES}
