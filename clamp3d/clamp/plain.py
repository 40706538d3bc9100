"""Dataclasses as plain data for JSON."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def plain(item: Any, **names: str) -> dict[str, Any]:
    """Fields of a dataclass as data for JSON; ``names`` are the keys of fields that are not called the same there.

    A field whose key ends in ``_deg`` is an angle in rad.
    """
    values = {names.get(f.name, f.name): _plain_value(getattr(item, f.name)) for f in fields(item)}
    return {key: math.degrees(value) if key.endswith("_deg") else value for key, value in values.items()}


def _plain_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [_plain_value(part) for part in value]
    if is_dataclass(value):
        return value.to_dict() if hasattr(value, "to_dict") else plain(value)
    return value
