"""Exact signed distance of a cylinder or a capsule from a groove, in any pose.

Apart it is the Euclidean distance of the two bodies. In an overlap it is a measure that is continuous through contact,
negative exactly there and cheap to differentiate, what a solver needs; it is not the separating depth (the shortest
translation that frees the bodies), of which it is a lower bound for a cylinder.

- `Cylinder` (flat ends): minus the inset, by how much radius and both ends must shrink alike for the cylinder to come
  free: the greatest depth in the cylinder that a point of the material reaches. Where nothing is left of the cylinder
  before it is free, it falls on with the depth of what was left last: its axis segment, or the middle of a disc.
- `Capsule`: the signed distance of the axis segment from the material minus the radius.
"""

from __future__ import annotations

import functools
import os
from dataclasses import dataclass, field
from enum import IntEnum
from types import ModuleType
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.checks import array, flag, whole
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array, check_pose, check_pose_array
from clamp3d.geometry.primitives import LARGEST, AnyCylinder, Cylinder, SweptArc, check_shapes


class Feature(IntEnum):
    """Part of a groove that a cylinder is nearest to. Seen from +z, M is the lip at -x and N the lip at +x."""

    ARC = 0
    LIP_M = 1
    LIP_N = 2
    FLAT_M = 3
    FLAT_N = 4
    END_FACE = 5
    END_ARC = 6
    END_EDGE_M = 7
    END_EDGE_N = 8
    CORNER_M = 9
    CORNER_N = 10

    def __str__(self) -> str:
        """Name for the user: 'arc', 'lip M', 'flat N', 'end face', ..."""
        words = self.name.lower().split("_")
        return " ".join(word.upper() if word in ("m", "n") else word for word in words)


_FEATURES = tuple(Feature)

VECTOR = (np.float64, 3)
TWIST = (np.float64, 6)
RECORD = np.dtype(
    [
        ("distance", np.float64),
        ("point_on_groove", *VECTOR),
        ("point_on_cylinder", *VECTOR),
        ("normal", *VECTOR),
        ("feature", np.int8),
        ("along", np.float64),
        ("error_bound", np.float64),
        ("axis_inside", np.bool_),
        ("gradient", *TWIST),
    ],
    align=True,
)
"""What the kernel writes: the fields of `SignedDistance` in their order."""
_NO_DISTANCES = np.empty(0)


@dataclass(frozen=True, slots=True)
class SignedDistance:
    """Answer of `signed_distance`; all in the groove's frame, mm.

    Attributes
    ----------
    distance : float
        Positive apart, negative inside.
    point_on_groove, point_on_cylinder : ndarray (3,)
        Nearest points, ``point_on_cylinder = point_on_groove + distance * normal``; of a line of contact its middle.
    normal : ndarray (3,)
        Unit vector from groove to cylinder.
    feature : Feature
        The part of the groove that is nearest.
    along : float
        Where the nearest axis point lies, from the cylinder's middle.
    error_bound : float
        Bound on the rounding error of ``distance``.
    axis_inside : bool
        Whether it lies deeper than the least of its half sizes: the axis of a capsule, or what is left of a cylinder
        when it is shrunk to nothing, enters the material.
    gradient : ndarray (6,)
        Rate of the distance by the cylinder's twist, 3 linear, then 3 angular about the groove's origin: moving it by
        ``v`` mm and ``w`` rad (in the groove's frame) changes the distance by ``gradient @ (v, w)`` to first order. Its
        first half is the normal, but in an overlap a mixture of two where the groove's point is as near to the
        cylinder's side as to its end, or where the deepest point of an axis is as near to a second face. Where several
        places are equally near (``unique`` is False) it is that of the place named; `generalised_gradient` gives all.
    asked : tuple
        Groove, cylinder and pose of the question.
    """

    distance: float
    point_on_groove: Array
    point_on_cylinder: Array
    normal: Array
    feature: Feature
    along: float
    error_bound: float
    axis_inside: bool
    gradient: Array
    asked: tuple[SweptArc, AnyCylinder, Array] = field(repr=False, compare=False)

    @property
    def unique(self) -> bool:
        """Whether one place alone is nearest, so that `gradient` is the derivative; see `generalised_gradient`."""
        from clamp3d.kernel.subgradient import generalised_gradient

        return generalised_gradient(*self.asked).unique


