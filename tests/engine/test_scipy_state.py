"""SciPy's methods for torques that depend on the state, compared with the reference."""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, Trajectory, solve
from pyharness.checks.scenes.state_scenes import draw
from pyharness.engine.methods import scipy_state
from pyharness.engine.methods.scipy_ivp import FINEST, finest_tolerance, scipy_method
from pyharness.model.errors import InputError, TimedError
from pyharness.model.state_torque import StateTorque, opaque, replayed
from pyharness.torques import table
from pyharness.truth.reference import Reference, reference

METHODS = ("DOP853", "RK45", "Radau", "LSODA")
_MOMENTS = (1.5, 2.0, 3.0)
_OMEGA = (0.3, -1.1, 2.2)


def _random_scene(number: int) -> tuple[Scene, list[float]]:
    """Return a random scene, with attitude in half of them, and times (s) of results."""
    names = ("damping", "wheel", "drag", "wave", "decay", *("spring",) * (number % 2))
    scene, time = draw(Random(f"scipy-state {number}"), names)
    time = min(time, 8.0 / max(map(abs, scene.omega))) if time > 0.0 else time / 50.0
    return scene, [time * part for part in (0.2, 0.55, 1.0)]


def _error(found: Trajectory, truth: Reference) -> float:
    """Return the error of omega over the largest |omega| of the rows, or the angle's error."""
    error = float(np.abs(found.omega - truth.omega).max() / np.abs(truth.omega).max())
    if truth.attitude is None:
        assert found.attitude is None
        return error
    assert found.attitude is not None
    turned = 2.0 * np.linalg.norm(found.attitude - truth.attitude, axis=1).max()
    return max(error, float(turned))


