"""Two solids from CAD of which one is turned about an axis, and the other too around it: their sections are measured.

Lemma: let one solid be turned about an axis, and within R of it, and the other up to S > R from that axis. Their
distance, or S - R if that is less, is that of their sections by a plane through the axis: of all points at one distance
from the axis and one height, those at the same angle as a given point are nearest to it. So it is with the depth of a
point of one in the other, if that is less than S - R.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.mesh_distance import surface_distance
from clamp3d.engine.model import CadModel
from clamp3d.engine.surface import Surface
from clamp3d.errors import Clamp3dError
from clamp3d.files import cad_process
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.files.turned import PLANE_AT, Section, axis_of, turned_about
from clamp3d.geometry.manifolds import arrays_of, prism
from clamp3d.geometry.pose import Array, inverse, to_source, to_target, translation

METHOD = f"coaxial sections, Open CASCADE, tolerance {TOLERANCE:g} mm"
_HALF = 5.0
"""Half of the length (mm) of the prisms that stand for sections: depths up to this are those of the sections."""


def coaxial_distance(a: CadModel, b: CadModel, T: Array, enough: Enough) -> Distance | None:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame; None of solids that are not turned about one axis."""
    if (distance := _about_axis(a, b, T, enough)) is not None:
        return distance
    other_way = _about_axis(b, a, inverse(T), enough)
    return None if other_way is None else other_way.moved(T).swapped()


def _about_axis(turned: CadModel, other: CadModel, T: Array, enough: Enough) -> Distance | None:
    """The same where one solid is wholly turned, ``other`` being at ``T`` (4, 4) in its frame; None where it is not."""
    form, others = turned.shape.surfaces, other.shape.surfaces
    axis = axis_of(form)
    if axis is None or not turned_about(form, axis).all():
        return None
    there = inverse(T) @ axis
    if not turned_about(others, there).any():
        return None
    own_axis = axis_of(others, there)
    if own_axis is None:  # of planes alone
        own_axis = there
    try:
        own = cad_process.turned_sections(turned.shape.brep, axis.tobytes(), 0.0)
        if not own or own[-1].reach < np.inf:
            return None
        # About the axis as its file has it: by one that is off in the last digits Open CASCADE finds no circles.
        around = cad_process.turned_sections(other.shape.brep, own_axis.tobytes(), own[-1].radius)
    except Clamp3dError:
        return None
    if not around:
        return None
    T_sections = translation(0.0, float(to_source(there, own_axis[:3, 3])[2]), 0.0)
    margin = around[-1].reach - own[-1].radius  # so far is what of the other solid is in no section
    for section, other_section in zip(own, around, strict=True):
        distance = _sections_distance(section, other_section, T_sections, enough)
        # A section ends at its reach, and a prism at its ends: what is deeper may lie further from the solid's surface.
        lower = min(distance.lower, margin) if distance.lower > -min(margin, _HALF) else -np.inf
        distance = replace(distance, lower=lower, method=f"{METHOD}, chord error {section.chord:g} mm")
        if enough(distance):
            break
    return distance.moved(axis @ PLANE_AT)


def _sections_distance(a: Section, b: Section, T: Array, enough: Enough) -> Distance:
    """The distance of two sections, as that of prisms over them; ``T`` (4, 4) moves the second one in the plane."""
    first, second = _prism(a), _prism(b)
    distance = surface_distance(first, second, T, enough)
    if distance.upper > 0.0:
        return distance
    # Its points lie on the prisms' ends: the corners of either section that are in the other one say more.
    for section, other, pose in ((a, second, inverse(T)), (b, first, T)):
        points = to_target(pose, np.insert(np.concatenate(section.loops), 2, 0.0, axis=1))
        points = points[other.contains(points)]
        depths = other.distance(points)
        if len(points) and (upper := a.error + b.error - float(depths.max())) < distance.upper:
            point = points[depths.argmax()] if other is first else to_target(T, points[depths.argmax()])
            distance = replace(distance, upper=upper, point_a=point, point_b=point)
    return distance


def _prism(section: Section) -> Surface:
    """A section drawn along the normal of its plane."""
    vertices, faces = arrays_of(prism(section.loops, _HALF))
    return Surface(vertices, faces, np.full(len(faces), section.error))
