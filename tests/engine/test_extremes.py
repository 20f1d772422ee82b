"""Extreme motions that random input found: no traceback, no hang, no NaN that is `complete`."""

import math
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, prepare, solve, solve_many
from pyharness.engine.plan.registry import FIXED_STEP, PREPARED
from tests.refused import refused


@pytest.mark.parametrize("method", PREPARED)
def test_start_that_is_not_finite_is_not_complete(method: str) -> None:
    """Regression test: the start was returned unchanged at time 0, with the status `complete`."""
    law = TorqueLaw() if method == "closed-form" else TorqueLaw((0.0, 0.0, 1.0))
    solver = prepare(Scene("", (1.0, 2.0, 3.0), moments=(0.5, 0.7, 1.0), torque=law), method, 1e-3)
    for start in (math.nan, math.inf):
        assert np.isnan(solver(np.array([start, 1.0, 2.0]), 0.0)).all()
        assert solver.status != "complete"


def test_many_steps_are_given_up_before_they_are_taken() -> None:
    """Regression test: a minute and more, because the limits ignored the cost of a wave."""
    law = TorqueLaw(sines=[((1.0, 2.0, 3.0), 17.0 + 0.01 * n) for n in range(40)])
    scene = Scene("", (1.0, 2.0, 3.0), moments=(4.0, 3.0, 2.0), torque=law, step_size=1e-6)
    for method in (*FIXED_STEP, "gauss-2"):
        solver = prepare(scene, method)
        solver(np.array(scene.omega), 6.0)
        assert (solver.status, solver.steps) == ("gave up", 0)


REST, SPHERE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
RUNAWAY = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))  # infinite at t = 1
GROWING = Scene("", REST, coefficients=(-1.67, -1.2, 3.0), torque=TorqueLaw((-0.5, 6.0, -9.8)))
BEYOND = Scene("", (1e300, -3e16, 1e16), coefficients=(1e100, -1e100, 1.0))
STEEP = Scene(
    "", (7e-63, 5e-242, -3e-86), coefficients=(1.2e5, 1.5e183, 2.5e297),
    torque=TorqueLaw((1.0, 1.0, 2e-308), (1.7976931348623157e308, 2e5, -8e-147)),
)  # fmt: skip
PUSHED = Scene("", REST, SPHERE, torque=TorqueLaw((-4.8e-92, -7.5e113, 2.2e165)))
RAMPED = Scene(
    "", (0.0, 0.0, 9.0), coefficients=(-3.0, -4.0, -7.0),
    torque=TorqueLaw(REST, (-10.0, -76.0, 4.6e272)),
)  # fmt: skip
LIGHT = Scene("", (1.0, 2.0, 3.0), (1.0, 5e-324, 1.0), torque=TorqueLaw((1.0, 1.0, 1.0)))
LONG = Scene("", (0.01, 7.0, -9.7), (9.85, 2.99, 1800.0))


