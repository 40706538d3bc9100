"""Mesh files in every format, spoilt: cut, bits flipped, wrong counts, bad numbers, open, inside out, empty, bombs."""

from __future__ import annotations

import functools
import io
import json
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz import garbage
from tests.fuzz.cli_calls import call, check_outputs, some_old
from tests.fuzz.runner import FindingError

_MODEL = b"<?xml version='1.0'?><model xmlns='http://schemas.microsoft.com/3dmanufacturing/core/2015/02'"
FORMATS = ("stl", "obj", "ply", "glb", "3mf")


@functools.cache
def _block() -> Any:
    """A block with a groove of radius 7, 16 chords."""
    from clamp3d.core import shapes
    from clamp3d.core.meshing import mesh
    from clamp3d.core.primitives import SweptArc

    return mesh(shapes.groove_block(SweptArc(7.0, 1.0, 30.0), 30.0, 15.0), 0.05)


def _export(mesh: Any, form: str) -> bytes:
    """A mesh as a file of a format, as other programs write it."""
    import trimesh

    ascii_form = form.startswith("ascii.")
    kind = form.removeprefix("ascii.")
    if ascii_form and kind == "stl":
        out = trimesh.exchange.stl.export_stl_ascii(mesh)
    elif ascii_form and kind == "ply":
        out = trimesh.exchange.ply.export_ply(mesh, encoding="ascii")
    else:
        out = mesh.export(file_type=kind)
    return out.encode() if isinstance(out, str) else bytes(out)


