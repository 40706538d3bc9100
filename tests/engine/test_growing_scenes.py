"""Scenes that grow from each other: none sees another's parts, and what is copied or pickled is the same scene."""

import pickle
from copy import copy, deepcopy
from dataclasses import replace

import numpy as np
import pytest

from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.geometry import shapes
from clamp3d.geometry.pose import rotation, translation

BOX = shapes.box((1, 1, 1))


def names(scene):
    return [part.name for part in scene.parts]


def test_no_scene_sees_what_was_added_to_another():
    first = Scene().add("a", BOX)
    left, right = first.add("b", BOX), first.add("c", BOX).allow(("a", "c"), overlap=1.0)
    more = right.allow(("c", "a"), overlap=3.0).add("b", BOX).moved({"a": translation(1, 2, 3)})
    assert [names(scene) for scene in (first, left, right, more)] == [["a"], ["a", "b"], ["a", "c"], ["a", "c", "b"]]
    assert [scene.allowance("a", "c") for scene in (right, more)] == [1.0, 3.0]
    assert left.allowance("a", "b") is None
    assert (right.index("c"), more.index("b")) == (1, 2)
    assert [scene.parts[0].T_world[0, 3] for scene in (first, right, more)] == [0.0, 0.0, 1.0]
    for scene in (first, left, right, more):
        same = Scene(scene.parts, allowed=scene.allowed)
        assert (scene, hash(scene), repr(scene)) == (same, hash(same), repr(same))
        assert replace(scene, clearance=2.0).parts == scene.parts
        for wrong in (scene.index, lambda x, scene=scene: scene.moved({x: np.eye(4)})):
            with pytest.raises(InputError, match="unknown part 'd'"):
                wrong("d")


def test_what_is_copied_or_pickled_cannot_be_written_to_either():
    T = rotation((1, 2, 3), 0.5)
    scene = Scene().add("a", BOX, T).add("b", BOX)
    size = len(pickle.dumps(scene))
    scene.add("c", BOX)  # whose name is none of the scene's
    for again in (pickle.loads(pickle.dumps(scene)), copy(scene), deepcopy(scene)):
        assert again.parts[0].T_world.tobytes() == T.tobytes()
        assert not again.parts[0].T_world.flags.writeable
        assert names(again) == ["a", "b"]
        assert again.index("b") == 1
    assert len(pickle.dumps(scene)) == size
