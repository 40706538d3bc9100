"""Dimensions of a parallel groove clamp: frozen dataclasses whose values are checked.

Lengths in mm; angles in degrees where a name ends in ``_deg`` (this is what the user types), properties give radians.
Section frame of the paper: x right, y down, so "depth" and "below" are along +y.
"""

from __future__ import annotations

import itertools
import math
from typing import Annotated, Literal, TypeAlias

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from clamp3d.clamp.conductors import conductor
from clamp3d.errors import InputError
from clamp3d.validation import checked

SMALLEST = 1e-6
"""Least length in mm: ratios of lengths stay within what a picture, a file and a turn of a nut can hold."""


Length = Annotated[float, Meta(ge=SMALLEST, lt=1e5)]
Offset = Annotated[float, Meta(gt=-1e5, lt=1e5)]
Load = Annotated[float, Meta(gt=0.0, lt=1e9)]
ClampPart = Literal["P1", "P2", "P3", "P4", "P5", "P6", "P7"]
"""Names of a clamp's parts, as files may give them."""
PartName: TypeAlias = str
ConnectionType = Literal[0, 1, 2, 3]

PARTS: tuple[PartName, ...] = ("P1", "P2", "P3", "P4", "P5", "P6", "P7")
TITLES: dict[PartName, str] = {
    "P1": "up splint",
    "P2": "down splint",
    "P3": "saddle washer",
    "P4": "bolt",
    "P5": "nut",
    "P6": "power line",
    "P7": "jumper",
}
TYPES: dict[ConnectionType, str] = {
    0: "no connection",
    1: "screw joint",
    2: "convex object collision",
    3: "concave arc surface collision",
}
"""Eq. 1 of the paper."""
Pair = tuple[PartName, PartName]
PAIRS: tuple[Pair, ...] = tuple(itertools.combinations(PARTS, 2))
"""All pairs of parts, in the order of the matrix."""
TOUCHING = 1e-6
"""Gap or overlap in mm up to which two parts of a clamp touch: a thousand times what a proof leaves."""


@checked
class Wire:
    """A conductor, by catalogue name or by ``diameter``; exactly one of the two. Raises InputError if it is unknown."""

    conductor: str | None = None
    diameter: Length | None = None

    def __post_init__(self) -> None:
        one = (self.conductor is None) != (self.diameter is None)
        _rule(one, "conductor or diameter: give one of them, not both")
        check_conductor(self.conductor)

    @property
    def radius(self) -> float:
        """Radius over all strands in mm."""
        return 0.5 * (conductor(self.conductor).diameter if self.conductor is not None else float(self.diameter or 0.0))

    @property
    def label(self) -> str:
        """Catalogue name, or the diameter where there is none."""
        return self.conductor or f"diameter {self.diameter:g} mm"


@checked
class GrooveDimensions:
    """A groove's arc: its centre lies ``offset`` beside the bolt axis and ``centre_depth`` below the part's origin."""

    radius: Length
    offset: Length
    centre_depth: Offset


@checked
class UpSplint:
    """P1: a plate with its two grooves underneath. Origin: its top left corner."""

    width: Length
    length: Length
    thickness: Length
    hole_diameter: Length
    line_groove: GrooveDimensions
    jumper_groove: GrooveDimensions

    def half_angle(self, groove: GrooveDimensions) -> float:
        """Half angle of a groove's arc in rad: it ends on the inner face."""
        return math.acos((groove.centre_depth - self.thickness) / groove.radius)

    def __post_init__(self) -> None:
        for key in ("line_groove", "jumper_groove"):
            groove: GrooveDimensions = getattr(self, key)
            _check_groove(key, groove, groove.centre_depth - self.thickness, self.width / 2, self.hole_diameter / 2)
            left = groove.centre_depth - groove.radius
            _rule(left > 0.0, f"{key}: the arc cuts the top face: centre_depth - radius must be > 0 mm, got {left:.4g}")


