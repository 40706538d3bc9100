"""The review set of the reference clamp: STEP and GLB of its final state, an STL per part in its own frame.

With --check nothing is written: the set is built again and compared, byte for byte where the libraries that built it
are the installed ones, else by names, boxes, volumes and poses.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from clamp3d.clamp.assemble import assemble
from clamp3d.output.export import export

MESHES = Path(__file__).resolve().parent.parent / "meshes"
MESH_ERROR = 0.01
TOLERANCE = 1e-6  # mm, and mm^3 per mm^3


def build(folder: Path, formats: list[str]) -> None:
    """Write the set into ``folder``."""
    os.environ["SOURCE_DATE_EPOCH"] = "0"
    assembly = assemble("reference")
    for format in formats:
        # STL: every part in its own frame.
        export(assembly.clamp if format == "stl" else assembly, folder, format=format, mesh_error=MESH_ERROR)


def check(formats: list[str]) -> list[str]:
    """What differs between meshes/ and a new build, one line each."""
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        build(Path(folder), formats)
        for format in formats:
            name = f"manifest-{format}.json"
            if not (MESHES / name).is_file():
                faults.append(f"{name} is missing")
                continue
            old, new = (json.loads((place / name).read_text()) for place in (MESHES, Path(folder)))
            for file, entry in old["files"].items():
                content = (MESHES / file).read_bytes() if (MESHES / file).is_file() else b""
                if hashlib.sha256(content).hexdigest() != entry["sha256"]:
                    faults.append(f"{file} is missing or is not the file that {name} describes")
            if old["libraries"] == new["libraries"]:
                if old != new:
                    faults.append(f"{name}: a new build differs: {_difference(old, new)}")
            else:
                for manifest in (old, new):
                    del manifest["libraries"]
                    for entry in manifest["files"].values():
                        del entry["bytes"], entry["sha256"]
                    for part in manifest["parts"].values():
                        part.pop("triangles", None)
                difference = _difference(old, new)
                if difference:
                    faults.append(f"{name}: a new build with other libraries differs: {difference}")
                else:
                    print(f"{name}: built with other libraries; geometry compared, not bytes", file=sys.stderr)
    return faults


def _difference(a: Any, b: Any, path: str = "") -> str:
    """The first place where two JSON values differ by more than `TOLERANCE`; empty if none does."""
    if isinstance(a, dict) and isinstance(b, dict) and a.keys() == b.keys():
        return next((d for key in a if (d := _difference(a[key], b[key], f"{path}.{key}"))), "")
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return next(
            (d for i, (x, y) in enumerate(zip(a, b, strict=True)) if (d := _difference(x, y, f"{path}[{i}]"))), ""
        )
    if isinstance(a, float) and isinstance(b, float) and abs(a - b) <= TOLERANCE * max(1.0, abs(a)):
        return ""
    return "" if a == b else f"{path.lstrip('.')}: {a!r} became {b!r}"


def main() -> int:
    """Exit code 0, or 1 if the set is not what a new build gives."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, compare")
    arguments = parser.parse_args()
    formats = ["stl", "glb"]
    if importlib.util.find_spec("OCP") is not None:
        formats.append("step")
    elif arguments.check:
        print("STEP not checked: Open CASCADE (extra step) is not installed", file=sys.stderr)
    else:
        print("the set has a STEP file: install the extra step first", file=sys.stderr)
        return 2
    if not arguments.check:
        build(MESHES, formats)
        return 0
    faults = check(formats)
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
