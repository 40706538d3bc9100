"""The methods that are compared, each made ready for the scene: one call for a pose, one for many."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.baselines import ContactModel, contact_model
from clamp3d.bench.compare.scene import BLOCK, GROOVE, PAIR, WIRE, chord_error
from clamp3d.geometry.pose import Array, inverse

if TYPE_CHECKING:
    from clamp3d.clamp.dimensions import Clamp

UNIT_ANGLES_DEG = (1.0, 5.0, 10.0, 20.0, 40.0)
HULL_THRESHOLDS = (0.01, 0.02, 0.05)
"""On CoACD's own scale, as its figures for this block are known."""
MESH_ERRORS = (0.0005, 0.01, 0.05, 0.2)
HULLS_CHORD_DEG = 5.0
"""Chords of the mesh that CoACD is given; finer ones give it more to do and no better hulls."""
CLAMP_THRESHOLD = 2.0
"""mm: hulls of the reference clamp. See `clamp3d.baselines.decomposition`."""

MANY = 100_000
"""Poses in a batch of a method that takes arrays as a whole; the others go through them one by one."""


@dataclass(frozen=True, slots=True)
class Method:
    """A ``family`` ('cas', 'chords', ...) with its ``setting`` in the family's own unit, None if it has none."""

    family: str
    setting: float | None = None

    @property
    def label(self) -> str:
        """The method in words, 'wedges 5 deg'."""
        if self.setting is None:
            return self.family
        return f"{self.family} {self.setting:g} {UNITS.get(self.family, 'deg')}".rstrip()


@dataclass(frozen=True, slots=True)
class Prepared:
    """A method ready to measure poses of the wire in the groove's frame.

    ``one`` takes a pose (4, 4), ``many`` takes poses (n, 4, 4). ``pieces`` counts the convex pieces, triangles or
    chords. ``depth``: a negative value measures the overlap.
    ``elsewhere`` are seconds of the set-up that other processes took (CoACD, also when its answer was cached).
    ``keep`` are objects of a library whose bindings hold bare pointers to them.
    """

    one: Callable[[Array], float]
    many: Callable[[Array], Array]
    pieces: int
    depth: bool = True
    parallel_only: bool = False
    elsewhere: float = 0.0
    keep: object = None


UNITS = {"chords": "deg", "wedges": "deg", "hulls": "", "mesh": "mm"}
"""Of a family's setting; degrees for those not named here."""
METHODS = (
    Method("cas"),
    *(Method("chords", a) for a in UNIT_ANGLES_DEG),
    *(Method("wedges", a) for a in UNIT_ANGLES_DEG),
    *(Method("hulls", t) for t in HULL_THRESHOLDS),
    *(Method("mesh", e) for e in MESH_ERRORS),
)


def load(method: Method) -> None:
    """Import what the method needs, so that its set-up time is its own."""
    own = {"cas": ("clamp3d.kernel.entries",), "chords": ()}
    for module in own.get(method.family, ("fcl", "manifold3d", "scipy.spatial", "trimesh")):
        importlib.import_module(module)


def prepare(method: Method) -> Prepared:
    """Set a method up for the scene of `compare.scene`; everything that can be done before the first pose is done.

    Raises InputError for an unknown method, and what the method itself raises.
    """
    if method.family == "cas":
        return _cas()
    settings = _settings(method)
    if method.family == "hulls":  # on CoACD's own scale
        from clamp3d.baselines.decomposition import NORMALISED

        settings["threshold"] = (method.setting or 0.0) * np.ptp(BLOCK.bounds, axis=0).max() / NORMALISED
        settings["mesh_error"] = chord_error(math.radians(HULLS_CHORD_DEG)) * (1.0 + 1e-9)
    model = contact_model(method.family, {"P1": BLOCK}, **settings, progress=False)

    def many(poses: Array) -> Array:
        return model.distances(PAIR, PAIR.T_a_groove @ poses @ inverse(PAIR.T_b_cylinder))

    def one(pose: Array) -> float:
        return float(many(pose[None])[0])

    many(np.eye(4)[None])
    return Prepared(
        one,
        many,
        _piece_count(model),
        parallel_only=model.name == "chords",
        elsewhere=coacd_seconds(model),
    )


def assembly_model(method: Method, clamp: Clamp) -> ContactModel:
    """The method for the parts of a clamp, set up for all of its grooves; hull thresholds are in mm here."""
    from clamp3d.clamp.parts import groove_pairs, parts

    settings = _settings(method)
    if method.family == "hulls":
        settings |= {"threshold": method.setting, "mesh_error": 0.01}
    model = contact_model(method.family, parts(clamp), **settings, progress=False)
    for groove in groove_pairs(clamp).values():  # models make their pieces on first use
        model.pieces(groove, groove.T_a_groove @ inverse(groove.T_b_cylinder))
    return model


def _cas() -> Prepared:
    from clamp3d.kernel.distance import signed_distance, signed_distances

    return Prepared(
        lambda T: signed_distance(GROOVE, WIRE, T).distance,
        lambda poses: signed_distances(GROOVE, WIRE, poses, workers=1),
        1,
    )


def _settings(method: Method) -> dict[str, Any]:
    """The setting of chords, wedges and mesh as `contact_model` takes it."""
    if method.setting is None:
        return {}
    if method.family in ("chords", "wedges"):
        return {"unit_angle": math.radians(method.setting)}
    return {"mesh_error": method.setting} if method.family == "mesh" else {}


def _piece_count(model: Any) -> int:
    """Chords, wedges, hulls or triangles of the groove's part."""
    if model.name == "chords":
        return int(model.segments([PAIR]))
    shapes = model.polytopes(PAIR.a).shapes
    return len(shapes[0].solid.faces) if model.name == "mesh" else len(shapes)


def coacd_seconds(model: Any) -> float:
    """Seconds that CoACD took in processes of its own, also when its answer was cached."""
    return sum(each.seconds for each in model.decompositions.values()) if model.name == "hulls" else 0.0


ANGLES_DEG = (1.0, 5.0, 20.0)
"""Unit angles of the pieces, degrees."""
SECTOR_ANGLES_DEG = (0.1, 1.0, 5.0)
"""Of pieces that are looked up: their number costs nothing."""
AXIS_ANGLES_DEG = (0.01, 0.1, *ANGLES_DEG)
"""Piece angles (deg) of a surface that is measured against an axis: the number of its triangles costs little."""


@dataclass(frozen=True, slots=True)
class Series:
    """One way to use a library: ``make`` takes the unit angle in rad, ``package`` is what pip installs, ``needs`` are
    modules to import first, ``angles`` the settings in degrees (None: there is none).
    """

    make: Callable[[float], Prepared]
    package: str
    needs: tuple[str, ...]
    angles: tuple[float | None, ...] = ANGLES_DEG


def ready(one: Callable[[Array], float], pieces: int, *, depth: bool, keep: object = None) -> Prepared:
    """A method that is called pose by pose; called once here, for what it makes on first use."""

    def many(poses: Array) -> Array:
        return np.array([one(T) for T in poses])

    many(np.eye(4)[None])
    return Prepared(one, many, pieces, depth=depth, keep=keep)
