"""FCL against closed forms: distances and normals of wedges and wires, containment, and what must be refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from clamp3d.baselines.fcl_shapes import Wire, bvh, contained, convex, distance, facets, measure
from clamp3d.baselines.wedges import prism
from clamp3d.core.pose import Array, rotation, translation
from clamp3d.core.primitives import Cylinder
from clamp3d.errors import InputError

BOX = prism(np.array([[-20.0, -10.0], [20.0, -10.0], [20.0, 10.0], [-20.0, 10.0]]), -25.0, 25.0)


def _box_distance(x: float, y: float, r: float) -> float:
    """Signed distance of a long wire along z at (x, y) from the section 40 x 20."""
    a, b = abs(x) - 20.0, abs(y) - 10.0
    return (math.hypot(max(a, 0.0), max(b, 0.0)) if max(a, b) > 0.0 else max(a, b)) - r


@settings(max_examples=300, deadline=None)
@given(
    x=st.floats(-40.0, 40.0),
    y=st.floats(-30.0, 30.0),
    r=st.floats(0.5, 30.0),
    length=st.floats(1.0, 300.0),
    turn=st.floats(-3.0, 3.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_parallel_wire_and_box(x: float, y: float, r: float, length: float, turn: float, seed: int) -> None:
    exact = _box_distance(x, y, r)
    assume(exact > -0.39 * min(r, length / 2))  # beyond, the depth is a bound
    # The way out along the axis must be longer.
    assume(exact > -0.4 * min(length, 50.0))
    axis = np.random.default_rng(seed).normal(size=3)
    move = translation(50.0, -30.0, 7.0) @ rotation(axis, turn)
    vertices, faces = BOX
    shape = convex(vertices @ move[:3, :3].T + move[:3, 3], faces)
    wire = Wire(Cylinder(r, length))
    wire.place(move @ translation(x, y, 0.0))
    found = measure(shape, wire)
    assert found.distance == pytest.approx(exact, abs=3e-6 + 1e-5 * abs(exact))  # FCL stops by relative progress
    assert found.distance > exact - 1e-9  # FCL errs on the far side
    assert distance(shape, wire) == pytest.approx(found.distance, abs=1e-12)
    _check_contract(shape, wire, found.normal, found.distance)


def _check_contract(shape: object, wire: Wire, normal: Array, d: float) -> None:
    """Moving the wire by -distance along the normal makes the two just touch."""
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
    before = wire.T
    wire.place(translation(*(-d * normal)) @ before)
    assert distance(shape, wire) == pytest.approx(0.0, abs=6e-6 + 1e-5 * abs(d))  # type: ignore[arg-type]
    wire.place(before)


@pytest.mark.parametrize("gap", [1.0, 1e-2, 1e-4, 1e-6, 1e-9, 0.0, -1e-9, -1e-6, -1e-4, -1e-2, -1.0])
def test_normal_is_right_however_small_the_gap(gap: float) -> None:
    shape = convex(*BOX)
    wire = Wire(Cylinder(7.0, 200.0))
    for turn in np.linspace(0.0, 6.0, 13):
        wire.place(translation(3.0, 17.0 + gap, 1.0) @ rotation([0.0, 0.0, 1.0], turn))
        found = measure(shape, wire)
        assert found.distance == pytest.approx(gap, abs=1e-8)
        assert np.abs(found.normal - [0.0, 1.0, 0.0]).max() < 1e-3
        assert np.abs(found.point[1] - 10.0) < 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_touching_poses_neither_end_nor_hang_the_interpreter(seed: int) -> None:
    # FCL's own signed distance aborts on some 30 of these 2000.
    rng = np.random.default_rng(seed)
    shape = convex(*BOX)
    for _ in range(500):
        r, length = rng.uniform(0.5, 30.0), rng.uniform(1.0, 300.0)
        off = rng.choice([0.0, 1e-14, 1e-12, 1e-9, 1e-6]) * rng.uniform(-1.0, 1.0)
        wire = Wire(Cylinder(r, length))
        wire.place(translation(rng.uniform(-18, 18), 10.0 + r + off, 1.0) @ rotation([0, 0, 1], rng.uniform(-3, 3)))
        assert abs(measure(shape, wire).distance - off) < 3e-6


MESH = bvh(*BOX)


@settings(max_examples=150, deadline=None)
@given(x=st.floats(-40.0, 40.0), y=st.floats(-30.0, 30.0), r=st.floats(0.5, 12.0))
@example(1.0, 9.625, 0.5)
def test_mesh_knows_apart_from_crossing(x: float, y: float, r: float) -> None:
    exact = _box_distance(x, y, r)
    assume(abs(exact) > 1e-6)
    wire = Wire(Cylinder(r, 200.0))
    wire.place(translation(x, y, 0.0))
    found = measure(MESH, wire)
    assert (found.distance > 0.0) == (exact > 0.0)
    if exact > 0.0:
        assert found.distance == pytest.approx(exact, abs=3e-6)
        _check_contract(MESH, wire, found.normal, found.distance)
    single = [measure(facet, wire).distance for facet in facets(MESH)]
    assert len(single) == 6
    if exact > -0.39 * r:  # beyond, the depth is a bound, and FCL's contact of a triangle is another one's
        assert min(single) == pytest.approx(found.distance, abs=1e-6)


def test_wire_inside_the_wall_is_contained() -> None:
    wire = Wire(Cylinder(2.0, 10.0))
    wire.place(translation(11.0, 3.0, 5.0))
    assert contained(MESH, wire)
    found = measure(MESH, wire)
    assert found.distance == pytest.approx(-(5.0 + 4.0), abs=1e-6)  # 5 mm under the top, 4 mm thick
    assert found.normal == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)
    # In the hollow of a pipe it is not contained, in its wall it is.
    pipe = trimesh.creation.annulus(r_min=20.0, r_max=40.0, height=100.0)
    shape = bvh(pipe.vertices, pipe.faces)
    wire.place(np.eye(4))
    assert not contained(shape, wire)
    assert measure(shape, wire).distance > 17.0
    wire.place(translation(30.0, 0.0, 0.0))
    assert contained(shape, wire)
    assert measure(shape, wire).distance < 0.0
    wire.place(translation(300.0, 0.0, 0.0))
    assert not contained(shape, wire)


def test_bad_shapes_are_refused() -> None:
    vertices, faces = BOX
    with pytest.raises(InputError, match=r"faces must have shape \(m, 3\), got \(0, 3\)"):
        bvh(vertices, faces[:0])
    with pytest.raises(InputError, match="watertight"):
        convex(vertices, faces[1:])
    dented = vertices.copy()
    dented[0] = 0.0
    with pytest.raises(InputError, match=r"P1 hull 3 must be convex: a vertex stands .* mm outside"):
        convex(dented, faces, "P1 hull 3")
    for factor in (1e-3, 1e4):  # metres, or far too large
        with pytest.raises(InputError, match=r"largest extent must be from 0\.1 to 10000 mm for FCL"):
            convex(vertices * factor, faces)
    with pytest.raises(InputError, match=r"cylinder radius must be from 0\.1 to 10000 mm"):
        Wire(Cylinder(0.0105, 0.2))
