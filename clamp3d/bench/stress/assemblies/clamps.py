"""Clamps and starts that are hard to close, each family a seeded generator.

Every generator takes a random number generator and returns one `Case`. All grooves are minor arcs. `MAKERS` maps name
-> (what is hard, generator).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.baselines.cas import Cas
from clamp3d.bench.stress.family import Makers
from clamp3d.clamp.dimensions import Clamp, Wire
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.section import Section
from clamp3d.geometry.pose import Array

_RADIUS, _OFFSET = 23.8012, 48.0
_PLACES = tuple((part, key) for part in ("up_splint", "down_splint") for key in ("line_groove", "jumper_groove"))


@dataclass(frozen=True, slots=True)
class Case:
    """A clamp with its wires, and the open state that it is closed from (None: straight and fully open)."""

    clamp: Clamp
    start: Array | None = None


MAKERS = Makers("assembly: ")


def _fitting(make: Callable[[np.random.Generator], Clamp | Case | None]) -> Callable[[np.random.Generator], Case]:
    """The generator, called again where it returns None: grooves that do not fit into the splints."""

    def case(rng: np.random.Generator) -> Case:
        drawn = None
        while drawn is None:
            drawn = make(rng)
        return drawn if isinstance(drawn, Case) else Case(drawn)

    return case


@cache
def _base() -> Clamp:
    return load_clamp()


def clamp_of(
    radius: ArrayLike, half_angle: ArrayLike, offset: ArrayLike, diameter: ArrayLike, max_tilt_deg: float | None = None
) -> Clamp | None:
    """The reference clamp with other grooves and wires; None if such grooves do not fit into its splints.

    Of the grooves up line, up jumper, down line, down jumper: ``radius`` (4,) mm, ``half_angle`` (4,) rad, ``offset``
    (4,) mm from the bolt; ``diameter`` (2,) mm of line and jumper. A narrow slot stops the tilt at ``max_tilt_deg``.
    """
    base, parts = _base(), dict[str, dict[str, Any]](up_splint={}, down_splint={})
    R, half, beside = (np.broadcast_to(np.asarray(v, float), 4) for v in (radius, half_angle, offset))
    for (part, key), r, h, o in zip(_PLACES, R, half, beside, strict=True):
        depth = r * math.cos(h)
        depth = base.up_splint.thickness + depth if part == "up_splint" else base.down_splint.face_depth - depth
        parts[part][key] = replace(
            getattr(getattr(base, part), key), radius=float(r), offset=float(o), centre_depth=float(depth)
        )
    if max_tilt_deg is not None:
        back, bolt = base.down_splint.back_radius, base.bolt.diameter / 2
        parts["down_splint"]["max_tilt_deg"] = None  # the file's check is of the reference's slot
        parts["down_splint"]["slot_width"] = 2.0 * back * math.sin(math.radians(max_tilt_deg) + math.asin(bolt / back))
    line, jumper = (Wire(diameter=float(d)) for d in np.broadcast_to(np.asarray(diameter, float), 2))
    try:
        splints = {part: replace(getattr(base, part), **changed) for part, changed in parts.items()}
        return replace(base, name="random", line=line, jumper=jumper, **splints)
    except ValueError:
        return None


def _near_one(rng: np.random.Generator, shape: int) -> Array:
    """1 +- 1e-12 ... 1e-3, or just 1."""
    off = 10.0 ** rng.uniform(-12.0, -3.0, shape) * rng.choice([-1.0, 0.0, 1.0], shape, p=[0.4, 0.2, 0.4])
    return np.asarray(1.0 + off)


def _grooves(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Four grooves that differ: radii, half angles, offsets."""
    scale = rng.uniform(0.5, 1.2)
    return (
        _RADIUS * scale * rng.uniform(0.85, 1.15, 4),
        np.arccos(np.cos(rng.uniform(0.3, 1.3, 4))),
        _OFFSET * rng.uniform(0.85, 1.15, 4),
    )


def open_start(rng: np.random.Generator, section: Section) -> Array:
    """An open state (6,), a poor one: far open, fully tilted, wires beside the middle or against a lip."""
    limit = section.clamp.tilt_stop
    while True:
        tilt = float(rng.choice([-limit, 0.0, limit, rng.uniform(-limit, limit)]))
        q = section.open_state(section.open_distance() + rng.choice([0.0, 1.0, 100.0]) * rng.random(), tilt)
        for i, wire in ((0, "P6"), (2, "P7")):
            (low, high), (least, most) = section.mouth(wire), section.reach(wire)
            low, high = max(low, least), min(high, most)
            # A lip itself, a little inside it, or anywhere in the mouth.
            place = rng.choice([0.0, 10.0 ** rng.uniform(-9.0, -2.0), rng.random()])
            q[i] = low + place * (high - low) if rng.random() < 0.5 else high - place * (high - low)
            q[i + 1] += rng.uniform(-5.0, 5.0)
        if section.gaps(q).value.min() >= 0.0:
            return q


