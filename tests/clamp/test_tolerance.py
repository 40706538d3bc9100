import re
from dataclasses import replace
from inspect import signature

import numpy as np
import pytest

from clamp3d import load_clamp, monte_carlo, placement, sensitivity
from clamp3d.baselines import Cas
from clamp3d.clamp import tolerance as montecarlo
from clamp3d.clamp.dimensions import Joints
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import Section
from clamp3d.clamp.sensitivity import DIMENSIONS, dimension, with_dimensions
from clamp3d.errors import SolverError
from tests.refusals import refusals_of


def _distance(clamp, near):
    section = Section(clamp, Cas())
    start = section.open_state(near.q[4] + 0.5, near.q[5] / section.lever)
    return section.splint_distance(solve_final_state(section, start).q)


# Wires in the arcs, also where bolt and round back have play, and a line too thick for its grooves: it rests on lips.
@pytest.mark.parametrize(("line", "jumper", "play"), [(None, None, False), (None, None, True), ("48", "47.8", False)])
def test_derivatives_are_the_solvers_differences(line, jumper, play):
    clamp = replace(load_clamp(line=line, jumper=jumper), joints=Joints(hole=play, saddle=play))
    rows = {row.name: row for row in sensitivity(clamp)}
    assert np.diff([abs(row.derivative) for row in rows.values()]).max() <= 1e-8
    assert ("up_splint.hole_diameter" in rows) == play
    assert 0 < len(rows) < len(DIMENSIONS)
    assert all(abs(row.derivative) > 1e-8 for row in rows.values())  # what has no influence is not listed
    near = solve_final_state(Section(clamp, Cas()))
    carrying = {f for f, force in zip(near.gaps.feature, near.multipliers, strict=True) if force > 0.0}
    assert any(f.startswith("lip") for f in carrying) == (line is not None)
    h = 5e-4
    for name in DIMENSIONS:
        value = dimension(clamp, name)
        low, high = (_distance(with_dimensions(clamp, {name: value + e}), near) for e in (-h, h))
        derivative = rows[name].derivative if name in rows else 0.0
        assert derivative == pytest.approx((high - low) / (2.0 * h), rel=1e-5, abs=1e-8), name


def test_a_state_that_is_not_isolated_has_no_derivatives():
    with pytest.raises(SolverError, match="the final state is not isolated"):
        sensitivity(replace(load_clamp(), joints=Joints(hole=True, saddle=True, washer=True)))


def test_samples_do_not_depend_on_where_they_run(monkeypatch):
    monkeypatch.setattr(montecarlo, "CHUNK", 2)
    clamp = load_clamp()
    alone = monte_carlo(clamp, n=3, seed=5)
    assert monte_carlo(clamp, n=3, seed=5, processes=2).distance.tobytes() == alone.distance.tobytes()
    assert monte_carlo(clamp, n=1, seed=5).distance.tolist() == alone.distance[:1].tolist()
    assert monte_carlo(clamp, n=1, seed=6).distance.tolist() != alone.distance[:1].tolist()
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        there = monte_carlo(clamp, n=3, seed=5, scheduler=cluster.scheduler_address)
    assert there.distance.tobytes() == alone.distance.tobytes()
    assert there.status == alone.status


def test_small_tolerances_scatter_as_the_derivatives_say():
    clamp = load_clamp()
    result = monte_carlo(clamp, n=3, tolerance=1e-3, wire_tolerance_percent=0.0)
    rows = sensitivity(clamp)
    for index, distance in enumerate(result.distance):
        drawn = montecarlo.sample_dimensions(result.spec, index)
        linear = sum(row.derivative * (drawn.get(row.name, row.value) - row.value) for row in rows)
        assert distance - result.nominal == pytest.approx(linear, abs=1e-5)


@pytest.mark.parametrize(("distribution", "spread"), [("uniform", 1.0 / 3.0**0.5), ("normal", 1.0 / 3.0)])
def test_dimensions_scatter_by_their_tolerances(distribution, spread):
    """Those of ISO 2768-1 class m by size; a wire's in percent."""
    clamp = load_clamp()
    spec = monte_carlo(clamp, n=1, distribution=distribution, wire_tolerance_percent=2.0).spec
    tolerance = dict(zip(DIMENSIONS, spec.tolerance, strict=True))
    chosen = ("line.diameter", "jumper.diameter", "up_splint.width", "up_splint.line_groove.radius", "saddle.radius")
    assert [len(tolerance), *(tolerance[k] for k in chosen)] == pytest.approx([23, 0.6534, 0.285, 0.5, 0.2, 0.3])
    drawn = [montecarlo.sample_dimensions(spec, k) for k in range(400)]
    unit = np.array([[(row[n] - dimension(clamp, n)) / t for n, t in tolerance.items()] for row in drawn])
    assert (unit.mean(), *unit.std(axis=0)) == pytest.approx((0.0, *[spread] * len(DIMENSIONS)), abs=0.08)
    assert (np.abs(unit).max() <= 1.0) == (distribution == "uniform")
    sizes, allowed = (6.0, 30.0, 120.0, 400.0, 1000.0, 2000.0, 4000.0), (0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0)
    assert tuple(map(montecarlo.general_tolerance, sizes)) == allowed
    assert tuple(montecarlo.general_tolerance(-size - 0.1) for size in sizes[:-1]) == allowed[1:]  # depths may be < 0


