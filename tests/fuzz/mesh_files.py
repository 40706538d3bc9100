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
from hypothesis import strategies as st

from tests.fuzz.cli_calls import FindingError, call, check_outputs, some_old
from tests.fuzz.values import Draw, chance, pick, power, spoil_bytes

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


def make(draw: Draw, folder: Path) -> tuple[str, Callable[[], bool]]:
    """A mesh file in ``folder`` and the command that reads it."""
    form, whole = pick(draw, *FORMATS, "ascii.stl", "ascii.ply", "stl", "stl"), False
    way = draw(st.integers(0, 11))
    if way <= 2:
        what, content = spoil_bytes(draw, _good(form))
    elif way <= 7:
        what, mesh = _bad_mesh(draw)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                content = _export(mesh, form)
            except Exception:  # trimesh cannot write this one
                what, content = f"{what}, not writable", b"solid x\nendsolid x\n"
    elif way == 8:
        what, content, form = _special(draw)
    elif way == 9 and form != "3mf":
        what, content = _text(draw, form)
    else:
        other = form if way == 10 else pick(draw, *FORMATS)
        what, content = f"in truth {other}", _good(other)
        whole = other == form.removeprefix("ascii.") or other == form
    suffix = form.removeprefix("ascii.")
    name = f"part.{suffix.upper() if chance(draw, 10) else suffix}"
    Path(folder, name).write_bytes(content)
    args, written = _command(draw, folder, name)
    old = some_old(draw, written)

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


def _bad_mesh(draw: Draw) -> tuple[str, Any]:
    """A mesh with a flaw."""
    import trimesh

    V, F = np.array(_block().vertices), np.array(_block().faces)
    rng, far, scale = np.random.default_rng(draw(st.integers(0, 2**32 - 1))), power(draw, 0, 38), power(draw, -40, 40)
    n, m = len(V), len(F)
    odd, flat, turned = V.copy(), V.copy(), F.copy()
    odd[rng.integers(n), rng.integers(3)] = pick(draw, np.nan, np.inf, -np.inf)
    flat[:, rng.integers(3)] = 0.0
    turned[::3] = turned[::3, ::-1]
    what, (V, F) = pick(
        draw,
        ("a vertex is not finite", (odd, F)),
        ("open", (V, F[rng.permutation(m)[rng.integers(1, m) :]])),
        ("inside out", (V, F[:, ::-1])),
        ("some triangles turned", (V, turned)),
        ("doubled", (V, np.vstack([F, F]))),
        ("zero area", (V, F[:, [0, 1, 1]])),
        ("one face", (V, F[:1])),
        (f"scaled by {scale:.1e}", (V * scale, F)),
        (f"{far:.1e} from the origin", (V + far, F)),
        ("an edge with three faces", (V, np.vstack([F, [[F[0, 0], F[0, 1], rng.integers(n)]]]))),
        ("flat", (flat, F)),
        ("noise", (V + rng.normal(0.0, power(draw, -6, 1), V.shape), F)),
        ("two bodies in each other", (np.vstack([V, V + 1.0]), np.vstack([F, F + n]))),
        ("random triangles", (rng.normal(0.0, 10.0, (30, 3)), rng.integers(0, 30, (40, 3)))),
        ("one point", (0.0 * V + V[0], F)),
        ("vertices unmerged", (V[F].reshape(-1, 3), np.arange(3 * m).reshape(-1, 3))),
    )
    return what, trimesh.Trimesh(V, F, process=False)


_OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
_FACES = ("f 1 2 99999", "f 0 1 2", "f -9 -8 -7", "f 1 2", "f 1 2 3 4 5 6 7", "f a b c", "f 1//9 2//9 3//9")
_XML = (
    b"",
    b"<",
    b"<model/>",
    _MODEL + b" unit='furlong'><resources/><build/></model>",
    b"<!DOCTYPE l [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'><!ENTITY c '&b;&b;&b;'>]><model>&c;</model>",
    b"<!DOCTYPE m [<!ENTITY x SYSTEM 'file:///etc/hostname'>]><model>&x;</model>",
)
_POSITION = b'{"meshes": [{"primitives": [{"attributes": {"POSITION": 9}}]}]}'
_CHUNKS = (b"{}", b'{"asset": {"version": "2.0"}}', b"[]", b"null", _POSITION)
_URIS = ("http://127.0.0.1:9/x.bin", "../../../../etc/passwd", "nowhere.bin", "data:,x")
_URIS += ("data:application/octet-stream;base64,!!!",)


