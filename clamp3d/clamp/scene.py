"""A clamp as a scene: its seven parts at their poses, and the contacts that its connection matrix declares."""

from __future__ import annotations

from collections.abc import Mapping

from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.parts import parts
from clamp3d.clamp.surfaces import TOUCHING
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.scene import Part, Scene
from clamp3d.geometry.pose import Array


def clamp_scene(clamp: Clamp, poses: Mapping[str, Array], *, clearance: float = 0.0) -> Scene:
    """The parts P1 to P7 at ``poses`` (``T_world_part``, mm); contacts that the matrix declares are allowed."""
    placed = tuple(Part(name, solid, poses[name]) for name, solid in parts(clamp).items())
    allowed = tuple(Allowed(a, b) for a, row in clamp.connections.items() for b, kind in row.items() if kind)
    return Scene(placed, TOUCHING, clearance, allowed, name=clamp.name)
