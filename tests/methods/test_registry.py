"""The registry: every method meets the tolerance that it was given, or says that it can't."""

import math
import re
from collections.abc import Sequence

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, case_scene
from pyharness.methods.registry import METHODS, SCIPY_METHODS
from pyharness.methods.scipy_ivp import RightHandSide
from pyharness.methods.solve import finest, solve
from pyharness.model.errors import TimedError
from pyharness.model.same_motion import scaled
from pyharness.original.programs import PROGRAM_REGISTRY
from pyharness.truth.reference import reference


@pytest.mark.parametrize("case", range(1, 8))
@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_tolerance_is_on_the_error_at_the_times(method: str, case: int) -> None:
    scene = case_scene(case)
    times = [0.1, 0.55, 1.0]
    truth = reference(scene, times)
    for asked in (1e-4, 1e-7, 1e-10) if method != "radau" else (1e-4, 1e-7):
        tolerance = max(asked, finest(method, scene, 1.0))
        found = solve(scene, times, method, tolerance)
        assert found.ended == "complete"
        error = np.abs(found.omega - truth.omega).max() / np.abs(truth.omega).max()
        assert error <= tolerance + 1e-14


@pytest.mark.parametrize("method", METHODS)
def test_times_may_run_either_way_on_either_side(method: str) -> None:
    scene = case_scene(3)
    tolerance = max(1e-9, METHODS[method].finest)
    forth = solve(scene, [0.25, 0.5], method, tolerance)
    back = solve(scene, [0.5, 0.25], method, tolerance)
    np.testing.assert_array_equal(forth.omega, back.omega[::-1])
    np.testing.assert_array_equal(back.time, [0.5, 0.25])
    past = solve(scene, [-0.5, -0.25, 0.0], method, tolerance)
    np.testing.assert_array_equal(past.omega[-1], scene.omega)
    # Torque-free and omega1(0) = 0: reversing time only turns the sign of omega1.
    np.testing.assert_allclose(
        past.omega[:2], back.omega * np.array([-1.0, 1.0, 1.0]), rtol=0, atol=1e-7
    )


@pytest.mark.parametrize("method", [name for name in METHODS if name != "closed-form"])
def test_solution_that_blows_up_returns_the_rows_until_then(method: str) -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    tolerance = max(1e-6, METHODS[method].finest)
    found = solve(scene, [0.5, 0.9, 2.0], method, tolerance)
    assert found.ended == "overflow"
    # The scene's own steps of 0.01 s are long near the pole.
    limit = 1e-5 if tolerance < 1.0 else 1e-2
    np.testing.assert_allclose(found.omega, [[2.0] * 3, [10.0] * 3], rtol=limit)


