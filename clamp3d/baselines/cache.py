"""Content-addressed cache on disk of files of arrays; input/output errors count as a miss."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray


def cache_dir() -> Path:
    """Folder of the cache: $CLAMP3D_CACHE, else the platform's place for caches ($XDG_CACHE_HOME/clamp3d on Linux)."""
    own = os.environ.get("CLAMP3D_CACHE")
    return Path(own).expanduser() if own else platformdirs.user_cache_path("clamp3d", appauthor=False)


def load(key: str) -> dict[str, NDArray[Any]] | None:
    """Arrays of the file kept under ``key``; None if there is none or it is damaged."""
    try:
        with np.load(cache_dir() / f"{key}.npz", allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except Exception:  # no file; what is damaged can raise anything
        return None


def keep(key: str, arrays: dict[str, NDArray[Any]]) -> None:
    """Keep a file of arrays whole or not at all; a cache that cannot be written is no error."""
    with contextlib.suppress(OSError):
        cache_dir().mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache_dir(), prefix=".part-") as folder:
            part = Path(folder, "part.npz")
            np.savez(part, allow_pickle=False, **arrays)
            os.replace(part, cache_dir() / f"{key}.npz")
