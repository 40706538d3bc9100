"""Scenes that grow from each other: none sees another's parts, and none copies what it shares with another."""

from __future__ import annotations

import pickle
from copy import copy, deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clamp3d.collide.allowed import Allowed
from clamp3d.collide.scene import Part, Scene
from clamp3d.core import shapes
from clamp3d.core.pose import rotation, translation
from clamp3d.errors import InputError

BOX = shapes.box((1, 1, 1))
NAMES = st.sampled_from("abcdef")
STEPS = st.one_of(
    st.tuples(st.just("add"), NAMES),
    st.tuples(st.just("allow"), st.tuples(NAMES, NAMES), st.integers(0, 3)),
    st.tuples(st.just("read"), st.sampled_from(["parts", "allowed", "placed"])),
    st.tuples(st.just("moved"), NAMES),
    st.tuples(st.just("clearance"), st.integers(1, 9)),
    st.tuples(st.just("pickled"), st.none()),
)


def agrees(scene: Scene, parts: tuple[Part, ...], allowed: tuple[Allowed, ...], clearance: float) -> None:
    """A scene has these parts and allowances and no others, to every way of asking."""
    assert scene.parts == parts
    assert scene.allowed == allowed
    same = Scene(parts, clearance=clearance, allowed=allowed)
    assert scene == same
    assert hash(scene) == hash(same)
    assert repr(scene) == repr(same)
    assert scene.placed.names == tuple(part.name for part in parts)
    index = {part.name: k for k, part in enumerate(parts)}
    for name in "abcdef":
        if name in index:
            assert scene.index(name) == index[name]
            with pytest.raises(InputError, match="is there twice"):
                scene.add(name, BOX)
        else:
            for asked in (scene.index, lambda x: scene.allow((x, "*")), lambda x: scene.moved({x: np.eye(4)})):
                with pytest.raises(InputError, match=f"unknown part '{name}'"):
                    asked(name)
        for other in "abcdef":
            meant = [item.overlap for item in allowed if {item.a, item.b} == {name, other}]
            assert scene.allowance(name, other) == max(meant, default=None)


@given(st.lists(st.tuples(st.integers(0, 10**6), STEPS), max_size=25))
def test_against_scenes_made_at_once(steps):
    grown = [(Scene(), (), (), 0.0)]
    for chosen, (step, *given_) in steps:
        scene, parts, allowed, clearance = grown[chosen % len(grown)]
        names = {part.name for part in parts}
        if step == "add" and given_[0] not in names:
            part = Part(given_[0], BOX)
            grown.append((scene.add(part), (*parts, part), allowed, clearance))
        elif step == "allow" and names.issuperset(given_[0]) and len(set(given_[0])) == 2:
            (a, b), overlap = given_
            more = (*allowed, Allowed(a, b, overlap))
            grown.append((scene.allow((a, b), overlap=overlap), parts, more, clearance))
        elif step == "read":
            getattr(scene, given_[0])
        elif step == "moved" and given_[0] in names:
            new = scene.moved({given_[0]: translation(1, 2, 3)})
            k = scene.index(given_[0])
            assert new.parts[k].T_world[:3, 3].tolist() == [1, 2, 3]
            grown.append((new, (*parts[:k], new.parts[k], *parts[k + 1 :]), allowed, clearance))
        elif step == "clearance":
            grown.append((replace(scene, clearance=given_[0]), parts, allowed, float(given_[0])))
        elif step == "pickled":
            new = pickle.loads(pickle.dumps(scene))
            assert [part.name for part in new.parts] == [part.name for part in parts]
            grown.append((new, new.parts, allowed, clearance))
    for scene, parts, allowed, clearance in grown:
        agrees(scene, parts, allowed, clearance)


def test_what_is_copied_or_pickled_cannot_be_written_to_either():
    T = rotation((1, 2, 3), 0.5)
    scene = Scene().add("a", BOX, T).add("b", BOX)
    size = len(pickle.dumps(scene))
    scene.add("c", BOX)  # whose name is none of the scene's
    for again in (pickle.loads(pickle.dumps(scene)), copy(scene), deepcopy(scene)):
        assert again.parts[0].T_world.tobytes() == T.tobytes()
        assert not again.parts[0].T_world.flags.writeable
        assert [part.name for part in again.parts] == ["a", "b"]
        assert again.index("b") == 1
    assert len(pickle.dumps(scene)) == size


def test_a_scene_has_no_other_names():
    with pytest.raises(AttributeError, match="'Scene' object has no attribute 'part'"):
        Scene().part  # noqa: B018
