"""Motions of any scale have the same digits in other units, in rows and by a prepared solver."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, case_scene, prepare, solve
from pyharness.engine.plan.registry import FIXED_STEP, METHODS
from pyharness.engine.problem.rescaled import omega_by_torque, rescaling_factor, scaled

_METHODS = ("auto", "taylor", "quick", "gauss-2", "gauss-8", *FIXED_STEP)
_LAW = TorqueLaw(
    (10.0, -20.0, 15.0), (1.0, 0.0, -2.0), (((3.0, 0.0, 1.0), 4.0),), (((0.0, 2.0, 0.0), 5.0),)
)


def _tolerance(method: str) -> float:
    return max(1e-6, METHODS[method].finest)


@pytest.mark.parametrize("power", [-990, -600, -310, 310, 600, 990])
@pytest.mark.parametrize("method", _METHODS)
def test_same_bits_in_other_units(method: str, power: int) -> None:
    scene, time, factor = case_scene(4), 3.0, math.ldexp(1.0, power)
    fast = scaled(scene, factor)
    start = np.array(scene.omega)
    plain, solver = prepare(scene, method, 1e-6), prepare(fast, method, 1e-6)
    wanted = plain(start, time).copy()
    np.testing.assert_array_equal(solver(factor * start, time / factor) / factor, wanted)
    assert (solver.status, solver.steps) == ("complete", plain.steps)
    if method == "quick":
        return
    by_rows = solve(fast, [0.5 * time / factor, time / factor], method, _tolerance(method))
    rows = solve(scene, [0.5 * time, time], method, _tolerance(method))
    np.testing.assert_array_equal(by_rows.omega / factor, rows.omega)
    np.testing.assert_array_equal(by_rows.time, [0.5 * time / factor, time / factor])


@pytest.mark.parametrize("method", _METHODS)
def test_torques_are_scaled_too(method: str) -> None:
    scene = Scene("", (0.5, 1.0, -0.7), moments=(40.0, 30.0, 20.0), torque=_LAW)
    wanted = prepare(scene, method, 1e-6)(np.array(scene.omega), 2.0).copy()
    for power in (-330, 330):
        factor = math.ldexp(1.0, power)
        fast = scaled(scene, factor)
        assert rescaling_factor(fast, 2.0 / factor) != 1.0
        found = prepare(fast, method, 1e-6)(np.array(fast.omega), 2.0 / factor)
        np.testing.assert_array_equal(found / factor, wanted)


def test_ordinary_scenes_are_left_alone() -> None:
    for case in range(1, 8):
        assert rescaling_factor(case_scene(case), 1.0) == 1.0
    # The effect of the torque counts: such a start soon becomes an ordinary motion.
    for case, first, time in ((5, 1e-200, 1.0), (4, 0.0, 1.0), (4, 1e200, 1e200)):
        assert rescaling_factor(replace(case_scene(case), omega=(first, 0.0, 0.0)), time) == 1.0


def test_a_result_beyond_the_range_of_numbers_is_an_overflow() -> None:
    """Axis 3 gets more than 1.8e308 rad/s, from the energy of the others."""
    scene = Scene("", (1e307, 1.6e308, 1e308), moments=(3.0, 2.0, 0.5))
    times = [1e-309 * k for k in range(1, 100)]
    run = solve(scene, times, "taylor", 1e-12)
    assert run.ended == "overflow"
    assert 0 < len(run.omega) < len(times)
    assert np.isfinite(run.omega).all()
    solver = prepare(scene, "taylor", 1e-12)
    ends = [
        (bool(np.isfinite(solver(np.array(scene.omega), t)).all()), solver.status) for t in times
    ]
    assert set(ends) == {(True, "complete"), (False, "overflow")}


@pytest.mark.parametrize("method", ["dop853", "rk45", "radau", "lsoda"])
def test_solve_ivp_says_overflow_where_omega_leaves_the_range(method: str) -> None:
    law = TorqueLaw((1e10, 2e10, -1e10))
    scene = Scene("", (0.0, 0.0, 0.0), moments=(2.0, 2.0, 2.0), torque=law)
    assert solve(scene, [1e300], method, 1e-6).ended == "overflow"


@pytest.mark.parametrize("method", ["lsoda", "dop853", "rk45", "radau"])
def test_solve_ivp_in_spans_whose_square_is_no_number(method: str) -> None:
    """LSODA squares the span, and did not advance in spans below 1e-150 s."""
    for size in (1e-120, 1e-150, 1e-160, 1e-200, 1e-300):
        scene = replace(case_scene(3), omega=(size, size, size))
        np.testing.assert_allclose(solve(scene, [1.0], method, 1e-9).omega / size, 1.0, rtol=1e-9)
    power = 2.0**530
    slow = Scene("", (0.3, 1.0, 1.0), coefficients=(1.0, -1.0, -0.51))
    fast = replace(slow, coefficients=(power, -power, -0.51 * power))
    found = solve(fast, [-10.0 / power, -20.0 / power], method, 1e-6)
    wanted = solve(slow, [-10.0, -20.0], "taylor", 1e-12)
    np.testing.assert_allclose(found.omega, wanted.omega, rtol=0.0, atol=2e-6)


def test_longer_motions_get_finer_steps_of_solve_ivp() -> None:
    """Local errors add up: thirty times as long, the result is still within the tolerance."""
    scene = Scene("", (1e-2, 1.0, 0.3), moments=(6.0, 5.0, 2.0))
    moments = np.array(scene.moments)
    for method in ("lsoda", "dop853"):
        run = solve(scene, [250.0], method, 1e-6)
        for weights in (moments, moments * moments):
            drift = weights @ (run.omega[-1] ** 2 - np.array(scene.omega) ** 2)
            assert abs(drift) < 2e-6 * (weights @ np.abs(run.omega[-1]))


@pytest.mark.parametrize("method", [*(m for m in _METHODS if m != "quick"), "sphere"])
@pytest.mark.parametrize(("law", "time", "wanted"), [
    (TorqueLaw((1e-281, 2e-281, 0.0)), 1e-24, 1e-305),
    (TorqueLaw((1e-290, 2e-290, 0.0)), 1e-15, 1e-305),
    (TorqueLaw(rate=(1e20, 2e20, 0.0)), 1e-60, 5e-101),
    (TorqueLaw(cosines=(((1e-281, 0.0, 0.0), 1.0),)), 1e-24, 1e-305),
])  # fmt: skip
def test_a_scale_that_loses_time_or_torque_is_not_taken(
    method: str, law: TorqueLaw, time: float, wanted: float
) -> None:
    """In other units the time would be 0, or the torque infinite."""
    moments = (1.0, 1.0, 1.0) if method == "sphere" else (1.0, 2.0, 2.5)
    scene = Scene("", (0.0, 0.0, 0.0), moments, torque=law, step_size=0.1 * time, steps=10)
    name = "auto" if method == "sphere" else method
    solver = prepare(scene, name, 1e-6)
    found = solver(np.zeros(3), time)
    assert solver.status == "complete"
    assert found[0] == pytest.approx(wanted, rel=1e-6, abs=0.0)
    rows = solve(scene, [time], name, _tolerance(name))
    assert rows.omega[0, 0] == pytest.approx(wanted, rel=1e-6, abs=0.0)


def test_torque_counts_by_what_it_gives_a_body() -> None:
    law = TorqueLaw((1e-50, 0.0, 0.0))
    scene = Scene("heavy", (0.0, 0.0, 0.0), moments=(1e50, 1e50, 1e50), torque=law)
    assert rescaling_factor(scene, 1.0) > 2.0**300


@pytest.mark.parametrize("time", [0.01, -1.3, 40.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_bound_of_what_torque_gives_holds_on_a_sphere(axis: int, time: float) -> None:
    """Without gyroscopic torques omega is the integral of the torque over the moment."""
    sphere = Scene("", (0.0, 0.0, 0.0), moments=(4.0, 4.0, 4.0))
    for law in (
        TorqueLaw((3.0, -2.0, 1.0)),
        TorqueLaw(rate=(1.0, -2.0, 0.5)),
        TorqueLaw(sines=(((2.0, 1.0, -3.0), 0.01),)),
        TorqueLaw(sines=(((2.0, 1.0, -3.0), 7.0),)),
        TorqueLaw(cosines=(((1.0, -3.0, 2.0), 5.0),)),
    ):
        # The torque has one axis only, because the bound is on the largest component.
        kept = np.eye(3)[axis]
        part = replace(
            law, constant=tuple(kept * law.constant), rate=tuple(kept * law.rate),
            sines=tuple((tuple(kept * a), f) for a, f in law.sines),
            cosines=tuple((tuple(kept * a), f) for a, f in law.cosines),
        )  # fmt: skip
        times = (time * np.linspace(0.0, 1.0, 400)[1:]).tolist()
        reached = np.abs(solve(replace(sphere, torque=part), times).omega).max()
        bound = omega_by_torque(replace(sphere, torque=part), time)
        assert reached <= (1.0 + 1e-12) * bound <= 2.6 * reached


def test_bound_of_what_torque_gives_is_of_the_smallest_moment_for_a_torque_in_space() -> None:
    scene = Scene("", (0.0, 0.0, 0.0), moments=(4.0, 3.0, 2.0), torque=TorqueLaw((6.0, 0.0, 0.0)))
    assert omega_by_torque(scene, -2.0) == 3.0
    assert omega_by_torque(replace(scene, torque=replace(scene.law, frame="space")), -2.0) == 6.0
    assert omega_by_torque(replace(scene, moments=(1e-300, 3.0, 2.0)), 1e10) == math.inf
