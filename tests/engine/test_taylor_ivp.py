"""Tests of the Taylor method for `scipy.integrate.solve_ivp`."""

import importlib.util
import inspect
import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import OdeSolver, quad, solve_ivp

from pyharness import InputError, Taylor
from tests.engine.textbook import PROBLEMS, Problem, pendulum, solution
from tests.engine.time_ivp import error

# SciPy's tests of `solve_ivp` whose lists of methods are replaced by Taylor alone.
OF_SCIPY = (
    "test_integration", "test_events", "test_max_step", "test_first_step",
    "test_t_eval_early_event", "test_no_integration", "test_no_integration_class", "test_empty",
    "test_classes", "test_integration_zero_rhs", "test_zero_interval",
    "test_tbound_respected_small_interval", "test_tbound_respected_larger_interval",
    "test_tbound_respected_oscillator",
)  # fmt: skip
# Those that fail, and why.
EXCEPTIONS = {
    "test_max_step": "a step of 1e-20 is refused at once, and not only when it is repeated",
    "test_tbound_respected_small_interval": "its function compares the time",
}


@cache
def scipy_tests() -> ModuleType | None:
    """Return SciPy's tests, with Taylor as the method, or None if they are not installed."""
    if importlib.util.find_spec("scipy.integrate._ivp.tests") is None:
        return None
    found = importlib.util.find_spec("scipy.integrate._ivp.tests.test_ivp")
    if found is None or found.origin is None:
        return None
    source = Path(found.origin).read_text()
    source, named = re.subn(r"\[\s*'RK23', 'RK45', 'DOP853'[^\]]*\]", "[Taylor]", source)
    source, classes = re.subn(r"\[RK23, RK45, DOP853, Radau, BDF, LSODA\]", "[Taylor]", source)
    if not (named and classes):
        return None
    # Marks of SciPy's own configuration of pytest.
    source = re.sub(r"^@pytest\.mark\.(?!parametrize).*\n", "", source, flags=re.M)
    module = ModuleType("scipy_tests")
    module.__dict__.update(Taylor=Taylor, __file__=found.origin)
    exec(compile(source, found.origin, "exec"), module.__dict__)
    return module


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", OF_SCIPY)
def test_the_tests_of_scipy_pass(name: str) -> None:
    test: Callable[..., None] | None = getattr(scipy_tests(), name, None)
    if test is None:
        pytest.skip("this SciPy has no such test, or other lists of methods")
    known = {"method": Taylor, "num_parallel_threads": 1}
    given = {each: known[each] for each in inspect.signature(test).parameters}
    if name in EXCEPTIONS:
        with pytest.raises((AssertionError, RuntimeError, InputError)):
            test(**given)
    else:
        test(**given)


@pytest.mark.sampled
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_errors_are_smaller_than_those_of_dop853(problem: Problem, tolerance: float) -> None:
    # At rounding error, either may be the smaller one.
    assert error(problem, Taylor, tolerance) <= max(error(problem, "DOP853", tolerance), 2e-13)


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_the_way_back_returns_to_the_start(problem: Problem) -> None:
    # An attractor repels backward.
    attracts = problem.name in ("Van der Pol", "Brusselator", "Lorenz")
    span = (0.0, (0.02 if attracts else 0.3) * problem.end)
    options: dict[str, Any] = {"method": Taylor, "rtol": 1e-12, "atol": 1e-13}
    there = solve_ivp(problem.fun, span, problem.y0, **options)
    back = solve_ivp(problem.fun, span[::-1], there.y[:, -1], **options)
    assert back.t[-1] == 0.0
    assert np.abs(back.y[:, -1] - problem.y0).max() <= 1e-8


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-12])
def test_the_dense_output_is_as_accurate_as_the_ends_of_steps(tolerance: float) -> None:
    def fun(t: Any, y: Any) -> Any:
        return [y[1], -y[0], -2.0 * t * y[2]]

    options: dict[str, Any] = {"method": Taylor, "rtol": tolerance, "atol": tolerance}
    found = solve_ivp(fun, (0.0, 6.0), [1.0, 0.0, 1.0], dense_output=True, **options)

    def largest(t: Any, y: Any) -> float:
        return float(np.abs(y - [np.cos(t), -np.sin(t), np.exp(-t * t)]).max())

    times = np.random.default_rng(5).uniform(0.0, 6.0, 1000)
    assert largest(times, found.sol(times)) <= max(2.0 * largest(found.t, found.y), tolerance)
    assert found.sol(times[0]).shape == (3,)
    np.testing.assert_allclose(found.sol(found.t), found.y, rtol=0.0, atol=4e-16)


