"""A few of the random pairs against Open CASCADE; the judge itself tells wrong answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("OCP")

from random_pairs import Truth, campaign, draw_pairs, judge

from clamp3d.collide.answer import Distance
from clamp3d.collide.result import PairResult
from clamp3d.collide.verdict import Verdict


def test_random_pairs_agree_with_open_cascade():
    score = campaign(12, 5)
    assert (score.wrong, score.beyond, score.failed) == ([], [], [])
    assert sum(score.verdicts.values()) == 12


def test_the_judge_finds_what_is_wrong():
    pair = next(iter(draw_pairs(1, 5)))
    none = np.zeros(3)
    apart, deep = Truth(0.2, none, none), Truth(0.0, none, none, 0.3, 1.0)
    row = PairResult("a", "b", Verdict.CLEARANCE, Distance(0.2, 0.2))
    assert judge(pair, row, apart)[0] == ""
    assert judge(pair, replace(row, verdict=Verdict.CONTACT), apart)[0] == "wrong"
    assert judge(pair, replace(row, distance=Distance(0.21, 0.25)), apart)[0] == "beyond"
    clash = PairResult("a", "b", Verdict.CLASH, Distance(-0.4, -0.3))
    assert judge(replace(pair, step=-0.5), clash, deep)[0] == ""
    assert judge(replace(pair, step=-0.5), replace(clash, distance=Distance(-0.1, -0.05)), deep)[0] == "beyond"
    assert (
        judge(
            replace(pair, step=-0.001), replace(clash, distance=Distance(-0.0009, -0.0001)), replace(deep, depth=0.0)
        )[0]
        == "wrong"
    )
    assert judge(replace(pair, step=-0.5), replace(clash, verdict=Verdict.CONTACT), deep)[0] == "wrong"
