"""Events: planted roots, SciPy's conventions, terminal events, ready events, and messages."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import InputError, Scene, TorqueLaw, case_scene, load, solve
from pyharness.engine import event_fits
from pyharness.engine.event_fits import Solution
from pyharness.engine.event_functions import event_functions
from pyharness.events import Event, crosses, extremum, flip, rest, tilt
from pyharness.model.dense_output import Pieces
from pyharness.model.trajectory import Array, Trajectory
from pyharness.torques import damping, opaque, pulses
from tests.campaigns import driver
from tests.campaigns.event_campaign import BODY, CORNERS, KINDS, planted, search, try_function

METHODS = ("auto", "closed-form", "taylor", "dop853", "gauss-4", "reference")


def with_attributes(
    function: Callable[..., Any], terminal: Any = False, direction: Any = 0
) -> Callable[..., Any]:
    function.terminal, function.direction = terminal, direction  # type: ignore[attr-defined]
    return function


def events_of(found: Trajectory) -> tuple[list[Array], list[Array]]:
    assert found.t_events is not None
    assert found.y_events is not None
    return found.t_events, found.y_events


def times_of(scene: Scene, times: Any, event: Any, **others: Any) -> list[float]:
    (found,), _ = events_of(solve(scene, times, events=event, **others))
    return [float(each) for each in found]


def second(t: Any, omega: Any) -> Any:
    return omega[1]


@pytest.mark.campaign
@pytest.mark.parametrize(("kinds", "count"), [(KINDS, 110), (CORNERS, 250)])
def test_planted_roots_are_found_and_none_is_invented(kinds: tuple[str, ...], count: int) -> None:
    tally = driver.campaign("", partial(try_function, kinds=kinds), count, "7")
    assert tally.counts["roots"] >= 3000
    assert tally.faults == []


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("cosine", 3000260), ("cosine", 3000518), ("polynomial", 3000822), ("edges", 1000003),
        # A simple root was lost beside one of multiplicity 7.
        ("odd", 5402000106),
    ],
)  # fmt: skip
def test_roots_of_planted_functions_are_found(kind: str, seed: int) -> None:
    tally = driver.Tally()
    search(kind, seed, tally)
    assert tally.faults == []


@pytest.mark.parametrize("seed", range(6))
def test_events_of_random_bodies_are_the_sign_changes_of_many_rows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = Scene("", tuple(rng.normal(size=3)), moments=(1.0, 1.5, 2.0), torque=damping(0.02))
    weights, shift = rng.normal(size=7), rng.normal() * 0.3

    def event(t: Any, omega: Any, attitude: Any) -> Any:
        return sum(weights[:3] * [*omega]) + attitude[0] * attitude[1] * weights[3] + shift

    times = np.linspace(0.0, 40.0, 40001)
    rows: Any = solve(body, times, attitude=True)
    q = rows.attitude
    values = rows.omega @ weights[:3] + q[:, 0] * q[:, 1] * weights[3] + shift
    expected = times[1:][np.diff(values > 0.0)]
    found = times_of(body, 40.0, event, attitude=True)
    assert len(found) >= len(expected) > 0
    # Roots that the rows do not show are pairs between two of them.
    assert found[: len(expected)] == pytest.approx(expected.tolist(), abs=1.1e-3)


def test_every_kind_of_function_has_roots() -> None:
    for kind in KINDS:
        assert sum(len(planted(kind, np.random.default_rng(k)).roots) for k in range(9)) > 9


@pytest.mark.sampled
@pytest.mark.parametrize("method", METHODS)
def test_events_of_a_body_are_those_of_scipy(method: str) -> None:
    tolerance = 1e-10
    a = [(2.0 - 3.0) / 1.0, (3.0 - 1.0) / 2.0, (1.0 - 2.0) / 3.0]
    expected = solve_ivp(
        lambda t, w: [a[0] * w[1] * w[2], a[1] * w[2] * w[0], a[2] * w[0] * w[1]],
        (0.0, 30.0), BODY.omega, "DOP853", events=second, rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    times, states = events_of(solve(BODY, 30.0, method, tolerance, events=second))
    assert len(times[0]) == 4
    np.testing.assert_allclose(times[0], expected.t_events[0], atol=1e-8)
    np.testing.assert_allclose(states[0], expected.y_events[0], atol=1e-8)


def test_fixed_step_has_the_events_of_its_dense_output() -> None:
    scene = replace(BODY, step_size=0.01)
    found: Any = solve(scene, 30.0, "rk4", events=second, dense_output=True)
    (times,), (states,) = events_of(found)
    assert len(times) == 4
    np.testing.assert_allclose(times, times_of(BODY, 30.0, second), atol=1e-5)
    np.testing.assert_array_equal(states, found.sol(times).T)
    assert np.abs(states[:, 1]).max() < 1e-14


def test_long_motion_misses_no_event() -> None:
    times = np.array(times_of(BODY, 1000.0 * math.pi, second))
    assert len(times) == 450
    np.testing.assert_allclose(np.diff(times), np.diff(times).mean(), rtol=1e-10)


def test_double_root_counts_once_and_for_direction_0_alone() -> None:
    def touch(t: Any, omega: Any) -> Any:
        return (t - 3.0) ** 2

    assert times_of(BODY, 9.0, touch) == pytest.approx([3.0], rel=1e-13)
    for direction in (-1, 1):
        assert (
            times_of(BODY, 9.0, with_attributes(lambda *x: touch(*x[:2]), False, direction)) == []
        )


@pytest.mark.parametrize(("function", "expected", "rel"), [
    (lambda t: (t - 2.0) * (t - 2.000001), [2.0, 2.000001], 5e-10),
    *((lambda t, n=n: (t - 3.25) ** n, [3.25], 0.1) for n in (3, 4, 5)),
    (lambda t: abs(t - 3.1) - 0.5, [2.6, 3.6], 1e-6),
    (lambda t: 1.0 if t > math.pi else -1.0, [math.pi], 1e-12),
    (lambda t: np.tanh(1e6 * (t - 4.4)), [4.4], 1e-12),
])  # fmt: skip
def test_near_multiple_and_sudden_roots(function: Any, expected: list[float], rel: float) -> None:
    found = times_of(BODY, 9.0, lambda t, omega: function(t))
    assert found == pytest.approx(expected, rel=rel)


def test_value_of_an_extremum_of_omega_counts_once() -> None:
    (tops,), (states,) = events_of(solve(BODY, 6.9, events=extremum(2, direction=-1)))
    (found,) = events_of(solve(BODY, 6.9, events=crosses(2, states[0, 1])))[0]
    assert found == pytest.approx(tops, abs=1e-7)
    assert len(times_of(BODY, 6.9, crosses(2, states[0, 1] - 1e-9))) == 2
    assert times_of(BODY, 6.9, crosses(2, states[0, 1] + 1e-9)) == []


@pytest.mark.sampled
@pytest.mark.parametrize("end", [1.0, 2.7, -2.0, 40.0])
def test_roots_of_odd_multiplicity_are_as_exact_as_the_sign(end: float) -> None:
    # Omega is the time.
    scene = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=TorqueLaw((1.0, 0.0, 0.0)))
    root = math.copysign(1.0, end)
    for direction in (0, root, -root):
        events = [
            with_attributes(lambda t, omega, n=n: (omega[0] - root) ** n, False, direction)
            for n in (1, 3, 5, 7)
        ]
        expected = [root] if root * direction >= 0.0 else []
        for found in events_of(solve(scene, end, events=events))[0]:
            assert found.tolist() == pytest.approx(expected, abs=2.0**-52 * abs(end))


def test_function_that_is_0_everywhere_has_no_event() -> None:
    spin = Scene("spin", omega=(0.0, 0.0, 2.0), moments=(1.0, 1.0, 3.0))
    for times in (9.0, -9.0, [-9.0, 9.0]):
        for event in (crosses(1), crosses(3, 2.0), crosses(1, direction=1), flip(1)):
            assert times_of(spin, times, event) == []


def test_a_kink_within_a_step_ends_an_interval_of_zeros() -> None:

    law = TorqueLaw((0.0, 0.0, 0.0), cosines=[((0.2, 0.0, 0.0), 1.0)])
    scene = Scene("ball", (0.3, 0.2, 0.9), moments=(2.0, 2.0, 2.0), torque=law)
    found: Any = solve(scene, [7.0], events=lambda t, omega: min(float(omega[0]) - 0.33, 0.0))
    wanted = [math.asin(0.3), 2.0 * math.pi + math.asin(0.3)]
    assert found.t_events[0] == pytest.approx(wanted, abs=1e-7)


@pytest.mark.campaign
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_an_interval_of_zeros_is_one_event_wherever_the_integration_ends(direction: int) -> None:
    # Omega is 0, rises from 1 s to 1 in 2 s, and falls from 3 s to 0 in 4 s.
    push = pulses([1.0, 3.0], [1.0, 1.0], [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
    scene = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=push)
    dead = 0.25  # of a function that is 0 about 0.5
    knots: list[tuple[Callable[..., Any], list[tuple[float, int]]]] = [
        (lambda t, omega: omega[0], [(4.0, -1)]),
        (lambda t, omega: omega[0] - 1.0, [(2.0, 1)]),
        (lambda t, omega: (omega[0] - 1.0) ** 3, [(2.0, 1)]),
        (lambda t, omega: np.sign(np.round(2.0 * omega[0] - 1.0)), [(1.25, 1), (3.25, -1)]),
        (
            lambda t, omega: (
                np.maximum(omega[0] - 0.5 - dead, 0.0) + np.minimum(omega[0] - 0.5 + dead, 0.0)
            ),
            [(1.25, 1), (3.25, -1)],
        ),
    ]
    functions = [with_attributes(function, False, direction) for function, _ in knots]
    for end in (0.5, 1.5, 2.0, 2.2, 2.9, 3.6, 4.0, 4.4, 9.0):
        found = events_of(solve(scene, end, events=functions))[0]
        for times, (_, events) in zip(found, knots, strict=True):
            expected = [t for t, change in events if t <= end and direction in (0, change)]
            assert times.tolist() == pytest.approx(expected, abs=1e-12), end


def test_a_body_at_rest_has_no_error_that_hides_a_small_value() -> None:
    rest = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0))
    assert times_of(rest, [1.0, 1e3], lambda t, w: w[1] - 3e-11) == []
    pushed = replace(rest, torque=pulses([5.0], [1.0], [(0.0, 1e-10, 0.0)]))
    assert times_of(pushed, [1.0, 1e3], lambda t, w: w[1] - 3e-11) == pytest.approx([5.6])


def test_periodic_roots_after_an_interval_of_zeros_are_found() -> None:
    ball = Scene("", (0.0, 0.0, 1.0), moments=(1.0, 1.0, 1.0))
    found = times_of(ball, 6.5, lambda t, w: np.where(t < 1.0, 0.0, np.sin(np.pi * t)))
    assert found == pytest.approx([2.0, 3.0, 4.0, 5.0, 6.0], abs=1e-12)
    nutation = Scene("", (0.3, 2.0, 0.1), moments=(1.0, 2.0, 3.0))
    flips = times_of(nutation, 40.0, flip(2))
    jumps = times_of(nutation, 40.0, lambda t, w: np.where(t < flips[0], -1.0, w[1]))
    assert jumps == pytest.approx(flips, abs=1e-9)
    assert len(flips) == 7


@pytest.mark.parametrize(
    ("rate", "tolerance"), [(0.03, 1e-9), (0.03, 1e-12), (3e-3, 1e-12), (3e-4, 1e-9), (3e-5, 1e-9)]
)
@pytest.mark.parametrize("part", [0.2, 0.47])
def test_a_slow_state_has_one_event_in_a_dead_zone(
    rate: float, tolerance: float, part: float
) -> None:
    """Omega is 5 + rate (t - 1) exactly; its rounding errors are many spacings of time."""
    torque = TorqueLaw((rate, 0.0, 0.0))
    ball = Scene("", (5.0 - rate, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=torque)
    dead = part * rate

    def relay(t: Any, omega: Any) -> Any:
        return np.sign(omega[0] - 5.0) * (np.abs(omega[0] - 5.0) > dead)

    def spring(t: Any, omega: Any) -> Any:
        return np.maximum(omega[0] - 5.0 - dead, 0.0) - np.maximum(5.0 - dead - omega[0], 0.0)

    for event in (relay, spring):
        found = times_of(ball, 3.0, event, tolerance=tolerance)
        assert found == pytest.approx([1.0 - part], abs=20.0 * tolerance / rate)


@pytest.mark.parametrize("power", [3, 5, 7])
def test_roots_of_a_power_are_those_of_its_base(power: int) -> None:
    source = np.random.default_rng(20261130)
    for _ in range(12):
        third, spin, size, phase, level = source.uniform(
            [0.4, 0.5, 0.2, 0.0, -0.9], [1.9, 3, 2, 6, 0.9]
        )
        top = Scene(
            "", (size * math.cos(phase), size * math.sin(phase), spin), moments=(1.0, 1.0, third)
        )
        simple, high = (
            times_of(
                top, 25.0, lambda t, w, k=k, size=size, level=level: (w[0] / size - level) ** k
            )
            for k in (1, power)
        )
        assert high == pytest.approx(simple, abs=1e-3)


@pytest.mark.parametrize("rate", [-0.05, 0.05])
def test_a_narrow_dead_zone_is_an_event_at_its_near_end(rate: float) -> None:
    torque = TorqueLaw((rate, 0.0, 0.0))
    ball = Scene("", (-0.1, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=torque)
    found = times_of(ball, 80.0 * rate, lambda t, w: np.where(np.abs(w[0]) < 0.0015, 0.0, w[0]))
    assert found == pytest.approx([math.copysign(1.97, rate)], abs=1e-9)


@pytest.mark.campaign
def test_an_interval_of_zeros_is_shorter_than_a_polynomial() -> None:
    omega = (-0.0038222917854609335, -5.41380616570781, -0.00823360074077185)
    moments = (2.4789830764403558, 1.8552293637606434, 2.991871515393006)
    high, low = -5.413800119471218, -5.4138030326532895

    def spring(t: Any, w: Any) -> Any:
        return np.maximum(w[1] - high, 0.0) - np.maximum(low - w[1], 0.0)

    scene = Scene("", omega, moments=moments)
    # From a run at the tolerance 1e-13.
    for end, wanted in ((-1.0, [-0.61028]), (1.5, [0.2478, 1.0683])):
        found = times_of(scene, end, spring, tolerance=1e-6)
        assert found == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize("end", [20.0, 33.0, 40.0, 60.0, 100.0, 300.0])
def test_a_body_that_comes_to_rest_slowly_has_no_events(end: float) -> None:
    ball = Scene("", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=damping(1.0))
    events = [crosses(1), flip(1), extremum(1)]
    assert [x.tolist() for x in events_of(solve(ball, end, events=events))[0]] == [[], [], []]


def scipy_events(scene: Scene, end: float, event: Callable[..., Any]) -> list[float]:
    found = solve_ivp(lambda t, w: -w, (0.0, end), scene.omega, events=event, rtol=1e-10)
    return list(found.t_events[0])


@pytest.mark.parametrize("end", [2.0, -2.0])
@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("root", [0.0, 0.6, 1.0])
def test_direction_and_ends_as_in_scipy(
    end: float, direction: int, sign: float, root: float
) -> None:
    scene = Scene("ball", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=damping(1.0))
    event = with_attributes(lambda t, omega: sign * (t - root * end), False, direction)
    # SciPy also reports a root at the start.
    expected = scipy_events(scene, end, event) if root else []
    assert times_of(scene, end, event) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("terminal", [True, 1, 2, 3])
def test_terminal_event_removes_what_follows(terminal: bool | int) -> None:
    event = with_attributes(lambda t, omega: omega[1], terminal)
    rows = np.linspace(0.0, 30.0, 301)
    found: Any = solve(BODY, rows, events=[event, lambda t, omega: t - 4.0, crosses(1)],
                  dense_output=True)  # fmt: skip
    times, states = events_of(found)
    expected = times_of(BODY, 30.0, second)[: int(terminal)]
    assert times[0].tolist() == pytest.approx(expected)
    assert states[0].shape == (int(terminal), 3)
    assert (times[1].size == 1) == (expected[-1] > 4.0)
    assert times[2].max(initial=0.0) <= expected[-1]
    assert found.time.tolist() == rows[rows <= expected[-1]].tolist()
    assert found.omega.shape == (len(found.time), 3)
    assert (found.status, found.success, found.ended) == (1, True, "event")
    assert "terminal event" in found.message
    assert not found.has_all_rows
    assert found.sol.t_max == times[0][-1]


def test_terminal_event_that_does_not_occur() -> None:
    found = solve(BODY, [0.0, 1.0], events=crosses(1, BODY.omega[0], terminal=True))
    assert (events_of(found)[0][0].size, found.time.tolist()) == (0, [0.0, 1.0])
    found = solve(BODY, [10.0, 30.0], events=with_attributes(lambda t, omega: omega[1], 9))
    assert (found.status, found.ended, len(found.time)) == (0, "complete", 2)


def test_each_side_of_0_has_its_terminal_event() -> None:
    rows = [-20.0, -10.0, -1.0, 0.0, 1.0, 10.0, 20.0]
    found = solve(BODY, rows, events=with_attributes(lambda t, omega: omega[1], True))
    (times,), (states,) = events_of(found)
    before, after = times_of(BODY, -20.0, second)[0], times_of(BODY, 20.0, second)[0]
    assert times.tolist() == pytest.approx([before, after])
    assert states.shape == (2, 3)
    assert found.time.tolist() == [t for t in rows if before <= t <= after]
    descending = solve(BODY, rows[::-1], events=with_attributes(lambda t, omega: omega[1], True))
    assert events_of(descending)[0][0].tolist() == times[::-1].tolist()
    np.testing.assert_array_equal(events_of(descending)[1][0], states[::-1])


@pytest.mark.parametrize(("method", "trials"), [("auto", [200.0, 800.0]), ("lsoda", [10.0, 40.0])])
def test_motion_is_computed_little_beyond_a_terminal_event(
    method: str, trials: list[float]
) -> None:
    damped = Scene("at 1 rad/s", (0.3, 0.2, 1.0), moments=(1.0, 2.0, 2.5), torque=damping(1e-3))
    late = 0.4 * trials[-1]
    found = solve(damped, [1.0, 2.0 * late, 1e9], method, 1e-7,
                  events=with_attributes(lambda t, omega: t - late, True))  # fmt: skip
    spent = [solve(damped, end, method, 1e-7, events=second).evaluations for end in trials]
    assert events_of(found)[0][0].tolist() == pytest.approx([late], abs=0.0, rel=1e-14)
    assert (found.ended, found.time.tolist()) == ("event", [1.0])
    assert found.evaluations == pytest.approx(sum(spent), rel=0.02)


def test_terminal_events_at_the_end_of_a_trial_and_on_both_sides() -> None:
    body = Scene("at 1 rad/s", (0.3, 0.2, 1.0), moments=(1.0, 2.0, 2.5))
    for direction in (-1, 0, 1):
        event = with_attributes(lambda t, omega: abs(t) - 200.0, True, direction)
        for sign in (1.0, -1.0):
            rows = [sign * t for t in (100.0, 200.0, 300.0, 900.0)]
            for times in (rows, [rows[0], *rows[2:]]):
                found = solve(body, times, events=event)
                occurs = direction >= 0
                assert events_of(found)[0][0].tolist() == ([200.0 * sign] if occurs else [])
                kept = [t for t in times if abs(t) <= 200.0] if occurs else times
                assert found.time.tolist() == kept
    event = with_attributes(lambda t, omega: (t + 300.0) * (t - 30.0), True)
    found = solve(body, [-1e7, -40.0, 40.0, 1e7], events=event)
    assert events_of(found)[0][0].tolist() == pytest.approx([-300.0, 30.0])
    assert found.time.tolist() == [-40.0]


def test_a_torque_without_a_value_at_time_0_is_told_as_without_events() -> None:
    event = crosses(2, 0.0, terminal=True)
    inverse = Scene(
        "1/t", (1.0, 0.2, 0.1), moments=(1, 2, 2.5), torque=lambda t, w: (1.0 / t, 0, 0)
    )
    assert solve(inverse, 1e4, events=event).ended == "overflow"
    with pytest.raises(InputError, match="the function raised ZeroDivisionError at t = 0 s"):
        solve(replace(inverse, torque=opaque(lambda t, w: (1.0 / t, 0, 0))), 1e4, events=event)


def test_functions_that_change_too_fast_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many jumps are no reason for a refusal, because only those near 0 are searched."""
    monkeypatch.setattr(event_fits, "_MOST_PIECES", 1000)
    for fast in (lambda t, omega: np.sin(2e5 * t), lambda t, omega: np.sin(1e5 * t**4)):
        with pytest.raises(InputError, match="event 1: the function changes too fast for 1000"):
            solve(BODY, 2.0, events=fast)
    # Nowhere smooth, and far from 0.
    assert times_of(BODY, 0.1, lambda t, omega: 1.0 + 1e-6 * np.sin(1e9 * t)) == []
    smooth = times_of(BODY, 9.0, lambda t, omega: omega[1] - 0.10005)
    stairs = times_of(BODY, 9.0, lambda t, omega: np.round(omega[1], 4) - 0.10005)
    assert len(smooth) == 1
    assert stairs == pytest.approx(smooth, abs=1e-9)


