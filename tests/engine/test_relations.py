"""How pins and holes fit: a table of drawn pairs, and what is no fit."""

from dataclasses import replace

import pytest

from clamp3d import Part, Scene, check, shapes
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.relations import relation
from clamp3d.kernel import translation
from tests.kinds import faceted_shape

TURNED = translation(30.0, -7.0, 4.0) @ [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]


def fit(radius, place=(0.0, 0.0, 0.0), hole=5.0, length=40.0):
    """A pin in a tube whose bore has a radius of 5."""
    tube = Part("tube", shapes.cylinder(9.0, 8.0, bore=hole), TURNED)
    found = relation(tube, Part("pin", shapes.cylinder(radius, length), TURNED @ translation(*place)))
    return found and (found.kind, found.overlap)


def test_the_two_radii_say_how_they_fit():
    assert [fit(radius) for radius in (4.9, 7.0)] == [None, None]
    assert [fit(radius) for radius in (4.99, 5.0)] == [("running", 0.0)] * 2
    assert [fit(radius) for radius in (5.01, 5.1, 6.0)] == [("press", 0.01), ("thread", 0.1), ("thread", 1.0)]


@pytest.mark.parametrize("place", [(0.01, 0.0, 0.0), (0.0, 0.0, 24.1), (0.0, 0.0, -24.1)])
def test_a_pin_beside_or_beyond_its_hole_does_not_fit(place):
    assert fit(5.01, place) is None


def test_the_holes_of_a_block_are_found_wherever_they_are():
    block = Part("block", shapes.box(40.0, 30.0, 8.0, holes=[shapes.Hole(3.0, (10.0, -2.0))]), TURNED)
    pin = Part("pin", shapes.cylinder(3.01, 20.0), TURNED @ translation(10.0, -2.0, 3.0))
    assert relation(block, pin).kind == relation(pin, block).kind == "press"


@pytest.mark.parametrize(("found", "kind"), [("round", "press"), ("off", None)])
def test_meshes_fit_only_where_round_surfaces_are_looked_for(found, kind):
    block = shapes.box(40.0, 30.0, 8.0, holes=[shapes.Hole(3.0, (10.0, -2.0))])
    first, second = (faceted_shape(shape, 0.01, found) for shape in (block, shapes.cylinder(3.01, 20.0)))
    match = relation(Part("block", first), Part("pin", second, translation(10.0, -2.0, 3.0)))
    assert (match and match.kind) == kind


def bolted(*rules, sink=0.0):
    """A bolt in a nut; ``sink``: how far a pin on a plate stands in the plate."""
    scene = Scene().add("nut", shapes.cylinder(9.0, 8.0, bore=4.2)).add("bolt", shapes.cylinder(5.0, 40.0))
    scene = scene.add("plate", shapes.box(20.0, 20.0, 4.0), translation(50.0, 0.0, -2.0))
    scene = scene.add("pin", shapes.cylinder(5.0, 40.0), translation(50.0, 0.0, 20.0 - sink))
    return replace(scene, allowed=rules)


def test_a_rule_covers_the_overlap_of_the_fit_and_no_other():
    assert check(bolted(sink=0.5)).counts["clash"] == 2
    scene = bolted(Allowed(relation="thread"), sink=0.5)
    verdicts = {frozenset((row.a, row.b)): row.verdict.value for row in check(scene).pairs}
    assert verdicts == {frozenset(("nut", "bolt")): "allowed", frozenset(("plate", "pin")): "clash"}
    shallow = check(bolted(Allowed(relation="thread", overlap=0.5)))
    assert shallow.verdict("nut", "bolt").value == "clash"  # its threads overlap by 0.8


def test_duplicates_can_be_meant():
    ball = shapes.cylinder(5.0, 5.0)
    scene = Scene().add("a", ball).add("b", ball)
    assert check(scene).verdict("a", "b").value == "duplicate"
    assert check(Scene(scene.parts, allowed=(Allowed(relation="duplicate"),))).verdict("a", "b").value == "allowed"
