import math

import numpy as np
import pytest

from clamp3d import Cylinder, InputError
from clamp3d.baselines import Chords
from clamp3d.kernel import rotation
from clamp3d.kernel.contact_model import GroovePair
from clamp3d.shapes import SweptArc


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


def test_tilted_wires_are_refused():
    with pytest.raises(InputError, match="parallel axes only"):
        Chords(0.1).pieces(pair(12.0, 70.0, 10.5), rotation([0.0, 1.0, 0.0], 1e-6))


@pytest.mark.parametrize("angle", [0.0, -1.0, math.pi, math.nan])
def test_unit_angle_must_be_an_angle(angle):
    with pytest.raises(InputError, match=r"unit angle must be (between 0 and 180 deg|a finite number)"):
        Chords(angle)