@pytest.mark.parametrize(("scene", "times", "method", "tolerance", "end"), [
    # ValueError: the maximum of no rows.
    *((RUNAWAY, [2.0, 3.0], f"gauss-{stages}", 1e-6, "overflow") for stages in (1, 3, 5)),
    # The time is too long for the method, and there is no blow-up; it reported one.
    (GROWING, [3000.0], "gauss-1", 1e-2, "refused"),
    # ZeroDivisionError: no step is small enough.
    (BEYOND, [0.0], "gauss-1", 1e-6, "complete"),
    (BEYOND, [1.0], "gauss-1", 1e-6, "refused"),
    # An intermediate row was not finite.
    (STEEP, [-0.0, -10.0], "taylor", 1e-10, "overflow"),
    # Radau: ValueError from a matrix of infinities; LSODA: a warning on stderr.
    (PUSHED, [0.09], "radau", 1e-7, "complete"),
    (PUSHED, [1e200], "radau", 1e-7, "overflow"),
    (RAMPED, [-0.48, -2353.0], "lsoda", 5e-7, "overflow"),
    # NumPy printed a warning of an overflow on stderr.
    (LIGHT, [1.0], "gauss-4", 1e-12, "refused"),
    (LIGHT, [1.0], "taylor", 1e-12, "refused"),
    # It took minutes; callers of `pyharness.truth.reference` may still wait as long.
    (LONG, [1000.0], "reference", 1e-10, "refused"),
])  # fmt: skip
def test_extreme_motion_ends_in_time_and_says_how(
    scene: Scene, times: list[float], method: str, tolerance: float, end: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("pyharness.engine.methods.gauss._MOST_EVALUATIONS", 1_000_000)
    if end == "refused":
        refused("", solve, scene, times, method, tolerance)
        return
    found = solve(scene, times, method, tolerance)
    assert found.ended == end
    assert np.isfinite(found.omega).all()
    if scene is RUNAWAY:
        assert len(found.time) == 0
    elif end == "complete":
        wanted = np.array(scene.omega) + times[0] * np.array(scene.law.constant)
        np.testing.assert_allclose(found.omega[0], wanted, rtol=1e-7, atol=1e157)


@pytest.mark.parametrize("size", [1e158, 1e200])
def test_errors_relative_to_an_omega_out_of_range_are_unknown(size: float) -> None:
    """Regression test: an omega of 1e-160 rad/s was wrong by one percent, and `complete`."""
    moments = (2.4 * size, 2.2 * size, 2.0 * size)

    def torque(t: Any, omega: Any) -> list[Any]:
        return [1.0 + 0.1 * np.sin(2.0 * t), -t * t, 0.2]

    found = solve(Scene("", REST, moments, torque=torque), 9.76, tolerance=1e-3)
    assert found.ended == "sensitive"
    assert found.error == pytest.approx(1.0)


def test_scipy_gives_up_by_what_it_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression test: Radau took half a minute and more, since its right-hand sides cost more."""
    monkeypatch.setattr("pyharness.engine.methods.scipy_ivp._MOST_EVALUATIONS", 3_000)
    waves = [((1.0, 2.0, 3.0), 1e4 + n) for n in range(8)]
    for law, method, most in (
        (TorqueLaw((1e42, 0.0, 0.0)), "dop853", 3000),
        (TorqueLaw((1e42, 0.0, 0.0)), "radau", 1500),
        (TorqueLaw((1e42, 0.0, 0.0), sines=waves), "dop853", 1500),
    ):
        scene = Scene("", (1.0, 1.0, 9.0), moments=(4.0, 7.0, 8.5), torque=law)
        refused(f"after {most} ", solve, scene, [0.7], method, 1e-9)


RATE = (1e244, -2e244, 0.0)


@pytest.mark.parametrize(("law", "time"), [
    (TorqueLaw(rate=RATE), 7.0), (TorqueLaw((5e163, 2e163, 0.0), RATE), 7.0),
    (TorqueLaw(sines=[((1e150, 0.0, 0.0), 1e-220)]), 1e90),
])  # fmt: skip
def test_a_torque_that_underflows_in_other_units_is_not_ignored(
    law: TorqueLaw, time: float
) -> None:
    """Regression test: the body stayed at rest, as a number of the torque became 0."""
    scene = Scene("", REST, (4.0, 3.0, 2.0), torque=law)
    refused("work limit", solve, scene, [time])
    solver = prepare(scene)
    assert np.isnan(solver(REST, time)).all()
    assert solver.status != "complete"
    found = solve_many([scene], time)
    assert np.isnan(found.omega).all()
    assert not found.has_result.any()


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_a_rate_about_one_axis_does_not_underflow_beside_another_torque(method: str) -> None:
    law = TorqueLaw((1e200, 0.0, 0.0), rate=(0.0, 1e200, 0.0))
    found = solve(Scene("", REST, (2.0, 2.0, 2.0), torque=law), [1.0], method)
    assert found.omega[0] == pytest.approx([5e199, 2.5e199, 0.0], rel=1e-9)


def test_a_subnormal_torque_that_scales_exactly_is_felt() -> None:
    unit = 2.0**532  # s
    moments, law = (2.0, 4.0, 4.0), TorqueLaw((3.0, 1.0, 2.0))
    wanted = solve(Scene("", (1.0, 2.0, 3.0), moments, torque=law), [1.0]).omega[0]
    law = TorqueLaw([x / unit / unit for x in law.constant])
    slow = Scene("", (1.0 / unit, 2.0 / unit, 3.0 / unit), moments, torque=law)
    assert solve(slow, [unit]).omega[0] * unit == pytest.approx(wanted, rel=1e-9)
    assert prepare(slow)(slow.omega, unit) * unit == pytest.approx(wanted, rel=1e-9)
