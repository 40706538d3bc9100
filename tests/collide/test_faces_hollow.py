"""What is above several surfaces at once, against projections on to each in turn; and depths of points in corners."""

import itertools
import math
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from test_faces_math import frame

from clamp3d.collide import faces_hollow, faces_math
from clamp3d.collide.faces_math import CONE, CYLINDER, PLANE, SPHERE
from clamp3d.core import jit


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    """Formulas as they are written: what numba makes of them takes seconds each, and other tests run it."""
    monkeypatch.setattr(jit._Formula, "__call__", lambda self, *arguments: self._function(*arguments))


def upper(kind, size, F, sense, x):
    """The point of what is above a plane, or in the hole of a cylinder, that is nearest to a point."""
    local = (x - F[0]) @ F[1:].T
    if kind == PLANE:
        local[2] = sense * max(0.0, sense * local[2])
    else:
        local[:2] *= min(1.0, size / max(np.hypot(*local[:2]), 1e-300))
    return F[0] + local @ F[1:]


def way_out(faces, x):
    """Distance (mm) of a point from what is above all faces, by Dykstra's projections."""
    y, left = x.copy(), [np.zeros(3) for _ in faces]
    for _ in range(3000):
        before = y.copy()
        for k, face in enumerate(faces):
            z = upper(*face, y + left[k])
            left[k], y = y + left[k] - z, z
        if np.linalg.norm(y - before) < 1e-10:
            break
    return float(np.linalg.norm(y - x))


def axes(F, order, sense=1.0):
    """A frame about the same origin with other axes."""
    return np.vstack([F[0], F[1:][list(order)] * np.array([1.0, sense, sense])[:, None]])


def corner(rng, name):
    """Kinds, first sizes, frames and senses of a corner's faces."""
    F, away = frame(rng), rng.uniform(1.0, 3.0)
    if name == "shoulder":
        return [(CYLINDER, 2.0, F, -1.0), (PLANE, 0.0, axes(F, (0, 1, 2)), rng.choice([-1.0, 1.0]))]
    if name == "groove":
        other = np.vstack([F[0] + away * F[3], F[1:]])
        return [(CYLINDER, 2.0, F, -1.0), (PLANE, 0.0, F, 1.0), (PLANE, 0.0, other, -1.0)]
    if name == "pocket":
        return [(PLANE, 0.0, axes(F, order), rng.choice([-1.0, 1.0])) for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))]
    if name == "steps":
        return [(PLANE, 0.0, F, 1.0), (PLANE, 0.0, np.vstack([F[0] - away * F[3], F[1:]]), 1.0)]
    turn = rng.uniform(-0.7, 0.95)
    z = turn * F[3] + math.sqrt(1.0 - turn * turn) * F[1]
    return [(PLANE, 0.0, F, 1.0), (PLANE, 0.0, np.vstack([F[0], np.cross(F[2], z), F[2], z]), 1.0)]


@pytest.mark.parametrize("name", ["shoulder", "groove", "pocket", "steps", "oblique"])
def test_the_way_out_of_a_corner(name):
    """As long as by projections, and with heights that are only known to be no less never shorter."""
    rng, seen = np.random.default_rng(9), set()
    for _ in range(40):
        faces = corner(rng, name)
        order = rng.permutation(len(faces))
        faces = [faces[k] for k in order]
        kind, size, F, sense = (np.array(column) for column in zip(*faces, strict=True))
        F, chosen, n = F.reshape(-1, 12), np.arange(len(faces)), len(faces)
        for count in range(1, n):
            assert faces_hollow.goes_with(kind, F, sense, chosen, 0, count, count)
        x = faces[0][2][0] + rng.uniform(-1.5, 1.5, 3)
        high = np.array(
            [s * faces_math.height_at(k, r, 0.0, f, *x) for k, r, f, s in zip(kind, size, F, sense, strict=True)]
        )
        told, true = faces_hollow.above_all(high, 0, n, chosen, kind, F, sense), way_out(faces, x)
        seen.add(true > 1e-9)
        if true > 1e-9:
            assert told <= -true + 1e-6
            assert told == pytest.approx(-true, rel=3e-5) or (name == "oblique" and high.max() > 0.0)
        else:
            assert told == pytest.approx(high.min(), abs=1e-12)
        known = high - rng.uniform(0.0, 0.3, n) * rng.integers(0, 2, n)
        assert faces_hollow.above_all(known, 0, n, chosen, kind, F, sense) <= told + 1e-12
    assert seen == {True, False}


def test_a_slit_too_narrow_has_no_way_out():
    F = np.vstack([np.zeros(3), np.eye(3)])
    frames = np.array([F, np.vstack([[0.0, 0.0, 0.1], np.eye(3)])]).reshape(2, 12)
    kind, sense, chosen = np.array([PLANE, PLANE]), np.array([1.0, -1.0]), np.arange(2)
    asked = 0, 2, chosen, kind, frames, sense
    assert faces_hollow.above_all(np.array([-0.2, 0.3]), *asked) == pytest.approx(-0.2, abs=1e-5)
    assert faces_hollow.above_all(np.array([-0.2, 0.15]), *asked) == -np.inf
    assert faces_hollow.above_all(np.array([-0.2, -0.1]), *asked) == -np.inf


def test_which_faces_make_a_corner():
    rng = np.random.default_rng(10)
    F = frame(rng)
    tilted = np.vstack([F[0], np.linalg.qr((F[1:] + 0.1 * rng.normal(size=(3, 3))).T)[0].T])
    end = np.cross(F[3], tilted[3]) / np.linalg.norm(np.cross(F[3], tilted[3]))
    faces = {
        "end": (PLANE, np.vstack([F[0], F[3], np.cross(end, F[3]), end]), 1.0),
        "plane": (PLANE, F, 1.0), "side": (PLANE, axes(F, (1, 2, 0)), 1.0),
        "hole": (CYLINDER, F, -1.0),
        "rod": (CYLINDER, F, 1.0), "cone": (CONE, F, -1.0), "ball": (SPHERE, F, -1.0),
        "tilted": (PLANE, tilted, np.sign(tilted[3] @ F[3])),
    }  # fmt: skip
    kind, frames, sense = (np.array(column) for column in zip(*faces.values(), strict=True))
    names, frames = list(faces), frames.reshape(-1, 12)
    able = {
        frozenset(pair)
        for pair in (
            ("plane", "side"),
            ("plane", "tilted"),
            ("side", "tilted"),
            ("plane", "hole"),
            ("end", "plane"),
            ("end", "tilted"),
            ("end", "side"),
        )
    }
    for one, other in itertools.permutations(names, 2):
        if one in ("rod", "cone", "ball") or {one, other} == {"end", "side"}:
            continue
        chosen = np.array([names.index(one)])
        told = faces_hollow.goes_with(kind, frames, sense, chosen, 0, 1, names.index(other))
        assert told == (frozenset((one, other)) in able), (one, other)
    for three in (
        ("plane", "tilted", "side"),
        ("tilted", "plane", "side"),
        ("plane", "side", "tilted"),
        ("plane", "tilted", "end"),
        ("plane", "hole", "side"),
    ):
        chosen = np.array([names.index(one) for one in three[:2]])
        assert not faces_hollow.goes_with(kind, frames, sense, chosen, 0, 2, names.index(three[2])), three
