"""The one factory of contact models: what goes with which method, and that nothing is made before it is asked for."""

import math

import numpy as np
import pytest

from clamp3d import Cylinder, InputError, baselines
from clamp3d.bench.compare.scene import block_pair, grooved_block
from clamp3d.shapes import SweptArc

GROOVE = SweptArc(12.0, math.radians(70.0), 60.0)
PAIR = block_pair(GROOVE, Cylinder(10.5, 200.0))
BLOCK = grooved_block(GROOVE, width=137.0, depth=30.0)
MESHES = {"hulls", "mesh"}


@pytest.mark.parametrize("name", baselines.METHODS)
def test_every_method_is_made_and_makes_nothing_before_it_is_asked(name):
    model = baselines.contact_model(name, {"P1": BLOCK}, progress=False)
    assert model.name == name
    assert model.meshes_built == 0
    if name != "hulls":  # CoACD takes seconds
        assert abs(model.distances(PAIR, np.eye(4)[None])[0] - 1.5) < 0.06  # 12 - 10.5 less the chord error
        assert model.meshes_built == (1 if name == "mesh" else 0)


def test_what_is_wrong_is_said_in_one_line():
    with pytest.raises(InputError, match="threshold goes with method hulls, got method 'mesh'"):
        baselines.contact_model("mesh", {"P1": BLOCK}, threshold=1.0)
    with pytest.raises(InputError, match="unknown method 'fog'; available: cas, chords, wedges, hulls, mesh"):
        baselines.contact_model("fog")
    with pytest.raises(InputError, match="method 'wedges' needs the parts"):
        baselines.contact_model("wedges")
    with pytest.raises(InputError, match="parts must be"):
        baselines.contact_model("mesh", [BLOCK])