def _special(draw: Draw) -> tuple[str, bytes, str]:
    """Files that lie about themselves."""
    stl, way = _good("stl"), draw(st.integers(0, 11))
    count = pick(draw, 0, 1, 2**31 - 1, 2**31, 2**32 - 1)
    if way == 0:
        return f"{count} faces said", stl[:80] + struct.pack("<I", count) + stl[84:], "stl"
    if way == 1:
        return "begins with solid", b"solid" + stl[5:], "stl"
    if way == 2:
        out = bytearray(stl)
        for face, k in draw(st.lists(st.tuples(st.integers(0, (len(stl) - 84) // 50 - 1), st.integers(0, 8)))):
            struct.pack_into("<f", out, 96 + 50 * face + 4 * k, pick(draw, np.nan, np.inf, 3e38, -3e38, 1e-45))
        return "numbers that are none", bytes(out), "stl"
    if way in (3, 4):
        said, of = pick(draw, b"-1", b"1e9", b"99999999999999", b"x", b"4294967296"), pick(draw, b"face", b"vertex")
        head, _, rest = _good(pick(draw, "ply", "ascii.ply")).partition(b"element " + of + b" ")
        return f"{said!r} said", head + b"element " + of + b" " + said + rest[rest.index(b"\n") :], "ply"
    if way == 5:
        face = pick(draw, *_FACES)
        return face, _OBJ + face.encode() + b"\n", "obj"
    if way == 6:
        return (
            "a bomb",
            _zip({"3D/3dmodel.model": _MODEL + b">" + b" " * (pick(draw, 10, 50) << 20) + b"</model>"}),
            "3mf",
        )
    if way == 7:
        return "a zip of something else", _zip({"readme.txt": b"hello"}), "3mf"
    if way == 8:
        return "bad XML", _zip({"3D/3dmodel.model": pick(draw, *_XML)}), "3mf"
    if way == 9:
        head, chunk = struct.pack("<4sII", b"glTF", 2, pick(draw, 12, 0, 2**32 - 1)), pick(draw, *_CHUNKS)
        return "a bad chunk", head + struct.pack("<I4s", len(chunk), b"JSON") + chunk, "glb"
    if way == 10:
        buffers = [{"uri": pick(draw, *_URIS), "byteLength": 36}]
        return str(buffers), json.dumps({"asset": {"version": "2.0"}, "buffers": buffers}).encode(), "gltf"
    return "no STEP", pick(draw, b"", b"ISO-10303-21;\n", b"hello", draw(st.binary(max_size=300))), "step"


def _zip(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


_NO_NUMBERS = (b"nan", b"inf", b"-inf", b"x", b"", b"1e400", b"1,5", b"0x1F", b"9" * 400, b"\xff")
_NO_MESHES = (b"hello\n", b"solid x\nfacet\nendsolid\n", b"ply\nformat ascii 1.0\nend_header\n", b"\n" * 100)


def _text(draw: Draw, form: str) -> tuple[str, bytes]:
    """A text file, or one whose numbers are words."""
    if form not in ("obj", "ascii.stl", "ascii.ply"):
        return "text", pick(draw, *_NO_MESHES)
    words = _good(form).split(b" ")
    for k in draw(st.lists(st.integers(0, len(words) - 1), min_size=1, max_size=6)):
        words[k] = pick(draw, *_NO_NUMBERS)
    return "words for numbers", b" ".join(words)


def _command(draw: Draw, folder: Path, name: str) -> tuple[list[str], list[Path]]:
    way = draw(st.integers(0, 9))
    unit = ["--unit", pick(draw, "mm", "m", "in")] if chance(draw, 4) else []
    if way <= 6:
        option, file = ("--html", "f.html") if way == 6 else ("--json", "f.json")
        return ["fit", name, "--quiet", option, file, *unit], [folder / file]
    fit, aside = pick(draw, "round", "off"), draw(st.floats(-8.0, 8.0))
    Path(folder, "scene.toml").write_text(
        f'[parts.part]\nshape = "mesh"\nfile = "{name}"\nfit = "{fit}"\n'
        '[parts.wire]\nshape = "cylinder"\nradius = 6.5\nlength = 50\n'
        f"pose = {{ translation = [0, {aside:.4f}, 0] }}\n",
        encoding="utf-8",
    )
    return ["check", "scene.toml", "--quiet", "--json", "c.json"], [folder / "c.json"]
