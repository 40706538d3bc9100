"""Exact assembly checking for parts with round grooves (Concave Arc Surface collision detection).

Lengths are millimetres, angles radians, poses 4x4 column-vector matrices ``T_target_source``.
Names are loaded on first use, so ``import clamp3d`` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOME: dict[str, str] = {
    "Distance": "clamp3d.collide.answer",
    "Distances": "clamp3d.collide.answer",
    "Motion": "clamp3d.core.motion",
    "MotionDistance": "clamp3d.collide.motions",
    "Part": "clamp3d.collide.scene",
    "PoseVerdicts": "clamp3d.collide.motions",
    "check_poses": "clamp3d.collide.motions",
    "distance": "clamp3d.collide.distance",
    "distances": "clamp3d.collide.distance",
    "first_contact": "clamp3d.collide.motions",
    "measure": "clamp3d.collide.distance",
    "min_clearance": "clamp3d.collide.motions",
    "ArcContact": "clamp3d.core.arc_circle",
    "ArcRelation": "clamp3d.core.arc_circle",
    "Assembly": "clamp3d.clamp.result",
    "Cas": "clamp3d.baselines.cas",
    "CheckResult": "clamp3d.collide.result",
    "Cylinder": "clamp3d.core.primitives",
    "CylinderFit": "clamp3d.fit.features",
    "Equilibrium": "clamp3d.clamp.result",
    "Feature": "clamp3d.core.distance",
    "FitResult": "clamp3d.fit.fit",
    "GrooveFit": "clamp3d.fit.features",
    "GroovePieces": "clamp3d.core.pieces",
    "GrooveRelation": "clamp3d.core.relation3d",
    "HoleContact": "clamp3d.core.rectangle",
    "HoleFit": "clamp3d.fit.features",
    "HoleRelation": "clamp3d.core.rectangle",
    "ImageMeasurement": "clamp3d.bench.image",
    "ImageStudy": "clamp3d.bench.image",
    "InputError": "clamp3d.errors",
    "MeshShape": "clamp3d.core.shapes",
    "PairResult": "clamp3d.collide.result",
    "Rectangle": "clamp3d.core.rectangle",
    "Relation3D": "clamp3d.core.relation3d",
    "Scene": "clamp3d.collide.scene",
    "Section": "clamp3d.clamp.section",
    "SignedDistance": "clamp3d.core.distance",
    "SignedDistances": "clamp3d.core.distance",
    "Solid": "clamp3d.core.shapes",
    "SweptArc": "clamp3d.core.primitives",
    "Verdict": "clamp3d.collide.verdict",
    "Viewer": "clamp3d.output.viewer",
    "WireClosing": "clamp3d.clamp.placement",
    "arc_circle": "clamp3d.core.arc_circle",
    "assemble": "clamp3d.clamp.assemble",
    "check": "clamp3d.collide.check",
    "classify_arc_circle": "clamp3d.core.arc_circle",
    "contact_figure": "clamp3d.output.figures",
    "contacts_figure": "clamp3d.output.figures",
    "equilibria": "clamp3d.clamp.equilibria",
    "exploded_figure": "clamp3d.output.assembly_figures",
    "export": "clamp3d.output.export",
    "fit_file": "clamp3d.fit.fit",
    "fit_mesh": "clamp3d.fit.fit",
    "groove_pieces": "clamp3d.core.pieces",
    "groove_relation": "clamp3d.core.relation3d",
    "hole_bolt": "clamp3d.core.rectangle",
    "image_study": "clamp3d.bench.image",
    "load_clamp": "clamp3d.clamp.loader",
    "load_mesh": "clamp3d.brep.mesh_file",
    "make_mesh": "clamp3d.core.mesh",
    "measure_image": "clamp3d.bench.image",
    "mesh": "clamp3d.core.meshing",
    "parts": "clamp3d.clamp.parts",
    "relative_pose": "clamp3d.core.relation3d",
    "save_figure": "clamp3d.output.figures",
    "section_figure": "clamp3d.output.figures",
    "signed_distance": "clamp3d.core.distance",
    "signed_distances": "clamp3d.core.distance",
    "states_figure": "clamp3d.output.figures",
    "steps_figure": "clamp3d.output.assembly_figures",
    "table2_figure": "clamp3d.bench.legends",
    "table3_figure": "clamp3d.bench.legends",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'clamp3d' has no attribute {name!r}; available: {', '.join(sorted(_HOME))}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *_HOME]
