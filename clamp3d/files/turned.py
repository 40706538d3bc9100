"""What of a solid is turned about an axis, and its section by a plane through that axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.files.faces import CYLINDER, PLANE, SPHERE, TORUS, Surfaces, surfaces
from clamp3d.files.open_cascade import TOLERANCE, area_of, bounds_of, explore, from_bytes, moved, occ
from clamp3d.geometry.pose import Array, inverse, to_source, to_target
from clamp3d.geometry.profile import chord_angle, chord_count
from clamp3d.geometry.triangles import distances_from_segments

CHORDS = (1e-3, 1e-5)
"""Chord errors (mm) of sections: the first decides most fits, in a tenth of the time that the last takes."""
_ALIKE, _PARALLEL = 1e-7, 1e-9
"""How far (mm, rad) a surface may be from one that is turned about the axis, as Open CASCADE confuses points."""
_ANGLES = (1.0, 2.2)
"""Where about the axis (rad) sections are made, away from seams, which mostly are at 0."""
PLANE_AT = np.array(
    [
        [math.cos(_ANGLES[0]), 0.0, 0.0, 0.0],
        [math.sin(_ANGLES[0]), 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
"""Takes points of sections, off the axis and along it, to the axis' frame; a third coordinate is left out."""
_BEYOND = 1.0
"""How far (mm) what sections are cut out of reaches beyond the solid."""
_OFF = 1e-5
"""How far (mm) Open CASCADE's curve of a section may be off the line or circle that it is."""
_APPROXIMATE = 1e-5
"""How far the area of a section by Open CASCADE may be off for that, relative to it."""
_SAMPLES = 17
"""Points of a curve that are looked at, from which the turns about a circle's centre are told."""


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """The section of a solid by a plane through an axis: outlines ``loops`` (n, 2), off the axis and along it, mm.

    What is inside of an odd number of loops is material. ``error``: how far (mm) they are off the true ones.
    ``reach``: all planes give the same nearer to the axis than this, mm; what is farther is left out.
    ``chord``: that of `CHORDS` with which circles are drawn.
    """

    loops: tuple[Array, ...]
    error: float
    reach: float
    chord: float

    @property
    def radius(self) -> float:
        """How far (mm) its points are from the axis."""
        return max(float(np.abs(loop[:, 0]).max()) for loop in self.loops) + self.error


def axis_of(form: Surfaces, about: Array | None = None) -> Array | None:
    """A pose (4, 4) whose z is the axis of the first round surface; None if there is none.

    ``about``: of the first that is turned about z of this pose, and z the same way.
    """
    is_round = (form.kind >= CYLINDER) & (form.kind <= TORUS) & (form.kind != SPHERE)
    if about is not None:
        is_round &= turned_about(form, about)
    if not is_round.any():
        return None
    origin, _, y, z = form.frame[is_round.argmax()]
    if about is not None:
        z = z * math.copysign(1.0, float(z @ about[:3, 2]))
    axis = np.eye(4)
    axis[:3] = np.column_stack([np.cross(y, z), y, z, origin])  # Open CASCADE's own x may be left-handed
    return axis


def turned_about(form: Surfaces, axis: Array) -> NDArray[np.bool_]:
    """Which (n,) of the surfaces are turned about z of a pose (4, 4)."""
    T = inverse(axis)
    off = np.hypot(*to_target(T, form.frame[:, 0]).T[:2])
    lean = np.hypot(*(form.frame[:, 3] @ T[:3, :3].T).T[:2])
    is_along = (form.kind == SPHERE) | (lean <= _PARALLEL)
    return np.asarray((form.kind <= TORUS) & is_along & ((form.kind == PLANE) | (off <= _ALIKE)))


@lru_cache(maxsize=512)
def turned_sections(brep: bytes, pose: bytes, radius: float) -> tuple[Section, ...]:
    """The section of a solid about z of a pose (4, 4), in bytes, as far as it is turned about that, with each chord.

    Nothing where it is not so far as ``radius`` (mm), and where Open CASCADE's sections are not what they should be.
    """
    axis = np.frombuffer(pose).reshape(4, 4)
    solid = moved(from_bytes(brep), inverse(axis))
    form = surfaces(brep)
    is_turned = turned_about(form, axis)
    reach = _reach(solid, is_turned, radius)
    if reach <= radius:
        return ()
    low, high = bounds_of(solid, quick=True)
    wide = min(reach, math.hypot(*np.maximum(high, -low)[:2]) + _BEYOND)
    circles = _circles(form, is_turned, axis)
    cut, other = (_cut(solid, angle, wide, low[2] - _BEYOND, high[2] + _BEYOND) for angle in _ANGLES)
    drawn = [_loops(cut, _ANGLES[0], circles, chord) for chord in CHORDS]
    loops, others = drawn[-1], _loops(other, _ANGLES[1], circles, CHORDS[-1])
    area = area_of(cut, adaptive=True)
    lost = CHORDS[-1] * sum(float(np.linalg.norm(_ways(loop), axis=1).sum()) for loop in loops)
    is_whole = area > 0.0 and abs(_area(loops) - area) <= lost + _APPROXIMATE * area
    if not (is_whole and abs(_area(loops) - _area(others)) <= lost):
        return ()
    return tuple(Section(x, chord + TOLERANCE, reach, chord) for x, chord in zip(drawn, CHORDS, strict=True))


