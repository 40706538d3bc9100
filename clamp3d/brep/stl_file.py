"""STL files as their triangles, where they are plainly as the format says; every other file is left to trimesh.

trimesh takes 0.45 s of CPU to import, which is more than to check a scene of a few meshes.
"""

from __future__ import annotations

import numpy as np

from clamp3d.core.mesh import Array, IntArray

_HEADER = 84
_FACET = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_WORDS = {0: b"facet", 1: b"normal", 5: b"outer", 6: b"loop", 7: b"vertex", 11: b"vertex", 15: b"vertex"}
_WORDS |= {19: b"endloop", 20: b"endfacet"}
"""What an ASCII facet of 21 words says, but for its twelve numbers."""
_LONGEST = 40
_NUMBERS = [8, 9, 10, 12, 13, 14, 16, 17, 18]


def read_stl(raw: bytes) -> tuple[Array, IntArray] | None:
    """Vertices (3m, 3) and faces (m, 3) of a plain file, every triangle with corners of its own; None if it is not.

    Plain is a binary file exactly as long as its count of triangles says, and an ASCII file of one solid and nothing
    else. The unit is the file's.

    >>> triangle = np.zeros(1, _FACET)
    >>> triangle["corners"] = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
    >>> read_stl(bytes(80) + (1).to_bytes(4, "little") + triangle.tobytes())[0].tolist()
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    corners = _binary(raw)
    if corners is None:
        corners = _ascii(raw)
    if corners is None:
        return None
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _binary(raw: bytes) -> Array | None:
    """Corners (3m, 3) of a binary file."""
    count, rest = int.from_bytes(raw[80:_HEADER], "little"), len(raw) - _HEADER
    if rest < 0 or rest != count * _FACET.itemsize:
        return None
    with np.errstate(invalid="ignore"):  # NaN is refused where meshes are checked
        return np.frombuffer(raw, _FACET, offset=_HEADER)["corners"].reshape(-1, 3).astype(np.float64)


def _ascii(raw: bytes) -> Array | None:
    """Corners (3m, 3) of an ASCII file; its first and last line may name the solid."""
    first, _, rest = raw.lower().strip().partition(b"\n")
    body, _, last = rest.rpartition(b"\n")
    words = body.split()
    if first.split()[:1] != [b"solid"] or last.split()[:1] != [b"endsolid"] or not words or len(words) % 21:
        return None
    if b"_" in body or max(map(len, words)) > _LONGEST:  # 1_000 is a number to NumPy alone
        return None
    facets = np.array(words).reshape(-1, 21)
    if any((facets[:, place] != word).any() for place, word in _WORDS.items()):
        return None
    try:
        return facets[:, _NUMBERS].reshape(-1, 3).astype(np.float64)
    except ValueError:
        return None