@checked
class DownSplint:
    """P2: grooves on top, a round back that tilts in the saddle. Origin: centre of the round back."""

    width: Length
    length: Length
    face_depth: Length
    back_radius: Length
    back_half_angle_deg: Annotated[float, Meta(gt=0.0, lt=90.0)]
    slot_width: Length
    slot_length: Length
    max_tilt_deg: Annotated[float, Meta(gt=0.0, lt=45.0)] | None = None
    line_groove: GrooveDimensions
    jumper_groove: GrooveDimensions

    @property
    def underside_depth(self) -> float:
        """Flat underside below the origin, where the round back ends; mm."""
        return self.back_radius * math.cos(math.radians(self.back_half_angle_deg))

    @property
    def slot_bottom(self) -> float:
        """Where the slot's walls come out of the round back, or of the underside beside it, below the origin; mm."""
        return math.sqrt(max(self.back_radius**2 - (self.slot_width / 2) ** 2, self.underside_depth**2))

    def half_angle(self, groove: GrooveDimensions) -> float:
        """Half angle of a groove's arc in rad: it ends on the inner face."""
        return math.acos((self.face_depth - groove.centre_depth) / groove.radius)

    def __post_init__(self) -> None:
        _rule(
            self.face_depth < self.underside_depth,
            f"face_depth must be above the flat underside (back_radius cos back_half_angle = "
            f"{self.underside_depth:.4g} mm), got {self.face_depth:g}",
        )
        _rule(
            self.width >= 2 * self.back_radius * math.sin(math.radians(self.back_half_angle_deg)),
            f"width must be >= the round back's, 2 back_radius sin back_half_angle, got {self.width:g}",
        )
        for key in ("line_groove", "jumper_groove"):
            groove: GrooveDimensions = getattr(self, key)
            _check_groove(key, groove, self.face_depth - groove.centre_depth, self.width / 2, self.slot_width / 2)
            _rule(
                groove.centre_depth + groove.radius < self.underside_depth,
                f"{key}: the arc cuts the underside: centre_depth + radius must be < "
                f"{self.underside_depth:.4g} mm, got {groove.centre_depth + groove.radius:.4g}",
            )


@checked
class Saddle:
    """P3: saddle washer under the round back. Origin: centre of its concave arc."""

    radius: Length
    width: Length
    length: Length
    apex_thickness: Length
    hole_diameter: Length

    @property
    def half_angle(self) -> float:
        """Half angle of the concave arc in rad."""
        return math.asin(self.width / 2 / self.radius)

    def __post_init__(self) -> None:
        _rule(self.width < 2 * self.radius, f"width must be < 2 radius = {2 * self.radius:g} mm, got {self.width:g}")
        hole = self.hole_diameter
        _rule(hole < self.width, f"hole_diameter must be < width = {self.width:g} mm, got {hole:g}")


@checked
class Bolt:
    """P4: hexagon bolt, head below the saddle. Origin: its free (upper) end."""

    diameter: Length
    pitch: Length
    shank_length: Length
    head_across_flats: Length
    head_height: Length

    def turn(self, travel: float) -> float:
        """Turn of the nut in rad that moves it by ``travel`` mm: the thread has a single start.

        >>> bolt = Bolt(diameter=20.0, pitch=2.5, shank_length=160.0, head_across_flats=30.0, head_height=12.5)
        >>> round(math.degrees(bolt.turn(1 / 3)), 9)
        48.0
        """
        return 2.0 * math.pi * travel / self.pitch


@checked
class Nut:
    """P5: hexagon nut and washers together, on the up splint. Origin: its free (upper) face."""

    across_flats: Length
    height: Length


@checked
class Joints:
    """Whether parts use their sideways play: the bolt in the up splint's ``hole``, the down splint's round back in the
    ``saddle``, the saddle ``washer`` on the bolt. The paper holds the down splint on the bolt's axis: none of it."""

    hole: bool = False
    saddle: bool = False
    washer: bool = False


@checked
class Limits:
    """What a tightening is measured by, where it is given: the most ``bolt_force`` in N, the most ``line_load`` on a
    wire in N/mm, and the ``wire_pull`` in N that each wire must hold lengthwise."""

    bolt_force: Load | None = None
    line_load: Load | None = None
    wire_pull: Load | None = None


