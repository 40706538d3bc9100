"""Meshes of several bodies that overlap or touch: what they make together is the part, without walls inside of it."""

from itertools import combinations

import numpy as np
import pytest
import trimesh

from clamp3d import Scene, Verdict, check, shapes
from clamp3d.geometry.pose import translation
from tests.kinds import mesh_shape

FIRST = np.array([[-5.0, -5.0, -5.0], [5.0, 5.0, 5.0]])
CAVITY = np.array([[-3.0, -3.0, -3.0], [3.0, 3.0, 3.0]])
SECOND = {
    "crossing": [[0.0, -4.0, -4.0], [10.0, 6.0, 6.0]],
    "touching": [[5.0, -3.0, -3.0], [13.0, 3.0, 3.0]],
    "touching all over": [[5.0, -5.0, -5.0], [15.0, 5.0, 5.0]],
    "inside": [[-4.5, -4.5, -4.5], [-3.5, -3.5, -3.5]],
    "apart": [[6.0, -3.0, -3.0], [9.0, 3.0, 3.0]],
}


def box_mesh(bounds, inward=False):
    mesh = trimesh.creation.box(bounds=bounds)
    if inward:
        mesh.invert()
    return mesh


def shared(*boxes):
    """Volume of the common part of boxes (2, 3)."""
    return float(np.prod(np.maximum(np.min([b[1] for b in boxes], axis=0) - np.max([b[0] for b in boxes], axis=0), 0)))


@pytest.mark.parametrize("hollow", [False, True])
@pytest.mark.parametrize("second", SECOND)
@pytest.mark.parametrize("turned", [False, True])
def test_bodies_of_one_mesh_are_one_part(second, hollow, turned):
    other = np.array(SECOND[second])
    if hollow and second == "crossing":
        other[0, 0] = 4.0  # beside the cavity
    bodies = [box_mesh(FIRST), box_mesh(other), *([box_mesh(CAVITY, inward=True)] if hollow else [])]
    whole = trimesh.util.concatenate(bodies[::-1] if turned else bodies)
    part = mesh_shape(whole)
    if second == "touching all over":  # what lies between the two is no wall of the part
        assert not (np.abs(part.mesh.vertices[part.mesh.faces][:, :, 0] - 5.0) < 1e-9).all(axis=1).any()
    rng = np.random.default_rng(5)
    for centre in [(-1.2, 0.0, 0.0), (4.3, 0.0, 0.3), (4.0, 0.4, 0.2), *rng.uniform(-6.0, 11.0, (12, 3))]:
        probe = np.array([-0.5, 0.5])[:, None] + centre
        truth = shared(probe, FIRST) + shared(probe, other) - shared(probe, FIRST, other)
        truth -= hollow * (shared(probe, CAVITY) - shared(probe, CAVITY, other))
        result = check(Scene().add("a", part).add("b", shapes.box((1, 1, 1)), translation(*centre)))
        verdicts = {"contained"} if truth > 1.0 - 1e-12 else {"clash"} if truth > 0.0 else {"clear", "contact"}
        assert result.verdict("a", "b").value in verdicts
        if truth > 0.0:
            low, high = result.pairs[0].where.volume
            assert low <= truth <= high <= truth + 1e-6


LOOP = np.array([[0, 0], [60, 0], [60, 40], [20, 40], [20, -40]], dtype=float)
HALF = 8.0
SECTION = ((-1, HALF), (1, HALF), (1, -HALF), (-1, -HALF))


