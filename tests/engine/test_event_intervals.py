"""Events of functions that are 0 in an interval, or jump."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pyharness import Scene, TorqueLaw, solve
from pyharness.events import crosses, flip
from pyharness.torques import pulses
from tests.engine.entry_points import ball
from tests.engine.test_events import events_of, times_of, with_attributes


def test_function_that_is_0_everywhere_has_no_event() -> None:
    spin = Scene("spin", omega=(0.0, 0.0, 2.0), moments=(1.0, 1.0, 3.0))
    for times in (9.0, -9.0, [-9.0, 9.0]):
        for event in (crosses(1), crosses(3, 2.0), crosses(1, direction=1), flip(1)):
            assert times_of(spin, times, event) == []


@pytest.mark.campaign
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_an_interval_of_zeros_is_one_event_wherever_the_integration_ends(direction: int) -> None:
    # Omega is 0, rises from 1 s to 1 in 2 s, and falls from 3 s to 0 in 4 s.
    push = pulses([1.0, 3.0], [1.0, 1.0], [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
    scene = ball(push, (0.0, 0.0, 0.0))
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
    scene = ball(TorqueLaw((rate, 0.0, 0.0)), (5.0 - rate, 0.0, 0.0))
    dead = part * rate

    def relay(t: Any, omega: Any) -> Any:
        return np.sign(omega[0] - 5.0) * (np.abs(omega[0] - 5.0) > dead)

    def spring(t: Any, omega: Any) -> Any:
        return np.maximum(omega[0] - 5.0 - dead, 0.0) - np.maximum(5.0 - dead - omega[0], 0.0)

    for event in (relay, spring):
        found = times_of(scene, 3.0, event, tolerance=tolerance)
        assert found == pytest.approx([1.0 - part], abs=20.0 * tolerance / rate)


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
        assert times_of(scene, end, spring, tolerance=1e-6) == pytest.approx(wanted, abs=1e-4)


@pytest.mark.sampled
@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("rate", [1e-3, 1e-4, 1e-6])
def test_jump_where_omega_is_slow_is_one_event(rate: float, tolerance: float) -> None:
    """Rounding errors of omega lead there and back across the jump, for as long as they count."""
    jump = with_attributes(lambda t, w: 1.0 if w[0] > 1.0 + 3.3 * rate else -1.0, 2)
    scene = ball(TorqueLaw((rate, 0.0, 0.0)), (1.0, 0.0, 0.0))
    found: Any = solve(scene, [5.0, 10.0], tolerance=tolerance, events=jump)
    assert found.ended == "complete"
    assert found.t_events[0] == pytest.approx([3.3], abs=1e-8)


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
