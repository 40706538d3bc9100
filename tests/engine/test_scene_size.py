"""What a scene, its check and its page take grows with the number of parts, not with its square: counts of work."""

import sys
from collections.abc import Callable

import numpy as np
import pytest

from clamp3d import Scene, check, check_poses, shapes
from clamp3d.kernel import translation
from clamp3d.output.scene_report import check_to_text

SIZES = (100, 400)
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
