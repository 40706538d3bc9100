"""How answers of several levels and of several bodies become one: agreement, order, and what counts as known."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from clamp3d import Distance, shapes
from clamp3d.engine import cad_pair, refine
from clamp3d.engine.closed_form import ClosedForm, bodies_distance
from clamp3d.engine.hull import hull
from clamp3d.engine.model import CadModel, ModelCache
from clamp3d.errors import SolverError
from clamp3d.geometry.pose import rotation, translation

CUBE = ModelCache().model(shapes.box((2.0, 2.0, 2.0)))


@pytest.mark.parametrize("off", [5e-7, -5e-7, 1.1e-6, -1.1e-6, 1.0])
def test_levels_that_contradict_each_other_by_more_than_rounding_give_no_answer(off):
    """Two cubes are 3 mm apart; what was said of them before is ``off`` from that."""
    said = Distance(3.0 + off, 3.0 + off, level="boxes", method="a wrong one")
    if abs(off) < 1e-6:
        found = refine.refine(CUBE, CUBE, translation(5.0, 0.0, 0.0), said, lambda d: d.level == "features")
        assert found.lower <= found.upper
        assert (found.lower, found.upper) == pytest.approx((min(3.0, 3.0 + off), max(3.0, 3.0 + off)), abs=1e-12)
        return
    with pytest.raises(SolverError, match=r"boxes \(a wrong one\) disagree"):
        refine.refine(CUBE, CUBE, translation(5.0, 0.0, 0.0), said, lambda _: False)


def some_bodies(rng):
    """Boxes (low, high) as bodies with errors of up to 1 mm."""
    for middle in rng.normal(size=(rng.integers(1, 5), 3)) * 4.0:
        corners = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        box = hull(middle + corners * rng.uniform(0.2, 3.0, 3))
        yield ClosedForm((box,), error=float(rng.choice([0.0, rng.uniform(0.0, 1.0)])))


def test_the_nearest_two_of_many_bodies_are_those_of_all_pairs():
    rng, overlaps = np.random.default_rng(7), 0
    for _ in range(40):
        a, b = tuple(some_bodies(rng)), tuple(some_bodies(rng))
        T = rotation(rng.normal(size=3), 1.0)
        T[:3, 3] = rng.normal(size=3) * 8.0
        found = refine._nearest_forms(a, b, T, lambda _: False)
        every = [bodies_distance(x, y, T, lambda _: False) for x in a for y in b]
        lower, upper = min(d.lower for d in every), min(d.upper for d in every)
        if len(every) > 1 and lower < -1e-6:  # of pieces that overlap together the depth is not known
            lower, overlaps = -math.inf, overlaps + 1
        assert (found.lower, found.upper) == (pytest.approx(lower, abs=1e-9), pytest.approx(upper, abs=1e-9))
    assert 2 < overlaps < 20


def solid(**answers):
    """A solid from CAD that has these answers, and no others."""
    return Mock(spec=CadModel, **answers)


def test_what_counts_as_known():
    cad, (small, large) = solid(bounds=np.array(1.0)), (SimpleNamespace(bounds=np.array(x)) for x in (1.0, -5e4))
    assert refine.accuracy_for(cad, cad) == pytest.approx(2.1e-6)
    assert refine.accuracy_for(cad, cad, 1e-3) == refine.accuracy_for(cad, small, 1e-3) == 1e-3
    assert refine.accuracy_for(cad, small) == refine.accuracy_for(small, small) == 1e-7
    assert refine.accuracy_for(small, large) == refine.accuracy_for(large, small) == pytest.approx(5e-6)
    for lower, upper, known in ((1.0, 1.0 + 0.9e-7, True), (1.0, 1.0 + 2e-7, False), (-9.0, -1e-5, True)):
        assert refine.measured(Distance(lower, upper)) == known
    assert not refine.measured(Distance(-9.0, 0.0))
    p, q, n = np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 3.0 + 1e-5]), np.eye(3)[0]
    near = Distance(1e-5, 1e-5, p, q, n, True)
    assert refine.with_normal(near).normal == pytest.approx([0.0, 0.0, 1.0])
    assert refine.with_normal(near).unique
    assert refine.with_normal(replace(near, lower=0.0)).unique is None
    for other in (replace(near, point_b=None), replace(near, lower=-2.0, upper=-1.0), replace(near, point_b=p)):
        assert refine.with_normal(other).normal is n


@pytest.fixture
def cad_levels(monkeypatch):
    """Replaces levels of two solids from CAD: sections say nothing, and no solid is a ball."""

    def replaced(deep=5.0, **others):
        answers = {"coaxial_distance": lambda *_: None, "_may_be_ball": lambda _: False}
        answers["exact_distance"] = lambda *_: Distance(method="distance")
        answers["exact_probe"] = lambda *_: Distance(-math.inf, -deep, method="probe")
        for name, answer in (answers | others).items():
            monkeypatch.setattr(cad_pair, name, answer)

    return replaced


@pytest.mark.parametrize("found", [True, False])
@pytest.mark.parametrize("deep", [5.0, 2e-4, 1e-4, 0.0, -1e-5, -math.inf])
@pytest.mark.parametrize("free_form", [False, True])
def test_the_levels_of_two_solids_from_cad_in_their_order(cad_levels, monkeypatch, free_form, found, deep):
    """Of faces that coincide small meshes prove it first; a common part that was not found is asked for once more.

    Meshes come before a distance to free-form faces, which they must not contradict.
    """

    def overlap(a, b, T, share, *, end, quick=False, attested):
        assert attested == deep
        return Distance(-1.0 if found or not quick else -math.inf, method=f"{share} {quick}")

    slab, sections = (lambda *_, by=by: Distance(method=by) for by in ("slab", "sections"))
    cad_levels(
        deep,
        slab_distance=slab,
        coaxial_distance=sections,
        exact_overlap=overlap,
        meshes_distance=lambda a, b, T, chord, *_: Distance(method=f"{chord}"),
        surface_distance=lambda a, b, T, enough, cuts: Distance(0.0, 2.0, [a, cuts], [b]),
        faces_nearby=lambda a, b, T: ([a], [b]),
    )
    monkeypatch.setattr(refine, "_nearest_forms", lambda *_: Distance(method="forms"))
    are_apart = deep < 0.0
    shares = ["0.04 True", *["0.015 False", "0.004 False"] * found]
    again = ["0.04 False", "0.015 False", "0.004 False"] * (not found)
    for chords, triangles, fine in (
        ([(0.1, 0.0018), (0.1,)], 7_500, "near [1] 0.0018 20000 near [2] 0.0018"),
        ([(0.1, 0.0018), (0.1, 0.0018)], 7_501, "near [1] 0.0018 20000 near [2] 0.0018"),
        ([(0.1,), (0.1,)], 80_000, "near [1] 0.0018 20000 near [2] 0.0018"),
        ([(0.1,), (0.1,)], 80_001, "near [1] 0.0018 100000 near [2] 0.0018"),
        ([(), (0.1,)], 7_500, "whole 0.0018 100000 whole 0.0018"),
    ):
        a, b = (
            solid(
                is_simple=True,
                chords=some,
                face_meshes=k,
                quick_bodies=(1,),
                fine_triangles=triangles,
                fine_triangles_near=lambda faces, triangles=triangles, k=k: triangles if faces == [k] else math.inf,
                is_free_form=free_form and k == 2,
                outer_near=lambda faces, chord: f"near {faces} {chord}",
                outer=lambda chord, *, thorough: f"whole {chord if thorough else None}",
            )
            for k, some in enumerate(chords, 1)
        )
        coarse = ["0.1", "slab"] * all(chords)
        place = 3 if not all(chords) or triangles > 80_000 else 1 if triangles <= 7_500 and deep <= 1e-4 else 2
        if free_form and are_apart and all(chords) and triangles <= 80_000:
            place = 0
        first, soon, later, last = ([fine] * (k == place) for k in range(4))
        answers = [answer for _, answer in refine._levels(a, b, np.eye(4), lambda _: False, False)]
        order = [
            answer.method if answer.point_a is None else " ".join(map(str, [*answer.point_a, *answer.point_b]))
            for answer in answers
        ]
        begin = [*coarse, "sections", "probe", *first, *["distance"] * are_apart]
        assert order == [*begin, *soon, *shares, "forms", *later, *again, *last]
        assert {x.method for x in answers if x.point_a} == {"meshes (FCL), chord error 0.0018 mm"}
        a.quick_bodies = None
        assert "forms" not in [answer.method for _, answer in refine._levels(a, b, np.eye(4), lambda _: False, False)]


@pytest.mark.parametrize(
    ("is_free_form", "probe", "coarse", "fine", "lower"),
    [
        (True, 9.0, 8.0, 7.0, 5.0),
        (True, 9.0, 8.0, 4.9, -math.inf),  # a gap that Open CASCADE takes for the least, and is not
        (True, 9.0, 4.9, 8.0, -math.inf),
        (False, 9.0, 4.9, 4.9, 5.0),
        (False, 4.9, 8.0, 7.0, -math.inf),  # a point lies in both: by that much
    ],
)
def test_a_distance_that_meshes_or_points_contradict_bounds_nothing_from_below(
    cad_levels, is_free_form, probe, coarse, fine, lower
):
    cad_levels(
        -probe,
        slab_distance=lambda *_: None,
        meshes_distance=lambda *_: Distance(-1.0, coarse),
        surface_distance=lambda *_: Distance(-1.0, fine),
        exact_distance=lambda *_: Distance(5.0, 5.0, method="distance"),
        faces_nearby=lambda *_: ([], []),
    )
    one = solid(
        is_simple=True,
        chords=(0.1,),
        face_meshes=1,
        is_free_form=is_free_form,
        fine_triangles_near=lambda _: 10_000,
        outer_near=lambda *_: None,
    )
    answers = cad_pair.CadPair(one, one, np.eye(4), lambda _: False).levels(iter(()))
    (distance,) = itertools.islice((answer for _, answer in answers if answer.method == "distance"), 1)
    assert (distance.lower, distance.upper) == (lower, 5.0)


def test_a_common_part_that_is_not_found_is_not_looked_for_more_finely_and_meshes_that_fail_say_nothing(cad_levels):
    def fails(*_, **__):
        raise SolverError("no answer in 20 s")

    cad_levels(exact_overlap=lambda a, b, T, share, **_: Distance(method=f"{share}"))

    a = solid(is_simple=True, chords=(), quick_bodies=None, outer=fails)
    answers = [answer for _, answer in refine._levels(a, a, np.eye(4), lambda _: False, False)]
    assert [answer.method for answer in answers[:3]] == ["probe", "0.04", "0.04"]
    assert len(answers) == 4
    assert all((answer.lower, answer.upper) == (-math.inf, math.inf) for answer in answers[1:])


def test_closed_forms_of_solids_from_cad_are_made_when_they_are_asked_for(cad_levels):
    made = []
    cad_levels(exact_overlap=lambda *_, **__: Distance(-5.0, method="common part"))
    a = solid(is_simple=True, chords=())
    type(a).quick_bodies = property(made.append)  # the class is its own
    answers = refine._levels(a, a, np.eye(4), lambda _: False, False)
    before = [next(answers)[1].method for _ in range(4)]
    assert (before, made) == (["probe", *["common part"] * 3], [])


def test_meshes_of_two_shapes_begin_as_coarse_as_the_finer_one_and_end_as_fine():
    for a, b, error, chords in (
        ((0.1, 0.02), (0.05, 0.01), 0.03, [0.05, 0.02, 0.01]),
        ((0.1,), (0.1, 0.02), 0.0, [0.1, 0.02]),
        ((0.5,), (0.5, 0.1, 0.02, 0.01), 0.03, [0.5, 0.1, 0.02]),  # no finer than the error of the given triangles
        ((0.1,), (0.5,), 0.0, [0.1]),  # a large solid from CAD and given triangles
        ((), (0.1, 0.02), 0.0, []),
    ):
        mesh = SimpleNamespace(error=error)
        first, second = (SimpleNamespace(chords=c, refines=len(c) > 1, outer=lambda _, m=mesh: m) for c in (a, b))
        assert refine._chords(first, second) == refine._chords(second, first) == chords
