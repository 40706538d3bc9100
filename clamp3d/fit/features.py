"""What a fit finds: grooves, cylinders and holes, each with the error that later distances inherit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import Cylinder, SweptArc


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
