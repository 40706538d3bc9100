"""Hidden surfaces and lines: what is in front is what is seen, whatever the order."""

import itertools

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from clamp3d.kernel import translation
from clamp3d.output.view3d import Camera, PosedMesh, draw_solids

FRONT = Camera(azimuth=0.0, elevation=0.0)  # looks along +Y: right is X, up is Z, near is -Y


def scene(solids, camera=FRONT):
    """The picture, 10 pixels a mm, and the lines drawn on it."""
    points = np.concatenate([camera.project(s.mesh.vertices + s.T[:3, 3]) for s in solids])
    ax = Figure().add_subplot()
    draw_solids(ax, solids, camera, pixels=round(10.0 * float(np.ptp(points[:, :2], axis=0).max())))
    return np.asarray(ax.images[0].get_array()), [c.get_segments() for c in ax.collections]


def block(size, at, colour):
    return PosedMesh(trimesh.creation.box(size), translation(*at), colour)


def test_axes_are_right_handed_and_face_the_viewer():
    for azimuth, elevation in ((0.0, 0.0), (0.5, 0.4), (-1.0, 1.2)):
        axes = Camera(azimuth, elevation).axes()
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(axes) == pytest.approx(1.0)
    assert FRONT.axes() == pytest.approx(np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))


def test_the_nearer_block_hides_the_other_in_every_order():
    near, far = block((4, 1, 4), (0, -5, 0), "#FF0000"), block((8, 1, 8), (0, 5, 0), "#0000FF")
    for order in itertools.permutations((near, far)):
        image, _ = scene(list(order))
        h, w = image.shape[:2]
        middle, corner = image[h // 2, w // 2], image[15, 15]
        assert middle[0] > 0.3 > middle[2]
        assert corner[2] > 0.3 > corner[0]
        assert image[0, 0, 3] == 0.0  # outside of both: nothing
        assert (image[..., 3] > 0.0).sum() == pytest.approx(72 * 72, rel=0.01)  # of 80 * 80 pixels


def test_hidden_edges_are_not_drawn():
    """A small block behind a large one leaves no line; in front of it, its four front edges (and those behind them)."""
    small, large = "#FF0000", "#0000FF"
    _, (hidden, _) = scene([block((2, 1, 2), (0, 5, 0), small), block((8, 1, 8), (0, -5, 0), large)])
    assert hidden == []
    _, (seen, _) = scene([block((2, 1, 2), (0, -5, 0), small), block((8, 1, 8), (0, 5, 0), large)])
    corners = np.abs(np.concatenate(seen))
    assert corners == pytest.approx(np.ones_like(corners), abs=0.02)


def test_an_edge_that_goes_behind_something_ends_there():
    """A bar passes behind a post 2 wide: its lines are 20 long, less the 2 that are hidden."""
    bar, post = block((20, 1, 2), (0, 5, 0), "#FF0000"), block((2, 1, 20), (0, -5, 0), "#0000FF")
    _, (lines, _) = scene([bar, post])
    level = [s for s in lines if abs(s[0, 1] - 1.0) < 0.05 and abs(s[1, 1] - 1.0) < 0.05]
    spans = sorted({(round(float(min(s[:, 0])), 0), round(float(max(s[:, 0])), 0)) for s in level})
    assert spans == [(-10.0, -1.0), (1.0, 10.0)]
