"""Families of hard motions: a wire that moves past a groove, and the least distance on its way.

A case is built backwards: a pose at a small gap from a feature of the groove, and a motion that goes through it at some
time. The truth is a search over time that uses only the speed of the wire. It starts from evenly spaced times, from the
time of the built pose, and from the times that a method names. The kernel measures single poses; the pose families
test it. The value is attained, so it is never too low. It is no higher than at any named time, so a method
with a lower value is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from clamp3d.bench.stress.family import Family, Makers, Methods
from clamp3d.bench.stress.outcome import REFERENCE, Outcome
from clamp3d.bench.stress.poses import draw
from clamp3d.bench.stress.poses.cases import Cases, Shapes, unit_rows
from clamp3d.bench.stress.poses.truth import truth_50_digits
from clamp3d.bench.stress.worker import Answers, Measured, Measures, Rows, run_here
from clamp3d.engine.motions import first_contact, min_clearance
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array
from clamp3d.kernel.distance import signed_distances

TRUTH_ERROR = 1e-9
"""Largest error of a truth in parts of the scene."""
_TIMES, _KEPT = 129, 24
"""Times of the first grid; times of a case that are followed."""
_CONVEX = ("lip", "end arc", "end edge", "corner")
"""Features that a wire passes on a tangent."""


@dataclass(frozen=True, slots=True)
class Motions(Rows):
    """n motions: ``shape`` (n,) row of ``shapes``; a turn by ``angle`` (n,) rad and a ``travel`` (n, 3) mm from 0 to 1.

    ``start`` (n, 4, 4) is ``T_groove_wire`` at time 0; the turn is about ``axis`` (n, 3) through ``point`` (n, 3).
    The case was built to be near at ``time`` (n,); another place may come nearer. ``number`` (n,) tells the cases
    apart when some are taken.
    """

    shapes: Shapes
    shape: NDArray[np.intp]
    start: Array
    point: Array
    axis: Array
    angle: Array
    travel: Array
    time: Array
    number: NDArray[np.intp]

    def motion(self, i: int) -> Motion:
        """Case i as a `Motion`."""
        return Motion(self.axis[i], self.point[i], float(self.angle[i]), self.travel[i])

    def distances(self, i: int, times: Array) -> Array:
        """Signed distances (m,) of case i at some times."""
        k, start, point = int(self.shape[i]), self.start[i], self.point[i]
        turns = Rotation.from_rotvec(times[:, None] * self.angle[i] * self.axis[i])
        T = np.tile(np.eye(4), (len(times), 1, 1))
        T[:, :3, :3] = turns.as_matrix() @ start[:3, :3]
        arm = start[:3, 3] - point if self.angle[i] else np.zeros(3)
        T[:, :3, 3] = start[:3, 3] - arm + turns.apply(arm) + times[:, None] * self.travel[i]
        return np.asarray(signed_distances(self.shapes.groove(k), self.shapes.wire(k), T, workers=1))

    def scene(self) -> Array:
        """Largest length of each case (n,), mm: sizes, the start, the point of the axis and the travel."""
        far = np.abs(np.concatenate([self.start[:, :3, 3], self.point, self.travel], 1)).max(1)
        return np.asarray(np.maximum(self.shapes.size()[self.shape], far))

    def snippet(self, i: int) -> str:
        """Python lines that ask for case i alone, bit by bit the same numbers."""
        axis, point, travel = (f"np.array({rows[i].tolist()})" for rows in (self.axis, self.point, self.travel))
        lines = [
            *self.shapes.snippet(int(self.shape[i])),
            f"motion = clamp3d.Motion({axis}, {point}, {float(self.angle[i])!r}, {travel})",
            f"start = np.array({self.start[i].tolist()})",
            "print(clamp3d.min_clearance(groove, wire, motion, start))",
            "print(clamp3d.first_contact(groove, wire, motion, start))",
        ]
        return "\n".join(lines)


def through(
    cases: Cases,
    time: ArrayLike,
    *,
    travel: ArrayLike,
    angle: ArrayLike = 0.0,
    point: ArrayLike = 0.0,
    axis: ArrayLike = (0.0, 0.0, 1.0),
) -> Motions:
    """Motions that are at the poses of ``cases`` at ``time`` (n,), from columns that are spread to n rows.

    ``travel`` is (n, 3) mm, or (n,) along the axis.
    """
    n = len(cases)

    def spread(x: ArrayLike, *more: int) -> Array:
        return np.array(np.broadcast_to(np.asarray(x, np.float64), (n, *more)))

    axis = np.asarray(unit_rows(spread(axis, 3)), np.float64)
    travel = np.asarray(travel, np.float64)
    travel = spread(travel, 3) if travel.ndim == 2 else spread(travel)[:, None] * axis
    time, angle, point = spread(time), spread(angle), spread(point, 3)
    motions = Motions(cases.shapes, cases.shape, cases.T_groove_wire, point, axis, angle, travel, time, np.arange(n))
    for i in range(n):
        motions.start[i] = motions.motion(i).at(-float(time[i]), motions.start[i])
    return motions


def _touching(
    rng: np.random.Generator, shapes: Shapes, n: int, features: tuple[str, ...], gap: Array
) -> tuple[Cases, Array]:
    """Poses at a gap from some feature, a third of them along the groove, and the unit normals (n, 3) there."""
    shape = draw.spread(n, len(shapes))
    contact = draw.contact_on(rng, shapes, shape, rng.choice(features, n))
    tilt = np.where(rng.random(n) < 0.33, 0.0, rng.uniform(-1.5, 1.5, n))
    cases = draw.place(rng, shapes, shape, contact, shapes.r[shape] * gap, tilt=tilt)
    return cases, np.asarray(unit_rows(contact.normal), np.float64)


def _square_to(rng: np.random.Generator, normal: Array) -> Array:
    """Random unit vectors (n, 3) square to ``normal``."""
    return np.asarray(unit_rows(np.cross(normal, rng.normal(size=normal.shape))), np.float64)


MAKERS = Makers("motion: ")


@MAKERS.family("grazing")
def _grazing(rng: np.random.Generator, n: int) -> Motions:
    """Straight past a lip, an edge or a corner on a tangent: clear or deep by 1e-12 ... 1e-2 of the radius."""
    cases, normal = _touching(rng, draw.shapes(rng, draw.count(n)), n, _CONVEX, draw.powers(rng, n, -12, -2))
    length = cases.shapes.R[cases.shape] * 10.0 ** rng.uniform(-1, 1, n)
    return through(cases, rng.uniform(0.05, 0.95, n), travel=_square_to(rng, normal) * length[:, None])


@MAKERS.family("screws")
def _screws(rng: np.random.Generator, n: int) -> Motions:
    """Circles and turns with advance, up to six turns, that curve away from where they touch."""
    cases, normal = _touching(rng, draw.shapes(rng, draw.count(n)), n, draw.FEATURES, draw.powers(rng, n, -12, -2))
    radius = cases.shapes.R[cases.shape] * 10.0 ** rng.uniform(-1, 1, n)
    turns = 10.0 ** rng.uniform(-1.0, np.log10(12.0 * np.pi), n) * rng.choice([-1.0, 1.0], n)
    return through(
        cases,
        rng.uniform(0.05, 0.95, n),
        travel=draw.powers(rng, n, -3, 0, 0.4) * radius * turns,
        angle=turns,
        point=cases.T_groove_wire[:, :3, 3] + radius[:, None] * normal,
        axis=_square_to(rng, normal),
    )


@MAKERS.family("thin and fast")
def _thin(rng: np.random.Generator, n: int) -> Motions:
    """A thin groove or a thin short wire crossed in 1e-6 ... 1e-2 of the motion."""
    k = draw.count(n)
    R = 10.0 ** rng.uniform(0, 2, k)
    sheet, thin = rng.random(k) < 0.5, R * 10.0 ** rng.uniform(-6, -2, k)
    r = np.where(rng.random(k) < 0.5, thin, R * 10.0 ** rng.uniform(-5, -1, k))
    L = np.where(sheet, thin, R * 10.0 ** rng.uniform(-1, 1, k))
    shapes = draw.shapes(rng, k, R=R, L=L, r=r, length=r * 10.0 ** rng.uniform(-2, 1, k))
    gap = np.where(rng.random(n) < 0.5, draw.powers(rng, n, -6, -0.1), -rng.uniform(0, 0.9, n))
    cases, normal = _touching(rng, shapes, n, _CONVEX, gap)
    # Through the sheet or past it, along the groove, off from the contact's own tangent.
    crossing = sheet[cases.shape] & (rng.random(n) < 0.7)
    along = np.column_stack([0.1 * rng.normal(size=(n, 2)), rng.choice([-1.0, 1.0], n)])
    fast = R[cases.shape] * 10.0 ** rng.uniform(0.5, 2, n)
    way = np.where(crossing[:, None], along, _square_to(rng, normal))
    return through(cases, rng.uniform(0.05, 0.95, n), travel=way * fast[:, None])


def least_distance(cases: Motions, i: int, end: float = 1.0, named: tuple[float, ...] = ()) -> tuple[float, float]:
    """Least signed distance (mm) of case i until the time ``end``, and its time; see the module."""
    k = int(cases.shape[i])
    ends = (cases.start[i, :3, 3] + t * cases.start[i, :3, 2] for t in (-0.5, 0.5 * float(cases.shapes.length[k])))
    speed = cases.motion(i).speed(np.array([*ends, cases.start[i, :3, 3]]))
    speed += abs(float(cases.angle[i])) * float(cases.shapes.length[k])
    hints = [t for t in (float(cases.time[i]), *named) if 0.0 <= t <= end]
    width = end / (_TIMES - 1)
    times = np.array([*np.linspace(0.0, end, _TIMES), *hints])
    best, best_time = np.inf, 0.0
    while True:
        values = cases.distances(i, times)
        lowest = int(values.argmin())
        best, best_time = min((best, best_time), (float(values[lowest]), float(times[lowest])))
        near = np.flatnonzero(values - speed * width < best)
        if speed * width <= 1e-13 * float(cases.shapes.size()[k]) or not len(near):
            return best, best_time
        near = near[np.argsort(values[near], kind="stable")[:_KEPT]]
        width *= 0.5
        times = np.unique(np.clip(times[near, None] + width * np.array([-1.0, 1.0]), 0.0, end))


class CasMethod:
    """`min_clearance` for the least distance and `first_contact`, whose answers are kept by the case's number.

    The bound is that of rounding (distance and pose) and the resolution of the search.
    """

    measures: Measures = "depth"

    def __init__(self) -> None:
        self.lowest: dict[int, float] = {}
        self.first: dict[int, tuple[bool, float, float]] = {}

    def measure(self, cases: Motions) -> Measured:
        """See `Method`."""
        k = int(cases.shape[0])
        groove, wire = cases.shapes.groove(k), cases.shapes.wire(k)
        distance, bound = np.empty(len(cases)), np.empty(len(cases))
        for i in range(len(cases)):
            motion, start = cases.motion(i), cases.start[i]
            least = min_clearance(groove, wire, motion, start)
            first = first_contact(groove, wire, motion, start)
            distance[i] = least.distance.value
            # In an overlap the answer bounds the depth of the whole way from one side only: the search's own error.
            uncertainties = [d.uncertainty for d in (least.distance, first.distance) if np.isfinite(d.uncertainty)]
            bound[i] = max(uncertainties, default=0.0) + max(least.resolution, first.resolution)
            self.lowest[int(cases.number[i])] = least.t
            self.first[int(cases.number[i])] = (bool(first.touches), first.t, first.distance.value)
        return Measured(distance, bound)


class SteppedMethod:
    """Exact distances at evenly spaced poses, ends included: the least of them. It has no bound."""

    measures: Measures = "depth"

    def __init__(self, steps: int) -> None:
        self.times = np.linspace(0.0, 1.0, steps + 1)

    def measure(self, cases: Motions) -> Measured:
        """See `Method`."""
        least = np.array([cases.distances(i, self.times).min() for i in range(len(cases))])
        return Measured(least, np.full(len(cases), np.nan))


METHODS: Methods = {
    "cas": ("closed forms of the arc groove; its bound is that of rounding", CasMethod),
    "stepped 100": (
        "exact distances at 101 evenly spaced poses of a motion, the usual practice; no bound",
        partial(SteppedMethod, 100),
    ),
}


@dataclass(frozen=True, slots=True)
class Truths:
    """Least distances (n,) mm of all cases, their ``time`` (n,), and what the reference method said."""

    distance: Array
    time: Array
    reference: CasMethod
    answers: Answers


class MotionFamily(Family):
    """A kind of difficulty of motions. The truth of a case is its least distance; a hit is one below 0."""

    methods = METHODS
    truth_error = TRUTH_ERROR

    def truths(self, cases: Motions) -> Truths:
        """See the module: times that the reference names are looked at too."""
        reference = CasMethod()
        answers = run_here(reference, cases)
        least = [least_distance(cases, i, named=(reference.lowest.get(i, -1.0),)) for i in range(len(cases))]
        distance, time = np.array(least).T
        return Truths(distance, time, reference, answers)

    def difference(self, cases: Motions, truths: Truths, i: int) -> float:
        """See `Family`: at 50 digits of the pose at the time that was found."""
        T = cases.motion(i).at(float(truths.time[i]), cases.start[i])
        pose = Cases(cases.shapes, cases.shape[i : i + 1], T[None], np.full(1, np.nan))
        return abs(float(truth_50_digits(pose, 0)) - float(truths.distance[i])) / float(cases.scene()[i])

    def ask(self, name: str, cases: Motions, truths: Truths, time_limit: float) -> Answers:
        """See `Family`; the reference has answered already, and its first contacts are judged too."""
        if name != REFERENCE:
            return super().ask(name, cases, truths, time_limit)
        check_first_contacts(cases, truths)
        return truths.answers

    def judge(self, name: str, cases: Motions, truths: Truths, answers: Answers) -> Outcome:
        """See `Family`."""
        return super().judge(name, cases, truths.distance, answers)

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        distance, time = least_distance(cases, i)
        return f"{cases.snippet(i)}\n# truth: least {distance!r} mm at t = {time!r}"


def check_first_contacts(cases: Motions, truths: Truths) -> None:
    """Count each wrong answer of `first_contact` as a failure of its case.

    It must touch if and only if the truth does (unless that is within the bound of 0); the time that it names must
    be one of contact, with no contact before it: the least distance of the motion that ends there is 0, within the
    bound, or the start is in contact.
    """
    answers = truths.answers
    for i, (touches, time, value) in truths.reference.first.items():
        least, bound = float(truths.distance[i]), float(answers.bound[i])
        flaw = ""
        if touches and least > bound:
            flaw = "a hit that is none"
        elif not touches and least < -bound:
            flaw = "a hit missed"
        elif not touches and not abs(value - float(answers.distance[i])) <= bound:
            flaw = "it and min_clearance differ"
        elif touches and float(cases.distances(i, np.array([time]))[0]) > bound:
            flaw = "not yet in contact"
        elif touches and time > 0.0 and least_distance(cases, i, time, (time,))[0] < -bound:
            flaw = "in contact before"
        if flaw:
            answers.failed[i] = True
            answers.note(f"first_contact: {flaw}, case {i}")


MOTIONS = {name: MotionFamily(name, *maker) for name, maker in MAKERS.items()}