def test_no_events_without_a_request() -> None:
    found = solve(BODY, 1.0)
    assert found.t_events is None
    assert found.y_events is None
    times, states = events_of(solve(BODY, 0.0, events=second))
    assert (times[0].shape, states[0].shape) == ((0,), (0, 3))
    _, states = events_of(solve(BODY, 0.0, attitude=True, events=second))
    assert states[0].shape == (0, 7)
    assert events_of(solve(BODY, 1.0, events=[])) == ([], [])


def test_very_slow_body() -> None:
    slow = replace(BODY, omega=(1e-201, 2e-200, 1e-201))
    found = np.array(times_of(slow, 3e201, second))
    np.testing.assert_allclose(found, 1e200 * np.array(times_of(BODY, 30.0, second)), rtol=1e-11)


def test_attitude_is_an_argument_and_in_the_states() -> None:
    ball = Scene("ball", (0.5, 0.0, 0.0), moments=(1.0, 1.0, 1.0))
    (times,), (states,) = events_of(
        solve(ball, 20.0, attitude=True, events=lambda t, omega, attitude: attitude[0])
    )
    assert times == pytest.approx(2.0 * math.pi * np.array([1.0, 3.0]))
    assert states.shape == (2, 7)
    np.testing.assert_allclose(np.abs(states[:, 4]), 1.0)


