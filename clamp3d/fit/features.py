"""What a fit finds: grooves, cylinders and holes, each with the error that later distances inherit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clamp3d.geometry.mesh import IntArray, Mesh
from clamp3d.geometry.pose import Array, to_source
from clamp3d.geometry.primitives import Cylinder, SweptArc
from clamp3d.geometry.triangles import normals_and_areas


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FittedSurface:
    """A piece of a circular cylinder fitted to part of a mesh.

    Frame ``T_part_feature`` (4, 4): axis on z, origin on the axis in the middle of the length, the covered arc centred
    on -y and spanning +-``half_angle`` (pi for a full turn), as in ``SweptArc``. Lengths in mm, angles in rad.

    ``covariance`` (5, 5) is that of (radius, x, y, tilt_x, tilt_y): the axis is (x + z tilt_x, y + z tilt_y, z) in the
    feature's frame. ``arc_error`` and ``length_error`` say how far the region's border strays from the stated ends.

    The errors, all in mm and all normal to the surface, over the covered faces:

    - ``covariance_error``: what the scatter of the vertices leaves open, over the whole arc at once (99.73 %).
    - ``form_error``: how far a vertex lies off the cylinder at most: the part is not quite round, the scanner scatters,
      or the exporter rounded.
    - ``chord_error``: the largest sagitta of the facets, what the mesh does not tell between its vertices.

    ``fit_error`` = the first two: the bound if the part is round and the vertices lie on it (what tessellation means).
    ``error_bound`` = all three: the bound that assumes nothing between the vertices, so that it also holds if the
    facets are the part, or touch the surface with their middles.
    """

    name: str
    radius: float
    half_angle: float
    length: float
    T_part_feature: Array
    residual_rms: float
    residual_max: float
    points: int
    covered_area: float
    form_error: float
    arc_error: float
    length_error: float
    faces: IntArray
    covariance: Array = field(default_factory=lambda: np.zeros((5, 5)))
    covariance_error: float = 0.0
    chord_error: float = 0.0

    @property
    def coverage(self) -> float:
        """Share of the surface, from end to end of its arc and its length, that triangles cover."""
        return min(1.0, self.covered_area / (2.0 * self.half_angle * self.radius * self.length))

    @property
    def radius_std(self) -> float:
        """Standard error of the radius in mm."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def fit_error(self) -> float:
        """Bound (mm) on the distance between fitted and true surface if the part is round between the vertices."""
        return self.covariance_error + self.form_error

    @property
    def error_bound(self) -> float:
        """Bound (mm) on the distance between fitted and true surface, whatever lies between the vertices."""
        return self.fit_error + self.chord_error

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists for JSON; angles in degrees under ``_deg`` names, lengths in mm."""
        return {
            "name": self.name,
            "radius_mm": self.radius,
            "radius_std_mm": self.radius_std,
            "half_angle_deg": float(np.degrees(self.half_angle)),
            "arc_error_deg": float(np.degrees(self.arc_error)),
            "length_mm": self.length,
            "length_error_mm": self.length_error,
            "T_part_feature": self.T_part_feature.tolist(),
            "error_bound_mm": self.error_bound,
            "fit_error_mm": self.fit_error,
            "covariance_error_mm": self.covariance_error,
            "form_error_mm": self.form_error,
            "chord_error_mm": self.chord_error,
            "residual_rms_mm": self.residual_rms,
            "residual_max_mm": self.residual_max,
            "points": self.points,
            "triangles": len(self.faces),
            "covered_area_mm2": self.covered_area,
            "coverage": self.coverage,
            "covariance": self.covariance.tolist(),
        }


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GrooveFit(FittedSurface):
    """A concave arc: material outside the radius, mouth to +y."""

    @property
    def shape(self) -> SweptArc:
        """The groove as the contact kernel takes it."""
        return SweptArc(self.radius, self.half_angle, self.length)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CylinderFit(FittedSurface):
    """A convex cylinder: material inside the radius; a full turn (wire, bolt) or an arc (round back)."""

    @property
    def full(self) -> bool:
        """True if the surface goes all the way round."""
        return bool(self.half_angle == np.pi)

    @property
    def shape(self) -> Cylinder:
        """The whole cylinder of this radius and length; for an arc only the covered part is the mesh's surface."""
        return Cylinder(self.radius, self.length)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HoleFit(FittedSurface):
    """A concave cylinder all the way round; ``through`` if both ends are open."""

    through: bool

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists for JSON."""
        return {**super(HoleFit, self).to_dict(), "through": self.through}


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """What was found in a mesh.

    Attributes
    ----------
    mesh : Mesh
        The mesh that was fitted.
    grooves : tuple of GrooveFit
        Concave arcs, largest covered area first.
    cylinders : tuple of CylinderFit
        Convex cylinders and arcs, largest covered area first.
    holes : tuple of HoleFit
        Concave cylinders all the way round, largest covered area first.
    area : float
        Area of the mesh in mm^2.
    notes : tuple of str
        What was repaired, assumed, or not found.
    """

    mesh: Mesh
    grooves: tuple[GrooveFit, ...]
    cylinders: tuple[CylinderFit, ...]
    holes: tuple[HoleFit, ...]
    area: float
    notes: tuple[str, ...]

    @property
    def features(self) -> tuple[FittedSurface, ...]:
        """Grooves, cylinders and holes in this order."""
        return (*self.grooves, *self.cylinders, *self.holes)

    @property
    def feature_area(self) -> float:
        """Area (mm^2) of the triangles that belong to a feature."""
        return float(sum(f.covered_area for f in self.features))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists for JSON; lengths in mm."""
        low, high = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        return {
            "mesh": self.mesh.name,
            "vertices": len(self.mesh.vertices),
            "triangles": len(self.mesh.faces),
            "watertight": self.mesh.watertight,
            "bounds_mm": [low.tolist(), high.tolist()],
            "area_mm2": self.area,
            "feature_area_mm2": self.feature_area,
            **{kind: [f.to_dict() for f in getattr(self, kind)] for kind in ("grooves", "cylinders", "holes")},
            "notes": list(self.notes),
        }


