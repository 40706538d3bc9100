"""A contact model in place of the exact engine, where the groove of one body is nearest to a cylinder of the other."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.closed_form import bore_rod
from clamp3d.engine.convex import Rod
from clamp3d.engine.model import Model
from clamp3d.geometry.pose import Array, inverse
from clamp3d.geometry.primitives import Cylinder, SweptArc
from clamp3d.geometry.profile import chord_count, sagitta
from clamp3d.kernel.contact_model import ContactModel, GroovePair

_SAME = 1e-6
"""A groove and a cylinder are the nearest ones if the kernel's distance of them is the exact one to within this, mm."""


def groove_pairs(a: Model, b: Model, T: Array) -> Iterator[tuple[float, GroovePair]]:
    """Grooves of ``a`` with cylinders of ``b`` at ``T`` (4, 4) in a's frame, and the kernel's distance of each, mm.

    Concave arcs of the outlines are the grooves, circles and convex arcs the cylinders; names are those of the shapes.
    """
    bores = {bore for form in a.bodies or () for bore in form.bores if bore.half_angle < math.pi}
    rods = {piece for form in b.bodies or () for piece in form.outers if isinstance(piece, Rod)}
    for bore in bores:
        groove = SweptArc(bore.radius, bore.half_angle, bore.length)
        for rod in rods:
            pair = GroovePair(a.name, b.name, groove, bore.T, Cylinder(rod.radius, rod.length), rod.T)
            yield bore_rod(bore, rod, T).upper, pair


def modelled(a: Model, b: Model, T: Array, exact: Distance, model: ContactModel) -> Distance:
    """The model's distance of the groove and cylinder that are nearest; ``exact`` where no groove is nearest.

    The model's faces beside a groove run on without end and it knows no other surface, so it is asked only where the
    exact nearest point is on the groove. Its bounds are what is known of it: chords and wedges lie in the hollow by up
    to a sagitta, so the true distance is no less, and no more than a sagitta above (FCL, which measures wedges, adds
    1e-6 of the value); for hulls and meshes no bound is known.
    """
    if exact.method != "groove kernel" or model.name == "cas":
        return exact
    for first, second, place, swapped in ((a, b, T, False), (b, a, inverse(T), True)):
        for gap, pair in groove_pairs(first, second, place):
            if abs(gap - exact.upper) <= _SAME:
                distance = _asked(model, pair, place)
                return distance.moved(T).swapped() if swapped else distance
    return exact


def _asked(model: ContactModel, pair: GroovePair, T: Array) -> Distance:
    pieces = model.pieces(pair, T)
    k = int(np.argmin(pieces.distance))
    value, point, normal = float(pieces.distance[k]), pieces.point[k], pieces.normal[k]
    lower, upper = -math.inf, math.inf
    unit = getattr(model, "unit_angle", None)
    if unit is not None:
        arc = 2.0 * pair.groove.half_angle
        rounding = 1e-9 if model.name == "chords" else 1e-6 * (1.0 + abs(value))
        lower = value - rounding
        upper = value + sagitta(pair.groove.radius, arc / chord_count(arc, unit)) + rounding
    return Distance(lower, upper, point, point + value * normal, normal, None, "model", model.name, value)
