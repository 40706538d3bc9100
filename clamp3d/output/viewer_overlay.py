"""What the baselines make of the grooved parts, as overlays for the viewer: wedges, and the hulls of CoACD."""

from __future__ import annotations

import math
from typing import Any

import trimesh

from clamp3d.baselines import contact_model
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.parts import parts
from clamp3d.errors import InputError

_KINDS = {
    "wedges": ("UNIT_ANGLE_DEG", 10.0, "wedges of {:g} deg"),
    "hulls": ("THRESHOLD_MM", 2.0, "hulls of CoACD at {:g} mm"),
}


def overlay(clamp: Clamp, text: str) -> tuple[str, dict[str, list[trimesh.Trimesh]]]:
    """Title and pieces of an overlay: ``wedges`` or ``wedges=UNIT_ANGLE_DEG``, ``hulls`` or ``hulls=THRESHOLD_MM``.

    Raises InputError for anything else.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> title, pieces = overlay(load_clamp(), "wedges=20")
    >>> title, {name: len(p) for name, p in pieces.items()}["P3"]
    ('wedges of 20 deg', 3)
    """
    kind, _, size = text.partition("=")
    if kind not in _KINDS:
        raise InputError(
            f"unknown overlay {text!r}; available: {', '.join(f'{k}[={v[0]}]' for k, v in _KINDS.items())}"
        )
    unit, value, title = _KINDS[kind]
    try:
        value = float(size) if size else value
    except ValueError:
        raise InputError(f"overlay {kind}: {unit} must be a number, got {size!r}") from None
    setting: dict[str, Any] = {"unit_angle": math.radians(value)} if kind == "wedges" else {"threshold": value}
    model: Any = contact_model(kind, parts(clamp), **setting)
    made = {a: [shape.solid for shape in model.polytopes(a).shapes] for a, _ in groove_pairs(clamp)}
    return title.format(value), {a: [trimesh.Trimesh(s.vertices, s.faces) for s in own] for a, own in made.items()}
