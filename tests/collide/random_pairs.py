"""Random pairs of drawn and meshed bodies a known way into or off each other, judged by Open CASCADE.

Each pair starts apart and is moved along the line of its nearest points by their distance and a step more or less. So
on the way in it touches first, and an overlap is no deeper than the step beyond that. Open CASCADE tells the distance
of a pair that is apart, and of one that is not the points that lie furthest inside, which its check knows nothing of.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clamp3d.collide.check import check
from clamp3d.collide.result import BAD, PairResult
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Verdict
from clamp3d.core import shapes
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.mesh import make_mesh
from clamp3d.core.meshing import mesh
from clamp3d.core.pose import Array, rotation, translation
from clamp3d.core.primitives import SweptArc
from clamp3d.core.profile import Profile
from clamp3d.core.shapes import MeshShape, Shape, Solid

CONTACT, CLEARANCE = 0.01, 0.5
_SAME = 1e-6
"""Two distances (mm) that agree to this are one: Open CASCADE's own tolerance is 1e-7."""
_DEEP = 2e-5
"""The same for depths: beside an edge Open CASCADE's distance of a point from a shell is off by up to 7e-6."""


FITS: tuple[shapes.Fit, ...] = ("off",)
"""What meshes are taken as where nothing else is said: their facets."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A shape for the check, and what it stands for: a drawn solid, or the facets of a mesh where they are the part."""

    kind: str
    shape: Shape
    meant: Solid | MeshShape


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two bodies, ``b`` at ``T`` (4, 4) in a's frame; ``step`` mm: more than 0 a gap was meant, else an overlap."""

    a: Body
    b: Body
    T: Array
    step: float


@dataclass
class Score:
    """What a campaign found: counts of verdicts, and the cases (number, words) that went wrong."""

    verdicts: Counter[str] = field(default_factory=Counter)
    methods: Counter[str] = field(default_factory=Counter)
    wrong: list[tuple[int, str]] = field(default_factory=list)
    beyond: list[tuple[int, str]] = field(default_factory=list)
    uncertain: list[tuple[int, str]] = field(default_factory=list)
    failed: list[tuple[int, str]] = field(default_factory=list)


def _plate(rng: np.random.Generator) -> Solid:
    x, y, z = rng.uniform(20.0, 60.0), rng.uniform(20.0, 60.0), rng.uniform(3.0, 15.0)
    holes = [shapes.Hole(rng.uniform(1.5, 0.2 * min(x, y)), (0.25 * x * s, 0.1 * y)) for s in (-1.0, 1.0)]
    return shapes.box((x, y, z), holes=holes[: int(rng.integers(1, 3))])


def _tube(rng: np.random.Generator) -> Solid:
    radius = rng.uniform(3.0, 15.0)
    return shapes.cylinder(radius, rng.uniform(5.0, 40.0), bore=radius * rng.uniform(0.4, 0.95))


def _groove_block(rng: np.random.Generator) -> Solid:
    radius, half = rng.uniform(3.0, 12.0), rng.uniform(0.5, 1.5)
    groove = SweptArc(radius, half, rng.uniform(10.0, 50.0))
    return shapes.groove_block(groove, 2.0 * radius + rng.uniform(3.0, 20.0), radius + rng.uniform(3.0, 20.0))


def _bolt(rng: np.random.Generator) -> Solid:
    radius, length = rng.uniform(2.0, 6.0), rng.uniform(10.0, 40.0)
    head = Extrusion(Profile.hexagon(3.2 * radius), "Z", 0.0, 1.3 * radius)
    return Solid("bolt", (head, Extrusion(Profile.circle(radius), "Z", -length, 0.0)))


def _bracket(rng: np.random.Generator) -> Solid:
    w, h, t = rng.uniform(15.0, 40.0), rng.uniform(15.0, 40.0), rng.uniform(2.0, 6.0)
    outline = Profile.of((0.0, 0.0), (w, 0.0), (w, t), (t, t), (t, h), (0.0, h))
    return Solid("bracket", (Extrusion(outline, "Z", 0.0, rng.uniform(8.0, 30.0)),))


