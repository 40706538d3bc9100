"""STEP files with pairs of solids that are placed by formula: the verdict is the one that the formula's gap gives."""

import numpy as np
import pytest

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
pytest.importorskip("bd_warehouse", reason="bd_warehouse (extra dev) is not installed")

from clamp3d import check, load
from tests.public.placed_pairs import FAMILIES, SOLIDS, PlacedPair, duplicate, judge, placed_pair, write_pairs

GAPS = (2e-4, 0.0103, -5e-3, -0.03)  # scripts/check-placed asks for many more
NO_ANSWER = {"spline_in_bore", "spline", "ball_in_socket", "tube_in_tube"}
"""Families and solids of which Open CASCADE takes up to a minute a pair; scripts/check-placed has them too."""
UNDECIDED = {"ring_in_groove", "taper_in_hub", "ring_on_shaft", "ball_in_ring"}
"""Families of which some shallow overlaps stay open where Open CASCADE does not find the common part in its time."""


def checked(pairs, folder):
    """Counts of right, wrong and uncertain by family, and a line for each pair that is not right."""
    path = write_pairs(pairs, folder / "pairs.step", np.random.default_rng(1))
    return judge(pairs, check(load(path), depths=False))


@pytest.fixture(scope="module")
def placed(tmp_path_factory):
    """All families in one file."""
    rng = np.random.default_rng(0)
    families = [family for family in FAMILIES if family not in NO_ANSWER and family != "duplicate"]
    pairs = [placed_pair(family, rng, gap, splines=0.0) for family in families for gap in GAPS]
    return checked(pairs, tmp_path_factory.mktemp("placed"))


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """Solids of each kind twice, as copies and as instances."""
    rng = np.random.default_rng(0)
    pairs = [
        PlacedPair(f"duplicate {kind}", *duplicate(rng, gap, kind), gap)
        for kind in SOLIDS
        if kind not in NO_ANSWER
        for gap in (0.0, 0.001, 0.009)
    ]
    return checked(pairs, tmp_path_factory.mktemp("twice"))


def marked(name, *names, reason):
    run = name not in NO_ANSWER
    return pytest.param(name, marks=[pytest.mark.xfail(reason=reason, run=run, strict=False)] * (name in names))


@pytest.mark.parametrize("family", [marked(f, *NO_ANSWER, reason="slow") for f in FAMILIES if f != "duplicate"])
def test_no_verdict_is_wrong(family, placed):
    counts, lines = placed
    assert counts[family]["wrong"] == 0, [line for line in lines if family in line]


@pytest.mark.parametrize(
    "family", [marked(f, *UNDECIDED, *NO_ANSWER, reason="undecided") for f in FAMILIES if f != "duplicate"]
)
def test_every_pair_is_decided(family, placed):
    counts, lines = placed
    assert counts[family]["uncertain"] == 0, [line for line in lines if family in line]


@pytest.mark.parametrize("kind", [marked(kind, *NO_ANSWER, reason="slow") for kind in SOLIDS])
def test_one_part_twice_is_an_overlap(kind, twice):
    counts, lines = twice
    assert counts[f"duplicate {kind}"]["right"] == 3, lines
