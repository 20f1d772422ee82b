"""Steps end where a rate breaks: at the breaks of tables and at switches, in all our drivers."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import Scene, Stepper, Taylor, solve
from pyharness.model.array_type import Array

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(20)
_DAMPING = 0.7
_PULSE: tuple[list[float], list[float]] = [0.37, 0.38, 0.4], [0.0, 1.0, 0.0]


@dataclass(frozen=True)
class Rate:
    """A function of time that is smooth between its breaks."""

    at: Callable[[Any], Any]
    breaks: Array


def _points(source: np.random.Generator) -> tuple[Array, Array]:
    """Return the points of an interpolation, some of which are a pulse or a jump."""
    width = 10.0 ** source.uniform(-4.0, -0.5)
    places = np.sort(source.uniform(-1.0, 1.0) + width * source.uniform(-1.0, 1.0, 4))
    if source.random() < 0.3:
        places[2] = places[1]
    values = source.normal(size=4)
    values[[0, -1]] *= source.random() < 0.5
    return places, values


def _interpolation(source: np.random.Generator) -> Rate:
    places, values = _points(source)
    scale, shift = 1.0, 0.0
    if source.random() < 0.5:
        scale, shift = source.choice([-1.0, 2.0, 0.3]), source.uniform(-0.5, 0.5)
    ends = (0.4, -0.2) if source.random() < 0.3 else (None, None)
    return Rate(
        lambda t: np.interp(scale * t + shift, places, values, *ends), (places - shift) / scale
    )


def _periodic(source: np.random.Generator) -> Rate:
    period = source.uniform(0.3, 1.0)
    places = np.sort(source.uniform(0.0, period, 3))
    values = source.normal(size=3)
    breaks = period * np.arange(-9, 10)[:, None] + [0.0, *places]
    return Rate(lambda t: np.interp(t % period, places, values), breaks.ravel())


def _composed(source: np.random.Generator) -> Rate:
    """Return an interpolation of an interpolation."""
    places, values = np.sort(source.uniform(-1.0, 1.0, 3)), source.normal(size=3)
    levels, heights = np.sort(source.uniform(-1.0, 1.0, 2)), source.normal(size=2)
    parts = (levels[:, None] - values[:-1]) / np.diff(values)
    inner = (places[:-1] + parts * np.diff(places))[(parts > 0.0) & (parts < 1.0)]
    return Rate(
        lambda t: np.interp(np.interp(t, places, values), levels, heights), np.append(places, inner)
    )


def _gate(source: np.random.Generator) -> Rate:
    middle, half = source.uniform(-1.0, 1.0), 10.0 ** source.uniform(-4.0, -1.0)
    return Rate(
        lambda t: np.where(np.abs(t - middle) < half, 1.0, 0.0),
        middle + half * np.array([-1.0, 1.0]),
    )


def random_rate(source: np.random.Generator) -> Rate:
    kinds = _interpolation, _periodic, _composed, _gate
    a, b = (kinds[k](source) for k in source.integers(4, size=2))
    at = (
        lambda t: a.at(t) + b.at(t),
        lambda t: a.at(t) * b.at(t),
        lambda t: a.at(t) + 0.5 * b.at(t) ** 2,
    )[source.integers(3)]
    return Rate(at, np.sort(np.concatenate([a.breaks, b.breaks])))


def damped(rate: Rate, start: float, begin: float, end: float) -> float:
    """Return the solution of y' = rate - _DAMPING y at `end`, by quadrature between the breaks."""
    low, high = sorted((begin, end))
    edges = [low, *rate.breaks[(rate.breaks > low) & (rate.breaks < high)], high]
    total = 0.0
    for first, last in itertools.pairwise(edges):
        times = 0.5 * (first + last) + 0.5 * (last - first) * _POINTS
        growth = np.exp(_DAMPING * (times - end))
        total += 0.5 * (last - first) * float(np.sum(_WEIGHTS * rate.at(times) * growth))
    return start * math.exp(_DAMPING * (begin - end)) + (total if begin < end else -total)


def scene_of(rate: Rate, start: float) -> Scene:
    return Scene(
        "", (start, 0.0, 0.0), moments=(1.0, 1.0, 1.0),
        torque=lambda t, w: (rate.at(t) - _DAMPING * w[0], 0.0, 0.0),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(12))