def make(rng: np.random.Generator, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A mesh file in ``folder`` and the command that reads it."""
    form = str(garbage.pick(rng, (*FORMATS, "ascii.stl", "ascii.ply", "stl", "stl")))
    whole = False
    way = rng.integers(12)
    if way <= 2:
        what, content = garbage.spoil_bytes(rng, _good(form))
    elif way <= 7:
        what, mesh = _bad_mesh(rng)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                content = _export(mesh, form)
            except Exception:  # trimesh cannot write this one
                what, content = f"{what}, not writable", b"solid x\nendsolid x\n"
    elif way == 8:
        what, content, form = _special(rng)
    elif way == 9 and form != "3mf":
        what, content = _text(rng, form)
    elif way == 10:
        what, content, whole = "whole", _good(form), True
    else:
        other = garbage.pick(rng, FORMATS)
        what, content = f"in truth {other}", _good(other)
        whole = other == form.removeprefix("ascii.") or (other == "stl" and form == "ascii.stl")
    suffix = form.removeprefix("ascii.")
    suffix = suffix.upper() if rng.integers(10) == 0 else suffix
    name = f"part.{suffix}"
    Path(folder, name).write_bytes(content)
    args, written = _command(rng, folder, name)
    old = some_old(rng, written)

    def ask() -> bool:
        called = call(args)
        check_outputs(called, folder, old, written)
        if whole and called.refused:
            raise FindingError(f"a whole file is refused: {called.stderr[-200:]}")
        if whole and args[0] == "fit" and "groove" not in called.stdout:
            raise FindingError("the groove of a whole file is not found")
        return not called.refused

    return f"{form}: {what} | {' '.join(args)}", ask


@functools.cache
def _good(form: str) -> bytes:
    return _export(_block(), form)


def _bad_mesh(rng: np.random.Generator) -> tuple[str, Any]:
    """A mesh with a flaw."""
    import trimesh

    V, F = np.array(_block().vertices), np.array(_block().faces)
    way = rng.integers(16)
    what = "whole"
    n, m = len(V), len(F)
    if way == 0:
        what = "a vertex is not finite"
        V[int(rng.integers(n)), int(rng.integers(3))] = float(rng.choice([np.nan, np.inf, -np.inf]))
    elif way == 1:
        what = "open"
        F = F[rng.permutation(m)[int(rng.integers(1, m)) :]]
    elif way == 2:
        what = "inside out"
        F = F[:, ::-1]
    elif way == 3:
        what = "some triangles turned"
        turned = rng.random(m) < 0.3
        F[turned] = F[turned][:, ::-1]
    elif way == 4:
        what = "doubled"
        F = np.vstack([F, F])
    elif way == 5:
        what = "zero area"
        F[:, 2] = F[:, 1]
    elif way == 6:
        what = "one face"
        F = F[:1]
    elif way == 7:
        scale = 10.0 ** float(rng.uniform(-40, 40))
        what = f"scaled by {scale:.1e}"
        V = V * scale
    elif way == 8:
        far = 10.0 ** float(rng.uniform(0, 38))
        what = f"{far:.1e} from the origin"
        V = V + far
    elif way == 9:
        what = "an edge with three faces"
        F = np.vstack([F, [[F[0, 0], F[0, 1], int(rng.integers(n))]]])
    elif way == 10:
        what = "flat"
        V[:, int(rng.integers(3))] = 0.0
    elif way == 11:
        what = "noise"
        V = V + rng.normal(0.0, 10.0 ** float(rng.uniform(-6, 1)), V.shape)
    elif way == 12:
        what = "two bodies in each other"
        V, F = np.vstack([V, V + 1.0]), np.vstack([F, F + n])
    elif way == 13:
        what = "random triangles"
        V, F = rng.normal(0.0, 10.0, (30, 3)), rng.integers(0, 30, (40, 3))
    elif way == 14:
        what = "one point"
        V[:] = V[0]
    else:
        what = "vertices unmerged"
        V, F = V[F].reshape(-1, 3), np.arange(3 * m).reshape(-1, 3)
    return what, trimesh.Trimesh(V, F, process=False)


def _special(rng: np.random.Generator) -> tuple[str, bytes, str]:
    """Files that lie about themselves."""
    way = rng.integers(12)
    stl = _good("stl")
    if way == 0:
        count = int(garbage.pick(rng, (0, 1, 2**31 - 1, 2**31, 2**32 - 1)))
        return f"{count} faces said", stl[:80] + struct.pack("<I", count) + stl[84:], "stl"
    if way == 1:
        return "begins with solid", b"solid" + stl[5:], "stl"
    if way == 2:
        out = bytearray(stl)
        for _ in range(3):
            i = 84 + 50 * int(rng.integers((len(stl) - 84) // 50)) + 12 + 4 * int(rng.integers(9))
            out[i : i + 4] = struct.pack("<f", float(rng.choice([np.nan, np.inf, 3e38, -3e38, 1e-45])))
        return "numbers that are none", bytes(out), "stl"
    if way == 3:
        count = garbage.pick(rng, ("-1", "1e9", "99999999999999", "x", "4294967296"))
        ply = _good("ascii.ply").replace(b"element face ", f"element face {count} ".encode(), 1)
        return f"{count} faces said", ply, "ply"
    if way == 4:
        count = garbage.pick(rng, ("-1", "1000000000", "99999999999999"))
        head, _, rest = _good("ply").partition(b"element vertex ")
        return f"{count} vertices said", head + b"element vertex " + count.encode() + rest[rest.index(b"\n") :], "ply"
    if way == 5:
        faces = garbage.pick(
            rng, ("f 1 2 99999", "f 0 1 2", "f -9 -8 -7", "f 1 2", "f 1 2 3 4 5 6 7", "f a b c", "f 1//9 2//9 3//9")
        )
        return faces, b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + faces.encode() + b"\n", "obj"
    if way == 6:
        return "a bomb", _bomb(int(rng.choice([10, 50])) << 20), "3mf"
    if way == 7:
        return "a zip of something else", _zip({"readme.txt": b"hello"}), "3mf"
    if way == 8:
        model = garbage.pick(
            rng,
            (
                b"",
                b"<",
                b"<model/>",
                _MODEL + b" unit='furlong'><resources/><build/></model>",
                b"<!DOCTYPE l [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'><!ENTITY c '&b;&b;&b;'>]><model>&c;</model>",
                b"<!DOCTYPE m [<!ENTITY x SYSTEM 'file:///etc/hostname'>]><model>&x;</model>",
            ),
        )
        return "bad XML", _zip({"3D/3dmodel.model": model}), "3mf"
    if way == 9:
        head = struct.pack("<4sII", b"glTF", 2, int(garbage.pick(rng, (12, 0, 2**32 - 1))))
        chunk = garbage.pick(
            rng,
            (
                b"{}",
                b'{"asset": {"version": "2.0"}}',
                b"[]",
                b"null",
                b'{"meshes": [{"primitives": [{"attributes": {"POSITION": 9}}]}]}',
            ),
        )
        return "a bad chunk", head + struct.pack("<I4s", len(chunk), b"JSON") + chunk, "glb"
    if way == 10:
        uri = garbage.pick(
            rng,
            (
                "http://127.0.0.1:9/x.bin",
                "../../../../etc/passwd",
                "nowhere.bin",
                "data:,x",
                "data:application/octet-stream;base64,!!!",
            ),
        )
        doc = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 36}]})
        return f"buffer {uri}", doc.encode(), "gltf"
    return "a step file that is none", garbage.pick(rng, (b"", b"ISO-10303-21;\n", b"hello", rng.bytes(300))), "step"


def _bomb(size: int) -> bytes:
    model = _MODEL + b">" + b" " * size + b"</model>"
    return _zip({"3D/3dmodel.model": model})


def _zip(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


def _text(rng: np.random.Generator, form: str) -> tuple[str, bytes]:
    """A text file, or one whose numbers are words."""
    if form in ("obj", "ascii.stl", "ascii.ply"):
        words = _good(form).split(b" ")
        for _ in range(int(rng.integers(1, 6))):
            word = garbage.pick(
                rng, (b"nan", b"inf", b"-inf", b"x", b"", b"1e400", b"1,5", b"0x1F", b"9" * 400, b"\xff")
            )
            words[int(rng.integers(len(words)))] = word
        return "words for numbers", b" ".join(words)
    return "text", garbage.pick(
        rng, (b"hello\n", b"solid x\nfacet\nendsolid\n", b"ply\nformat ascii 1.0\nend_header\n", b"\n" * 100)
    )


def _command(rng: np.random.Generator, folder: Path, name: str) -> tuple[list[str], list[Path]]:
    way = rng.integers(10)
    unit = ["--unit", str(garbage.pick(rng, ("mm", "m", "in")))] if rng.integers(4) == 0 else []
    if way < 6:
        return ["fit", name, "--quiet", "--json", "f.json", *unit], [folder / "f.json"]
    if way == 6:
        return ["fit", name, "--html", "f.html", *unit], [folder / "f.html"]
    fit = str(garbage.pick(rng, ("bound", "round", "off")))
    pose = f"translation = [0, {float(rng.uniform(-8, 8)):.4f}, 0]"
    Path(folder, "scene.toml").write_text(
        f'[parts.part]\nshape = "mesh"\nfile = "{name}"\nfit = "{fit}"\n'
        f'[parts.wire]\nshape = "cylinder"\nradius = 6.5\nlength = 50\npose = {{ {pose} }}\n',
        encoding="utf-8",
    )
    return ["check", "scene.toml", "--quiet", "--json", "c.json"], [folder / "c.json"]