def test_what_does_not_clamp_is_counted_by_reason():
    result = monte_carlo(load_clamp(line="48.5"), n=4)
    assert result.nominal is None
    assert sum(result.reasons().values()) == int(np.isnan(result.distance).sum()) == 4
    assert result.percentiles((50.0,)) == ()
    said = (
        "clamped",
        "not proven: x",
        "b, loose",
        "not proven: x",
        "clamped, but",
        "a far too long bolt",
        "not proven: y",
    )
    nan = float("nan")
    mixed = replace(result, distance=np.array([2.0, nan, nan, nan, 3.0, nan, nan]), status=said)
    assert mixed.clamped.tolist() == [2.0, 3.0]
    assert mixed.unproven == 3
    in_order = {"not proven: x": 2, "a far too long bolt": 1, "b, loose": 1, "not proven: y": 1}
    assert list(mixed.reasons().items()) == list(in_order.items())
    assert mixed.percentiles((0.0, 50.0, 90.0)) == pytest.approx((2.0, 2.5, 2.9))


def test_each_sample_is_a_clamp_of_its_own(monkeypatch):
    """Closed, not closed, or none; and where nothing is proven it says so."""
    monkeypatch.setattr(montecarlo, "CHUNK", 2)
    clamp, told, kinds = load_clamp(), [], ["clamped", "not clamped", "clamped", "not a clamp", "not a clamp"]
    settings = {"seed": 2, "tolerance": 2.0, "wire_tolerance_percent": 0.0}
    result = monte_carlo(clamp, n=5, **settings, progress=lambda *at: told.append(at))
    assert told == [(0, 5), (2, 5), (4, 5), (5, 5)]
    assert [status.split(":")[0] for status in result.status] == kinds
    assert np.isnan(result.distance).tolist() == [kind != "clamped" for kind in kinds]
    drawn = montecarlo.sample_dimensions(result.spec, 2)
    assert "line.diameter" not in drawn
    section, state, status = montecarlo.closed(with_dimensions(clamp, drawn))
    assert (result.distance[2], result.status[2]) == (section.splint_distance(state.q), status.text)

    def refused(asked, closed=montecarlo.closed):
        if asked is not clamp:
            raise SolverError("off by 1.5 mm")
        return closed(asked)

    monkeypatch.setattr(montecarlo, "closed", refused)
    assert monte_carlo(clamp, n=1, tolerance=0.0).status == ("not proven: off by ... mm",)


def test_commands_say_the_defaults_of_their_functions(main):
    tolerance, sweep = "n seed wire_tolerance_percent distribution processes", "wire seat_tolerance"
    for command, function, names in (("tolerance", monte_carlo, tolerance), ("sweep", placement, sweep)):
        said = " ".join(main(command, "--help")[1].split())
        for name in names.split():
            option = re.search(rf"--{name.replace('_', '-')} [^[]*(?:\[[^]d]*\][^[]*)?\[default: ([^];]*)", said)
            assert option[1] == str(signature(function).parameters[name].default), name
    assert [signature(placement).parameters[name].default for name in ("columns", "yaw", "pitch")] == [40, 0.1, 0.05]


test_bad_settings = refusals_of(
    lambda settings: monte_carlo(load_clamp(), **{"n": 1} | settings),
    ({"n": 0}, "n must"),
    ({"processes": 0}, "processes must"),
    ({"tolerance": -1e-9}, "tolerance must be >= 0"),
    ({"tolerance": 1e5}, "tolerance must be >= 0 and < 100000 mm"),
    ({"wire_tolerance_percent": 50.001}, "wire tolerance must be from 0 to 50 %"),
    ({"wire_tolerance_percent": -1.0}, "wire tolerance must be from 0"),
    ({"seed": -1}, "seed"),
    ({"tolerance": float("nan")}, "tolerance"),
    ({"distribution": "cauchy"}, "one of uniform, normal, got 'cauchy'"),
)


def test_an_address_without_a_scheduler_is_one_line(main):
    pytest.importorskip("distributed")
    code, _, error = main("tolerance", "--n", "2", "--scheduler", "x")
    assert code == 2
    assert error == "clamp3d: error: no Dask scheduler at 'x': missing port number in address 'x'\n"


def test_a_cluster_without_workers_is_said_to_have_none(monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(montecarlo, "_PATIENCE", 0.5)
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster,
        pytest.raises(SolverError, match="no workers are left"),
    ):
        monte_carlo(load_clamp(), n=52, scheduler=cluster.scheduler_address)
