"""What the CAS-CD paper prints: its tables as data, nothing computed.

Xin Shi and Li Tian, "Application of the Concave Arc Surface Collision Detection method to Virtual Assembly".
Section frame: mm, x right, y down, relative to the power line P6; angles counter-clockwise as seen, in degrees.
"""

from __future__ import annotations

from clamp3d.clamp.dimensions import ConnectionType, PartName

TABLE_1: dict[tuple[PartName, PartName], ConnectionType] = {
    ("P1", "P4"): 2,
    ("P1", "P5"): 2,
    ("P1", "P6"): 3,
    ("P1", "P7"): 3,
    ("P2", "P3"): 3,
    ("P2", "P4"): 2,
    ("P2", "P6"): 3,
    ("P2", "P7"): 3,
    ("P3", "P4"): 2,
    ("P4", "P5"): 1,
}
"""Connection matrix, entries that are not 0."""

TABLE_3 = ("inside", "outside", "intersect", "exterior contact", "interior contact")

ACTUAL_DISTANCE = 31.630
CAS_DISTANCE = 31.530
CHORD_DISTANCES: dict[float, float] = {1.0: 31.863, 5.0: 31.863, 10.0: 31.863, 20.0: 32.196, 40.0: 32.863}
"""Table 4, convex partitioning: unit angle in degrees -> distance between the splints in mm."""
IMAGE_DISTANCES = (32.534, 33.672, 29.147, 32.450, 32.619)

FINAL_STATE: dict[PartName, tuple[float, float, float]] = {
    "P1": (-23.328, -41.374, 0.0),
    "P2": (45.172, -20.374, 12.0),
    "P3": (45.172, -21.604, 0.0),
    "P4": (45.172, -120.184, 0.0),
    "P5": (45.172, -67.774, 0.0),
    "P7": (94.969, -9.260, 0.0),
}
"""The six matrices of Section 4.1: x, y and angle (cos 0.978, sin 0.208 is 12 degrees)."""

TABLE_5 = {"cas": ("M(n)", "C(1)", "M(n^a) C(b)"), "chords": ("M(mn)", "C(m)", "M(4 m^(a-1) n^a) C(bm)")}
"""Part motion, collision detection, time complexity: n steps, m segments, a moving parts, b grooves."""
