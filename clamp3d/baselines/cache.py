"""Content-addressed cache on disk of arrays with metadata; I/O errors count as a miss."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray


def cache_dir() -> Path:
    """Folder of the cache: $CLAMP3D_CACHE, else the platform's place for caches ($XDG_CACHE_HOME/clamp3d on Linux)."""
    own = os.environ.get("CLAMP3D_CACHE")
    return Path(own).expanduser() if own else platformdirs.user_cache_path("clamp3d", appauthor=False)


def load(key: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
    """Arrays and metadata stored under ``key``; None if there are none or the file is damaged."""
    try:
        with np.load(_path(key), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        metadata = json.loads(str(arrays.pop("note")))
    except Exception:  # no file; what is damaged can raise anything
        return None
    return (arrays, metadata) if isinstance(metadata, dict) else None


def store(key: str, arrays: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]) -> None:
    """Write arrays and metadata whole or not at all; a cache that cannot be written is no error."""
    temporary = None
    try:
        path = _path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, note=np.array(json.dumps(dict(metadata))), **arrays)  # type: ignore[arg-type]
        os.replace(temporary, path)
        temporary = None
    except OSError:
        pass
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def _path(key: str) -> Path:
    return cache_dir() / f"{key}.npz"
