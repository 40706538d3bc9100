"""Dimensions made in Python: wrong values are the same one-line errors as from a file."""

import math
from dataclasses import replace

import pytest

from clamp3d.clamp.dimensions import Wire
from clamp3d.clamp.loader import load_clamp
from clamp3d.errors import InputError


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda c: Wire(diameter=-3.0), "Wire: diameter: must be greater than 0, got -3.0"),
        (lambda c: Wire(diamter=3.0), "Wire: diamter is not a known key; did you mean diameter?"),
        (lambda c: replace(c.bolt, pitch=math.nan), "Bolt: pitch: must be a finite number, got nan"),
        (
            lambda c: replace(c, bolt=replace(c.bolt, diameter=60.0)),
            "Clamp: up_splint.hole_diameter must be > bolt.diameter = 60 mm, got 22",
        ),
    ],
)
def test_wrong_values_in_python_are_one_line_too(make, message):
    with pytest.raises(InputError) as found:
        make(load_clamp())
    assert str(found.value) == message
