"""Events: planted roots, SciPy's conventions, terminal events, ready events, and messages."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import Scene, TorqueLaw, case_scene, solve
from pyharness.engine.events.event_fits import Solution
from pyharness.engine.events.event_functions import event_functions
from pyharness.events import Event, crosses, extremum, flip, rest
from pyharness.model.dense_output import Pieces
from pyharness.model.trajectory import Array, Trajectory
from pyharness.torques import damping, opaque, pulses
from tests.campaigns import driver
from tests.campaigns.event_campaign import BODY, CORNERS, KINDS, planted, search, try_function
from tests.engine.entry_points import ball

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


@pytest.mark.parametrize(("kind", "seed"), [
    ("cosine", 3000260), ("cosine", 3000518), ("polynomial", 3000822), ("edges", 1000003),
    # A simple root was lost beside one of multiplicity 7.
    ("odd", 5402000106),
])  # fmt: skip
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
    found: Any = solve(replace(BODY, step_size=0.01), 30.0, "rk4", events=second, dense_output=True)
    (times,), (states,) = events_of(found)
    assert len(times) == 4
    np.testing.assert_allclose(times, times_of(BODY, 30.0, second), atol=1e-5)
    np.testing.assert_array_equal(states, found.sol(times).T)
    assert np.abs(states[:, 1]).max() < 1e-14


def test_long_motion_misses_no_event() -> None:
    times = np.array(times_of(BODY, 1000.0 * math.pi, second))
    assert len(times) == 450
    np.testing.assert_allclose(np.diff(times), np.diff(times).mean(), rtol=1e-10)


@pytest.mark.parametrize("direction", [-1, 1])
def test_double_root_counts_for_direction_0_alone(direction: int) -> None:
    touch = with_attributes(lambda t, omega: (t - 3.0) ** 2, False, direction)
    assert times_of(BODY, 9.0, touch) == []


_AT_REST = Scene("", (0.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0))
_LATER = replace(_AT_REST, torque=pulses([5.0], [1.0], [(0.0, 1e-10, 0.0)]))
_WAVE = TorqueLaw((0.0, 0.0, 0.0), cosines=[((0.2, 0.0, 0.0), 1.0)])
_DAMPED = ball(damping(1.0), (3.0, 0.0, 4.0))
_OPAQUE = ball(opaque(lambda t, omega: [-w for w in omega]), (3.0, 0.0, 4.0))
# omega1 = (t - 1)**2 reaches 0 without a change of sign.
_TOUCHING = ball(TorqueLaw((-2.0, 0.0, 0.0), (2.0, 0.0, 0.0)), (1.0, 0.0, 0.0))
# Scene, end (s), event, its times, and their error.
ROOTS: dict[str, tuple[Scene, float, Any, list[float], Any]] = {
    "double": (BODY, 9.0, lambda t, w: (t - 3.0) ** 2, [3.0], {"rel": 1e-13}),
    "near": (
        BODY, 9.0, lambda t, w: (t - 2.0) * (t - 2.000001), [2.0, 2.000001], {"rel": 5e-10}
    ),
    **{
        f"of multiplicity {n}": (BODY, 9.0, lambda t, w, n=n: (t - 3.25) ** n, [3.25], {"rel": 0.1})
        for n in (3, 4, 5)
    },
    "corners": (BODY, 9.0, lambda t, w: abs(t - 3.1) - 0.5, [2.6, 3.6], {"rel": 1e-6}),
    "jump": (BODY, 9.0, lambda t, w: 1.0 if t > math.pi else -1.0, [math.pi], {"rel": 1e-12}),
    "sudden": (BODY, 9.0, lambda t, w: np.tanh(1e6 * (t - 4.4)), [4.4], {"rel": 1e-12}),
    "kinks of an interval of zeros": (
        Scene("ball", (0.3, 0.2, 0.9), moments=(2.0, 2.0, 2.0), torque=_WAVE), 7.0,
        lambda t, w: min(float(w[0]) - 0.33, 0.0), [math.asin(0.3), 2.0 * math.pi + math.asin(0.3)],
        {"abs": 1e-7},
    ),
    "small value at rest": (_AT_REST, 1e3, lambda t, w: w[1] - 3e-11, [], {}),
    "small value after a push": (_LATER, 1e3, lambda t, w: w[1] - 3e-11, [5.6], {}),
    **{
        f"narrow dead zone, {rate:g}": (
            ball(TorqueLaw((rate, 0.0, 0.0)), (-0.1, 0.0, 0.0)), 80.0 * rate,
            lambda t, w: np.where(np.abs(w[0]) < 0.0015, 0.0, w[0]), [math.copysign(1.97, rate)],
            {"abs": 1e-9},
        )
        for rate in (-0.05, 0.05)
    },
    "rest": (_DAMPED, 3.0, rest(0.5), [math.log(10.0)], {}),
    "rest, rising": (_DAMPED, 3.0, rest(0.5, direction=1), [], {}),
    "rest under an opaque torque": (_OPAQUE, 3.0, rest(0.5), [math.log(10.0)], {"rel": 1e-8}),
    "no flip of a case": (case_scene(1), 2.0, flip(1), [], {}),
    "touched by omega": (_TOUCHING, 3.0, crosses(1, 0.0), [1.0], {}),
    "no flip where omega touches 0": (_TOUCHING, 3.0, flip(1), [], {}),
}  # fmt: skip


@pytest.mark.parametrize("name", ROOTS)
def test_roots_are_where_they_are_known(name: str) -> None:
    scene, end, event, expected, limit = ROOTS[name]
    method = "dop853" if scene is _OPAQUE else "auto"
    times = [1.0, end] if "small value" in name else end
    assert times_of(scene, times, event, method=method) == pytest.approx(expected, **limit)


def test_flips_are_where_omega_is_0() -> None:
    assert times_of(BODY, 30.0, flip(2)) == pytest.approx(times_of(BODY, 30.0, second))


def test_value_of_an_extremum_of_omega_counts_once() -> None:
    (tops,), (states,) = events_of(solve(BODY, 6.9, events=extremum(2, direction=-1)))
    (found,) = events_of(solve(BODY, 6.9, events=crosses(2, states[0, 1])))[0]
    assert found == pytest.approx(tops, abs=1e-7)
    assert len(times_of(BODY, 6.9, crosses(2, states[0, 1] - 1e-9))) == 2
    assert times_of(BODY, 6.9, crosses(2, states[0, 1] + 1e-9)) == []


@pytest.mark.sampled
@pytest.mark.parametrize("end", [1.0, 2.7, -2.0, 40.0])
def test_roots_of_odd_multiplicity_are_as_exact_as_the_sign(end: float) -> None:
    scene = ball(TorqueLaw((1.0, 0.0, 0.0)), (0.0, 0.0, 0.0))  # omega is the time
    root = math.copysign(1.0, end)
    for direction in (0, root, -root):
        events = [
            with_attributes(lambda t, omega, n=n: (omega[0] - root) ** n, False, direction)
            for n in (1, 3, 5, 7)
        ]
        expected = [root] if root * direction >= 0.0 else []
        for found in events_of(solve(scene, end, events=events))[0]:
            assert found.tolist() == pytest.approx(expected, abs=2.0**-52 * abs(end))


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


@pytest.mark.parametrize("end", [20.0, 33.0, 40.0, 60.0, 100.0, 300.0])
def test_a_body_that_comes_to_rest_slowly_has_no_events(end: float) -> None:
    found = solve(ball(damping(1.0), (1, 0, 0)), end, events=[crosses(1), flip(1), extremum(1)])
    assert [x.tolist() for x in events_of(found)[0]] == [[], [], []]


@pytest.mark.parametrize("shape", [(), (1,), (1, 1)])
def test_a_function_may_return_an_array_of_one_number(shape: tuple[int, ...]) -> None:
    def of_one(t: Any, omega: Any) -> Any:
        return np.full(shape, float(omega[1]))

    assert times_of(BODY, 9.0, of_one) == pytest.approx(times_of(BODY, 9.0, flip(2)))


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
    # A number for one time, and for an array of times the largest of all.
    found = times_of(BODY, 9.0, lambda t, omega: np.max(omega[1]) - 0.5)
    assert found == pytest.approx(times_of(BODY, 9.0, crosses(2, 0.5)))


def test_few_calls_with_arrays() -> None:
    calls: list[int] = []

    def counted(t: Any, omega: Any) -> Any:
        calls.append(np.size(t))
        return omega[1]

    def unrecorded(t: Any, omega: Any) -> Any:
        return np.array(counted(t, omega), dtype=float)

    times = times_of(BODY, 300.0, counted)
    assert len(calls) < 60
    assert max(calls) < 100
    calls.clear()
    assert times_of(BODY, 300.0, unrecorded) == pytest.approx(times)
    assert len(calls) < 60
    assert max(calls) > 1000


def test_few_calls_of_a_function_that_is_recorded() -> None:
    calls: list[Any] = []

    def turned(t: Any, omega: Any, q: Any) -> Any:
        calls.append(t)
        # The norm of an array of vectors would be one number.
        return np.linalg.norm(q[1:]) - 0.5

    found = times_of(BODY, 30.0, turned, attitude=True)
    assert len(calls) < 60
    assert len(found) > 4
    same = times_of(BODY, 30.0, lambda t, omega, q: 0.75 - q[0] ** 2, attitude=True)
    assert found == pytest.approx(same)


def test_an_event_of_the_user_is_that_of_its_function() -> None:
    own = Event("own", lambda t, omega, attitude, rates: omega[1])
    expected = times_of(BODY, 30.0, second)
    assert len(expected) > 2
    assert times_of(BODY, 30.0, own) == expected


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