DRAWN: dict[str, Callable[[np.random.Generator], Solid]] = {
    "box": lambda rng: shapes.box(rng.uniform(5.0, 40.0, 3).tolist()),
    "cylinder": lambda rng: shapes.cylinder(rng.uniform(2.0, 15.0), rng.uniform(5.0, 40.0)),
    "tube": _tube,
    "groove block": _groove_block,
    "plate with holes": _plate,
    "bolt": _bolt,
    "L-bracket": _bracket,
}


def draw_body(rng: np.random.Generator, fits: tuple[shapes.Fit, ...]) -> Body:
    """A body of a random kind, two fifths of them as meshes with one of ``fits``."""
    kind = str(rng.choice(list(DRAWN)))
    solid = DRAWN[kind](rng)
    if rng.random() < 0.6:
        return Body(kind, solid, solid)
    made = mesh(solid, float(rng.choice([0.2, 0.05, 0.01])))
    fit = fits[int(rng.integers(len(fits)))]
    shape = MeshShape(make_mesh(made.vertices, made.faces), fit)
    return Body(f"{kind}, mesh ({fit})", shape, shape if fit == "off" else solid)


def draw_pairs(n: int, seed: int, fits: tuple[shapes.Fit, ...] = FITS) -> Iterator[Pair]:
    """The n pairs of a seed; steps from 1e-6 to 10 mm, gaps and overlaps alike."""
    for k in range(n):
        rng = np.random.default_rng([seed, k])
        a, b = draw_body(rng, fits), draw_body(rng, fits)
        R = rotation(rng.normal(size=3), rng.uniform(0.0, math.pi))
        if rng.random() < 0.3:  # square to each other, as parts in assemblies are
            R = rotation(np.eye(3)[int(rng.integers(3))], 0.5 * math.pi * int(rng.integers(4)))
        way = rng.normal(size=3)
        T = translation(*(150.0 * way / np.linalg.norm(way))) @ R
        T[:3, 3] += rng.uniform(-10.0, 10.0, 3)
        found = Truth.of(a.meant, b.meant, T)
        step = 10.0 ** rng.uniform(-6.0, 1.0) * float(rng.choice([-1.0, 1.0]))
        T[:3, 3] -= (found.distance - step) * (found.q - found.p) / found.distance
        yield Pair(a, b, T, step)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """What Open CASCADE says: distance (mm), nearest points (3,), and a depth (mm) that a common point has."""

    distance: float
    p: Array
    q: Array
    depth: float = 0.0
    volume: float = 0.0

    @classmethod
    def of(cls, a: Solid | MeshShape, b: Solid | MeshShape, T: Array) -> Truth:
        """Two bodies, ``b`` at ``T`` (4, 4)."""
        from OCP.BRepExtrema import BRepExtrema_DistShapeShape

        x, y = _solid(a), _placed(_solid(b), T)
        found = BRepExtrema_DistShapeShape(x, y)
        p, q = (np.array([v.X(), v.Y(), v.Z()]) for v in (found.PointOnShape1(1), found.PointOnShape2(1)))
        distance = float(found.Value())
        if distance > _SAME:
            return cls(distance, p, q)
        return cls(distance, p, q, *_overlap(x, y))


def _placed(shape: Any, T: Array) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf

    move = gp_Trsf()
    move.SetValues(*T[:3].flatten().tolist())
    return BRepBuilderAPI_Transform(shape, move, True).Shape()


def _solid(body: Solid | MeshShape) -> Any:
    if isinstance(body, Solid):
        from clamp3d.output.step import solid

        return solid(body)
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeFace,
        BRepBuilderAPI_MakePolygon,
        BRepBuilderAPI_MakeSolid,
        BRepBuilderAPI_Sewing,
    )
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS

    sewing = BRepBuilderAPI_Sewing(1e-9)
    for corners in body.mesh.vertices[body.mesh.faces]:
        outline = BRepBuilderAPI_MakePolygon(*(gp_Pnt(*x) for x in corners.tolist()), True)
        sewing.Add(BRepBuilderAPI_MakeFace(outline.Wire()).Face())
    sewing.Perform()
    return BRepBuilderAPI_MakeSolid(TopoDS.Shell(sewing.SewedShape())).Solid()


