"""Events of a torque-free body over many periods: the events of one period are repeated."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from pyharness import InputError, Scene, TorqueLaw, events, solve
from pyharness.engine import continuous
from pyharness.engine.events import periodic_events
from pyharness.engine.events.event_functions import event_functions
from pyharness.engine.events.periodic_events import are_of_omega, repeat
from pyharness.engine.methods.closed_form import period_of

WING_NUT = Scene("wing nut", omega=(0.01, 5.0, 0.0), moments=(1.0, 2.0, 3.0))
FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "component": lambda t, w: w[2],
    "sum": lambda t, w: w[0] + 0.3 * w[1] - 0.2,
    "product": lambda t, w: w[0] * w[1] + 0.01 * w[2],
    "square": lambda t, w: w[1] ** 2 - 4.0,
    "corner": lambda t, w: abs(w[0]),
    "touch": lambda t, w: (w[0] - w[2]) ** 2,
    "none": lambda t, w: w[0] + 100.0,
}


def random_scene(number: int) -> Scene:
    rng = np.random.default_rng([number, 20261123])
    moments = np.sort(rng.uniform(1.0, 3.0, 3))
    moments[2] = min(moments[2], moments[0] + moments[1])
    return Scene(f"{number}", rng.uniform(-2.0, 2.0, 3), rng.permutation(moments))


def by_polynomials(*given: Any, **options: Any) -> Any:
    """Return what `solve` returns if no function is known to depend on omega alone."""
    with mock.patch.object(continuous, "are_of_omega", return_value=False):
        return solve(*given, **options)


@pytest.mark.campaign
@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_events_are_those_of_the_polynomials(name: str) -> None:
    count = 0
    for number in range(6):
        scene = random_scene(number)
        g, period = FUNCTIONS[name], period_of(scene)
        for ends in ([25.3 * period], [-17.7 * period, -1.0, 12.4 * period], [-40.0 * period]):
            found: Any = solve(scene, ends, events=g)
            times, wanted = found.t_events[0], by_polynomials(scene, ends, events=g).t_events[0]
            assert len(times) == len(wanted)
            count += len(times)
            atol = (1e-7 if name == "touch" else 1e-11) * abs(ends[-1])
            np.testing.assert_allclose(times, wanted, rtol=0, atol=atol)
            if len(times):
                states = solve(scene, np.sort(times)).omega
                np.testing.assert_array_equal(found.y_events[0][np.argsort(times)], states)
    assert count == 0 if name == "none" else count > 100


@pytest.mark.campaign
def test_events_of_a_million_seconds() -> None:
    found: Any = solve(
        WING_NUT, 1e6, events=[events.flip(2), events.extremum(3), events.crosses(1, 2.0)]
    )
    for times, states, k in zip(found.t_events, found.y_events, (1, None, 0), strict=True):
        assert len(times) > 180_000
        assert np.diff(times).min() > 0.1
        assert found.t_events[0][-1] <= 1e6
        if k is not None:
            level = 2.0 if k == 0 else 0.0
            # Here perturbations grow with time: a rounding error of omega at 0 is 1e-10 s at 1e6 s.
            assert np.abs(states[:, k] - level).max() <= 1e-9
    # Two flips in each period.
    gaps = np.diff(found.t_events[0])
    assert np.ptp(gaps) <= 1e-9
    assert 2.0 * gaps.mean() == pytest.approx(period_of(WING_NUT), rel=1e-12)


@pytest.mark.campaign
def test_terminal_events_and_directions() -> None:
    for direction, limit in ((1, 30), (-1, 31), (0, 32)):
        ready = events.flip(2, terminal=limit, direction=direction)
        found: Any = solve(WING_NUT, [0.5, 900.0], events=ready)
        other = by_polynomials(WING_NUT, [0.5, 900.0], events=ready)
        assert found.ended == "event"
        assert len(found.t_events[0]) == limit
        np.testing.assert_allclose(found.t_events[0], other.t_events[0], rtol=1e-12)
        assert found.time.tolist() == other.time.tolist() == [0.5]


def test_an_event_at_the_end_but_not_at_time_zero() -> None:
    period = period_of(WING_NUT)
    start = Scene("", solve(WING_NUT, 2.0).omega[0], WING_NUT.moments)
    level = start.omega[0]
    for end in (20.0 * period, 20.3 * period):
        found: Any = solve(start, end, events=lambda t, w: w[0] - level)
        other = by_polynomials(start, end, events=lambda t, w: w[0] - level)
        assert found.t_events[0][0] > 0.1
        assert np.abs(found.t_events[0] - period).min() < 1e-9
        assert abs(len(found.t_events[0]) - len(other.t_events[0])) <= (end == 20.0 * period)


def test_functions_of_time_or_attitude_are_not_repeated() -> None:
    def opaque(t: Any, omega: Any) -> Any:
        return omega[1] if float(omega[0]) < 100.0 else t

    known = event_functions([*FUNCTIONS.values(), events.flip(1), events.extremum(2)], True)
    assert are_of_omega(known)
    for unknown in (
        lambda t, w: w[1] - 1e-6 * t,
        lambda t, w, q: q[0],
        opaque,
        events.tilt(3, (0.0, 0.0, 1.0), 0.5),
    ):
        assert not are_of_omega(event_functions([unknown], True))
    found: Any = solve(WING_NUT, 300.0, events=lambda t, w: w[1] - 0.01 * t)
    assert np.ptp(np.diff(found.t_events[0])[::2]) > 0.1
    # With a torque, there is no period.
    assert period_of(replace(WING_NUT, torque=TorqueLaw((0.1, 0.0, 0.0)))) == 0.0
    ball = Scene("", (1.0, 2.0, 3.0), moments=(2.0, 2.0, 2.0))
    assert solve(ball, 1e5, events=lambda t, w: w[0]).t_events[0].size == 0


def test_too_many_events_are_refused() -> None:
    with (
        mock.patch.object(periodic_events, "_MOST_EVENTS", 1000),
        pytest.raises(InputError, match="event 1: more than 1000"),
    ):
        solve(WING_NUT, 1e5, events=events.flip(2))


def test_the_period_that_is_repeated_begins_between_events() -> None:
    """Events at the ends of a period are neither lost nor doubled by rounding errors."""
    for shift in (0.0, -1e-16, 1e-16, 0.3, 0.999999):
        all_of_them = np.arange(0.0, 40.0, 1.0) + shift
        some = np.concatenate([all_of_them, all_of_them + 1e-9])
        some.sort()
        three = some[(some >= 0.0) & (some <= 3.0)]
        found, which, kept = repeat(three, 1.0, 37.5, "")
        np.testing.assert_allclose(found, some[(some >= 0.0) & (some <= 37.5)], rtol=0, atol=1e-12)
        periods = found - three[which]
        np.testing.assert_allclose(periods, np.round(periods), rtol=0, atol=1e-12)
        assert 0 < kept < len(found)
    # An event at the end of the polynomials may be lost there.
    some = np.sort(np.concatenate([np.arange(0.0, 37.5), np.arange(0.9, 37.5)]))
    found, _, kept = repeat(some[some < 3.0], 1.0, 37.5, "")
    np.testing.assert_allclose(found, some, rtol=0, atol=1e-12)
    found, which, kept = repeat(np.array([0.1]), 1.0, 37.5, "")
    assert (found.tolist(), which.tolist(), kept) == ([0.1], [0], 1)


def test_an_event_on_both_sides_of_the_ends_of_periods_is_found() -> None:
    """The first event is just before the end of a period, and the second just after its end."""
    once = np.array([1.0 - 1e-12, 2.0 + 1e-12])
    found, _, _ = repeat(once, 1.0, 37.5, "")
    np.testing.assert_allclose(found, np.arange(1.0, 38.0), rtol=0, atol=1e-9)
    found, _, _ = repeat(np.sort([*once, 0.5, 1.5, 2.5]), 1.0, 37.5, "")
    np.testing.assert_allclose(found, np.arange(1, 76) / 2.0, rtol=0, atol=1e-9)
    tilt = 0.47137931034482766
    omega = 2.0 * np.array([np.cos(tilt), 0.0, np.sin(tilt)])
    scene = Scene("", omega, moments=(1.0, 2.0, 3.0))
    rising: Any = solve(scene, 300.0, events=events.flip(2, direction=1)).t_events
    np.testing.assert_allclose(rising[0], period_of(scene) * np.arange(1, 35), rtol=1e-12)
