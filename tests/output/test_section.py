"""Drawings: arcs are arcs, to scale, with the right numbers; files come whole and equal; what is in front is seen."""

import itertools
import math

import numpy as np
import pytest
import trimesh
from legends import table2_figure
from matplotlib.figure import Figure

from clamp3d import InputError, load_clamp
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.parts import parts
from clamp3d.kernel import translation
from clamp3d.output.assembly_figures import exploded_figure, exploded_poses, steps_figure
from clamp3d.output.figures import contact_figure, contacts_figure, save_figure, section_figure, states_figure
from clamp3d.output.palette import PART_COLOURS
from clamp3d.output.section import draw_section, edge_openings
from clamp3d.output.view3d import Camera, PosedMesh, draw_solids


def texts(figure):
    return [t.get_text() for ax in figure.axes for t in (*ax.texts, ax.title, ax._left_title) if t.get_text()]


def test_outlines_are_round_to_scale_and_where_the_parts_are(run):
    """The wires: within 1e-3 mm of the circle, which they enclose; on the canvas of one scale, y down."""
    figure = Figure(figsize=(6.0, 6.0))
    ax = figure.add_subplot()
    draw_section(ax, run.clamp, run.poses, only=("P6", "P7", "P4"))
    figure.draw_without_rendering()
    patches = {tuple(round(255 * c) for c in patch.get_facecolor()[:3]): patch for patch in ax.patches}
    boxes, radii = {}, {"P6": run.clamp.line.radius, "P7": run.clamp.jumper.radius}
    for wire, radius in radii.items():
        path, pose = patches[tuple(bytes.fromhex(PART_COLOURS[wire][1:]))], run.poses[wire]
        ring = path.get_path().vertices - [pose.x, pose.y]
        middles = 0.5 * (ring[1:] + ring[:-1])
        assert np.abs(np.hypot(*ring[:-1].T) - radius).max() < 1e-9
        assert np.abs(np.hypot(*middles.T) - radius).max() < 1e-3
        boxes[wire] = path.get_path().get_extents(path.get_transform())
    line, jumper = boxes.values()
    scale = line.width / (2.0 * radii["P6"])
    assert line.height == pytest.approx(line.width, rel=1e-6)
    assert jumper.width == pytest.approx(scale * 2.0 * radii["P7"], rel=1e-6)
    assert (jumper.x0 + jumper.x1 - line.x0 - line.x1) / 2 == pytest.approx(scale * run.poses["P7"].x, rel=1e-6)
    assert (jumper.y0 + jumper.y1 - line.y0 - line.y1) / 2 == pytest.approx(-scale * run.poses["P7"].y, rel=1e-6)


def test_dimensions_are_the_published_ones(run):
    assert {"31.530", "3.046", "12.00°"} <= set(texts(section_figure(run)))
    left, right = edge_openings(run.clamp, run.poses)
    assert left == pytest.approx(31.530, abs=5e-4)
    assert left - right == pytest.approx(137.0 * math.sin(math.radians(12.0)), abs=1e-3)


def test_figures_name_what_they_show(run):
    assert set(PARTS) <= set(texts(states_figure(run)))
    enlarged = [t for t in texts(contacts_figure(run)) if "interior contact" in t]
    assert len(enlarged) == 5
    assert all("gap 0.000000 mm" in t for t in enlarged)
    for contact in run.contacts[::10]:
        shown = texts(contact_figure(run, contact))
        relation = "apart" if contact.relation == "none" else contact.relation
        assert f"{contact.a} and {contact.b}: {relation}\n" in "".join(shown)
        assert "31.530" in shown
    assert set(PARTS) <= set(texts(exploded_figure(run.clamp)))
    steps = " ".join(texts(steps_figure(run)))
    for name in ("P1|P2P3P4P5", "P7", "P2", "P5|P3P4"):
        assert name in steps


def test_exploded_parts_keep_clear_of_each_other():
    clamp = load_clamp(line="LJ-800")
    poses, bodies = exploded_poses(clamp), parts(clamp)
    spans = sorted(tuple(bodies[n].bounds[:, 2] + poses[n].T()[2, 3]) for n in ("P1", "P2", "P3", "P5", "P6"))
    assert all(below[1] < above[0] for below, above in itertools.pairwise(spans))


def test_files_are_whole_equal_and_named(tmp_path, monkeypatch):
    first, second = (save_figure(table2_figure(), tmp_path / f"{i}.svg") for i in (1, 2))
    assert first.read_bytes() == second.read_bytes()
    assert save_figure(table2_figure(), tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match=r"must end in \.svg, \.png, \.pdf, got 't\.gif'"):
        save_figure(table2_figure(), tmp_path / "t.gif")
    with pytest.raises(InputError, match="cannot write"):
        save_figure(table2_figure(), tmp_path / "none" / "t.png")
    broken = table2_figure()
    monkeypatch.setattr(broken, "savefig", lambda *a, **k: (_ for _ in ()).throw(RuntimeError("disk")))
    before, kept = sorted(tmp_path.iterdir()), first.read_bytes()
    with pytest.raises(RuntimeError):
        save_figure(broken, first)
    assert sorted(tmp_path.iterdir()) == before
    assert first.read_bytes() == kept


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
