"""Fits as they were once recorded: a change of any number is seen. What they were judged by is in the other files.

``python -m tests.fit.test_recorded`` records them again.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from clamp3d import fit_mesh
from clamp3d.files.solid import BrepSolid
from clamp3d.fit.cad import fit_solid
from clamp3d.shapes import make_mesh
from tests.fit.fit_shapes import prism, scan, splint
from tests.kinds import TURNED
from tests.recorded import differences, recorded

FILE = Path(__file__).with_name("data") / "fits.json"


def stepped_bar():
    """A bar of two radii with a slit along its thinner half, cut through the middle of its facets."""
    thick, thin = (trimesh.creation.cylinder(r, 20.0, sections=n) for r, n in ((9.0, 40), (5.0, 17)))
    slit = trimesh.creation.box((1.3, 12.0, 40.0), transform=trimesh.transformations.translation_matrix((0, 6, 20)))
    bar = trimesh.boolean.union([thick, thin.apply_translation((0, 0, 20.0))], engine="manifold")
    return trimesh.boolean.difference([bar, slit], engine="manifold")


def scattered(made, sigma):
    """A mesh whose corners are scattered, as a scanner does."""
    made.vertices += np.random.default_rng(4).normal(0.0, sigma, made.vertices.shape)
    return made


def shell(radius, arc, length, columns, rows):
    """Facets of an open arc whose corners lie on it."""
    t, z = np.meshgrid(np.linspace(-arc, arc, columns), np.linspace(0.0, length, rows), indexing="ij")
    i = np.arange(t.size).reshape(t.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    return trimesh.Trimesh(np.c_[radius * np.sin(t.ravel()), -radius * np.cos(t.ravel()), z.ravel()], faces)


def torn():
    """A splint without the walls beside the middle of one groove."""
    whole = splint(0.015)
    x = whole.triangles_center[:, 0]
    return trimesh.Trimesh(whole.vertices, whole.faces[~((x > 48.7) & (x < 51.0))], process=False)


def tube():
    """The inside and the outside of a tube without its ends."""
    inside = shell(5.0, np.pi, 24.0, 25, 14)
    inside.invert()
    return trimesh.util.concatenate([inside, shell(8.0, np.pi, 24.0, 35, 14)])


def pocked(columns, rows, *off):
    """A scanned bar some of whose corners are further off than its scatter."""
    made = scattered(shell(8.0, np.pi, 30.0, columns, rows), 0.01)
    few = slice(rows + 3, -rows, 17)
    made.vertices[few, :2] *= 1.0 + np.resize(off, len(made.vertices[few]))[:, None] / 8.0
    return made


def beside(*parts):
    """Some parts as one mesh, each 30 mm further on than the one before."""
    return trimesh.util.concatenate([part.apply_translation((30.0 * k, 0.0, 0.0)) for k, part in enumerate(parts)])


def pieces(arc, by, turn, radius=9.0):
    """Two pieces of one surface or two: the second one is ``by`` mm on along the axis, and turned about it."""
    there = trimesh.transformations.rotation_matrix(turn, (0, 0, 1)) @ trimesh.transformations.translation_matrix(by)
    both = [shell(9.0, arc, 20.0, 9, 5), shell(radius, arc, 20.0, 9, 5).apply_transform(there)]
    return trimesh.util.concatenate(both)


CREATION = trimesh.creation
PARTS = {
    "splint": lambda: splint(0.3, hole=11.0),
    "splint, strips cut in four": lambda: splint(0.5).subdivide(),
    "torn splint": torn,
    "stepped bar": stepped_bar,
    "nine sides": lambda: prism([(6 * np.cos(k * np.pi / 4.5), 6 * np.sin(k * np.pi / 4.5)) for k in range(9)], 14.0),
    "scanned groove": lambda: trimesh.Trimesh(*scan(2.5, 0.03, 1), process=False),
    "scanned bar": lambda: scattered(shell(8.0, np.pi, 30.0, 41, 16), 0.01),
    "scanned arc": lambda: scattered(shell(12.0, 1.1, 30.0, 25, 18), 0.02),
    "scanned bend": lambda: scattered(shell(40.0, 0.25, 20.0, 17, 15), 0.002),
    "scanned bar with pocks": lambda: pocked(41, 26, 0.09, 0.05),
    "coarse bar with pocks": lambda: pocked(19, 16, 0.09, 0.14),
    "scanned tube": lambda: scattered(tube(), 0.005),
    "six, seven and eight sides": lambda: beside(*(CREATION.cylinder(8.0, 10.0, sections=n) for n in (6, 7, 8))),
    "cone, ball and ring": lambda: beside(
        CREATION.cone(6.0, 12.0, sections=12), CREATION.icosphere(2), CREATION.torus(9.0, 2.5, 14, 9)
    ),
    "rounded bar": lambda: CREATION.capsule(30.0, 6.0, count=[10, 10]),
    "bar between cones": lambda: CREATION.revolve([(0, 0), (3, 0), (5, 8), (5, 16), (3, 24), (0, 24)], sections=60),
    "three facets of 29.5 deg": lambda: shell(9.0, 1.5 * np.radians(29.5), 20.0, 4, 2),
    "three facets of 30.5 deg": lambda: shell(9.0, 1.5 * np.radians(30.5), 20.0, 4, 2),
    "pieces end on": lambda: pieces(1.2, (0.0, 0.0, 23.0), 0.0),
    "pieces far apart": lambda: pieces(1.2, (0.0, 0.0, 27.0), 0.0),
    "pieces side by side": lambda: pieces(0.5, (0.0, 0.0, 2.0), 1.05),
    "pieces of two radii": lambda: pieces(0.5, (0.0, 0.0, 2.0), 1.05, 9.3),
    "pieces end on of two radii": lambda: pieces(1.2, (0.0, 0.0, 20.5), 0.0, 9.02),
}
SOLIDS = ("drilled solid", "solid with other faces")


def solid(kind):
    """A solid from CAD, turned: drilled and cut obliquely, or with faces that are no cylinders."""
    pytest.importorskip("OCP")
    from tests import cad

    plate = cad.cut(cad.block((-20, -12, -4), (20, 12, 4)), cad.rod(3.0, -5, 5, 5.0), cad.rod(5.0, -5, 5, -20.0))
    if kind == "drilled solid":
        slot = cad.moved(cad.block((-30, -1, -9), (30, 1, 9)), cad.turn((0, 1, 0.2), 0.4))
        made = cad.cut(plate, cad.rod(2.0, 0, 9, -6.0, 3.0), slot)
    else:
        made = cad.cut(cad.rod(9.0, -8, 8), cad.cone(3.0, 1.0, -9, 9), cad.ring(9.0, 1.5), cad.ball(4.0, 9.0))
    return BrepSolid.of(cad.first_solid(cad.moved(made, TURNED)), kind)


def answer(name):
    if name in SOLIDS:
        return recorded(fit_solid(solid(name)).to_dict())
    made = PARTS[name]()
    return recorded(fit_mesh(make_mesh(trimesh.transform_points(made.vertices, TURNED), made.faces)).to_dict())


@pytest.mark.parametrize("name", [*PARTS, *SOLIDS])
def test_fits_are_those_that_were_recorded(name):
    old = json.loads(FILE.read_text(encoding="utf-8"))[name]
    assert differences(answer(name), old) == []


if __name__ == "__main__":
    FILE.write_text(json.dumps({name: answer(name) for name in (*PARTS, *SOLIDS)}, indent=0) + "\n", encoding="utf-8")
