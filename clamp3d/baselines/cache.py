"""A small cache on disk: arrays and a note under a name made from their content. It never fails its caller."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_BROKEN = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


def cache_dir() -> Path:
    """Folder of the cache: $CLAMP3D_CACHE, else $XDG_CACHE_HOME/clamp3d, else the platform's place for caches."""
    own = os.environ.get("CLAMP3D_CACHE")
    if own:
        return Path(own).expanduser()
    base = os.environ.get("XDG_CACHE_HOME")
    if base:
        return Path(base) / "clamp3d"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "clamp3d" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "clamp3d"
    return Path.home() / ".cache" / "clamp3d"


def load(key: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
    """Arrays and note stored under ``key``; None if there are none or the file is damaged."""
    try:
        with np.load(_path(key), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        note = json.loads(str(arrays.pop("note")))
    except _BROKEN:
        return None
    return (arrays, note) if isinstance(note, dict) else None


def store(key: str, arrays: Mapping[str, NDArray[Any]], note: Mapping[str, Any]) -> None:
    """Write arrays and note whole or not at all; a cache that cannot be written is no error."""
    temporary = None
    try:
        path = _path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, note=np.array(json.dumps(dict(note))), **arrays)  # type: ignore[arg-type]
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