def test_a_step_is_not_longer_than_a_pulse() -> None:
    # exp(-x**2) with x = 100 (t - 5) is invisible at the beginning of a step, and so is its sum.
    found = solve_ivp(
        lambda t, y: [np.exp(-((100.0 * (t - 5.0)) ** 2))], (0.0, 9.0), [1.0], method=Taylor
    )
    assert found.y[0, -1] == pytest.approx(1.0 + 0.01 * math.sqrt(math.pi), abs=1e-5)
    assert len(found.t) < 200


def test_every_operation_is_integrated() -> None:
    def fun(t: Any, y: Any) -> Any:
        return [
            np.sqrt(1.0 + y[0] ** 2) / (2.0 + np.cos(t)),
            np.tanh(y[1]) - np.exp(-y[0]) * y[1] ** 3,
            np.tan(0.1 * y[2]) + np.sinh(0.1 * t) - np.cosh(0.1 * y[0]) / (1 + t) ** 2,
        ]

    options = {"rtol": 1e-12, "atol": 1e-13}
    ours = solve_ivp(fun, (0.0, 3.0), [0.5, 0.7, -0.2], method=Taylor, **options)
    theirs = solve_ivp(fun, (0.0, 3.0), [0.5, 0.7, -0.2], method="DOP853", **options)
    np.testing.assert_allclose(ours.y[:, -1], theirs.y[:, -1], rtol=1e-10)


def test_arguments_and_arrays_are_those_of_scipy() -> None:
    def fun(t: Any, y: Any, matrix: Any, shift: float) -> Any:
        return matrix @ y + shift

    matrix = np.array([[-1.0, 2.0], [-3.0, 0.5]])
    ours, theirs = (
        solve_ivp(
            fun, (1.0, 3.0), [1.0, 2.0], method=method, args=(matrix, 0.5), t_eval=[1.5, 3.0],
            rtol=1e-10, atol=[1e-9, 1e-10], max_step=0.25, first_step=0.125,
        )
        for method in (Taylor, "DOP853")
    )  # fmt: skip
    assert ours.y.shape == (2, 2)
    np.testing.assert_allclose(ours.y, theirs.y, atol=1e-9)


def failed_at(solver: Taylor) -> tuple[float, str | None]:
    """Return the time and message of the failure, which must come within 5000 steps."""
    for _ in range(5000):
        message = solver.step()
        if solver.status == "failed":
            return solver.t, message
    return pytest.fail(f"no failure until {solver.t} s")


@pytest.mark.parametrize(("begin", "max_step"), [(0.0, 5e-324), (1.0 - 1e-15, 1.2e-16)])
def test_a_max_step_below_the_spacing_of_times_fails(begin: float, max_step: float) -> None:
    solver = Taylor(pendulum, begin, [1.0, 0.0], begin + 1.0, max_step=max_step)
    assert failed_at(solver)[1] == OdeSolver.TOO_SMALL_STEP


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_switch_without_end_fails(start: float) -> None:
    time, message = failed_at(Taylor(lambda t, y: -np.sign(y), 0.0, [start], 4.0))
    assert message is not None
    assert "would change back and forth without end" in message
    assert time == pytest.approx(start)


def test_many_switches_or_short_steps_do_not_fail() -> None:

    found = solve_ivp(lambda t, y: np.sign(np.sin(1e6 * t)) - y, (1.0, 1.001), [0.0], method=Taylor)
    assert found.success
    assert len(found.t) > 300
    short = 64.0 * math.ulp(1.0)
    end = 1.0 + 200.0 * short
    assert solve_ivp(pendulum, (1.0, end), [1.0, 0.0], method=Taylor, max_step=short).t[-1] == end


@pytest.mark.parametrize("friction", [0.1, 0.2, 0.9])
def test_switches_whose_intervals_shrink_to_nothing_fail(friction: float) -> None:
    def twisting(t: Any, y: Any) -> Any:
        return [y[1], -np.sign(y[0]) - friction * np.sign(y[1])]

    _, message = failed_at(Taylor(twisting, 0.0, [1.0, 0.5], 200.0))
    assert message is not None
    ends = ["would change back and forth without end"]
    if friction < 0.2:
        # The intervals shrink so slowly that rounding errors decide which comes first.
        ends.append("step size is less than spacing")
    assert any(end in message for end in ends)


def test_a_terminal_event_ends_an_infinite_time_span() -> None:
    def fall(t: Any, y: Any) -> Any:
        return [y[1], -9.81]

    def ground(t: Any, y: Any) -> Any:
        return y[0]

    ground.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(fall, (0.0, math.inf), [10.0, 0.0], method=Taylor, events=ground)
    assert found.status == 1
    assert found.t[-1] == pytest.approx(math.sqrt(20.0 / 9.81), rel=1e-12)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-12])