@pytest.mark.parametrize("axis", [1, 2, 3])
def test_tilt_is_the_angle_of_the_rotation_matrix(axis: int) -> None:
    toward, angle = (1.0, -2.0, 0.5), 1.2
    event = tilt(axis, toward, angle)
    (times,), (states,) = events_of(solve(BODY, 30.0, attitude=True, events=event))
    assert len(times) > 3
    q0, q = states[:, 3], states[:, 4:]
    unit = np.eye(3)[axis - 1]
    turned = unit + 2.0 * np.cross(q, np.cross(q, unit) + q0[:, None] * unit)
    np.testing.assert_allclose(turned @ toward / np.linalg.norm(toward), math.cos(angle), atol=1e-9)
    assert str(tilt(axis, toward, 0.0)).startswith(f"Event(name='tilt({axis}, ")


def test_extrema_are_those_of_the_rows() -> None:
    grid = np.linspace(0.0, 30.0, 30001)
    rows = solve(BODY, grid).omega[:, 1]
    for direction, sign in ((-1, 1.0), (1, -1.0)):
        inner = sign * rows[1:-1]
        tops = grid[1:-1][(inner > sign * rows[:-2]) & (inner > sign * rows[2:])]
        found = times_of(BODY, 30.0, extremum(2, direction=direction))
        assert found == pytest.approx(tops.tolist(), abs=2e-3)
        assert len(found) >= 2