def test_taylor_has_the_integral_of_random_rates(seed: int) -> None:
    source = np.random.default_rng([20261201, seed])
    for _ in range(6):
        rate = random_rate(source)
        start = source.normal()
        inner = rate.breaks[np.abs(rate.breaks) < 1.2]
        span = source.permutation([-1.5, source.choice([1.2, *inner])])
        options: dict[str, Any] = (
            {}, {"max_step": 0.3}, {"first_step": 0.2}, {"first_step": np.ptp(span)},
            {"t_eval": span}, {"dense_output": True},
        )[source.integers(6)]  # fmt: skip
        found = solve_ivp(
            lambda t, y, k, rate=rate: rate.at(t) - k * y[0], span, [start], Taylor,
            args=(_DAMPING,), rtol=1e-11, atol=1e-12, **options,
        )  # fmt: skip
        assert found.success
        assert found.t[-1] == span[1]
        assert found.y[0, -1] == pytest.approx(damped(rate, start, *span), abs=1e-9)
        if found.sol is not None:
            times = source.uniform(span.min(), span.max(), 9)
            exact = [damped(rate, start, span[0], t) for t in times]
            assert found.sol(times)[0] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_the_stepper_and_solve_have_the_integral_of_random_rates(seed: int) -> None:
    source = np.random.default_rng([20261202, seed])
    for _ in range(4):
        rate, start = random_rate(source), source.normal()
        scene = scene_of(rate, start)
        for end in (-1.5, 1.5):
            exact = damped(rate, start, 0.0, end)
            assert solve(scene, end, "taylor", 1e-11).omega[0, 0] == pytest.approx(exact, abs=1e-9)
            stepper = Stepper(scene, 1e-12)
            stepper.until(end)
            assert stepper.omega[0] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("begin", [0.0, 0.37, 0.38, 1.7e9, -1e12])
def test_the_stepper_and_taylor_stop_at_the_same_breaks(sign: float, begin: float) -> None:
    """Taylor ends a step two units beyond a break, where an event that is 0 there has a sign."""
    shift = begin if abs(begin) > 1.0 else 0.0
    places = sorted(sign * np.array(_PULSE[0]) + shift)
    scene = Scene(
        "", (1e-3, 0.0, 0.0), moments=(1.0,) * 3,
        torque=lambda t, w: (np.interp(t, places, _PULSE[1]), 0.0, 0.0),
    )  # fmt: skip
    end = shift + sign
    stepper = Stepper(scene)
    stepper._time = sign * begin if shift == 0.0 else begin
    method = Taylor(lambda t, y: [np.interp(t, places, _PULSE[1])], stepper.time, [1e-3], end)
    ahead = {place for place in places if sign * (place - stepper.time) > 0.0}
    ends: list[list[float]] = [[], []]
    while stepper.time != end:
        ends[0].append(stepper.step(end - stepper.time))
    while method.status == "running":
        method.step()
        ends[1].append(method.t)
    assert method.status == "finished"
    assert ahead < set(ends[0])
    assert {place + sign * 2.0 * np.spacing(abs(place)) for place in ahead} < set(ends[1])


@pytest.mark.parametrize("span", [(0.0, 1.0), (1.0, 0.0)])
@pytest.mark.parametrize("options", [{}, {"max_step": 0.07}])
def test_an_event_at_a_break_is_found_once(
    span: tuple[float, float], options: dict[str, Any]
) -> None:
    def fun(t: Any, y: Any) -> Any:
        return [0.1 + np.interp(t, *_PULSE)]

    begin = span[0]
    reached = [
        solve_ivp(fun, (begin, each), [0.0], Taylor, rtol=1e-12, atol=1e-14).y[0, -1]
        for each in _PULSE[0]
    ]
    events = [
        *(lambda t, y, each=each: t - each for each in _PULSE[0]),
        *(lambda t, y, each=each: y[0] - each - 1e-10 for each in reached),
        *(lambda t, y, each=each: t - each - 1e-9 for each in _PULSE[0]),
    ]
    found = solve_ivp(fun, span, [0.0], Taylor, events=events, rtol=1e-12, atol=1e-14, **options)
    assert [len(each) for each in found.t_events] == [1] * 9
    assert np.ravel(found.t_events) == pytest.approx(np.tile(_PULSE[0], 3), abs=1.1e-9)
    again = events[1]
    again.terminal = True  # type: ignore[attr-defined]
    stopped = solve_ivp(fun, span, [0.0], Taylor, events=again, rtol=1e-12, atol=1e-14)
    assert (stopped.status, stopped.t[-1]) == (1, pytest.approx(0.38, abs=1e-13))
