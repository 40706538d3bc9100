"""What ``fit`` found, as text and as one self-contained page."""

from __future__ import annotations

import base64
import json
import math
from importlib.resources import files

import numpy as np

from clamp3d.fit.features import CylinderFit, FittedSurface, GrooveFit, HoleFit
from clamp3d.fit.fit import FitResult

COLOURS = {
    "groove": ("#e4572e", "#f3a712", "#c3423f", "#f18805"),
    "cylinder": ("#2e86ab", "#3bb273", "#1b998b", "#5688c7"),
    "hole": ("#8e5ea2", "#b56576", "#6d597a", "#9d6b9e"),
}
"""Colours of the features by kind, in turn."""


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
    share = 100.0 * result.feature_area / result.area
    first = f"{mesh.name}: {len(mesh.faces)} triangles, {_count(result)}, {share:.0f} % of the surface"
    if not result.features:
        return f"{mesh.name}: {len(mesh.faces)} triangles, no groove, no cylinder, no hole"
    rows = [("", "what", "radius", "+-", "arc deg", "length", "axis through x, y, z", "direction", "rms", "bound")]
    for f in result.features:
        rows.append(
            (
                f.name,
                kind(f),
                f"{f.radius:.4f}",
                f"{f.radius_std:.1e}",
                _arc(f),
                f"{f.length:.3f}",
                _vector(f.T_part_feature[:3, 3], 4),
                _vector(f.T_part_feature[:3, 2], 5),
                f"{f.residual_rms:.1e}",
                f"{f.error_bound:.4f}",
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [
        "  ".join(
            c.ljust(w) if i < 2 else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    return "\n".join([first, *lines])


def fit_to_html(result: FitResult) -> str:
    """A page without any outside resource: the mesh with its features in colour, and the table of their errors."""
    from jinja2 import Environment, StrictUndefined

    V, F = result.mesh.vertices, result.mesh.faces
    owner = np.zeros(len(F), dtype=np.uint8)
    rows = []
    turn: dict[str, int] = {}
    for number, f in enumerate(result.features[:255], start=1):
        owner[f.faces] = number
        family = {"G": "groove", "C": "cylinder", "H": "hole"}[f.name[0]]
        palette = COLOURS[family]
        colour = palette[turn.get(family, 0) % len(palette)]
        turn[family] = turn.get(family, 0) + 1
        half = 0.5 * f.length + 0.15 * f.radius
        T = f.T_part_feature
        rows.append(
            {
                "name": f.name,
                "kind": kind(f),
                "colour": colour,
                "radius": f"{f.radius:.4f}",
                "radius_std": _short(f.radius_std),
                "arc": _arc(f),
                "arc_error": _short(math.degrees(f.arc_error)),
                "length": f"{f.length:.3f}",
                "length_error": _short(f.length_error),
                "point": _vector(T[:3, 3], 4),
                "direction": _vector(T[:3, 2], 5),
                "rms": _short(f.residual_rms),
                "coverage": f"{100.0 * f.coverage:.0f}",
                "covariance_error": _short(f.covariance_error),
                "form_error": _short(f.form_error),
                "chord_error": _short(f.chord_error),
                "error_bound": _short(f.error_bound),
                "axis": [(T[:3, 3] + s * half * T[:3, 2]).tolist() for s in (-1.0, 1.0)],
            }
        )
    low, high = V[np.unique(F)].min(axis=0), V[np.unique(F)].max(axis=0)
    middle = 0.5 * (low + high)
    data = {
        "positions": _base64((V[F] - middle).astype("<f4")),
        "owner": _base64(owner),
        "size": 2.0 * max(float(np.linalg.norm(p - middle)) for p in (low, *(q for r in rows for q in r["axis"]))),
        # A groove's mouth is its +y: look at the side that most of the grooves open to.
        "from_below": sum(float(g.T_part_feature[2, 1]) for g in result.grooves) < -0.1,
        "colours": [r["colour"] for r in rows],
        "axes": [(np.array(r["axis"]) - middle).tolist() for r in rows],
    }
    template = files("clamp3d.output").joinpath("templates", "fit.html").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    return environment.from_string(template).render(
        title=result.mesh.name,
        count=_count(result),
        triangles=f"{len(F):,}".replace(",", " "),
        extent=_vector(high - low, 2),
        share=f"{100.0 * result.feature_area / result.area:.0f}",
        rows=rows,
        notes=result.notes,
        data=json.dumps(data),
    )


def _count(result: FitResult) -> str:
    parts = []
    for number, one, many in (
        (len(result.grooves), "groove", "grooves"),
        (len(result.cylinders), "cylinder", "cylinders"),
        (len(result.holes), "hole", "holes"),
    ):
        parts.append(f"{number or 'no'} {one if number <= 1 else many}")
    return ", ".join(parts)


def _arc(f: FittedSurface) -> str:
    return "360" if f.half_angle == math.pi else f"{math.degrees(2.0 * f.half_angle):.3f}"


def _vector(values: np.ndarray[tuple[int], np.dtype[np.float64]], digits: int) -> str:
    return ", ".join(f"{v + 0.0:.{digits}f}" for v in np.round(values, digits))


def _short(value: float) -> str:
    """Four decimals, two digits of what is smaller, 0 below a millionth."""
    return "0" if value < 1e-6 else f"{value:.1e}" if value < 1e-3 else f"{value:.4f}"


def _base64(array: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