def loop():
    """A square tube swept along `LOOP`, as one surface that crosses itself, and the boxes (2, 3) that it is made of."""
    way = np.diff(LOOP, axis=0) / np.linalg.norm(np.diff(LOOP, axis=0), axis=1)[:, None]
    aside = np.column_stack([-way[:, 1], way[:, 0]])
    mitre = HALF * np.vstack([aside[:1], aside[:-1] + aside[1:], aside[-1:]])
    corners = [np.column_stack([LOOP + s * mitre, np.full(5, z)]) for s, z in SECTION]
    faces = [[0, 2, 1], [0, 3, 2], [16, 17, 18], [16, 18, 19]]
    for a, b in ((4 * k + j, 4 * k + (j + 1) % 4) for k in range(4) for j in range(4)):
        faces += [[a, b, b + 4], [a, b + 4, a + 4]]
    tube = trimesh.Trimesh(np.stack(corners, axis=1).reshape(-1, 3), faces, process=False)
    boxes = []
    for k in range(4):
        ends = np.array([LOOP[k] - HALF * (k > 0) * way[k], LOOP[k + 1] + HALF * (k < 3) * way[k]])
        wide = HALF * np.abs(aside[k])
        boxes.append(np.column_stack([[ends.min(axis=0) - wide, ends.max(axis=0) + wide], [-HALF, HALF]]))
    return mesh_shape(tube), boxes


def union(place, boxes):
    """Volume of what boxes (2, 3) cover of another, by inclusion and exclusion."""
    subsets = (some for n in range(1, len(boxes) + 1) for some in combinations(boxes, n))
    return sum((-1) ** (len(some) + 1) * shared(place, *some) for some in subsets)


@pytest.mark.parametrize("form", ["mesh", "drawn"])
def test_walls_of_a_surface_inside_of_what_it_covers_are_no_end_of_it(form):
    part, boxes = loop()
    cube = box_mesh([[-0.5] * 3, [0.5] * 3])
    probe = shapes.box((1, 1, 1)) if form == "drawn" else mesh_shape(cube)
    rng = np.random.default_rng(3)
    drawn = rng.uniform([10, -15, -8.4], [35, 15, 8.4], (40, 3))
    for centre in [(31, 0, 0), (20, 6, 0), (20, 7, 3), (20, 0, 0), *drawn]:
        place = np.array([-0.5, 0.5])[:, None] + centre
        pair = check(Scene().add("loop", part).add("probe", probe, translation(*centre))).pairs[0]
        distance, truth = pair.distance, union(place, boxes)
        if truth == 0.0:
            away = [np.linalg.norm(np.maximum(0.0, np.maximum(b[0] - place[1], place[0] - b[1]))) for b in boxes]
            assert distance.lower <= min(away) <= distance.upper <= min(away) + 1e-9
            continue
        assert pair.verdict is Verdict.CLASH
        assert "crosses itself" in distance.method
        assert 0.0 < -distance.upper <= HALF + 0.5 - abs(centre[2])


@pytest.mark.parametrize(
    "way", [(10, 10, 10), (10, 10, 0), (10, 0, 0), (10, 3, 4)], ids=["corner", "edge", "face", "part"]
)
@pytest.mark.parametrize("inward", [(), (0,), (1,), (0, 1), (0, 2), (0, 1, 2)])
def test_no_body_is_lost_that_touches_others_and_is_inside_out(way, inward):
    boxes = [np.array([[-5.0] * 3, [5.0] * 3]) + k * np.array(way) for k in range(3)]
    whole = trimesh.util.concatenate([box_mesh(box, inward=k in inward) for k, box in enumerate(boxes)])
    part = mesh_shape(whole)
    for box in boxes:
        probe = Scene().add("a", part).add("b", shapes.box((1, 1, 1)), translation(*box.mean(axis=0)))
        pair = check(probe).pairs[0]
        assert pair.verdict is Verdict.CONTAINED
        assert pair.where.volume == pytest.approx((1.0, 1.0))


def test_a_plane_parts_a_small_part_from_one_that_it_lies_deep_in():
    """The way out, 5.5 mm over the top, is longer than the lengths that are tried one after the other."""
    whole = trimesh.util.concatenate([box_mesh(FIRST), box_mesh(SECOND["touching"])])
    part = mesh_shape(whole)
    distance = check(Scene().add("a", part).add("b", shapes.box((1, 1, 1)))).pairs[0].distance
    assert -distance.lower == pytest.approx(5.5, abs=1e-6)
    moved = np.array([-0.5, 0.5])[:, None] - distance.lower * distance.normal
    assert union(moved, [FIRST, np.array(SECOND["touching"])]) == pytest.approx(0.0, abs=1e-6)