@checked
class Clamp:
    """A parallel groove clamp with its two wires, connection matrix and assembly sequence."""

    name: str
    description: str = ""
    unit: Literal["mm"]
    sequence: str
    line: Wire
    jumper: Wire
    up_splint: UpSplint
    down_splint: DownSplint
    saddle: Saddle
    bolt: Bolt
    nut: Nut
    joints: Joints = Joints()
    limits: Limits = Limits()
    connections: dict[ClampPart, dict[ClampPart, ConnectionType]]

    @property
    def wire_length(self) -> float:
        """Length of wire that is shown and measured: the splints are well inside it (three times their length)."""
        return 3.0 * max(self.up_splint.length, self.down_splint.length)

    @property
    def back_clearance(self) -> float:
        """Distance of the two arc centres when the round back rests in the saddle's apex; mm."""
        return self.saddle.radius - self.down_splint.back_radius

    @property
    def _saddle_edge(self) -> tuple[float, float]:
        """The saddle's edge as seen from the back's centre, when the back rests in the apex: distance in mm, angle."""
        x, y = self.saddle.width / 2, self.saddle.radius * math.cos(self.saddle.half_angle) - self.back_clearance
        return math.hypot(x, y), math.atan2(x, y)

    @property
    def tilt_stops(self) -> dict[str, float]:
        """Tilts in rad at which the bodies stop the down splint, centred over the bolt."""
        down, r = self.down_splint, self.bolt.diameter / 2
        distance, angle = self._saddle_edge
        half, depth = down.slot_width / 2, down.slot_bottom
        return {
            # The flat underside comes down on the saddle's edge.
            "the saddle's edge": math.acos(min(1.0, down.underside_depth / distance)) - angle,
            # A lower corner of the slot meets the upright shank, before an upper one: half cos t - depth sin t = r.
            "the slot": math.acos(r / math.hypot(half, depth)) - math.atan2(depth, half),
        }

    def lifted(self, tilt: NDArray[np.float64]) -> NDArray[np.float64]:
        """How high (n,) over the saddle's apex the saddle's edges hold the centred down splint at a tilt (n,); mm."""
        distance, angle = self._saddle_edge
        half, under = self.saddle.width / 2, self.down_splint.underside_depth
        raised = (under + half * np.abs(np.sin(tilt))) / np.cos(tilt) - distance * math.cos(angle)
        return np.maximum(0.0, raised)

    @property
    def tilt_stop(self) -> float:
        """Tilt in rad, either way, at which the bodies stop the down splint when it is centred over the bolt.

        >>> from clamp3d.clamp.loader import load_clamp
        >>> clamp = load_clamp()
        >>> round(math.degrees(clamp.tilt_stop), 3), clamp.tilt_stopped_by
        (12.99, "the saddle's edge")
        """
        return min(self.tilt_stops.values())

    @property
    def tilt_stopped_by(self) -> str:
        """What stops the tilt: "the saddle's edge" or "the slot"."""
        return min(self.tilt_stops, key=self.tilt_stops.__getitem__)

    def connection(self, a: PartName, b: PartName) -> ConnectionType:
        """Entry c_ij of the connection matrix (Eq. 1 and Table 1 of the paper), symmetric."""
        entries = ((first, *entry) for first, row in self.connections.items() for entry in row.items())
        return next((kind for first, second, kind in entries if {first, second} == {a, b}), 0)

    def __post_init__(self) -> None:
        down = self.down_splint
        for key, wire in (("line", self.line), ("jumper", self.jumper)):
            _rule(
                wire.radius < self.up_splint.width,
                f"{key}: the diameter must be < {2.0 * self.up_splint.width:g} mm, twice up_splint.width, "
                f"got {2.0 * wire.radius:g}; are both in mm?",
            )
        bolt = ("bolt.diameter", self.bolt.diameter)
        for key, value, (other, least) in (
            ("up_splint.hole_diameter", self.up_splint.hole_diameter, bolt),
            ("saddle.hole_diameter", self.saddle.hole_diameter, bolt),
            ("down_splint.slot_length", down.slot_length, bolt),
            ("nut.across_flats", self.nut.across_flats, bolt),
            ("down_splint.slot_width", down.slot_width, bolt),
            ("saddle.radius", self.saddle.radius, ("down_splint.back_radius", down.back_radius)),
        ):
            _rule(value > least, f"{key} must be > {other} = {least:g} mm, got {value:g}")
        reach = math.degrees(self._saddle_edge[1])
        _rule(
            down.back_half_angle_deg >= reach,
            f"down_splint.back_half_angle_deg must be >= {reach:.4g} (the saddle's edge), "
            f"got {down.back_half_angle_deg:g}",
        )
        if down.max_tilt_deg is not None:
            stop = math.degrees(self.tilt_stop)
            _rule(
                down.max_tilt_deg <= stop,
                f"down_splint.max_tilt_deg must be <= {stop:.4g}, where {self.tilt_stopped_by} stops the tilt, "
                f"got {down.max_tilt_deg:g}",
            )
        for a, row in self.connections.items():
            for b in row:
                _rule(a < b, f"connections.{a}.{b}: the matrix is given above its diagonal, write it as {b}.{a}")


def check_conductor(name: str | None) -> None:
    """Raise ValueError for a name that the catalogue does not hold."""
    try:
        if name is not None:
            conductor(name)
    except InputError as error:
        raise ValueError(f"conductor: {error}") from None


def _rule(holds: bool, message: str) -> None:
    """Raise ValueError, which is reported with the place in the file, unless a rule holds."""
    if not holds:
        raise ValueError(message)


def _check_groove(
    key: str, groove: GrooveDimensions, centre_to_face: float, half_width: float, half_hole: float
) -> None:
    """Raise ValueError unless the arc reaches the inner face and its mouth lies between hole and edge."""
    _rule(
        abs(centre_to_face) < groove.radius,
        f"{key}: the arc does not reach its face: the centre must be less than radius = "
        f"{groove.radius:g} mm from the inner face, got {abs(centre_to_face):.4g}",
    )
    half_mouth = math.sqrt(groove.radius**2 - centre_to_face**2) if centre_to_face > 0 else groove.radius
    highest, least = half_width - half_mouth, half_hole + half_mouth
    _rule(
        groove.offset + half_mouth <= half_width,
        f"{key}: the arc leaves the splint at its edge: offset must be <= {highest:.4g} mm, got {groove.offset:g}",
    )
    _rule(
        groove.offset - half_mouth >= half_hole,
        f"{key}: the arc meets the bolt hole: offset must be >= {least:.4g} mm, got {groove.offset:g}",
    )
