"""What a contact model is: a way to measure the gap between a groove and the cylinder that lies in it."""

from __future__ import annotations

import math

import numpy as np

from clamp3d.checks import array, instance, number, shown
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array, check_pose, check_pose_array
from clamp3d.geometry.primitives import LARGEST
from clamp3d.kernel.contact_model import ContactModel as ContactModel
from clamp3d.kernel.contact_model import GroovePair
from clamp3d.kernel.contact_model import Pieces as Pieces

FINEST_DEG = 0.01
"""Smallest angle of a chord: a full circle then has 36 000."""


def check_model(model: object) -> None:
    """Raise InputError unless ``model`` can answer as a `ContactModel`; a class in place of a model cannot."""
    answers = all(callable(getattr(model, name, None)) for name in ("pieces", "distances"))
    if isinstance(model, type) or not answers:
        raise InputError(f"model must be a contact model, got {shown(model)}")


def check_unit_angle(unit_angle: object) -> float:
    """The angle of a chord in rad as a float. Raises InputError unless it is from 0.01 deg to less than 180 deg."""
    rule = "unit angle must be between 0 and 180 deg"
    value = number("unit angle", unit_angle, rule=rule.removeprefix("unit angle must "))
    if not 0.0 < value < math.pi:
        raise InputError(f"{rule}, got {math.degrees(value):g}")
    if math.degrees(value) < FINEST_DEG:
        raise InputError(f"unit angle must be >= {FINEST_DEG:g} deg, got {math.degrees(value):g}")
    return value


def pose_of(pair: GroovePair, T_a_b: Array) -> Array:
    """``T_a_b`` as the (4, 4) array of moderate numbers that `ContactModel.pieces` works on, rigid or not.

    Raises InputError for any other, and for a pair that is none. Quick: solvers ask thousands of times.
    """
    if type(pair) is not GroovePair:
        instance("pair", pair, GroovePair)
    T = T_a_b
    if not (type(T) is np.ndarray and T.dtype == np.float64 and T.shape == (4, 4)):
        T = array("T_a_b", T_a_b, (4, 4), finite=False)
    if not np.vdot(T, T) < LARGEST**2:  # NaN, infinite, or too large to be multiplied
        check_pose(T, "T_a_b")
        raise InputError(f"T_a_b must have an offset up to {LARGEST:g} mm, got {shown(T[:3, 3])}")
    return T


def poses_of(pair: GroovePair, T_a_b: Array) -> Array:
    """``T_a_b`` as the (n, 4, 4) array that `ContactModel.distances` works on, checked by `check_pose_array`."""
    instance("pair", pair, GroovePair)
    return check_pose_array(T_a_b, "T_a_b")
