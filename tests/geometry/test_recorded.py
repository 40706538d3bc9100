"""Outlines, bodies and damaged meshes as they once came out: a change of any number is seen.

What they were judged by then is in the other files here. ``python -m tests.geometry.test_recorded`` records them again.
"""

from pathlib import Path

import numpy as np
import trimesh

from clamp3d.errors import InputError
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.meshing import enclosed, enclosing
from clamp3d.geometry.pose import rotation
from clamp3d.geometry.shells import volume
from clamp3d.shapes import Hole, SweptArc, box, cylinder, extrusion, groove_block, mesh, sphere
from tests.geometry.test_shapes import outlines as drawn
from tests.recorded import record_tests

BALL, BLOCK = trimesh.creation.icosphere(1, 2.0), trimesh.creation.box((2.0, 3.0, 4.0))


def outlines():
    rows = []
    for profile in drawn(np.random.default_rng(31), 25):
        rows.append(
            [profile.area, *np.ravel(profile.bounds), *(profile.support(3.0 * c, 1.0 - c) for c in (0.2, -2.0))]
        )
        for error in (0.7, 0.01):
            polygons = [profile.polygon(error, side) for side in ("chords", "inner", "outer")]
            rows.append([profile.chord_error(error), *profile.chord_areas(error)])
            rows.append([x for polygon in polygons for x in (len(polygon), *(polygon.sum(axis=0)))])
    return rows


def bodies():
    """Boxes around them, turned; and what their meshes hold."""
    T, groove, rows = rotation((1.0, 2.0, 3.0), 0.8), SweptArc(7.0, 1.1, 30.0), []
    sides, hole = [(20.0, 4.0, 1.9), (-19.0, 5.0, 0.6)], Hole(2.0, (12.0, -12.0))
    plate = box(30.0, 20.0, 10.0, holes=[Hole(2.0, (9.0, 4.0)), Hole(1.5, (-8.0, -3.0), "y")])
    some = [plate, cylinder(6.0, 14.0, bore=3.5), groove_block(groove, 60.0, 20.0, others=sides, holes=[hole])]
    for solid in [*some, extrusion(next(drawn(np.random.default_rng(5), 1)), 7.0)]:
        around = [trimesh.Trimesh(*make(solid, 0.2), process=False) for make in (enclosed, enclosing)]
        held = [(made.volume, made.area, *made.center_mass) for made in (mesh(solid, 0.2), *around)]
        rows.append([*solid.bounds_at(T).ravel(), *np.ravel(held)])
    return [*rows, *([ball.error, len(ball.mesh.faces)] for ball in (sphere(3.0), sphere(3.0, mesh_error=0.2)))]


def meshes():
    """Bodies beside, in and through each other, with faces turned, lost and doubled, and corners torn."""
    rng, rows = np.random.default_rng(8), []
    for k in range(60):
        parts = [(BALL, BLOCK)[rng.integers(2)].copy() for _ in range(1 + k % 3)]
        for j, part in enumerate(parts):
            part.apply_scale(0.5 ** (k % 4 == 2 and j)).apply_translation((j * (6.0, 1.1, 0.03, 2.0)[k % 4], 0.0, 0.0))
        whole = trimesh.util.concatenate(parts)
        V, F = whole.vertices * (1e-3, 1.0, 1e4)[k % 5 % 3], whole.faces.copy()
        for kind in rng.choice(5, rng.integers(0, 3), replace=False):
            some = rng.choice(len(F), rng.integers(1, 5), replace=False)
            if kind == 0:
                F[some] = F[some, ::-1]
            elif kind == 1:
                F = np.delete(F, some[:2], axis=0)
            elif kind == 2:
                F = np.concatenate([F, F[some, :: int(rng.choice([-1, 1]))]])
            elif kind == 3:  # corners of its own, off by the rounding of its numbers
                V = np.concatenate([V, V[F[some]].reshape(-1, 3) * (1.0 + 1e-7 * (k % 2))])
                F[some] = len(V) - 3 * len(some) + np.arange(3 * len(some)).reshape(-1, 3)
            else:
                F = np.where(np.isin(np.arange(len(F)), np.arange(len(parts[-1].faces)))[:, None], F[:, ::-1], F)
        try:
            m = make_mesh(V, F, name="m", scale=2.0, float32=bool(k % 2))
        except InputError as error:
            rows.append(str(error))
            continue
        size = float(np.abs(m.vertices).max())
        enclosed = volume(m.vertices, m.faces) / size**3 if m.watertight else 0.0
        rows.append([*m.notes, m.rounding / size * 2.0**50, enclosed, m.crosses_itself()])
        if not any("taken as one" in note for note in m.notes):  # else by the library's way to unite them
            rows.append([len(m.vertices), len(m.faces), int(m.slivers.sum()), float((m.vertices / size).sum())])
    return rows


test_geometry_is_as_recorded, record = record_tests(Path(__file__).with_name("data"), outlines, bodies, meshes)


if __name__ == "__main__":
    record()