@pytest.mark.parametrize("method", ["dop853", "reference"])
def test_hopeless_scale_gives_up(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing hangs: the number of right-hand sides and of Taylor steps is bounded."""
    monkeypatch.setattr("pyharness.methods.scipy_ivp._MOST_EVALUATIONS", 10_000)
    scene = Scene("", (1e100, 1e100, 1e100), coefficients=(1.0, -1.0, 1.0))
    with pytest.raises(InputError, match=r"gave up|Taylor steps"):
        solve(scene, [2.0], method, 1e-6)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([], "none given"),
        ([1.0, float("nan")], "not finite"),
        ([-1.0, 1.0, 0.0], "monotonic"),
        ([1.0, 1.0], "monotonic"),
        ([1.0, 3.0, 2.0], "monotonic"),
    ],
)
def test_times_are_checked(times: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        solve(case_scene(3), times, "dop853", 1e-6)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 1e-17, 2.0, float("nan")])
def test_tolerance_is_checked(tolerance: float) -> None:
    with pytest.raises(InputError, match="tolerance"):
        solve(case_scene(3), [1.0], "dop853", tolerance)


def test_unknown_method_names_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'dop853'"):
        solve(case_scene(3), [1.0], "dop835", 1e-6)


def test_right_hand_sides_are_counted() -> None:
    counts = [solve(case_scene(3), [1.0], "dop853", e).evaluations for e in (1e-4, 1e-8, 1e-12)]
    assert 0 < counts[0] < counts[1] < counts[2]


@pytest.mark.parametrize("method", METHODS)
def test_rows_of_descending_times_belong_together(method: str) -> None:
    scene = case_scene(3)
    tolerance = max(1e-6, METHODS[method].finest)
    forth = solve(scene, [0.125, 0.25, 0.5], method, tolerance)
    back = solve(scene, [0.5, 0.25, 0.125], method, tolerance)
    np.testing.assert_array_equal(back.time, [0.5, 0.25, 0.125])
    np.testing.assert_array_equal(back.recorded_time, back.time)
    np.testing.assert_array_equal(back.omega, forth.omega[::-1])
    assert (back.steps, back.evaluations, back.ended) == (
        forth.steps, forth.evaluations, forth.ended,
    )  # fmt: skip


def test_descending_times_end_where_the_solution_does() -> None:
    scene = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = solve(scene, [2.0, 0.9, 0.5], "taylor", 1e-9)
    assert found.ended == "overflow"
    np.testing.assert_array_equal(found.time, [0.9, 0.5])
    np.testing.assert_array_equal(found.recorded_time, [0.9, 0.5])
    np.testing.assert_allclose(found.omega, [[10.0] * 3, [2.0] * 3], rtol=1e-8)


@pytest.mark.parametrize("power", [0, -400, 400])
@pytest.mark.parametrize(
    ("method", "words"),
    [
        ("dop853", r"gave up at t = ([\d.e+-]+) s after 2000 right-hand sides"),
        ("closed-form", r"at t = ([\d.e+-]+) s the phase"),
        ("taylor", r"gave up before t = ([\d.e+-]+) s after"),
        ("rk4", r"steps of ([\d.e+-]+) s are too many"),
    ],
)
def test_time_of_a_refusal_is_in_the_seconds_of_the_scene(
    method: str, words: str, power: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And it is that of the result that could not be had, not the first, nor the last."""
    monkeypatch.setattr("pyharness.methods.scipy_ivp._MOST_EVALUATIONS", 2000)
    plain = Scene("", (1.0, 1.0, 2.0), moments=(3.0, 2.0, 1.0))
    factor = math.ldexp(1.0, power)
    scene = scaled(plain, factor)
    # The last two are out of reach of all of them.
    times = [1.0 / factor, 1e19 / factor, 1e20 / factor]
    tolerance = max(1e-6, METHODS[method].finest)
    with pytest.raises(TimedError) as refusal:
        solve(scene, times, method, tolerance)
    found = re.search(words, str(refusal.value))
    assert found is not None, refusal.value
    time = float(found[1]) * factor
    if method == "dop853":
        assert 5.0 < time < 1e4
    else:
        assert time == pytest.approx({"rk4": 0.01, "taylor": 1.0}.get(method, 1e19), rel=1e-5)
    assert refusal.value.time * factor == pytest.approx(time, rel=1e-5)


def test_waves_leave_fewer_right_hand_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a wave costs is taken off, so that no refusal takes much longer than another."""
    monkeypatch.setattr("pyharness.methods.scipy_ivp._MOST_EVALUATIONS", 4000)
    wave = ((1.0, 2.0, 3.0), 50.0)
    law = TorqueLaw(sines=(wave,) * 4, cosines=(wave,) * 4)
    scene = Scene("", (1.0, 1.0, 2.0), moments=(3.0, 2.0, 1.0), torque=law)
    with pytest.raises(InputError, match="after 2000 right-hand sides"):
        solve(scene, [1000.0], "rk45", 1e-9)


@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_every_call_of_the_right_hand_side_is_counted(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = 0
    plain = Scene.right_hand_side

    def counted(scene: Scene) -> RightHandSide:
        slope = plain(scene)

        def call(time: float, omega: Sequence[float]) -> list[float]:
            nonlocal calls
            calls += 1
            return slope(time, omega)

        return call

    monkeypatch.setattr(Scene, "right_hand_side", counted)
    found = solve(case_scene(5), [0.5, 1.0], method, 1e-6)
    # Those of the look ahead too; SciPy's own count leaves out Radau's Jacobians.
    assert found.evaluations == calls


def test_time_of_a_refusal_in_a_span_whose_square_is_no_number(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("pyharness.methods.scipy_ivp._MOST_EVALUATIONS", 2000)
    law = TorqueLaw(sines=(((1e105, 2e105, 3e105), 1e104),))
    scene = Scene("", (1.0, 2.0, -1.0), moments=(3.0, 2.0, 1.0), torque=law)
    with pytest.raises(TimedError) as refusal:
        solve(scene, [1e-100], "rk45", 1e-9)
    assert 0.0 < refusal.value.time < 1e-100


@pytest.mark.parametrize("power", [-700, 700])
@pytest.mark.parametrize("method", SCIPY_METHODS)
def test_solve_ivp_in_units_far_from_one(method: str, power: int) -> None:
    """Products of such omegas are no numbers, or nothing."""
    factor = math.ldexp(1.0, power)
    scene = case_scene(4)
    found = solve(scaled(scene, factor), [1.0 / factor], method, 1e-6).omega / factor
    np.testing.assert_allclose(found, reference(scene, [1.0]).omega, rtol=0, atol=1e-5)


def test_reference_has_steps_enough_for_some_turns() -> None:
    scene = case_scene(3)
    found = solve(scene, [40.0], "reference", 1e-15).omega[0]
    closed = solve(scene, [40.0], "closed-form", 1e-14).omega[0]
    np.testing.assert_allclose(found, closed, rtol=0, atol=1e-12)


def test_orders_of_the_programs_are_those_of_their_schemes() -> None:
    """Two points, or four, and one correction: order 2; eq. 31: order 4."""
    orders = {name: program.order for name, program in PROGRAM_REGISTRY.items()}
    assert orders == {"two-term": 2, "four-term": 2, "runge-kutta": 4}


def test_steps_that_are_too_many_are_those_to_the_last_time() -> None:
    with pytest.raises(InputError, match=r"rk4: 1e\+10 steps of 0\.01 s are too many"):
        solve(case_scene(3), [1.0, 1e8], "rk4", 1.0)
