from dataclasses import replace

import numpy as np
import pytest

from clamp3d import assemble, load_clamp
from clamp3d.clamp.dimensions import PARTS
from clamp3d.clamp.parts import clamp_scene
from clamp3d.kernel import rotation, translation
from clamp3d.output.report import make_report
from clamp3d.output.report_page import report_html


@pytest.fixture(scope="session")
def reference():
    return load_clamp()


@pytest.fixture(scope="session")
def odd_poses():
    """A turned and moved pose for each part: a transposed matrix or a swapped axis cannot hide in it."""
    generator = np.random.default_rng(7)
    numbers = {name: generator.normal(size=(2, 3)) for name in PARTS}
    return {name: translation(*(200.0 * place)) @ rotation(axis, 2.0) for name, (place, axis) in numbers.items()}


@pytest.fixture(scope="session")
def odd_scene(reference, odd_poses):
    """The seven parts at those poses."""
    return clamp_scene(reference, odd_poses)


@pytest.fixture(scope="session")
def reference_report():
    return make_report(assemble(others=True))


@pytest.fixture(scope="session")
def odd_page(reference_report):
    """The page, which takes seconds to draw, of a clamp whose name is not to be taken for markup."""
    clamp = replace(reference_report.assembly.clamp, name="<b>x</b>&", description="<script>alert(1)</script>")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "1700000000")
        return report_html(replace(reference_report, assembly=replace(reference_report.assembly, clamp=clamp)))