@dataclass(frozen=True, slots=True)
class SignedDistances:
    """Answers of ``signed_distances(..., full=True)``: the fields of ``SignedDistance`` with n in front."""

    distance: Array
    point_on_groove: Array
    point_on_cylinder: Array
    normal: Array
    feature: NDArray[np.int8]
    along: Array
    error_bound: Array
    axis_inside: NDArray[np.bool_]
    gradient: Array


def as_pose(pose: ArrayLike) -> Array:
    """Return ``pose`` as the (4, 4) float64 array the kernel takes (C order, writeable); shape alone is checked."""
    if type(pose) is np.ndarray and pose.dtype == np.float64 and pose.shape == (4, 4) and pose.flags.carray:
        return pose
    return np.require(check_pose(pose), np.float64, ["C", "A", "W"])


def _unit_axes(T: Array) -> Array:
    """Positions and axes (n, 2, 3) that the kernel refused, with axes of length 1. Raises InputError for others."""
    longest = np.abs(T[:, 1]).max(axis=1, keepdims=True)
    sound = np.isfinite(T).all(axis=(1, 2)) & (np.abs(T[:, 0]).sum(axis=1) < LARGEST) & (longest[:, 0] > 0.0)
    if not sound.all():
        k = int(np.argmin(sound))
        rule = f"be a finite position, below {LARGEST:g} mm, and an axis that is not zero"
        raise InputError(f"poses[{k}] must {rule}, got {T[k].tolist()}")
    axis = T[:, 1] / longest
    return np.stack([T[:, 0], axis / np.linalg.norm(axis, axis=1, keepdims=True)], axis=1)


@functools.cache
def kernel() -> ModuleType:
    """The compiled entry points, loaded (or compiled, with a notice on stderr) on first use."""
    from clamp3d.kernel import entries

    return entries


def signed_distance(groove: SweptArc, cylinder: AnyCylinder, pose: ArrayLike) -> SignedDistance:
    """Signed distance of a cylinder or a capsule from a groove, with witnesses.

    Apart it is the distance of the bodies. In an overlap it is minus the inset of a `Cylinder`, and the distance of the
    axis minus the radius for a `Capsule`: both are continuous through contact and neither is the separating depth,
    which `clamp3d.distance` gives. A capsule holds the cylinder of its sizes, so its answer is never the larger one.
    Only the cylinder's position and axis direction matter, so ``pose`` enters as its last column and its third,
    normalised.

    Parameters
    ----------
    groove, cylinder : SweptArc, Cylinder or Capsule
        The two shapes.
    pose : array_like (4, 4)
        ``T_groove_cylinder``, mm; rounding errors are mended as `check_pose` says.

    Returns
    -------
    SignedDistance
        Distance, points and normal in the groove's frame.

    Raises
    ------
    InputError
        For other shapes, or if ``pose`` is not a finite rigid matrix.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.geometry.primitives import Cylinder, SweptArc
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> answer = signed_distance(groove, wire, np.eye(4))
    >>> answer.distance, answer.feature.name
    (1.5, 'ARC')
    """
    if type(groove) is not SweptArc or type(cylinder) is not Cylinder:
        check_shapes(groove, cylinder)
    T = as_pose(pose)
    out = np.empty(1, RECORD)
    half, along, flat = 0.5 * groove.length, 0.5 * cylinder.length, type(cylinder) is Cylinder
    if (
        kernel().measure(
            T[None], groove.radius, groove.half_angle, half, cylinder.radius, along, flat, _NO_DISTANCES, out
        )
        >= 0
    ):
        return signed_distance(groove, cylinder, check_pose(T))
    values: list[Any] = [*out.tolist()[0], (groove, cylinder, T)]
    values[4] = _FEATURES[values[4]]
    return SignedDistance(*values)