@MAKERS.family("random clamps", _fitting)
def _random(rng: np.random.Generator) -> Clamp | None:
    """Grooves and wires of any size, closed from the open clamp."""
    R, half, offset = _grooves(rng)
    return clamp_of(R, half, offset, rng.uniform(2.0, 60.0, 2))


@MAKERS.family("poor starts", _fitting)
def _poor(rng: np.random.Generator) -> Case | None:
    """Far open, fully tilted, wires against a lip or beside the middle."""
    clamp = _random(rng)
    return None if clamp is None else Case(clamp, open_start(rng, Section(clamp, Cas())))


@MAKERS.family("equal clearances", _fitting)
def _equal(rng: np.random.Generator) -> Clamp | None:
    """Grooves and wires equal, or up to 1e-12 ... 1e-3: rounding decides which contacts are active."""
    R, half, offset = _RADIUS * rng.uniform(0.5, 1.2), rng.uniform(0.3, 1.3), _OFFSET * rng.uniform(0.85, 1.15)
    wire = 2.0 * R * rng.uniform(0.3, 1.3)
    return clamp_of(R * _near_one(rng, 4), half, offset * _near_one(rng, 4), wire * _near_one(rng, 2))


@MAKERS.family("wire fills groove", _fitting)
def _fills(rng: np.random.Generator) -> Clamp | None:
    """A wire's radius is a groove's, or up to 1e-12 ... 1e-3 beside it: arc or both lips."""
    R, half, offset = _grooves(rng)
    if rng.random() < 0.5:  # facing grooves alike: it fills both
        R[2:], half[2:], offset[2:] = R[:2] * _near_one(rng, 2), half[:2], offset[:2] * _near_one(rng, 2)
    wires = rng.uniform(10.0, 50.0, 2)
    for i in (0, 1):
        if i == 0 or rng.random() < 0.5:
            wires[i] = 2.0 * R[i + 2 * int(rng.integers(2))] * _near_one(rng, 1)[0]
    return clamp_of(R, half, offset, wires)


@MAKERS.family("lip contacts", _fitting)
def _lips(rng: np.random.Generator) -> Clamp | None:
    """Wires thicker than their grooves, or grooves aside: on lips, or about to slide onto one."""
    R, half, offset = _grooves(rng)
    if rng.random() < 0.5:  # facing grooves so far aside that arc and lip compete
        offset[2:] = offset[:2] + R[:2] * np.sin(half[:2]) * rng.uniform(-0.6, 0.6, 2)
        wires = 2.0 * R[:2] * rng.uniform(0.5, 1.05, 2)
    else:
        wires = 2.0 * R[:2] * rng.uniform(1.0, 1.8, 2)
    return clamp_of(R, half, offset, wires)


@MAKERS.family("faces meet", _fitting)
def _faces(rng: np.random.Generator) -> Clamp | None:
    """Wires about as thick as both grooves are deep: held by the wires, by the faces, or by both."""
    R, half, offset = _grooves(rng)
    offset[2:] = offset[:2] * (1.0 + rng.uniform(-0.02, 0.02, 2))
    depth = R * 2.0 * np.sin(0.5 * half) ** 2
    wires = (depth[:2] + depth[2:]) * np.where(rng.random(2) < 0.5, _near_one(rng, 2), rng.uniform(0.1, 1.3, 2))
    return clamp_of(R, half, offset, wires)


@MAKERS.family("tilt limit", _fitting)
def _tilted(rng: np.random.Generator) -> Clamp | None:
    """One thick and one thin wire and little tilt: the limit carries, or nearly does."""
    R, half, offset = _grooves(rng)
    wires = np.array([rng.uniform(20.0, 60.0), rng.uniform(2.0, 20.0)])[:: int(rng.choice([-1, 1]))]
    return clamp_of(R, half, offset, wires, max_tilt_deg=float(rng.choice([1e-6, 1e-3, rng.uniform(0.1, 12.8)])))


def snippet(case: Case) -> str:
    """Python lines that make ``clamp`` and ``start``."""
    base, clamp = _base(), case.clamp
    changed = [f.name for f in fields(clamp) if getattr(clamp, f.name) != getattr(base, f.name)]
    names = sorted({type(getattr(clamp, name)).__name__ for name in changed} - {"str"} | {"GrooveDimensions"})
    lines = ["from dataclasses import replace", "", "import numpy as np", ""]
    lines.append(f"from clamp3d.clamp.dimensions import {', '.join(names)}")
    lines += ["from clamp3d.clamp.loader import load_clamp", "", "clamp = replace(", "    load_clamp(),"]
    lines += [f"    {name}={getattr(clamp, name)!r}," for name in changed]
    start = "None" if case.start is None else f"np.array({case.start.tolist()})"
    return "\n".join([*lines, ")", f"start = {start}"])
