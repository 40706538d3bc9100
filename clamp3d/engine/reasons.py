"""Why a pair is undecided, or failed, in words, and what would decide it."""

from __future__ import annotations

from clamp3d.engine.answer import Distance
from clamp3d.engine.model import MeshModel, Model
from clamp3d.engine.verdict import Thresholds
from clamp3d.errors import Clamp3dError, one_line


def failure(error: Exception) -> str:
    """What went wrong, in one line."""
    return str(error) if isinstance(error, Clamp3dError) else one_line(f"{type(error).__name__}: {error}")


def undecided(models: dict[str, Model], distance: Distance, thresholds: Thresholds, allowance: float | None) -> str:
    """Why the distance of two parts, by name, gives no verdict, and what would decide it, in one line."""
    marks = " and ".join(thresholds.between(distance, allowance))
    advice = []
    for name, model in models.items():
        if not model.closed:
            advice.append(f"a closed mesh of {name}")
        elif isinstance(model, MeshModel) and (error := model.outer(0.0).error) > 0.0:
            advice.append(f"a finer mesh of {name} (its round faces are off by up to {error:.2g} mm)")
    would = f"; what would decide: {' or '.join(advice)}" if advice else ""
    return (f"between the bounds: {marks}" if marks else "the bounds allow several verdicts") + would