def result_of(mesh: Mesh, surfaces: list[tuple[float, dict[str, Any]]], notes: list[str]) -> FitResult:
    """The features with the sense and the values of ``surfaces``, named."""
    corners = mesh.vertices[mesh.faces]
    grooves: list[GrooveFit] = []
    cylinders: list[CylinderFit] = []
    holes: list[HoleFit] = []
    for sign, values in sorted(surfaces, key=lambda x: -x[1]["covered_area"]):
        if sign > 0:
            cylinders.append(CylinderFit(name=f"C{len(cylinders) + 1}", **values))
        elif values["half_angle"] < np.pi:
            grooves.append(GrooveFit(name=f"G{len(grooves) + 1}", **values))
        else:
            holes.append(HoleFit(name=f"H{len(holes) + 1}", **values, through=_open_ended(corners, values)))
    if not grooves:
        notes = [*notes, "no groove: no concave circular arc found"]
    area = float(normals_and_areas(corners)[1].sum())
    return FitResult(mesh, tuple(grooves), tuple(cylinders), tuple(holes), area, tuple(notes))


def _open_ended(corners: Array, values: dict[str, Any]) -> bool:
    """True if nothing closes either end: from the middle, no face crosses the axis up to a radius past the ends."""
    T, reach = values["T_part_feature"], 0.5 * values["length"] + values["radius"]
    x, y, z = np.moveaxis(to_source(T, corners), -1, 0)
    # A face meets the axis if the origin lies in its projection along z: all three edge functions of one sign.
    e = np.roll(x, -1, axis=1) * np.roll(y, -2, axis=1) - np.roll(y, -1, axis=1) * np.roll(x, -2, axis=1)
    total = e.sum(axis=1)
    hit = ((e >= 0).all(axis=1) | (e <= 0).all(axis=1)) & (total != 0.0)
    z = (e * z).sum(axis=1)[hit] / total[hit]
    return not bool((np.abs(z) <= reach).any())