@pytest.mark.sampled
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_an_opaque_torque_has_the_results_of_the_recorded_one(
    number: int, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The two right-hand sides differ by rounding errors, and therefore the results do too."""
    source = np.random.default_rng(number)
    damping, wheel, pull = source.uniform(-0.3, 0.3, 3), source.uniform(-1.0, 1.0, 3), number % 2

    def function(t: Any, w: Any, q: Any) -> list[Any]:
        pulse = np.exp(-((t - 2.0) ** 2))
        return [
            pulse - damping[0] * w[0] * w[0] + pull * q[1] * q[0],
            w[2] * wheel[0] - w[0] * wheel[2] - damping[1] * w[1] + np.sin(3.0 * t),
            w[0] * wheel[1] - w[1] * wheel[0] - damping[2] * w[2] - pull * q[3],
        ]

    # Without the series, both have the same longest steps.
    monkeypatch.setattr(scipy_state, "series_beside", lambda *_: None)
    kinds = replayed(function), opaque(lambda t, omega, attitude: function(t, omega, attitude))
    attitude = (0.5, -0.1, 0.7, 0.5)
    first, second = (
        scipy_method(name)(
            Scene("", _OMEGA, _MOMENTS, torque=each, attitude=attitude), [1.0, 4.0], 1e-6
        )
        for each in kinds
    )
    np.testing.assert_allclose(first.omega, second.omega, rtol=0, atol=1e-9)
    assert first.attitude is not None
    assert second.attitude is not None
    np.testing.assert_allclose(first.attitude, second.attitude, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", METHODS)
def test_a_short_pulse_is_not_missed(name: str) -> None:
    """A body at rest until a pulse of 0.2 s in 10 s: every first step sees no torque."""
    torque = replayed(lambda t, w, q: [np.exp(-200.0 * (t - 7.0) * (t - 7.0)), -w[1], -w[2]])
    scene = Scene("", (0.0, 0.0, 0.0), _MOMENTS, torque=torque)
    found = scipy_method(name)(scene, [10.0], 1e-6)
    wanted = math.sqrt(math.pi / 200.0) / _MOMENTS[0]
    assert found.omega[0, 0] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_step_passes_a_change_of_a_table(name: str, sign: float) -> None:
    """The pulses are far shorter than a step, and some rows are at their ends."""
    changes = [sign * x for x in (0.3, 0.301, 1.0, 1.0 + 1e-6, 1.7)]
    # From 0 on: no torque, a pulse, a constant, a shorter pulse, a constant, and again no torque.
    values = [(0, 0, 0), (900, 0, 50), (0, -0.2, 0), (0, 3e5, 0), (0.1, 0.1, 0.1), (0, 0, 0)]
    if sign < 0.0:
        changes.reverse()
        values.reverse()
    torque: Any = table([changes[0] - 1.0, *changes], values, "held")
    scene = Scene("", _OMEGA, _MOMENTS, torque=torque + replayed(lambda t, w, q: -0.1 * w))
    times = [sign * x for x in (0.0, 0.3, 0.3005, 0.301, 0.9, 1.0, 1.1, 1.7, 2.0)]
    tolerance = 1e-6 if name == "Radau" else 1e-9
    found = scipy_method(name)(scene, times, tolerance)
    assert found.time.tolist() == times
    assert _error(found, reference(scene, times)) <= tolerance
    assert len(np.unique(found.omega, axis=0)) == len(times)
    # The first piece holds before its breakpoint too.
    assert torque.tape.breaks == changes


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["Radau", "LSODA"])
def test_a_stiff_torque(name: str) -> None:
    torque = replayed(lambda t, w, q: -1e6 * (w - np.array([0.1, 0.2, 0.3])))
    scene = Scene("", _OMEGA, _MOMENTS, torque=torque)
    found = scipy_method(name)(scene, [1.0, 2.0], 1e-6)
    np.testing.assert_allclose(found.omega, [[0.1, 0.2, 0.3]] * 2, rtol=0, atol=1e-6)
    assert found.ended == "complete"


@pytest.mark.parametrize("name", METHODS)
def test_a_body_at_rest_and_the_state_at_time_zero_remain(name: str) -> None:
    torque = replayed(lambda t, w, q: -np.sqrt(w @ w) * w)
    attitude = (0.5, 0.5, -0.5, 0.5)
    for omega, times in (((0.0, 0.0, 0.0), [1.0, 2.0]), (_OMEGA, [0.0])):
        for law in (torque, TorqueLaw()):
            scene = Scene("", omega, _MOMENTS, torque=law, attitude=attitude)
            found = solve(scene, times, name.lower(), 1e-8, attitude=True)
            assert found.has_all_rows
            np.testing.assert_array_equal(found.omega, [omega] * len(times))
            np.testing.assert_array_equal(found.attitude, [attitude] * len(times))


def _one(component: Any) -> list[Any]:
    return [component, 0.0, 0.0]


@pytest.mark.sampled
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize(("torque", "rows"), [
    (replayed(lambda t, w, q: _one(w[0] * w[0] * 3.0)), 1),  # omega becomes infinite
    (replayed(lambda t, w, q: _one(1.0 / (t - 2.0))), 2),
    (replayed(lambda t, w, q: _one(np.sqrt(0.9 - t))), 1),
    (replayed(lambda t, w, q: _one(1.0 / t)), 0),
    (opaque(lambda t, w: _one(math.inf if t > 0.7 else 0.1)), 1),
    (opaque(lambda t, w: _one(-math.inf)), 0),
    (opaque(lambda t, w: _one(np.float64(1.0) / np.float64(t))), 0),
])  # fmt: skip
def test_the_rows_end_where_the_torque_is_singular(
    name: str, torque: StateTorque, rows: int
) -> None:
    scene = Scene("", _OMEGA, _MOMENTS, torque=torque)
    found = scipy_method(name)(scene, [0.5, 1.0, 3.0], 1e-7)
    assert found.ended == "overflow"
    assert found.time.tolist() == [0.5, 1.0, 3.0][:rows]
    assert np.isfinite(found.omega).all()
    if rows and torque.tape is not None:
        assert _error(found, reference(scene, [0.5, 1.0][:rows])) <= 1e-7


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("later", [0.0, 0.4])
def test_an_opaque_function_that_returns_nan_is_refused_with_the_time(
    name: str, later: float
) -> None:
    torque = opaque(lambda t, w: _one(math.nan if t >= later else 0.1))
    with pytest.raises(TimedError, match="NaN") as refusal:
        scipy_method(name)(Scene("", _OMEGA, _MOMENTS, torque=torque), [0.2, 1.0], 1e-6)
    assert later <= refusal.value.time < later + 0.2


@pytest.mark.parametrize("name", METHODS)
def test_a_nan_in_a_trial_step_is_passed_by_shorter_steps(name: str) -> None:
    """Near its end omega3 is e**-15.6; trial steps pass 0, where the torque is NaN."""
    torque = opaque(lambda t, w: (0.0, 0.0, 50.0 * w[2] * np.log(w[2])))
    scene = Scene("", (0.0, 0.0, 0.9), (1.0, 1.0, 1.0), torque=torque)
    found = scipy_method(name)(scene, [0.1], 1e-7)
    assert found.ended == "complete"
    assert found.omega[0, 2] == pytest.approx(0.9 ** math.exp(5.0), abs=1e-7)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("later", [0.0, 0.4])
def test_an_exception_of_an_opaque_function_is_the_cause_of_an_input_error(
    name: str, later: float
) -> None:
    for raised in (KeyError("mass"), ZeroDivisionError("x"), ValueError("array has infs or NaNs")):

        def torque(t: Any, w: Any, raised: Exception = raised) -> Any:
            if t >= later:
                raise raised
            return -w

        scene = Scene("", _OMEGA, _MOMENTS, torque=opaque(torque))
        with pytest.raises(InputError, match=type(raised).__name__) as e:
            scipy_method(name)(scene, [1.0], 1e-6)
        assert e.value.__cause__ is raised


def test_an_opaque_function_must_return_three_numbers() -> None:
    for value in ([1.0, 2.0], 3.0, "abc", [1.0, 2.0, None], [1j, 0, 0]):
        torque = opaque(lambda t, w, value=value: value)
        with pytest.raises(InputError, match="torque"):
            solve(Scene("", _OMEGA, _MOMENTS, torque=torque), [1.0], "dop853", 1e-6)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("raised", [KeyboardInterrupt, SystemExit])
def test_an_interrupt_is_not_caught(name: str, raised: type[BaseException]) -> None:
    def torque(t: Any, w: Any) -> Any:
        if t > 0.4:
            raise raised
        return -w

    scene = Scene("", _OMEGA, _MOMENTS, torque=opaque(torque))
    with pytest.raises(raised):
        scipy_method(name)(scene, [1.0], 1e-6)


@pytest.mark.parametrize("name", METHODS)
def test_the_work_limit_holds(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pyharness.engine.methods.scipy_ivp._MOST_EVALUATIONS", 8000)
    calls = 0

    def torque(t: Any, w: Any) -> Any:
        nonlocal calls
        calls += 1
        return -0.5 * np.sign(w)  # chatters where a component of omega is 0

    scene = Scene("", _OMEGA, _MOMENTS, torque=opaque(torque))
    with pytest.raises(TimedError, match="jumps back and forth"):
        scipy_method(name)(scene, [20.0], 1e-6)
    assert calls <= 4001 + 60
    fast = replace(scene, torque=opaque(lambda t, omega: [math.cos(1e5 * t), 0.0, 0.0]))
    with pytest.raises(TimedError, match="--effort"):
        scipy_method(name)(fast, [20.0], 1e-6)


def test_a_jump_at_the_start_is_told() -> None:
    def torque(t: Any, w: Any) -> Any:
        return [-np.sign(w[0] - 1.0) if t < 1e-3 else 0.0, 0.0, 0.0]

    scene = Scene("", (1.0 + 1e-15, 0.0, 0.0), _MOMENTS, torque=opaque(torque))
    with pytest.raises(TimedError, match="jumps back and forth") as refused:
        solve(scene, 2.0, "dop853", 1e-6, effort=1e-5)
    assert refused.value.time == 0.0


@pytest.mark.campaign
def test_a_tolerance_that_can_not_be_met_is_refused() -> None:
    """A component of omega grows by the factor exp(21), and so does the error of the first step."""
    torque = replayed(lambda t, w, q: [6.0 * w[0], -w[1] + w[0] * w[0], -w[2]])
    scene = Scene("", (1e-9, 1.0, 0.5), (2.0, 2.0, 2.0), torque=torque)
    truth = reference(scene, [7.0])
    refused = set()
    for name in METHODS:
        try:
            found = scipy_method(name)(scene, [7.0], 1e-11)
        except InputError:
            refused.add(name)
        else:
            assert _error(found, truth) <= 1e-11
    assert {"DOP853", "RK45", "LSODA"} <= refused


@pytest.mark.parametrize("name", ["DOP853", "RK45", "LSODA"])
def test_the_smallest_tolerance_can_be_met(name: str) -> None:
    for number in (1, 2, 5):
        scene, times = _random_scene(number)
        least = 1.06 * finest_tolerance(name, scene, times[-1])
        assert FINEST[name] <= least < 1e-6
        assert _error(scipy_method(name)(scene, times, least), reference(scene, times)) <= least


def test_threads_may_use_lsoda_at_a_time() -> None:
    """LSODA of older versions of SciPy can't alternate between two integrations."""

    def slow(t: float, w: Any) -> Any:
        time.sleep(1e-5)  # another thread runs
        return -0.3 * w

    body = Scene("slow", (0.3, 1.1, -0.7), moments=(3.0, 2.0, 1.2), torque=opaque(slow))

    def last(_: int) -> list[float]:
        found: list[float] = solve(body, [1.0], "lsoda", 1e-6).omega[-1].tolist()
        return found

    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(last, range(8)))
    assert all(result == results[0] for result in results)


def test_an_opaque_torque_with_memory_is_refused() -> None:
    total = last = 0.0

    def integral(t: Any, omega: Any) -> Any:
        nonlocal total, last
        total, last = total + omega[0] * (t - last), t
        return [-0.1 * total, 0.0, 0.0]

    with pytest.raises(InputError, match="held_torque of a Stepper"):
        solve(Scene("", (1.0, 2.0, 3.0), (1.0, 2.0, 2.5), torque=opaque(integral)), [1.0])
