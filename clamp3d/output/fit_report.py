"""The result of ``fit`` as text and as one self-contained page."""

from __future__ import annotations

import base64
import json
import math
from typing import Any

import numpy as np

from clamp3d.fit.features import CylinderFit, FitResult, FittedSurface, GrooveFit, HoleFit
from clamp3d.output.pages import render
from clamp3d.output.tables import text_table
from clamp3d.output.wording import counted

COLOURS = {
    "G": ("#e4572e", "#f3a712", "#c3423f", "#f18805"),
    "C": ("#2e86ab", "#3bb273", "#1b998b", "#5688c7"),
    "H": ("#8e5ea2", "#b56576", "#6d597a", "#9d6b9e"),
}
"""Colours of grooves, cylinders and holes, by the first letter of their names, in turn."""
_DRAWN = 255
"""Features that the page can colour: a byte for each triangle says whose it is."""


def kind(feature: FittedSurface) -> str:
    """The feature in a word or two."""
    if isinstance(feature, GrooveFit):
        return "groove"
    if isinstance(feature, HoleFit):
        return "through hole" if feature.through else "blind hole"
    return "cylinder" if isinstance(feature, CylinderFit) and feature.full else "round back"


def fit_to_text(result: FitResult) -> str:
    """One line per feature; lengths in mm. The radius is followed by its standard error."""
    mesh = result.mesh
    first = f"{mesh.name}: {len(mesh.faces)} triangles, "
    if not result.features:
        return f"{first}no groove, no cylinder, no hole"
    head = ("", "what", "radius", "+-", "arc deg", "length", "axis through x, y, z", "direction", "rms", "bound")
    rows = [
        (
            f.name,
            kind(f),
            f"{f.radius:.4f}",
            f"{f.radius_std:.1e}",
            _arc(f),
            f"{f.length:.3f}",
            _point(f),
            _direction(f),
            f"{f.residual_rms:.1e}",
            f"{f.error_bound:.4f}",
        )
        for f in result.features
    ]
    share = 100.0 * result.feature_area / result.area
    return f"{first}{_count(result)}, {share:.0f} % of the surface\n{text_table(head, rows)}"


def fit_to_html(result: FitResult) -> str:
    """A page without any outside resource: the mesh with its features in colour, and the table of their errors."""
    V, F = result.mesh.vertices, result.mesh.faces
    features = result.features[:_DRAWN]
    owner = np.zeros(len(F), dtype=np.uint8)
    for number, f in enumerate(features, start=1):
        owner[f.faces] = number
    colours = [COLOURS[f.name[0]][(int(f.name[1:]) - 1) % 4] for f in features]
    low, high = V[np.unique(F)].min(axis=0), V[np.unique(F)].max(axis=0)
    middle = 0.5 * (low + high)
    halves = [(0.5 * f.length + 0.15 * f.radius) * f.T_part_feature[:3, 2] for f in features]
    centres = [f.T_part_feature[:3, 3] - middle for f in features]
    axes = np.array([(c - h, c + h) for c, h in zip(centres, halves, strict=True)]).reshape(-1, 2, 3)
    data: dict[str, Any] = {
        "positions": _base64((V[F] - middle).astype("<f4")),
        "owner": _base64(owner),
        "size": 2.0 * float(np.linalg.norm(np.vstack([low - middle, *axes]), axis=1).max()),
        # A groove's mouth is its +y: look at the side that most of the grooves open to.
        "from_below": sum(float(g.T_part_feature[2, 1]) for g in result.grooves) < -0.1,
        "colours": colours,
        "axes": axes.tolist(),
    }
    return render(
        "fit.html",
        result=result,
        features=list(zip(features, colours, strict=True)),
        count=_count(result),
        extent=_vector(high - low, 2),
        kind=kind,
        arc=_arc,
        point=_point,
        direction=_direction,
        short=_short,
        data=json.dumps(data),
    )


def _count(result: FitResult) -> str:
    families = {"groove": result.grooves, "cylinder": result.cylinders, "hole": result.holes}
    return ", ".join(counted(len(features), kind) if features else f"no {kind}" for kind, features in families.items())


def _arc(f: FittedSurface) -> str:
    return "360" if f.half_angle == math.pi else f"{math.degrees(2.0 * f.half_angle):.3f}"


def _vector(values: np.ndarray[tuple[int], np.dtype[np.float64]], digits: int) -> str:
    return ", ".join(f"{v:z.{digits}f}" for v in values)


def _point(f: FittedSurface) -> str:
    return _vector(f.T_part_feature[:3, 3], 4)


def _direction(f: FittedSurface) -> str:
    return _vector(f.T_part_feature[:3, 2], 5)


def _short(value: float) -> str:
    """Four decimals, two digits of what is smaller, 0 below a millionth."""
    return "0" if value < 1e-6 else f"{value:.1e}" if value < 1e-3 else f"{value:.4f}"


def _base64(array: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