def test_rest_and_flip() -> None:
    ball = Scene("ball", (3.0, 0.0, 4.0), moments=(1.0, 1.0, 1.0), torque=damping(1.0))
    assert times_of(ball, 3.0, rest(0.5)) == pytest.approx([math.log(10.0)])
    assert times_of(ball, 3.0, rest(0.5, direction=1)) == []
    assert times_of(BODY, 30.0, flip(2)) == pytest.approx(times_of(BODY, 30.0, second))
    assert times_of(case_scene(1), 2.0, flip(1)) == []
    # omega1 = (t - 1)**2 reaches 0 without a change of sign.
    law = TorqueLaw((-2.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    touching = Scene("touching", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=law)
    assert times_of(touching, 3.0, crosses(1, 0.0)) == pytest.approx([1.0])
    assert times_of(touching, 3.0, flip(1)) == []


@pytest.mark.parametrize("shape", [(), (1,), (1, 1)])
def test_a_function_may_return_an_array_of_one_number(shape: tuple[int, ...]) -> None:
    def of_one(t: Any, omega: Any) -> Any:
        return np.full(shape, float(omega[1]))

    assert times_of(BODY, 9.0, of_one) == pytest.approx(times_of(BODY, 9.0, flip(2)))


@pytest.mark.parametrize("end", [0.005, -0.005])
def test_events_are_in_the_order_of_integration(end: float) -> None:
    fast = Scene("fast", (1.0, 4e4, 1.0), moments=(1.0, 2.0, 3.0))
    found: Any = solve(fast, end, events=flip(1))
    assert len(found.t_events[0]) > 3
    assert (np.diff(np.abs(found.t_events[0])) > 0.0).all()


def test_function_of_one_number_alone() -> None:
    calls: list[float] = []

    def magnitude(t: Any, omega: Any) -> float:
        calls.append(float(t))
        return float(np.linalg.norm(omega)) - level

    level = float(np.linalg.norm(solve(BODY, 1.0).omega[0]))
    expected = times_of(BODY, 9.0, lambda t, omega: sum(omega**2) - level**2)
    assert len(expected) >= 2
    assert times_of(BODY, 9.0, magnitude) == pytest.approx(expected, rel=1e-10)
    assert len(calls) > 30


def test_a_function_that_mixes_the_times_of_an_array_is_called_for_each() -> None:
    def largest_so_far(t: Any, omega: Any) -> Any:
        # A number for one time, and for an array of times the largest of all.
        return np.max(omega[1]) - 0.5

    assert times_of(BODY, 9.0, largest_so_far) == pytest.approx(
        times_of(BODY, 9.0, crosses(2, 0.5))
    )


def test_few_calls_with_arrays() -> None:
    calls: list[int] = []

    def counted(t: Any, omega: Any) -> Any:
        calls.append(np.size(t))
        return omega[1]

    times_of(BODY, 300.0, counted)
    assert len(calls) < 60
    assert max(calls) > 1000


def test_few_calls_of_a_function_that_is_recorded() -> None:
    calls = 0

    def turned(t: Any, omega: Any, q: Any) -> Any:
        # The norm of an array of vectors would be one number.
        nonlocal calls
        calls += 1
        return np.linalg.norm(q[1:]) - 0.5

    found = times_of(BODY, 30.0, turned, attitude=True)
    assert calls < 60
    assert len(found) > 4
    assert found == pytest.approx(
        times_of(BODY, 30.0, lambda t, omega, q: 0.75 - q[0] ** 2, attitude=True)
    )


def test_an_event_of_the_user_is_that_of_its_function() -> None:
    own = Event("own", lambda t, omega, attitude, rates: omega[1])
    expected = times_of(BODY, 30.0, second)
    assert len(expected) > 2
    assert times_of(BODY, 30.0, own) == expected


def test_opaque_torque_has_events() -> None:
    torque = opaque(lambda t, omega: [-w for w in omega])
    ball = Scene("ball", (3.0, 0.0, 4.0), moments=(1.0, 1.0, 1.0), torque=torque)
    found = times_of(ball, 3.0, rest(0.5), method="dop853")
    assert found == pytest.approx([math.log(10.0)], rel=1e-8)


def test_overflow_after_the_last_row() -> None:
    runaway = Scene("", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = solve(runaway, [0.5, 0.9, 2.0], events=crosses(1, 4.0))
    assert (found.ended, found.status) == ("overflow", -1)
    assert events_of(found)[0][0].tolist() == pytest.approx([0.75])
    ended = solve(runaway, [0.5, 0.9, 2.0], events=crosses(1, 4.0, terminal=True))
    assert (ended.ended, ended.time.tolist()) == ("event", [0.5])


def test_ending_is_saved(tmp_path: Path) -> None:
    found = solve(BODY, [1.0, 9.0], events=crosses(2, 0.0, terminal=True))
    found.save(tmp_path / "found.npz")
    assert load(tmp_path / "found.npz").status == 1


@pytest.mark.sampled
@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("rate", [1e-3, 1e-4, 1e-6])
def test_jump_where_omega_is_slow_is_one_event(rate: float, tolerance: float) -> None:
    """Rounding errors of omega lead there and back across the jump, for as long as they count."""

    def jump(t: float, w: Array) -> float:
        return 1.0 if w[0] > 1.0 + 3.3 * rate else -1.0

    jump.terminal = 2  # type: ignore[attr-defined]
    torque = TorqueLaw((rate, 0.0, 0.0))
    scene = Scene("ball", (1.0, 0.0, 0.0), moments=(1.0, 1.0, 1.0), torque=torque)
    found: Any = solve(scene, [5.0, 10.0], tolerance=tolerance, events=jump)
    assert found.ended == "complete"
    assert found.t_events[0] == pytest.approx([3.3], abs=1e-8)


@pytest.mark.campaign
def test_jumps_are_the_crossings_of_their_level() -> None:
    generator = np.random.default_rng(20261125)
    for _ in range(40):
        moments = tuple(np.sort(generator.uniform(1.0, 2.0, 3)).tolist())
        scene = Scene("", tuple(generator.normal(size=3).tolist()), moments=moments)
        level = float(solve(scene, generator.uniform(1.0, 19.0)).omega[0, 1])
        both = [lambda t, w, a=level: np.sign(w[1] - a), crosses(2, level)]
        found: Any = solve(scene, 20.0, events=both).t_events
        assert found[0] == pytest.approx(found[1], abs=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_noise_is_the_error_of_omega_and_of_the_time(sign: float) -> None:
    """3 w1 + 2 t, with omega's error 1e-11 of the largest |omega| so far, and rounding of t."""
    omega = (sign, 0.5 * sign, -2.0 * sign)
    scene = Scene("", omega, moments=(1.0, 2.0, 2.5), torque=damping(0.1 * sign))
    sol: Any = solve(scene, 8.0 * sign, dense_output=True).sol
    assert isinstance(sol.states, Pieces)
    (g,) = event_functions(lambda t, w: 3.0 * w[0] + 2.0 * t, attitude=False)
    times = sign * np.linspace(0.5, 7.5, 15)
    for tolerance, own in ((1e-11, 1e-11), (1e-3, 1e-10), (0.0, 2.0**-50)):
        noise = Solution(sol.states, sol, tolerance).noise(g, times)
        due = own * 3.0 * 2.0 + 2.0**-50 * 2.0 * abs(times)
        assert noise == pytest.approx(due, rel=0.01, abs=0.0)


def test_small_values_beside_a_jump_are_no_roots() -> None:
    def remainder(t: Any, w: Any) -> Any:
        return w[0] % (0.5 + w[1]) + 1e-3

    def late(t: Any, w: Any) -> Any:
        u = w[0] % (0.5 + w[1])
        return np.where(u > 0.4, -1.0, 0.01 * u - 1e-3)

    ball = Scene("ball", (0.05, 0.02, 0.1), moments=(1.0,) * 3, torque=TorqueLaw((1.0, 0.3, 0.0)))
    found: Any = solve(ball, 4.0, events=[remainder, late])
    assert not found.t_events[0].size
    # With w1 = 0.05 + t and w2 = 0.02 + 0.3 t.
    roots = [0.05, 0.35, 0.57 / 0.7, 0.87 / 0.7, 1.09 / 0.4, 1.39 / 0.4]
    assert found.t_events[1] == pytest.approx(roots, abs=1e-9)
