"""Families of poses of flat-ended cylinders, with truths that are intervals found from the definition alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from clamp3d.bench.stress.family import Family, Makers, Methods
from clamp3d.bench.stress.outcome import REFERENCE, Outcome, Wrong, score
from clamp3d.bench.stress.poses import draw, features
from clamp3d.bench.stress.poses.cases import Cases, Extended, unit_rows
from clamp3d.bench.stress.poses.family import METHODS as POSE_METHODS
from clamp3d.bench.stress.poses.flat_truth import flat_truth
from clamp3d.bench.stress.poses.truth import truth
from clamp3d.bench.stress.worker import Answers
from clamp3d.geometry.pose import Array

Make = Callable[[np.random.Generator, int], Cases]

NARROW = 1e-13
"""Width of a truth, in parts of the scene, at which it is narrow enough."""
_BOXES, MAX_BOXES = 4000, 200_000
"""Boxes that a truth may look at, and that a check of it may."""
_KNOWN = 1e-9
"""Truths are counted as known that are narrower than this, in parts of the scene."""

MAKERS = Makers("flat ends: ")


def _flat(make: Make) -> Make:
    def made(rng: np.random.Generator, n: int) -> Cases:
        cases = make(rng, n)
        return replace(cases, shapes=replace(cases.shapes, flat=True))

    return made


for _name, (_about, _make) in features.MAKERS.items():
    if _name in ("random", "tangency", "nearly parallel", "nearly coaxial", "wire ends", "embedded", "ties", "crossed"):
        MAKERS["flat ends: " + _name] = (_about, _flat(_make))


def _on_rims(rng: np.random.Generator, n: int, shapes: Any) -> Cases:
    """Cases whose rim touches a random feature, at gaps of +-1e-15 ... 1e-1 of the radius and any lean."""
    shape, feature = draw.spread(n, len(shapes)), rng.choice(draw.FEATURES, n)
    gap = shapes.r[shape] * draw.powers(rng, n, -15, -1)
    contact = draw.contact_on(rng, shapes, shape, feature)
    normal = unit_rows(contact.normal)
    # The normal leads to the rim: between the directions from it to the axis and to the middle.
    lean = np.asarray(rng.uniform(0.0, np.pi / 2, n), Extended)
    lean = np.where(rng.random(n) < 0.2, 10.0 ** rng.uniform(-9, -1, n), lean)
    lean = np.where(rng.random(n) < 0.5, lean, np.pi / 2 - lean)[:, None]
    across = unit_rows(np.cross(normal, rng.normal(size=(n, 3))))
    d = -np.sin(lean) * normal + np.cos(lean) * across
    out = -np.cos(lean) * normal - np.sin(lean) * across
    r, half = (np.asarray(v, Extended)[shape][:, None] for v in (shapes.r, shapes.length / 2))
    centre = contact.q + np.asarray(gap, Extended)[:, None] * normal - half * d - r * out
    return Cases(shapes, shape, draw.poses_from_axes(rng, centre, d), np.asarray(gap, np.float64))


@MAKERS.family("rims", _flat)
def _rims(rng: np.random.Generator, n: int) -> Cases:
    """The rim of an end touches any feature, gaps of 0 and +-1e-15 ... 1e-1 of the radius."""
    return _on_rims(rng, n, draw.shapes(rng, draw.count(n)))


@MAKERS.family("discs", _flat)
def _discs(rng: np.random.Generator, n: int) -> Cases:
    """The same with discs whose length is 1e-3 ... 0.5 of the radius, up to thrice the groove's."""
    k = draw.count(n)
    R = 10.0 ** rng.uniform(0.0, 2.0, k)
    r = R * 10.0 ** rng.uniform(-1.0, 0.5, k)
    return _on_rims(rng, n, draw.shapes(rng, k, R=R, r=r, length=r * 10.0 ** rng.uniform(-3.0, -0.3, k)))


def interval(cases: Cases, i: int, most: int = MAX_BOXES) -> tuple[float, float]:
    """The interval in mm that holds the signed distance of case i."""
    case = cases.take([i])
    k, s, scene, T = int(case.shape[0]), case.shapes, float(case.scene()[0]), case.T_groove_wire[0]
    R, half_angle, L, r, length = (float(column[k]) for column in (s.R, s.half_angle, s.L, s.r, s.length))
    low, high = flat_truth(R, half_angle, L, r, length, T, NARROW * scene, most)
    rounding = 20.0 * NARROW * scene if high < -min(r, 0.5 * length) + _KNOWN * scene else 0.05 * NARROW * scene
    if low <= -min(r, 0.5 * length) + rounding:
        if length <= 2.0 * r:  # of a disc only a bound is known from here on
            return -np.inf, high + rounding
        core = replace(case, shapes=replace(s, length=s.length - 2.0 * s.r, flat=False))
        deep = float(truth(core)[0])  # what is left of it: the axis segment, whose truth is that of a capsule
        if deep <= -r:
            return deep - rounding, deep + rounding
    return low - rounding, high + rounding


class FlatFamily(Family):
    """A kind of difficulty of flat-ended cylinders. A truth is an interval that holds the signed distance."""

    methods: ClassVar[Methods] = {REFERENCE: POSE_METHODS[REFERENCE]}
    truth_error = 1e-12

    def truths(self, cases: Cases) -> Array:
        """Intervals (n, 2) in mm."""
        return np.array([interval(cases, i, _BOXES) for i in range(len(cases))]).reshape(-1, 2)

    def difference(self, cases: Cases, truths: Array, i: int) -> float:
        """See `Family`: how far the interval is from a second, finer one."""
        low, high = interval(cases, i)
        return max(low - float(truths[i, 1]), float(truths[i, 0]) - high, 0.0) / float(cases.scene()[i])

    def judge(self, name: str, cases: Cases, truths: Array, answers: Answers) -> Outcome:
        """See `Family`: an answer is wrong where its own interval and the truth's have no common point."""
        low, high = truths.T
        size = cases.scene()
        d, bound = answers.distance, answers.bound
        error = np.maximum(np.maximum(low - d, d - high), 0.0)
        wrong = Wrong((d < -bound) & (low >= 0.0), (d > bound) & (high < 0.0), error > bound)
        worst = wrong.examples(error, 0.5 * (low + high), d)
        narrow, signed = (high - low <= _KNOWN * size).mean(), ((low >= 0.0) | (high < 0.0)).mean()
        answers.note(
            f"the truth is known to {_KNOWN:g} of the scene in {narrow:.1%} of the cases, its sign in {signed:.1%}"
        )
        return score(self.name, name, answers, error, size, wrong, worst)

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        low, high = interval(cases, i)
        return f"{cases.snippet(i)}\n# truth: from {low!r} to {high!r} mm"


FLATS = {name: FlatFamily(name, *maker) for name, maker in MAKERS.items()}
