"""STEP files with pairs of solids that are placed by formula: the verdict is the one that the formula's gap gives."""

import numpy as np
import pytest

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
pytest.importorskip("bd_warehouse", reason="bd_warehouse (extra dev) is not installed")

from clamp3d import check, load
from tests.public.placed_pairs import FAMILIES, SOLIDS, PlacedPair, duplicate, judge, placed_pair, write_pairs

GAPS = ((0.0103, -0.03), (-5e-3, 0.0103))
"""Gaps of every other family, mm: scripts/check-placed asks for many more."""
SLOW = {"ring_in_groove", "ball_in_ring", "thread_in_tube", "ball_in_socket", "spline_in_bore", "balls"}
"""Families of round or free-form faces: one gap."""


def checked(pairs, folder):
    """Counts of right, wrong and uncertain by family, and a line for each pair that is not right."""
    path = write_pairs(pairs, folder / "pairs.step", np.random.default_rng(1))
    return judge(pairs, check(load(path), depths=False))


@pytest.mark.parametrize("family", [family for family in FAMILIES if family != "duplicate"])
def test_no_verdict_is_wrong_and_every_pair_is_decided(family, tmp_path):
    k = list(FAMILIES).index(family)
    rng, gaps = np.random.default_rng(k), GAPS[k % 2][1 if family in SLOW else 0 :]
    if family == "ball_in_cone":  # the other takes the finest meshes: 15 s
        gaps = gaps[1:]
    counts, lines = checked([placed_pair(family, rng, gap, splines=0.0) for gap in gaps], tmp_path)
    assert counts[family]["wrong"] == 0, lines
    assert counts[family]["uncertain"] == 0, lines


@pytest.mark.parametrize("kind", SOLIDS)
def test_one_part_twice_is_an_overlap(kind, tmp_path):
    rng = np.random.default_rng(0)
    pairs = [PlacedPair(f"duplicate {kind}", *duplicate(rng, gap, kind), gap) for gap in (0.0, 0.001, 0.009)]
    counts, lines = checked(pairs, tmp_path)
    assert counts[f"duplicate {kind}"]["right"] == 3, lines
