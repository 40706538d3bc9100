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
    "Cas": "clamp3d.contact.cas",
    "CheckResult": "clamp3d.scene.result",
    "Clearance": "clamp3d.geometry.motion",
    "Cylinder": "clamp3d.geometry.shapes",
    "CylinderFit": "clamp3d.fit.features",
    "Equilibrium": "clamp3d.assembly.result",
    "Feature": "clamp3d.geometry.distance",
    "FitResult": "clamp3d.fit.fit",
    "GrooveFit": "clamp3d.fit.features",
    "GroovePieces": "clamp3d.geometry.pieces",
    "GrooveRelation": "clamp3d.geometry.relation3d",
    "HoleContact": "clamp3d.geometry.rectangle",
    "HoleFit": "clamp3d.fit.features",
    "HoleRelation": "clamp3d.geometry.rectangle",
    "ImageMeasurement": "clamp3d.study.image",
    "ImageStudy": "clamp3d.study.image",
    "InputError": "clamp3d.errors",
    "MeshShape": "clamp3d.scene.shapes",
    "MotionContact": "clamp3d.geometry.motion",
    "PairResult": "clamp3d.scene.result",
    "PoseSweep": "clamp3d.scene.sweep",
    "Rectangle": "clamp3d.geometry.rectangle",
    "Relation3D": "clamp3d.geometry.relation3d",
    "Rotation": "clamp3d.geometry.motion",
    "Scene": "clamp3d.scene.scene",
    "Screw": "clamp3d.geometry.motion",
    "Section": "clamp3d.assembly.section",
    "SignedDistance": "clamp3d.geometry.distance",
    "SignedDistances": "clamp3d.geometry.distance",
    "Solid": "clamp3d.scene.shapes",
    "SweptArc": "clamp3d.geometry.shapes",
    "Translation": "clamp3d.geometry.motion",
    "Verdict": "clamp3d.scene.bounds",
    "Viewer": "clamp3d.output.viewer",
    "WireClosing": "clamp3d.study.misalign",
    "arc_circle": "clamp3d.geometry.arc_circle",
    "assemble": "clamp3d.assembly.run",
    "check": "clamp3d.scene.check",
    "classify_arc_circle": "clamp3d.geometry.arc_circle",
    "contact_figure": "clamp3d.output.figures",
    "contacts_figure": "clamp3d.output.figures",
    "equilibria": "clamp3d.assembly.equilibria",
    "exploded_figure": "clamp3d.output.assembly_figures",
    "export": "clamp3d.output.export",
    "first_contact": "clamp3d.geometry.motion",
    "fit_file": "clamp3d.fit.fit",
    "fit_mesh": "clamp3d.fit.fit",
    "groove_pieces": "clamp3d.geometry.pieces",
    "groove_relation": "clamp3d.geometry.relation3d",
    "hole_bolt": "clamp3d.geometry.rectangle",
    "image_study": "clamp3d.study.image",
    "load_clamp": "clamp3d.clamp.loader",
    "load_mesh": "clamp3d.fit.mesh_file",
    "make_mesh": "clamp3d.fit.mesh_file",
    "measure_image": "clamp3d.study.image",
    "mesh": "clamp3d.clamp.meshes",
    "parts": "clamp3d.clamp.parts",
    "relative_pose": "clamp3d.geometry.relation3d",
    "save_figure": "clamp3d.output.figures",
    "section_figure": "clamp3d.output.figures",
    "signed_distance": "clamp3d.geometry.distance",
    "signed_distances": "clamp3d.geometry.distance",
    "states_figure": "clamp3d.output.figures",
    "steps_figure": "clamp3d.output.assembly_figures",
    "sweep": "clamp3d.geometry.motion",
    "sweep_poses": "clamp3d.scene.sweep",
    "table2_figure": "clamp3d.output.legends",
    "table3_figure": "clamp3d.output.legends",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'clamp3d' has no attribute {name!r}; available: {', '.join(sorted(_HOME))}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *_HOME]
