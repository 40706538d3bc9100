"""Exact assembly checking for parts with round grooves (Concave Arc Surface collision detection).

Lengths are millimetres, angles radians, poses 4x4 column-vector matrices ``T_target_source``.
Names are loaded on first use, so ``import clamp3d`` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOME: dict[str, str] = {
    "ArcContact": "clamp3d.geometry.arc_circle",
    "ArcRelation": "clamp3d.geometry.arc_circle",
    "Cylinder": "clamp3d.geometry.shapes",
    "Feature": "clamp3d.geometry.distance",
    "GroovePieces": "clamp3d.geometry.pieces",
    "HoleContact": "clamp3d.geometry.rectangle",
    "HoleRelation": "clamp3d.geometry.rectangle",
    "InputError": "clamp3d.errors",
    "Rectangle": "clamp3d.geometry.rectangle",
    "SignedDistance": "clamp3d.geometry.distance",
    "SignedDistances": "clamp3d.geometry.distance",
    "SweptArc": "clamp3d.geometry.shapes",
    "arc_circle": "clamp3d.geometry.arc_circle",
    "classify_arc_circle": "clamp3d.geometry.arc_circle",
    "groove_pieces": "clamp3d.geometry.pieces",
    "hole_bolt": "clamp3d.geometry.rectangle",
    "relative_pose": "clamp3d.geometry.pose",
    "signed_distance": "clamp3d.geometry.distance",
    "signed_distances": "clamp3d.geometry.distance",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'clamp3d' has no attribute {name!r}; available: {', '.join(sorted(_HOME))}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *_HOME]