@overload
def signed_distances(
    groove: SweptArc,
    cylinder: AnyCylinder,
    poses: ArrayLike,
    *,
    full: Literal[False] = False,
    workers: int | None = None,
) -> Array: ...
@overload
def signed_distances(
    groove: SweptArc, cylinder: AnyCylinder, poses: ArrayLike, *, full: Literal[True], workers: int | None = None
) -> SignedDistances: ...
def signed_distances(
    groove: SweptArc, cylinder: AnyCylinder, poses: ArrayLike, *, full: bool = False, workers: int | None = None
) -> Array | SignedDistances:
    """Signed distances of a cylinder or a capsule from a groove in many poses: the same bits as `signed_distance`.

    A pose may be given as position and axis alone, which is all of it that matters.

    Parameters
    ----------
    groove, cylinder : SweptArc, Cylinder or Capsule
        The two shapes.
    poses : array_like (n, 4, 4) or (n, 2, 3)
        ``T_groove_cylinder``, mm, rounding errors (single precision) mended as `check_pose` says; or, as an
        array, the cylinder's middle and a vector of any length along its axis, in the groove's frame.
    full : bool
        Return all fields, not the distances alone.
    workers : int, optional
        Threads that share the poses; all cores by default.

    Returns
    -------
    ndarray (n,) or SignedDistances
        Distances in mm, or all fields as arrays.

    Raises
    ------
    InputError
        For other shapes; it names the first pose that is not finite and rigid, or the first axis of no length.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.geometry.primitives import Cylinder, SweptArc
    >>> signed_distances(SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0), np.eye(4)[None])
    array([1.5])
    >>> signed_distances(SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0), np.array([[(0, 0, 0), (0, 0, 1)]]))
    array([1.5])
    """
    check_shapes(groove, cylinder)
    flag("full", full)
    axes = isinstance(poses, np.ndarray) and poses.shape[1:] == (2, 3)
    T = array("poses", poses, (None, 2, 3) if axes else (None, 4, 4), finite=False)
    T = np.require(T, np.float64, ["C", "A", "W"])
    if workers is not None:
        workers = whole("workers", workers, least=1)
    out = _measured(groove, cylinder, T, full, workers)
    return SignedDistances(**{name: out[name] for name in RECORD.names or ()}) if full else out


def _measured(groove: SweptArc, cylinder: AnyCylinder, T: Array, full: bool, workers: int | None) -> NDArray[Any]:
    """Distances (n,) or full records of the kernel for poses (n, 4, 4) or (n, 2, 3), shared by threads."""
    from concurrent.futures import ThreadPoolExecutor

    n = len(T)
    half, along, flat = 0.5 * groove.length, 0.5 * cylinder.length, isinstance(cylinder, Cylinder)
    distances, records = np.empty(0 if full else n), np.empty(n if full else 0, RECORD)

    def part(start: int, stop: int) -> bool:
        rows = distances[start:stop], records[start:stop]
        sizes = groove.radius, groove.half_angle, half, cylinder.radius, along
        return int(kernel().measure(T[start:stop], *sizes, flat, *rows)) < 0

    threads = min(workers or os.cpu_count() or 1, max(1, n // 4096))
    cuts = [n * i // threads for i in range(threads + 1)]
    if threads == 1:
        is_done = part(0, n)
    else:
        with ThreadPoolExecutor(threads) as pool:
            is_done = all(pool.map(part, cuts[:-1], cuts[1:]))
    if is_done:
        return records if full else distances
    mended = _unit_axes(T) if T.shape[1] == 2 else check_pose_array(T)
    return _measured(groove, cylinder, mended, full, workers)