@pytest.mark.parametrize("speed", [1e-3, 10.0, 1e4])
@pytest.mark.parametrize("end", [1e6, math.inf])
def test_a_cannon_on_the_ground_is_not_stopped_by_its_start(
    end: float, speed: float, tolerance: float
) -> None:
    # The solution has three terms, so that the tolerances allow one step for all of it.
    for earth in (0.0, 6.4e6):

        def ground(t: Any, y: Any, earth: float = earth) -> Any:
            return y[0] - earth

        ground.terminal, ground.direction = True, -1  # type: ignore[attr-defined]
        found = solve_ivp(
            lambda t, y: [y[1], -0.5], (0.0, end), [earth, speed], method=Taylor,
            rtol=tolerance, atol=1e-3 * tolerance, events=[lambda t, y: y[1], ground],
        )  # fmt: skip
        apex, impact = found.t_events
        assert apex == pytest.approx([2.0 * speed], rel=1e-6)
        assert impact == pytest.approx([4.0 * speed], rel=1e-4 if earth else 1e-9)


def test_a_singularity_fails() -> None:
    found = solve_ivp(lambda t, y: [y[0] ** 2], (0.0, 2.0), [1.0], method=Taylor)
    assert not found.success
    assert "step size is less" in found.message
    assert found.t[-1] == pytest.approx(1.0, abs=1e-3)
    at_once = solve_ivp(lambda t, y: [1.0 / t], (0.0, 1.0), [1.0], method=Taylor)
    assert (at_once.success, at_once.t.tolist()) == (False, [0.0])


def test_a_component_that_is_zero_needs_no_absolute_tolerance() -> None:
    found = solve_ivp(pendulum, (0.0, 9.0), [0.0, 1.0], method=Taylor, rtol=1e-9, atol=0.0)
    truth = solve_ivp(pendulum, (0.0, 9.0), [0.0, 1.0], method=Taylor, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(found.y[:, -1], truth.y[:, -1], rtol=1e-8)
    assert (solve_ivp(pendulum, (0.0, 9.0), [0.0, 0.0], method=Taylor, atol=0.0).y == 0.0).all()


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1e9])
def test_the_unit_of_time_does_not_matter(scale: float) -> None:
    found = solve_ivp(
        lambda t, y: [y[1] / scale, -np.sin(y[0]) / scale], (0.0, 20.0 * scale), [3.0, 0.0],
        method=Taylor, rtol=1e-9, atol=1e-9,
    )  # fmt: skip
    plain = solve_ivp(pendulum, (0.0, 20.0), [3.0, 0.0], method=Taylor, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.y[:, -1], plain.y[:, -1], atol=2e-7)
    assert len(found.t) <= len(plain.t) + 6


def test_the_truth_of_the_tests_is_independent_of_the_unknowns_order() -> None:
    # The solution of Kepler's problem is an ellipse with the period 2 pi.
    kepler = next(each for each in PROBLEMS if each.name.startswith("Kepler"))
    turn = Problem("turn", kepler.fun, kepler.y0, 2.0 * math.pi)
    np.testing.assert_allclose(solution(turn), kepler.y0, atol=1e-13)


@pytest.mark.parametrize("fun", [
    lambda t, y: -y[0],
    lambda t, y: -y,
    lambda t, y: -y.sum(),
    lambda t, y: [-np.mean(y)],
    lambda t, y: -(y @ y) / y[0],
])  # fmt: skip
def test_a_single_equation_may_return_a_number(fun: Any) -> None:
    found = solve_ivp(fun, (0.0, 1.0), [1.0], method=Taylor, rtol=1e-10, atol=1e-10)
    assert found.y[0, -1] == pytest.approx(math.exp(-1.0), rel=1e-10)


def test_many_unknowns_may_have_no_operations() -> None:
    """Storage that was too small for the rates ended the interpreter."""
    rates = np.linspace(0.1, 1.0, 150)
    found = solve_ivp(lambda t, y: -y * rates, (0.0, 1.0), np.ones(150), method=Taylor, rtol=1e-10)
    assert found.y[:, -1] == pytest.approx(np.exp(-rates), rel=1e-9)


@pytest.mark.parametrize("begin", [-1e12, 1.7e9, 1e15])
def test_a_late_time_is_rounded_together_with_the_step(begin: float) -> None:
    options: dict[str, Any] = {"method": Taylor, "rtol": 1e-11, "atol": 1e-11}
    span = (begin, begin + 100.0)
    found = solve_ivp(lambda t, y: [y[1], -y[0]], span, [0.0, 1.0], dense_output=True, **options)
    np.testing.assert_allclose(found.y[0], np.sin(found.t - begin), atol=1e-9)
    limited = solve_ivp(lambda t, y: [y[1], -y[0]], span, [0.0, 1.0], max_step=0.3, **options)
    np.testing.assert_allclose(limited.y[0], np.sin(limited.t - begin), atol=1e-9)


