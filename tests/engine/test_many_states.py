"""Tests of many bodies with states of their own."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyharness import ChangingMoments, Ensemble, Scene, solve, solve_many
from pyharness.torques import wheels

MOMENTS = (4.0, 3.0, 2.0)


def motor(t: Any, omega: Any, attitude: Any, h: Any) -> Any:
    return 0.5 * omega + 0.3 * attitude[1:]


SCENE = Scene(
    omega=(0.1, 0.2, -0.1), moments=MOMENTS, attitude=(1, 0.2, 0.1, 0),
    torque=wheels((0.0, 0.0, 0.5), motor),
)  # fmt: skip
STARTS = np.array([[0.1, 0.0, 0.1], [0.0, -0.2, 0.1], [0.2, 0.1, 0.0]])


def one(i: int, times: Any, **own: Any) -> Any:
    scene = Scene(
        omega=STARTS[i], attitude=SCENE.attitude, torque=SCENE.torque, **{"moments": MOMENTS, **own}
    )
    return solve(scene, times, tolerance=1e-10)


@pytest.mark.parametrize("threads", [1, 2])
def test_bodies_are_those_of_single_calls(threads: int) -> None:
    wheel = [0.5, 0.0, -0.4]
    found = solve_many(
        SCENE, [3.0, 20.0, -2.0], omega=STARTS, states={"wheel3": wheel}, tolerance=1e-10,
        estimates=True, threads=threads,
    )  # fmt: skip
    assert list(found.states) == ["wheel1", "wheel2", "wheel3"]
    for i, time in enumerate((3.0, 20.0, -2.0)):
        wanted = one(i, time, states={"wheel1": 0.0, "wheel2": 0.0, "wheel3": wheel[i]})
        assert found.error is not None
        allowed = found.error[i] + wanted.error
        assert allowed <= 2e-10
        assert found.omega[i] == pytest.approx(wanted.omega[0], abs=0.3 * allowed)
        assert found.attitude is not None
        assert found.attitude[i] == pytest.approx(wanted.attitude[0], abs=allowed)
        own = [each[i] for each in found.states.values()]
        assert own == pytest.approx(wanted.own[0], abs=allowed * np.abs(wanted.own[0]).max())
        assert found.ended[i] == "complete"


def test_rows_over_time_and_other_bodies(tmp_path: Path) -> None:
    bodies = np.array([MOMENTS, (3.0, 3.0, 2.0), (5.0, 4.0, 2.0)])
    found = solve_many(SCENE, times=[1.0, 5.0, 9.0], omega=STARTS, moments=bodies, tolerance=1e-10)
    for i in range(3):
        wanted = one(i, [1.0, 5.0, 9.0], moments=bodies[i])
        assert found.omega[i] == pytest.approx(wanted.omega, abs=3e-11)
        assert found.own is not None
        assert found.own[i] == pytest.approx(wanted.own, abs=1e-10 * np.abs(wanted.own).max())
    assert found.to_pandas().loc[(1, 5.0), "wheel2"] == found.states["wheel2"][1, 1]
    assert (found.to_xarray()["wheel3"].values == found.states["wheel3"]).all()
    found.save(tmp_path / "bodies.npz")
    again = Ensemble.load(tmp_path / "bodies.npz")
    assert again.names == found.names
    assert again.own is not None
    assert (again.own == found.own).all()


def test_bodies_that_fail_have_a_status() -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.0, 0.0, 0.0], {"x": states["x"] ** 2}

    scene = Scene(omega=(0.1, 0.2, 0.3), moments=MOMENTS, torque=law, states={"x": 1.0})
    starts = {"x": [0.1, 1.0, np.nan]}
    found = solve_many(scene, 2.0, states=starts)
    assert found.ended[0] == "complete"
    assert found.states["x"][0] == pytest.approx(0.125, abs=1e-8)
    assert found.ended[1] in ("overflow", "singular", "gave up")
    assert found.ended[2] == "refused"
    assert np.isnan(found.omega[1:]).all()
    rows = solve_many(scene, times=[0.5, 0.9, 2.0], states=starts)
    assert rows.ended[1, :2].tolist() == ["complete", "complete"]
    assert rows.ended[1, 2] == found.ended[1]
    assert rows.states["x"][1, :2] == pytest.approx([2.0, 10.0], rel=1e-6)
    assert np.isnan(rows.omega[1, 2]).all()
    assert solve_many(scene, 1e7, states={"x": [-1.0]}, effort=1e-6).ended.tolist() == ["gave up"]


@pytest.mark.parametrize("order", [1, -1])
def test_rows_are_at_their_times_if_a_side_ends_early(order: int) -> None:
    def law(t: Any, omega: Any, states: Any) -> Any:
        return [0.1 * states["x"], 0.0, 0.0], {"x": 1.0 + states["x"] ** 2}  # x is tan t

    scene = Scene(omega=(0.1, 0.2, 0.3), moments=MOMENTS, torque=law, states={"x": 0.0})
    for times in ([-2.0, -1.0, 0.5, 1.0], [-2.0, -1.0, 1.0, 2.0], [-1.0, 0.0, 2.0]):
        rows = np.array(times)[::order]
        found = solve_many(scene, times=rows, omega=[scene.omega])
        inside = np.abs(rows) < np.pi / 2
        assert found.states["x"][0, inside] == pytest.approx(np.tan(rows[inside]), rel=1e-8)
        assert np.isnan(found.states["x"][0, ~inside]).all()
        assert ((found.ended[0] == "complete") == inside).all()
        assert found.omega[0, inside] == pytest.approx(solve(scene, rows[inside]).omega, rel=1e-8)


def test_other_bodies_replace_a_changing_inertia() -> None:
    changing: Any = ChangingMoments([(3.0, 0.1), (2.0, 0.2), (1.2,)])
    scene, moments = replace(SCENE, moments=changing), (5.0, 4.0, 2.0)
    wanted = solve(replace(SCENE, moments=moments), 2.0, tolerance=1e-10)
    for given in ({"moments": [moments]}, {"inertia": [np.diag(moments)]}):
        found = solve_many(scene, 2.0, **given, tolerance=1e-10)
        assert found.omega[0] == pytest.approx(wanted.omega[0], rel=1e-9)
