"""Calls of everything public, most with one or two bad arguments; what answers is held to being finite and right."""

from __future__ import annotations

import dataclasses
import inspect
import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import clamp3d
from clamp3d.errors import Clamp3dError
from tests.fuzz.api_targets import groups
from tests.fuzz.cli_calls import FindingError
from tests.fuzz.values import ANYTHING, Draw, near, pick

_INFINITE = {"curvature", "gap_left", "gap_right", "gap", "high", "least", "lower", "opening", "upper", "uncertainty"}
"""Fields whose documented value is infinite where there is none."""


def make(draw: Draw, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A call, with none to three of its arguments spoilt."""
    group = groups()[draw(st.sampled_from([k for k, (weight, _) in enumerate(groups()) for _ in range(weight)]))][1]
    name = pick(draw, *group)
    function, given = group[name]
    known = inspect.signature(function).parameters.values()
    defaults = {p.name: p.default for p in known if p.default is not p.empty}
    others = [] if any(p.kind is p.VAR_KEYWORD for p in known) else ["extra"]
    arguments = {**defaults, **given}
    for key, value in arguments.items():
        arguments[key] = draw(value) if isinstance(value, st.SearchStrategy) else value
    for key in draw(
        st.lists(st.sampled_from([*(key for key in arguments if key != "self"), *others] or ["extra"]), max_size=3)
    ):
        way = draw(st.integers(0, 29))
        if way == 29:
            arguments.pop(key, None)
        elif way < 10 and isinstance(arguments.get(key), float):
            arguments[key] = near(draw, arguments[key])
        else:
            arguments[key] = draw(ANYTHING)
        if key == "progress" and callable(arguments.get(key)):  # what a user's own function raises is theirs
            arguments[key] = None
    if any(isinstance(value, str) and value == "box.stl" for value in arguments.values()):
        import trimesh

        trimesh.creation.box((10.0, 8.0, 6.0)).export(folder / "box.stl")
    text = f"{name}({', '.join(f'{k}={v!r}'[:300] for k, v in arguments.items())})"

    def ask() -> bool:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            try:
                result = function(**arguments)
            except Clamp3dError as error:
                _clear(error)
                return False
            except TypeError as error:
                if error.__traceback__ is not None and error.__traceback__.tb_next is None:
                    return False  # a missing or an unknown argument: raised by the call itself
                raise
            finite(result, name)
            _right(name, arguments, result)
        return True

    return text, ask


def _clear(error: Clamp3dError) -> None:
    message = str(error)
    if not message.strip() or "\n" in message or len(message) > 1000:
        raise FindingError(f"message is not one clear line: {message[:300]!r}")


def finite(value: Any, where: str, depth: int = 0) -> None:
    """Raise FindingError for a NaN anywhere in an answer, and an infinity where none is documented."""
    if depth > 6 or isinstance(value, (str, bytes, type)) or value is None:
        return
    if (isinstance(value, np.ndarray) and value.dtype.kind == "f") or isinstance(value, (float, np.floating)):
        allowed = where.rsplit(".", 1)[-1] in _INFINITE
        bad = np.isnan(value) if allowed else ~np.isfinite(value)
        if np.any(bad):
            raise FindingError(f"{where} is not finite: {np.asarray(value).tolist() if np.size(value) < 20 else '...'}")
    elif isinstance(value, Mapping):
        for key, item in value.items():
            finite(item, f"{where}[{key!r}]", depth + 1)
    elif isinstance(value, (list, tuple)):
        for item in value:
            finite(item, where, depth + 1)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            finite(getattr(value, field.name), f"{where}.{field.name}", depth + 1)


def _right(name: str, arguments: dict[str, Any], result: Any) -> None:
    """Checks of answers where one is at hand: plain float64 inputs must give the same."""
    if name in ("signed_distance", "groove_pieces") and "pose" in arguments:
        plain = np.array(arguments["pose"], dtype=np.float64)
        if _off(plain) > 2e-4:
            raise FindingError(f"answered for a pose that is not rigid by {_off(plain):.3g}")
        groove, wire = arguments["groove"], arguments["cylinder"]
        again = clamp3d.kernel.signed_distance(groove, wire, plain)
        if name == "signed_distance" and again.distance != result.distance:
            raise FindingError(f"distance {result.distance!r}, for the same numbers in float64 {again.distance!r}")
        if name == "signed_distance":
            gap = result.point_on_groove + result.distance * result.normal - result.point_on_cylinder
            scale = max(1.0, float(np.abs(plain[:3, 3]).max()), wire.length, groove.length, groove.radius, wire.radius)
            if not np.abs(gap).max() <= 1e-9 * scale or not abs(np.linalg.norm(result.normal) - 1.0) < 1e-9:
                raise FindingError(f"witness points do not fit the distance: {gap.tolist()}")
    elif name == "signed_distances" and "poses" in arguments:
        plain = np.array(arguments["poses"], dtype=np.float64)
        found = result.distance if arguments.get("full") else result
        if len(found) != len(plain):
            raise FindingError(f"{len(found)} answers for {len(plain)} poses")
        for k in range(0, len(plain), max(1, len(plain) // 3)):
            if _off(plain[k]) > 2e-4:
                raise FindingError(f"answered for a pose that is not rigid by {_off(plain[k]):.3g}")
            one = clamp3d.kernel.signed_distance(arguments["groove"], arguments["cylinder"], plain[k])
            if one.distance != found[k]:
                raise FindingError(f"poses[{k}]: {found[k]!r} in the batch, {one.distance!r} alone")
    elif name in ("check_pose", "relative_pose") and _off(result) > 1e-8:
        raise FindingError(f"the result is not rigid by {_off(result):.3g}")
    elif name in ("SweptArc", "Cylinder", "Capsule"):
        for field in dataclasses.fields(result):
            if type(getattr(result, field.name)) is not float:
                raise FindingError(f"{field.name} is kept as {type(getattr(result, field.name)).__name__}")


def _off(T: np.ndarray) -> float:
    R = T[:3, :3]
    off = float(np.abs(R @ R.T - np.eye(3)).max())
    return off if np.linalg.det(R) > 0.0 else math.inf
