import math

import numpy as np
import pytest

from clamp3d.baselines.cas import Cas
from clamp3d.baselines.chords import Chords
from clamp3d.errors import InputError
from clamp3d.geometry.pose import rotation, translation
from clamp3d.geometry.primitives import Cylinder, SweptArc
from clamp3d.kernel.contact_model import GroovePair


def pair(radius, half_deg, wire):
    eye = np.eye(4)
    return GroovePair("P1", "P6", SweptArc(radius, math.radians(half_deg), 50.0), eye, Cylinder(wire, 200.0), eye)


@pytest.mark.parametrize(("unit_deg", "m"), [(180.0 / 8, 8), (5.0, 36), (1.0, 180)])
def test_a_coaxial_wire_loses_the_chord_error(unit_deg, m):
    # Chords lie inside the hollow by R (1 - cos(half / m)): known figure 6.865 for R 7, half 90 deg, 8 chords.
    model = Chords(math.radians(unit_deg))
    free = model.distances(pair(7.0, 90.0, 1.0), np.eye(4)[None])[0] + 1.0
    assert free == pytest.approx(7.0 * math.cos(math.pi / 2 / m), abs=1e-12)
    if m == 8:
        assert free == pytest.approx(6.865, abs=1e-3)


def test_finer_chords_come_down_to_the_arc():
    groove = pair(12.0, 70.0, 10.5)
    poses = np.array([translation(x, y, 0.0) for x in (-2.0, 0.0, 0.7) for y in (-1.2, 0.0, 3.0, 8.0)])
    exact = Cas().distances(groove, poses)
    fine = Chords(math.radians(0.05)).distances(groove, poses)
    assert np.all(fine <= exact + 1e-12)
    assert fine == pytest.approx(exact, abs=12.0 * (1 - math.cos(math.radians(0.026))))


def test_pieces_and_distances_agree_and_witnesses_touch():
    groove, model = pair(12.0, 70.0, 10.5), Chords(math.radians(10.0))
    for x, y in ((0.0, 0.3), (4.0, -0.5), (-11.0, 2.0), (14.0, 20.0)):
        T = translation(x, y, 5.0)
        found = model.pieces(groove, T)
        assert found.distance.min() == pytest.approx(model.distances(groove, T[None])[0], abs=1e-12)
        reach = found.point + (found.distance[:, None] + 10.5) * found.normal
        assert reach[:, :2] == pytest.approx(np.tile([x, y], (len(reach), 1)), abs=1e-9)


def test_tilted_wires_are_refused():
    with pytest.raises(InputError, match="parallel axes only"):
        Chords(0.1).pieces(pair(12.0, 70.0, 10.5), rotation([0.0, 1.0, 0.0], 1e-6))


@pytest.mark.parametrize("angle", [0.0, -1.0, math.pi, math.nan])
def test_unit_angle_must_be_an_angle(angle):
    with pytest.raises(InputError, match=r"unit angle must be (between 0 and 180 deg|a finite number)"):
        Chords(angle)