def _reach(solid: Any, is_turned: NDArray[np.bool_], radius: float) -> float:
    """How far (mm) from z a solid is turned about it, whose faces are or are not (n,), if that is beyond ``radius``.

    Lemma: surfaces that are turned about one axis meet in circles about it, or are the same. So nearer to the axis than
    all other faces the solid's surface is turned, too, wherever its edges are.
    """
    faces = zip(explore(solid, "FACE"), is_turned.tolist(), strict=True)
    return min((_from_axis(face, radius) for face, turned in faces if not turned), default=math.inf)


def _from_axis(face: Any, radius: float) -> float:
    """How far (mm) a face is from z at least, exactly where its box does not keep ``radius``."""
    low, high = bounds_of(face, quick=True)
    away = math.hypot(*np.maximum(np.maximum(low, -high), 0.0)[:2])
    if away > radius:
        return away
    ends = [occ.gp_Pnt(0.0, 0.0, z) for z in (low[2] - _BEYOND, high[2] + _BEYOND)]
    axis = occ.BRepBuilderAPI_MakeEdge(*ends).Edge()
    return float(occ.BRepExtrema_DistShapeShape(axis, face).Value())


def _cut(solid: Any, angle: float, wide: float, low: float, high: float) -> Any:
    """The faces at an ``angle`` (rad) about z, up to ``wide`` mm from it and between two heights."""
    across = occ.gp_Dir(math.cos(angle), math.sin(angle), 0.0)
    frame = occ.gp_Ax3(occ.gp_Pnt(0.0, 0.0, 0.0), occ.gp_Dir(math.sin(angle), -math.cos(angle), 0.0), across)
    face = occ.BRepBuilderAPI_MakeFace(occ.gp_Pln(frame), -wide, wide, low, high).Face()
    return occ.BRepAlgoAPI_Common(solid, face).Shape()


def _circles(form: Surfaces, is_turned: NDArray[np.bool_], axis: Array) -> Array:
    """Centres and radii (k, 3) of spheres and tori that are turned about z of a pose (4, 4), in sections."""
    heights = to_source(axis, form.frame[:, 0])[:, 2]
    balls, rings = (np.flatnonzero(is_turned & (form.kind == kind)) for kind in (SPHERE, TORUS))
    circles = [np.column_stack([np.zeros(len(balls)), heights[balls], form.size[balls, 0]])]
    circles += [np.column_stack([side * form.size[rings, 0], heights[rings], form.size[rings, 1]]) for side in (-1, 1)]
    return np.concatenate(circles)


def _loops(cut: Any, angle: float, circles: Array, chord: float) -> tuple[Array, ...]:
    """The outlines of a section at an ``angle`` (rad), with circles drawn within ``chord`` mm."""
    return tuple(_loop(wire, angle, circles, chord) for wire in explore(cut, "WIRE"))


def _loop(wire: Any, angle: float, circles: Array, chord: float) -> Array:
    """Points (n, 2) along a wire of the section at an ``angle``; none if it is not of lines and some of ``circles``.

    Open CASCADE gives curves that are a circle's but for the last digits as splines, 1e-6 mm off.
    """
    points, walk = [], occ.BRepTools_WireExplorer(wire)
    across = np.column_stack([(math.cos(angle), math.sin(angle), 0.0), (0.0, 0.0, 1.0)])
    while walk.More():
        edge = walk.Current()
        curve = occ.BRepAdaptor_Curve(edge)
        at = np.linspace(curve.FirstParameter(), curve.LastParameter(), _SAMPLES)
        if edge.Orientation() == occ.TopAbs_Orientation.TopAbs_REVERSED:
            at = at[::-1]
        places = np.array([curve.Value(t).Coord() for t in at.tolist()]) @ across
        points.append(_without_end(places, circles, chord))
        walk.Next()
    return np.concatenate(points) if all(map(len, points)) else np.empty((0, 2))


def _without_end(places: Array, circles: Array, chord: float) -> Array:
    """Points (n, 2), all but the last, on the line or circle through some of it (k, 2); none if it is neither."""
    if distances_from_segments(places, places[0], places[-1]).max() <= _OFF:
        return places[:1]
    centres, radii = circles[:, :2], circles[:, 2]
    off = np.abs(np.linalg.norm(places - centres[:, None], axis=2) - radii[:, None]).max(axis=1)
    if not len(off) or off.min() > _OFF:
        return places[:0]
    centre, radius = centres[off.argmin()], radii[off.argmin()]
    turns = np.unwrap(np.arctan2(*(places - centre).T[::-1]))
    count = chord_count(turns[-1] - turns[0], chord_angle(radius, chord))
    at = np.linspace(turns[0], turns[-1], count + 1)[:-1]
    return np.asarray(centre + radius * np.column_stack([np.cos(at), np.sin(at)]))


def _ways(loop: Array) -> Array:
    """From each of the points (n, 2) of a loop to the next."""
    return np.asarray(np.roll(loop, -1, axis=0) - loop)


def _area(loops: tuple[Array, ...]) -> float:
    """What outlines, inner ones the other way round, hold; mm^2."""
    return abs(sum(0.5 * float((x[:, 0] * (y := _ways(x))[:, 1] - x[:, 1] * y[:, 0]).sum()) for x in loops))