def _overlap(x: Any, y: Any) -> tuple[float, float]:
    """Depth (mm) of the deepest corner or middle of the common part, in either body, and its volume (mm^3)."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_ShapeEnum, TopAbs_State
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    common = BRepAlgoAPI_Common(x, y).Shape()
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(common, properties)
    points = [properties.CentreOfMass()] if properties.Mass() > 0.0 else []
    explorer = TopExp_Explorer(common, TopAbs_ShapeEnum.TopAbs_VERTEX)
    while explorer.More() and len(points) < 24:
        points.append(BRep_Tool.Pnt_s(TopoDS.Vertex(explorer.Current())))
        explorer.Next()
    depth = 0.0
    for point in points:
        if any(BRepClass3d_SolidClassifier(body, point, 1e-7).State() == TopAbs_State.TopAbs_OUT for body in (x, y)):
            continue
        vertex = BRepBuilderAPI_MakeVertex(point).Vertex()
        for body in (x, y):
            depth = max(depth, *(BRepExtrema_DistShapeShape(vertex, shell).Value() for shell in _shells(body)))
    return depth, float(properties.Mass())


def _shells(body: Any) -> list[Any]:
    """The body's surface: distances of points inside a solid are zero, those from its shell are depths."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(body, TopAbs_ShapeEnum.TopAbs_SHELL)
    found = []
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def judge(pair: Pair, row: PairResult, truth: Truth) -> tuple[str, str]:
    """("wrong", "beyond" a bound or "", why): an answer against Open CASCADE and the way that the pair was made."""
    low, high, verdict = row.distance.lower, row.distance.upper, row.verdict
    said = f"{pair.a.kind} / {pair.b.kind}, step {pair.step:.3g}: {verdict.value} [{low:.9g}, {high:.9g}]"
    if truth.distance > _SAME:  # apart
        right = Scene(contact=CONTACT, clearance=CLEARANCE).thresholds._of(truth.distance)
        near = min(abs(truth.distance - mark) for mark in (CONTACT, CLEARANCE)) <= 2.0 * _SAME
        said += f", Open CASCADE: apart by {truth.distance:.9g}"
        if low > truth.distance + _SAME or high < truth.distance - _SAME:
            return "beyond", said
        wrong = verdict not in (right, Verdict.UNCERTAIN, Verdict.FAILED) and not near
        return ("wrong" if wrong else ""), said
    said += f", Open CASCADE: {truth.depth:.6g} deep at least, {truth.volume:.6g} mm3"
    limit = max(-pair.step, 0.0)
    if -high > limit + _SAME or -low < truth.depth - _DEEP:
        return "beyond", said
    if verdict in BAD and limit <= CONTACT - _SAME:
        return "wrong", said
    if truth.depth > CONTACT + 2.0 * _SAME and verdict not in (*BAD, Verdict.UNCERTAIN, Verdict.FAILED):
        return "wrong", said
    if verdict in (Verdict.CLEAR, Verdict.CLEARANCE):
        return "wrong", said
    return "", said


def campaign(
    n: int,
    seed: int,
    fits: tuple[shapes.Fit, ...] = FITS,
    listen: Callable[[int, Score], None] | None = None,
) -> Score:
    """``n`` pairs, each checked as a scene of two with default settings, and judged."""
    score = Score()
    for k, pair in enumerate(draw_pairs(n, seed, fits)):
        scene = Scene.of({"a": (pair.a.shape, np.eye(4)), "b": (pair.b.shape, pair.T)}, clearance=CLEARANCE)
        rows = check(scene).pairs
        row = rows[0] if rows else PairResult("a", "b", Verdict.CLEAR, _apart())
        score.verdicts[row.verdict.value] += 1
        score.methods[row.distance.method.split(",")[0]] += 1
        kind, said = judge(pair, row, Truth.of(pair.a.meant, pair.b.meant, pair.T))
        if kind:
            (score.wrong if kind == "wrong" else score.beyond).append((k, said))
        if row.verdict is Verdict.UNCERTAIN:
            score.uncertain.append((k, f"{said}; {row.reason}"))
        if row.verdict is Verdict.FAILED:
            score.failed.append((k, f"{said}; {row.reason}"))
        if listen is not None:
            listen(k, score)
    return score


def _apart() -> Any:
    from clamp3d.collide.answer import Distance

    return Distance(CLEARANCE)
