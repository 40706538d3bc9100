"""What a scene, its check and its page take grows with the number of parts, not with its square: counts of work."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from clamp3d.collide import check_motions
from clamp3d.collide.broad import near_between
from clamp3d.collide.check import check
from clamp3d.collide.poses import check_poses
from clamp3d.collide.scene import Part, Scene
from clamp3d.core import shapes
from clamp3d.core.motion import Motion
from clamp3d.core.pose import translation
from clamp3d.output.placed import place
from clamp3d.output.scene_report import check_to_text
from clamp3d.output.viewer import view
from clamp3d.scenefile.parts import names_like

SIZES = (150, 600)
BOX = shapes.box((10, 10, 10))
PIN = shapes.cylinder(3, 12)


def calls(run: Callable[[], object]) -> int:
    """Functions of Python and C that a call comes to; what one of C copies is not seen."""
    count = 0

    def told(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(told)
    try:
        run()
    finally:
        sys.setprofile(None)
    return count


def row_of_boxes(n: int) -> Scene:
    """Boxes that each touch the next one, with a gap too small after every second: pairs that are allowed, and not."""
    scene = Scene(clearance=0.5)
    for k in range(n):
        scene = scene.add(f"p{k}", PIN if k % 5 == 0 else BOX, translation(10.0 * k + 0.2 * (k // 2), 0.0, 0.0))
    return scene


def allowed(scene: Scene) -> Scene:
    names = [part.name for part in scene.parts]
    for a, b in zip(names[::2], names[1::2], strict=False):
        scene = scene.allow((a, b))
    scene.allowance(*names[:2])
    return scene


def half_of_it_moves(scene: Scene) -> Scene:
    names = tuple(part.name for part in scene.parts[::2])
    return replace(scene, motions=(Motion.translate((0, 0, 500), parts=names),))


def test_all_ways_of_a_motion_are_compared_with_the_standing_parts_at_once(monkeypatch):
    boxes = []

    def counted(ways, standing, reach):
        boxes.append((len(ways.centre), len(standing.centre)))
        return near_between(ways, standing, reach)

    monkeypatch.setattr(check_motions, "near_between", counted)
    check(half_of_it_moves(row_of_boxes(100)))
    assert boxes == [(50, 50)]


class Name(str):
    """A name that counts how often it is compared with another."""

    compared = 0

    def __eq__(self, other: object) -> bool:
        Name.compared += 1
        return super().__eq__(other)

    __hash__ = str.__hash__


STEPS: dict[str, Callable[[Scene], object]] = {
    "add": lambda scene: row_of_boxes(len(scene.parts)),
    "allow": allowed,
    "check": check,
    "verdict": lambda scene: (
        lambda result: [result.verdict(x.name, y.name) for x, y in zip(scene.parts, scene.parts[1:], strict=False)]
    )(check(scene)),
    "to_dict": lambda scene: check(scene).to_dict(),
    "text": lambda scene: check_to_text(check(scene)),
    "poses": lambda scene: check_poses(scene, "p1", np.tile(np.eye(4), (50, 1, 1))),
}


@pytest.mark.parametrize("step", STEPS)
def test_work_grows_with_the_parts(step):
    run = STEPS[step]
    few, many = (row_of_boxes(n) for n in SIZES)
    run(few)  # what is made once
    grown = calls(lambda: run(many)) / calls(lambda: run(few))
    assert grown <= 1.3 * SIZES[1] / SIZES[0], f"{step}: {grown:.1f} times the work for 4 times the parts"


@pytest.mark.parametrize(
    "run",
    [
        lambda names: names_like(["*"], names),
        lambda names: names_like([str(name) for name in names], names),
        lambda names: place(Scene(tuple(Part(name, BOX) for name in names))),
        lambda names: place(Scene(tuple(Part(name, BOX) for name in names)), [str(name) for name in names]),
    ],
)
def test_names_are_looked_up_not_searched_for(run):
    before, names = Name.compared, [Name(f"p{k}") for k in range(100)]
    run(names)
    assert Name.compared - before <= 10 * len(names)


def test_pages_grow_with_the_parts(tmp_path):
    size = []
    for n in SIZES:
        scene = allowed(row_of_boxes(n))
        view(check(scene), serve=False).save_html(tmp_path / "page.html")
        size.append((tmp_path / "page.html").stat().st_size)
    assert size[1] <= 1.3 * size[0] * SIZES[1] / SIZES[0]