def test_a_small_component_is_checked_beside_a_huge_one() -> None:
    # The pulse is invisible in the series at time 0, and its factor is too large for the limit of
    # the step: it is seen at the end of the step alone.
    def rate(t: Any) -> Any:
        return 1e50 * np.exp(50.0 * np.tanh(t - 3.0) - 150.0)

    def fun(t: Any, y: Any) -> Any:
        return [1e25 * np.cos(t), rate(t)]

    found = solve_ivp(fun, (0.0, 9.0), [0.0, 0.0], method=Taylor, rtol=1e-6, atol=1e-3)
    assert found.y[1, -1] == pytest.approx(quad(rate, 0.0, 9.0, epsrel=1e-10)[0], rel=1e-5)


def test_steps_that_were_cut_do_not_shorten_the_next() -> None:
    def expansions(tiny: float) -> int:
        steps = Taylor(lambda t, y: [y[1], -y[0]], 0.0, [0.0, 1.0], 100.0)
        while steps.t < 90.0:
            steps.step()
            steps.max_step = tiny if steps.max_step == math.inf else math.inf
        return steps.nfev

    # Every other step is tiny.
    assert expansions(1e-6) <= 2.1 * expansions(math.inf)


def test_components_of_any_size_need_no_absolute_tolerance() -> None:
    found = solve_ivp(
        lambda t, y: -y, (0.0, 1.0), [1e-300, 1.0, 5e-324], method=Taylor, rtol=1e-6, atol=0.0
    )
    assert found.success
    np.testing.assert_allclose(found.y[:2, -1], [1e-300 / math.e, 1.0 / math.e], rtol=1e-5)


def test_a_state_beyond_binary64_fails() -> None:
    found = solve_ivp(lambda t, y: 1e308 * np.cos(0.01 * t), (0.0, 9.0), [1e308], method=Taylor)
    assert not found.success
    assert np.isfinite(found.y).all()


def _relay(level: float, down: float, up: float) -> dict[str, Callable[..., Any]]:
    """Return an equation whose acceleration changes at a level, and the event there."""
    return {
        "fun": lambda t, y: [y[1], np.where(y[0] > level, -down, up)],
        "events": lambda t, y: 1.7 * (y[0] - level),
    }


@pytest.mark.parametrize("options", [{}, {"max_step": 0.1}])
def test_events_at_a_switch_are_found_once(options: dict[str, Any]) -> None:
    source = np.random.default_rng(20261129)
    for number in range(30):
        level = source.uniform(-5.0, 5.0) * (number % 2)
        down, up, start = *source.uniform(0.3, 3.0, 2), source.uniform(0.2, 2.0)
        rtol = float(10.0 ** source.uniform(-12.0, -6.0))
        found = solve_ivp(
            t_span=(0.0, 20.0), y0=[level + start, 0.0], method=Taylor, rtol=rtol, atol=rtol,
            **_relay(level, down, up), **options,
        )  # fmt: skip
        fall = math.sqrt(2.0 * start / down)
        halves = np.resize([2.0 * fall * down / up, 2.0 * fall], 200)
        wanted = fall + np.append(0.0, np.cumsum(halves))
        assert found.t_events[0] == pytest.approx(wanted[wanted < 20.0], abs=1e2 * rtol)
    found = solve_ivp(
        lambda t, y: [np.where(t > 1.0, 1.0, 0.0)], (0.0, 3.0), [0.0], method=Taylor,
        events=lambda t, y: t - 1.0,
    )  # fmt: skip
    assert found.t_events[0] == pytest.approx([1.0], abs=1e-15)


@pytest.mark.parametrize(
    ("excess", "rtol", "most"), [(1e-8, 1e-4, 1e-6), (1e-8, 1e-9, 1e-8), (1e-10, 1e-12, 3e-6)]
)
def test_a_level_that_is_barely_exceeded_keeps_its_width(
    excess: float, rtol: float, most: float
) -> None:
    found = solve_ivp(
        lambda t, y: [np.where(np.sin(1.3 * t) > 1.0 - excess, 1.0, 0.0)], (0.0, 3.0), [0.0],
        method=Taylor, rtol=rtol, atol=1e-13,
    )  # fmt: skip
    width = 2.0 * math.acos(1.0 - excess) / 1.3
    assert found.y[0, -1] == pytest.approx(width, rel=most)


def test_warnings() -> None:
    with pytest.warns(UserWarning, match="the method Taylor ignores `jac`, `lband`"):
        solve_ivp(pendulum, (0.0, 1.0), [1.0, 2.0], method=Taylor, jac=None, lband=1)
    with pytest.warns(UserWarning, match=r"`rtol` is too small; 2.2e-14 is used"):
        solve_ivp(pendulum, (0.0, 1.0), [1.0, 2.0], method=Taylor, rtol=1e-16)
