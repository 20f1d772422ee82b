"""Attitudes of many bodies in one call: as accurate as single calls, whatever the other bodies."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pyharness import Ensemble, Scene, TorqueLaw, prepare, solve_many, torques
from pyharness.model.attitude import angle_between
from tests.many_errors import KINDS, bodies

TOP = Scene("top", (0.3, -0.4, 1.2), moments=(40.0, 30.0, 20.0))


@pytest.mark.sampled
@pytest.mark.parametrize("kind", KINDS)
def test_sizes_and_threads_change_no_bit(kind: str, level: int) -> None:
    drawn = bodies(kind, 1000, 5)
    drawn["t_end"] = np.clip(drawn["t_end"], -3.0, 3.0)
    drawn["attitude0"] = np.random.default_rng(5).standard_normal((1000, 4))
    whole = solve_many(TOP, tolerance=1e-6, **drawn)
    assert whole.attitude is not None
    for n, threads in ((0, 1), (1, 1), (2, 1), (17, 1), (1000, 3)):
        found = solve_many(
            TOP, tolerance=1e-6, threads=threads, **{name: each[:n] for name, each in drawn.items()}
        )
        assert found.attitude is not None
        assert found.attitude.shape == (n, 4)
        assert np.array_equal(found.attitude, whole.attitude[:n], equal_nan=True)
        assert np.array_equal(found.omega, whole.omega[:n], equal_nan=True)
        assert np.array_equal(found.status, whole.status[:n])


@pytest.mark.parametrize("with_torque", [False, True])
def test_a_bad_body_spoils_no_other(with_torque: bool, level: int) -> None:
    rng = np.random.default_rng(8)
    drawn: dict[str, Any] = {
        "omega0": rng.standard_normal((40, 3)), "attitude0": rng.standard_normal((40, 4)),
        "moments": rng.uniform(2.0, 3.0, (40, 3)),
    }  # fmt: skip
    if with_torque:
        drawn["torque_constant"] = rng.standard_normal((40, 3))
    good = solve_many(TOP, 2.0, tolerance=1e-9, **drawn)
    assert good.attitude is not None
    assert good.has_result.all()
    drawn["attitude0"][3] = 0.0
    drawn["attitude0"][5, 2] = np.nan
    drawn["moments"][7, 0] = -1.0
    drawn["omega0"][9, 0] = np.inf
    drawn["omega0"][11] = [1e300, -1e300, 1e300]
    drawn["attitude0"][13] *= 1e200  # any norm is allowed
    drawn["attitude0"][14] *= 1e-200
    found = solve_many(TOP, 2.0, tolerance=1e-9, effort=1e-3, **drawn)
    assert found.attitude is not None
    assert found.has_result[[13, 14]].all()
    assert angle_between(found.attitude[13:15], good.attitude[13:15]).max() <= 1e-9
    assert np.isnan(found.attitude[[3, 5, 7, 9]]).all()
    assert found.ended[7] == "refused"
    others = ~np.isin(np.arange(40), (3, 5, 7, 9, 11, 13, 14))
    assert np.array_equal(found.attitude[others], good.attitude[others])
    assert np.array_equal(found.omega[others], good.omega[others])


def test_one_attitude_for_all_and_arrays_of_the_caller() -> None:
    starts = np.random.default_rng(1).standard_normal((30, 3))
    turned = [0.5, -0.5, 0.5, 0.5]
    each = solve_many(TOP, 3.0, omega0=starts, attitude0=np.tile(turned, (30, 1)))
    out = solve_many(TOP, 1.0, omega0=starts, attitude0=turned)
    shared = solve_many(TOP, 3.0, omega0=starts, attitude0=turned, out=out)
    assert shared is out
    assert shared.attitude is not None
    assert each.attitude is not None
    assert np.array_equal(shared.attitude, each.attitude)
    scene = replace(TOP, attitude=(0.5, -0.5, 0.5, 0.5))
    assert np.array_equal(solve_many(scene, 3.0, omega0=starts).omega, each.omega)


@pytest.mark.parametrize("law", [TorqueLaw(), TorqueLaw((3.0, -2.0, 1.0))], ids=("free", "torque"))
def test_results_may_replace_the_starts(law: TorqueLaw) -> None:
    rng = np.random.default_rng(2)
    starts, attitudes = rng.standard_normal((30, 3)), rng.standard_normal((30, 4))
    starts[::3] = [0.0, 1.2, 1e-9]  # left to the single-body kernel
    scene = replace(TOP, torque=law)
    wanted = solve_many(scene, 30.0, omega0=starts, attitude0=attitudes)
    place = Ensemble(starts, np.empty(30, np.int8), attitudes)
    found = solve_many(scene, 30.0, omega0=starts, attitude0=attitudes, out=place)
    assert found is place
    assert wanted.attitude is not None
    assert np.array_equal(starts, wanted.omega)
    assert np.array_equal(attitudes, wanted.attitude)


def test_omegas_may_replace_the_starts() -> None:
    starts = np.random.default_rng(2).standard_normal((30, 3))
    starts[::3] = [0.0, 1.2, 1e-9]  # left to the single-body kernel
    many = prepare(TOP).many
    wanted, whole = many(starts, 30.0)[0], solve_many(TOP, 30.0, omega0=starts).omega
    place = starts.copy()
    assert np.array_equal(many(place, 30.0, out=place)[0], wanted)
    place = starts.copy()
    assert np.array_equal(solve_many(TOP, 30.0, omega0=place, out=place).omega, whole)


def test_statuses_are_those_of_a_single_solver(level: int) -> None:
    rng = np.random.default_rng(4)
    beside = 10.0 ** rng.uniform(-9.0, 0.0, (60, 1)) * rng.standard_normal((60, 3))
    starts = np.array([0.0, 1.0, 0.0]) + beside
    times = 10.0 ** rng.uniform(0.0, 2.0, 60)
    for law in (TorqueLaw(), TorqueLaw((3.0, -2.0, 1.0))):
        scene = replace(TOP, torque=law, attitude=(1.0, 0.0, 0.0, 0.0))
        solver = prepare(scene, tolerance=1e-12, attitude=True)
        found = solve_many(scene, times, omega0=starts, tolerance=1e-12)
        statuses = []
        for start, time in zip(starts, times, strict=True):
            solver(start, time)
            statuses.append(solver.status)
        assert found.ended.tolist() == statuses
        assert {"complete", "sensitive"} <= set(statuses)


def test_a_prepared_solver_takes_many_starts() -> None:
    rng = np.random.default_rng(9)
    starts, attitudes = rng.standard_normal((17, 3)), rng.standard_normal((17, 4))
    laws = (TorqueLaw(), TorqueLaw((1.0, 2.0, 3.0)), TorqueLaw((1.0, 0.5, 2.0), frame="space"))
    full = Scene("", (1.0, 0.0, 0.0), inertia=[[40, 3, 1], [3, 30, -2], [1, -2, 20]])
    for body, law in ((TOP, laws[0]), (TOP, laws[1]), (TOP, laws[2]), (full, laws[1])):
        scene = replace(body, torque=law, attitude=(0.5, 0.5, 0.5, -0.5))
        many = prepare(scene, tolerance=1e-9, attitude=True).many
        found = solve_many(scene, 2.0, omega0=starts, attitude0=attitudes, tolerance=1e-9)
        assert found.attitude is not None
        omega, attitude, status = many(starts, 2.0, attitudes, threads=2)
        assert np.allclose(omega, found.omega, rtol=0.0, atol=1e-8)
        assert np.allclose(attitude, found.attitude, rtol=0.0, atol=1e-9)
        assert np.array_equal(omega, found.omega) or body is full
        assert not status.any()
        usual = solve_many(scene, 2.0, omega0=starts, tolerance=1e-9)
        assert usual.attitude is not None
        assert np.allclose(many(starts, 2.0)[1], usual.attitude, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    "torque",
    [
        TorqueLaw((1.0, 0.0, 0.0)),
        TorqueLaw((1.0, 0.0, 0.0), frame="space"),
        torques.damping([1.0, 2.0, 3.0]),
    ],
)
def test_a_bad_attitude_spoils_no_other_of_a_prepared_solver(torque: Any) -> None:
    """Under most torques one such row had raised an error, and all results were lost."""
    starts, turns = np.ones((3, 3)), np.ones((3, 4))
    many = prepare(replace(TOP, torque=torque, attitude=(1.0, 0.0, 0.0, 0.0)), attitude=True).many
    good = many(starts, 1.0, turns)
    turns[0], turns[2, 1] = 0.0, np.nan
    omega, attitude, status = many(starts, 1.0, turns)
    assert np.isnan(attitude[[0, 2]]).all()
    assert np.isnan(omega[[0, 2]]).all()
    assert status[0]
    assert status[2]
    assert np.array_equal(attitude[1], good[1][1])
    assert np.array_equal(omega[1], good[0][1])
