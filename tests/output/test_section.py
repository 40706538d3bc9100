"""Drawings: arcs are arcs, to scale, with the right numbers; files come whole and equal."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from legends import table2_figure
from matplotlib.figure import Figure

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Assembly
from clamp3d.errors import InputError
from clamp3d.output.assembly_figures import exploded_figure, exploded_poses, steps_figure
from clamp3d.output.figures import contact_figure, contacts_figure, save_figure, section_figure, states_figure
from clamp3d.output.palette import PART_COLOURS
from clamp3d.output.section import draw_section, edge_openings


@pytest.fixture(scope="module")
def run() -> Assembly:
    return assemble(load_clamp(), Cas())


def texts(figure: Figure) -> list[str]:
    return [t.get_text() for ax in figure.axes for t in (*ax.texts, ax.title, ax._left_title) if t.get_text()]


def test_curves_lie_on_their_arcs(run: Assembly) -> None:
    """The wires' outlines, enlarged or not: every point within 1e-3 mm of the circle, which they enclose."""
    ax = Figure().add_subplot()
    draw_section(ax, run.clamp, run.poses, only=("P6", "P7"))
    for patch, wire in zip(ax.patches[::2], ("P6", "P7"), strict=True):
        pose, radius = run.poses[wire], (run.clamp.line if wire == "P6" else run.clamp.jumper).radius
        ring = patch.get_path().vertices - [pose.x, pose.y]
        middles = 0.5 * (ring[1:] + ring[:-1])
        assert np.abs(np.hypot(*ring[:-1].T) - radius).max() < 1e-9
        assert np.abs(np.hypot(*middles.T) - radius).max() < 1e-3


def test_drawing_is_to_scale_and_where_the_parts_are(run: Assembly) -> None:
    """The wires' outlines on the canvas: round, of one scale, y down."""
    figure = Figure(figsize=(6.0, 6.0))
    ax = figure.add_subplot()
    draw_section(ax, run.clamp, run.poses, only=("P6", "P7", "P4"))
    figure.draw_without_rendering()
    boxes = {}
    for patch in ax.patches:
        colour = tuple(round(255 * c) for c in patch.get_facecolor()[:3])
        box = patch.get_path().get_extents(patch.get_transform())
        boxes[colour] = box
    line, jumper = (boxes[tuple(bytes.fromhex(PART_COLOURS[n][1:]))] for n in ("P6", "P7"))
    scale = line.width / (2.0 * run.clamp.line.radius)
    assert line.height == pytest.approx(line.width, rel=1e-6)
    assert jumper.width == pytest.approx(scale * 2.0 * run.clamp.jumper.radius, rel=1e-6)
    assert (jumper.x0 + jumper.x1 - line.x0 - line.x1) / 2 == pytest.approx(scale * run.poses["P7"].x, rel=1e-6)
    assert (jumper.y0 + jumper.y1 - line.y0 - line.y1) / 2 == pytest.approx(-scale * run.poses["P7"].y, rel=1e-6)


def test_dimensions_are_the_published_ones(run: Assembly) -> None:
    assert {"31.530", "3.046", "12.00°"} <= set(texts(section_figure(run)))
    left, right = edge_openings(run.clamp, run.poses)
    assert left == pytest.approx(31.530, abs=5e-4)
    assert left - right == pytest.approx(137.0 * math.sin(math.radians(12.0)), abs=1e-3)


def test_figures_name_what_they_show(run: Assembly) -> None:
    assert set(PARTS) <= set(texts(states_figure(run)))
    enlarged = [t for t in texts(contacts_figure(run)) if "interior contact" in t]
    assert len(enlarged) == 5
    assert all("gap 0.000000 mm" in t for t in enlarged)
    for contact in run.contacts[::5]:
        shown = texts(contact_figure(run, contact))
        relation = "apart" if contact.relation == "none" else contact.relation
        assert f"{contact.a} and {contact.b}: {relation}\n" in "".join(shown)
        assert "31.530" in shown
    assert set(PARTS) <= set(texts(exploded_figure(run.clamp)))
    steps = " ".join(texts(steps_figure(run)))
    for name in ("P1|P2P3P4P5", "P7", "P2", "P5|P3P4"):
        assert name in steps


def test_exploded_parts_keep_clear_of_each_other() -> None:
    clamp = load_clamp(line="LJ-800")
    poses, bodies = exploded_poses(clamp), parts(clamp)
    spans = sorted(
        (float(poses[n].T()[2, 3] + bodies[n].bounds[0, 2]), float(poses[n].T()[2, 3] + bodies[n].bounds[1, 2]))
        for n in ("P1", "P2", "P3", "P5", "P6")
    )
    for below, above in itertools.pairwise(spans):
        assert below[1] < above[0]


def test_files_are_whole_equal_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
