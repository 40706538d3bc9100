"""Every mesh that would end CoACD or FCL, or fool them, is refused with one line that says why."""

import numpy as np
import pytest

from clamp3d import InputError
from clamp3d.geometry.mesh import closed_mesh

V = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 4.0)])
F = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def _with(array, row, value):
    out = array.astype(np.result_type(array, np.asarray(value)))
    out[row] = value
    return out


@pytest.mark.parametrize(
    ("vertices", "faces", "rule"),
    [
        (_with(V, 3, np.nan), F, "vertex 3 is not finite, or not within 1e+12 mm: [nan, nan, nan]"),
        (np.zeros((0, 3)), F, "is out of range for 0 vertices"),
        (V, np.zeros((0, 3), dtype=int), "faces must have shape (m, 3), got (0, 3)"),
        (V[:, :2], F, "must have shape (n, 3), got (8, 2)"),
        ([[0, 0], [1, 2, 3]], F, "must be an array of numbers"),
        (V, _with(F, 5, [0, 1, 8]), "face index 8 is out of range for 8 vertices"),
        (V, _with(F, 5, [0, 1, 2.5]), "faces must be integers, got float64"),
        (V, _with(F, 5, [0, 5, 5]), "not closed: 3 edges with one triangle"),
        (V, F[1:], "not closed: 3 edges with one triangle"),
        (np.vstack([V, V + 9.0]), np.vstack([F, F[:, ::-1] + 8]), "a body of 12 triangles inside out"),
        (np.vstack([2.0 * V, V - 9.0]), np.vstack([F, F[:, ::-1] + 8]), "a body of 12 triangles inside out"),
        (np.vstack([2.0 * V, V - 1.0]), np.vstack([F, F[:, ::-1] + 8]), "a body of 12 triangles inside out"),
        (_with(V, 3, 1e300), F, "within 1e+12 mm"),
        (V, np.vstack([F, F[:1]]), "1 doubled triangles left out"),
        (V, np.vstack([F[:1, ::-1], F[1:]]), "1 triangles turned to one winding"),
        (V, F[:, ::-1], "inside out: all triangles turned"),
        (V * [1.0, 1.0, 0.0], F, "2 doubled triangles left out"),
    ],
)
def test_bad_mesh_is_one_clear_line(vertices, faces, rule):
    with pytest.raises(InputError) as caught:
        closed_mesh(vertices, faces, "part P9")
    message = str(caught.value)
    assert message.startswith("part P9")
    assert rule in message
    assert "\n" not in message


def test_corners_of_triangles_are_merged_and_cavities_kept():
    soup = closed_mesh(V[F].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert len(soup.vertices) == 8
    assert {tuple(map(tuple, soup.vertices[face])) for face in soup.faces} == {tuple(map(tuple, V[f])) for f in F}
    hollow = closed_mesh(np.vstack([4.0 * V, V + 1.0]), np.vstack([F, F[:, ::-1] + 8]))
    assert len(hollow.faces) == 24
