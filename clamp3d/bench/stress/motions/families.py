"""Families of hard motions, each with a seeded generator, built backwards from where and how closely it comes near.

A generator takes ``(rng, n)`` and returns n `Motions`: first the pose at the place of least clearance, as for single
poses, then a motion through it whose clearance is least there.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.family import Makers
from clamp3d.bench.stress.motions.cases import Motions, motions, moved, screws_through, square_to, touching
from clamp3d.bench.stress.poses import draw
from clamp3d.bench.stress.poses.cases import Extended
from clamp3d.core.pose import Array

_CONVEX = ("lip", "end arc", "end edge", "corner")
"""Features that a wire passes on a tangent."""


MAKERS = Makers("motion: ")


@MAKERS.family("grazing")
def _grazing(rng: np.random.Generator, n: int) -> Motions:
    """Straight past a lip, an edge or a corner on a tangent: clear or deep by 1e-12 ... 1e-2 of the radius."""
    shapes, shape = draw.shapes_for(rng, n)
    gap = shapes.r[shape] * draw.powers(rng, n, -12, -2)
    cases, normal = touching(rng, shapes, shape, rng.choice(_CONVEX, n), gap)
    way = square_to(rng, normal)
    # A third square to the groove: the wire's centre moves in the section.
    section = np.stack([-normal[:, 1], normal[:, 0], np.zeros(n)], 1)
    flat = np.sqrt((section * section).sum(1))
    across = (rng.random(n) < 0.33) & (flat > 0.1)
    way = np.where(across[:, None], section / np.maximum(flat, 0.1)[:, None], way)
    travel = np.asarray(way * (shapes.R[shape] * 10.0 ** rng.uniform(-1, 1, n))[:, None], np.float64)
    instant = rng.uniform(0.05, 0.95, n)
    start = moved(cases.T_world_wire, -instant[:, None] * travel.astype(Extended))
    return motions(shapes, shape, start, travel=travel, gap=gap, instant=instant)


def _turning_screws(rng: np.random.Generator, n: int, turns: Array, pitch: Array) -> Motions:
    """Circles and helices that curve away from where they touch, on any feature."""
    k = draw.count(n)
    R = 10.0 ** rng.uniform(0.0, 2.0, k)
    shapes = draw.shapes(rng, k, R=R, length=R * 10.0 ** rng.uniform(-1.0, 1.0, k))
    shape = draw.spread(n, k)
    gap = shapes.r[shape] * draw.powers(rng, n, -12, -2)
    feature = rng.choice(draw.FEATURES, n)
    cases, normal = touching(rng, shapes, shape, feature, gap)
    # In the hollow a circle narrower than it, square to the groove.
    hollow = np.isin(feature, ["arc", "end arc"])
    clearance = (shapes.R - shapes.r)[shape]
    radius = np.where(hollow, clearance * rng.uniform(0.1, 0.9, n), shapes.R[shape] * 10.0 ** rng.uniform(-1, 1, n))
    axis = square_to(rng, normal)
    along = (feature == "arc") | (rng.random(n) < 0.33) & (np.abs(normal[:, 2]) < 1e-9)
    axis = np.where(along[:, None], [[0.0, 0.0, 1.0]], axis)
    centre = cases.T_world_wire[:, :3, 3]
    point = centre + np.asarray(radius[:, None] * normal, np.float64) + np.asarray(
        axis * rng.uniform(-1, 1, n)[:, None] * radius[:, None], np.float64
    )  # fmt: skip
    instant = rng.uniform(0.05, 0.95, n)
    return screws_through(cases, point, np.asarray(axis, float), turns, pitch * radius * turns, instant)


@MAKERS.family("screws")
def _screws(rng: np.random.Generator, n: int) -> Motions:
    """Circles and turns with advance, up to six turns, near at one place; and screws of no plan at all."""
    part = n // 2
    turns = 10.0 ** rng.uniform(-1.0, np.log10(12.0 * np.pi), n) * rng.choice([-1.0, 1.0], n)
    pitch = draw.powers(rng, n, -3, 0, 0.4)
    built = _turning_screws(rng, n, turns, pitch)
    size = built.shapes.size()[built.shape][:, None]
    centre, point = rng.uniform(-1.5, 1.5, (n, 3)) * size, rng.uniform(-1.0, 1.0, (n, 3)) * size
    T = draw.poses_from_axes(rng, centre, rng.normal(size=(n, 3)))
    free = motions(built.shapes, built.shape, T, travel=rng.uniform(-2, 2, n) * size[:, 0], angle=turns, point=point,
                   axis=rng.normal(size=(n, 3)))  # fmt: skip
    return _choose(rng.permutation(n) < part, built, free)


def _choose(first: NDArray[np.bool_], a: Motions, b: Motions) -> Motions:
    """Row by row one of two of the same shapes."""

    picked: dict[str, Any] = {}
    for f in fields(a):
        x, y = getattr(a, f.name), getattr(b, f.name)
        if isinstance(x, np.ndarray):
            picked[f.name] = np.where(first.reshape(-1, *[1] * (x.ndim - 1)), x, y)
    return replace(a, **picked)


@MAKERS.family("thin and fast")
def _thin(rng: np.random.Generator, n: int) -> Motions:
    """A thin groove or a thin short wire crossed in 1e-6 ... 1e-2 of the motion."""
    k = draw.count(n)
    R = 10.0 ** rng.uniform(0, 2, k)
    sheet = rng.random(k) < 0.5
    thin = R * 10.0 ** rng.uniform(-6, -2, k)
    r = np.where(rng.random(k) < 0.5, thin, R * 10.0 ** rng.uniform(-5, -1, k))
    shapes = draw.shapes(
        rng,
        k,
        R=R,
        L=np.where(sheet, thin, R * 10.0 ** rng.uniform(-1, 1, k)),
        r=r,
        length=r * 10.0 ** rng.uniform(-2, 1, k),
    )
    shape = draw.spread(n, k)
    gap = shapes.r[shape] * np.where(rng.random(n) < 0.5, draw.powers(rng, n, -6, -0.1), -rng.uniform(0, 0.9, n))
    cases, normal = touching(rng, shapes, shape, rng.choice(_CONVEX, n), gap)
    fast = (shapes.R[shape] * 10.0 ** rng.uniform(0.5, 2, n))[:, None]
    tangent = square_to(rng, normal)
    # Through the sheet or past it, along the groove, off from the contact's own tangent.
    through = sheet[shape] & (rng.random(n) < 0.7)
    lean = 0.1 * np.abs(rng.normal(size=(n, 2)))
    z = np.column_stack([lean * rng.choice([-1, 1], (n, 2)), rng.choice([-1.0, 1.0], n)])
    travel = np.asarray(np.where(through[:, None], z, tangent) * fast, np.float64)
    instant = rng.uniform(0.05, 0.95, n)
    start = moved(cases.T_world_wire, -instant[:, None] * travel.astype(Extended))
    return motions(shapes, shape, start, travel=travel, gap=gap, instant=instant)


@MAKERS.family("level")
def _level(rng: np.random.Generator, n: int) -> Motions:
    """Clearance that does not change: slides along the groove, a face or an edge, turns about its axis; rest."""
    shapes, shape = draw.shapes_for(rng, n)
    gap = shapes.r[shape] * draw.powers(rng, n, -9, -1)
    feature = rng.choice(("arc", "lip", "flat", "end edge"), n)
    contact = draw.contact_on(rng, shapes, shape, feature)
    contact.ends[:] = False
    cases = draw.place(rng, shapes, shape, contact, gap, tilt=np.zeros(n))
    R = shapes.R[shape]
    length = R * 10.0 ** rng.uniform(-1, 1.5, n) * rng.choice([-1.0, 1.0], n)
    z = np.zeros(n)
    along_z = np.stack([z, z, length], 1)
    along_x = np.stack([length, z, z], 1)
    on_edge = (feature == "end edge") | ((feature == "flat") & (rng.random(n) < 0.5))
    travel = np.where(on_edge[:, None], along_x, along_z)
    kind = rng.random(n)
    travel = np.where((kind < 0.1)[:, None], 0.0, travel)
    slides = motions(shapes, shape, cases.T_world_wire, travel=travel, gap=gap, instant=0.5)
    # About the groove's axis, with or without advance: level as long as it stays behind the arc or at one lip.
    angle = rng.uniform(0.01, 6.0, n) * rng.choice([-1.0, 1.0], n)
    advance = np.where(rng.random(n) < 0.5, 0.0, length)
    turns = motions(shapes, shape, cases.T_world_wire, travel=advance, angle=angle, gap=gap, instant=0.0)
    # About the wire's own axis: nothing moves.
    own = cases.T_world_wire
    spins = motions(shapes, shape, own, travel=np.where(rng.random(n) < 0.5, 0.0, length), angle=angle,
                    point=own[:, :3, 3], axis=own[:, :3, 2], gap=gap, instant=0.5)  # fmt: skip
    return _choose(kind < 0.6, slides, _choose(kind < 0.85, turns, spins))


@MAKERS.family("start")
def _start(rng: np.random.Generator, n: int) -> Motions:
    """Starts in contact or by 1e-12 ... 1e-2 of the radius off it, and leaves, slides or comes back."""
    shapes, shape = draw.shapes_for(rng, n)
    r = shapes.r[shape]
    gap = np.where(rng.random(n) < 0.2, -r * rng.uniform(0, 0.99, n), r * draw.powers(rng, n, -12, -2, 0.3))
    cases, normal = touching(rng, shapes, shape, rng.choice(draw.FEATURES, n), gap)
    way = square_to(rng, normal)
    away = np.where(rng.random(n) < 0.3, 0.0, rng.uniform(-0.2, 1.5, n))[:, None]
    length = (shapes.R[shape] * 10.0 ** rng.uniform(-2, 1, n))[:, None]
    travel = np.asarray((np.cos(away) * way + np.sin(away) * normal) * length, np.float64)
    leaves = motions(shapes, shape, cases.T_world_wire, travel=travel, gap=gap, instant=0.0)
    # Full circles that come back to the contact, curving away from it.
    radius = (shapes.R[shape] * 10.0 ** rng.uniform(-2, 0, n))[:, None]
    point = np.asarray(cases.T_world_wire[:, :3, 3] + radius * normal, np.float64)
    turns = motions(shapes, shape, cases.T_world_wire, travel=0.0, angle=2.0 * np.pi * rng.integers(1, 4, n),
                    point=point, axis=np.asarray(square_to(rng, normal), float), gap=gap, instant=0.0)  # fmt: skip
    return _choose(rng.random(n) < 0.75, leaves, turns)
