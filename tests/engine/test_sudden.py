"""Tests of torques that change suddenly: pulses, peaks and switches narrower than a step."""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from pyharness import Scene, Stepper, Taylor, solve
from pyharness.truth.reference import reference

SPHERE = (2.0, 2.0, 2.0)
MIDDLE = 4.321
WIDTHS = (1e-1, 1e-2, 3e-3, 1e-3, 1e-6)

# A torque as a function of x, the time since MIDDLE over a width, and its integral over x.
PULSES: dict[str, tuple[Callable[[Any], Any], Callable[[float], float]]] = {
    "bell": (lambda x: np.exp(-x * x), lambda x: 0.5 * math.sqrt(math.pi) * math.erf(x)),
    "peak": (lambda x: 1.0 / (1.0 + x * x), math.atan),
    "narrow peak": (
        lambda x: 1.0 / (1.0 + x * x) ** 2,
        lambda x: 0.5 * (math.atan(x) + x / (1.0 + x * x)),
    ),
    "switch": (
        lambda x: np.tanh(x),
        lambda x: abs(x) + math.log1p(math.exp(-2.0 * abs(x))) - math.log(2.0),
    ),
    "root": (lambda x: x / np.sqrt(1.0 + x * x), lambda x: math.hypot(1.0, x)),
    "sigmoid": (
        lambda x: 0.5 + 0.5 * np.tanh(0.5 * x),
        lambda x: max(x, 0.0) + math.log1p(math.exp(-abs(x))),
    ),
}


def pulse(name: str, width: float) -> tuple[Scene, list[float], list[float]]:
    """Return a sphere under a pulse about its first axis, times, and omega1 at these times."""
    value, integral = PULSES[name]
    scene = Scene(
        name,
        (0.1, 0.2, 0.3),
        moments=SPHERE,
        torque=lambda t, omega: [3.0 * value((t - MIDDLE) / width) + 0.0 * omega[0], 0.0, 0.0],
    )
    times = [2.0, MIDDLE, 4.4, 9.0]
    begin = integral(-MIDDLE / width)
    change = [1.5 * width * (integral((t - MIDDLE) / width) - begin) for t in times]
    return scene, times, [0.1 + each for each in change]


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", PULSES)
def test_a_pulse_of_time_is_not_missed(name: str, width: float) -> None:
    scene, times, wanted = pulse(name, width)
    for tolerance in (1e-3, 1e-6, 1e-9, 1e-12):
        found = solve(scene, times, "taylor", tolerance)
        assert found.ended == "complete"
        error = np.abs(found.omega[:, 0] - wanted).max() / max(0.3, *map(abs, wanted))
        # The time itself is rounded, relative to the width of the pulse.
        assert error <= tolerance + 4e-15


@pytest.mark.sampled
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", PULSES)
def test_the_reference_misses_no_pulse_of_time(name: str, width: float) -> None:
    scene, times, wanted = pulse(name, width)
    assert reference(scene, times).omega[:, 0] == pytest.approx(wanted, rel=0.0, abs=2e-14)


def _of_sine(power: int) -> float:
    """Return the integral of sin(x)**power over a full turn, a quotient of double factorials."""
    return 2.0 * math.pi * float(Fraction(math.comb(power, power // 2), 2**power))


def _of_parabola(power: int) -> float:
    """Return the integral of (1 - x**2)**power from -1 to 1."""
    return 2.0 * float(Fraction(4**power, (2 * power + 1) * math.comb(2 * power, power)))


def _sine(n: int, t: Any) -> Any:
    return np.sin(t) ** n


def _versine(n: int, t: Any) -> Any:
    return (0.5 - 0.5 * np.cos(t)) ** n


def _parabola(n: int, t: Any) -> Any:
    return (t * (4.0 - t) / 4.0) ** n


_TURNS = (1, 5, 20)
# Functions of time, ends of time spans, and the integrals from 0 to there: powers, whose pulses
# change no digit where they begin.
POWERS: dict[str, tuple[Callable[[Any], Any], list[tuple[float, float]]]] = {
    **{
        f"sine**{n}": (partial(_sine, n), [(2.0 * math.pi * k, k * _of_sine(n)) for k in _TURNS])
        for n in (6, 8, 12, 16, 24, 32, 200)
    },
    **{
        f"versine**{n}": (partial(_versine, n), [(2.0 * math.pi, _of_sine(2 * n))])
        for n in (4, 7, 100)
    },
    **{
        f"parabola**{n}": (partial(_parabola, n), [(4.0, 2.0 * _of_parabola(n))])
        for n in (7, 20, 300)
    },
    "product of sine and cosine": (
        lambda t: (2.0 * np.sin(t) * np.cos(t)) ** 64,
        [(3.0 * math.pi, 1.5 * _of_sine(64))],
    ),
    "far parabola": (
        lambda t: (1.0 - ((t - 50.0) / 50.0) ** 2) ** 1000,
        [(100.0, 50.0 * _of_parabola(1000))],
    ),
    "chain of products": (lambda t: math.prod([np.sin(t)] * 64), [(2.0 * math.pi, _of_sine(64))]),
    "power of a sum of powers": (
        lambda t: (np.sin(t) ** 14 + np.cos(t) ** 14) ** 6,
        [(2.0 * math.pi, 0.0)],
    ),
}


@pytest.mark.sampled
@pytest.mark.parametrize("name", POWERS)
def test_a_high_power_is_a_series_of_pulses(name: str) -> None:
    value, rows = POWERS[name]
    scene = Scene(
        "pulses",
        (0.1, 0.2, 0.3),
        moments=SPHERE,
        torque=lambda t, omega: [2.0 * value(t) + 0.0 * omega[0], 0.0, 0.0],
    )
    times = [t for t, _ in rows]
    change = np.array([each for _, each in rows])
    if not change.all():
        change = np.array([quad(value, 0.0, times[-1], epsabs=1e-13, epsrel=1e-13, limit=1000)[0]])
    scale = max(0.3, 0.1 + change[-1])
    for tolerance in (1e-3, 1e-6, 1e-9, 1e-12):
        solution = solve(scene, times, "taylor", tolerance)
        assert np.abs(solution.omega[:, 0] - 0.1 - change).max() <= (tolerance + 4e-15) * scale
        stepper = Stepper(scene, tolerance)
        stepper.until(times[-1])
        allowed = tolerance * stepper.steps * scale
        assert abs(stepper.omega[0] - 0.1 - change[-1]) <= allowed + 1e-14
        step = solve_ivp(
            lambda t, y: value(t), (0.0, times[-1]), [0.0],
            method=Taylor, rtol=max(tolerance, 1e-13), atol=tolerance,
        )  # fmt: skip
        assert abs(step.y[0, -1] - change[-1]) <= allowed + 1e-14
    true = reference(scene, times[:1])
    assert true.omega[0, 0] - 0.1 == pytest.approx(change[0], abs=4e-15 * scale)


@pytest.mark.sampled
@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e-9, 1e-12])
def test_a_power_beside_a_divisor_of_its_size_is_not_missed(unit: float) -> None:
    """The unit of a length changes no Hill function of it."""

    def hill(t: Any, unit: float = unit) -> Any:
        x = unit * (1.0 - np.cos(t)) / 2.0
        return x**20 / ((0.9 * unit) ** 20 + x**20)

    scene = Scene(
        "switch", (0.0, 0.0, 0.1), moments=(1.0, 2.0, 3.0),
        torque=lambda t, omega: [0.0, 0.0, 3.0 * hill(t) + 0.0 * omega[0]],
    )  # fmt: skip
    end = 7
    truth = math.fsum(quad(hill, k, k + 1, args=(1.0,), epsabs=1e-14)[0] for k in range(end))
    for tolerance in (1e-3, 1e-6, 1e-12):
        found = solve(scene, [end], "taylor", tolerance)
        assert abs(found.omega[0, 2] - 0.1 - truth) <= (tolerance + 4e-15) * (0.1 + truth)
        stepper = Stepper(scene, tolerance)
        stepper.until(end)
        assert abs(stepper.omega[2] - 0.1 - truth) <= tolerance * stepper.steps
    assert reference(scene, [end]).omega[0, 2] - 0.1 == pytest.approx(truth, rel=1e-14)


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-8, 1e-300])
def test_a_tangent_of_any_argument_is_finite(width: float) -> None:
    """A saturated brake is a constant torque until omega is near 0."""
    scene = Scene(
        "brake",
        (0.0, 1.0, 0.0),
        moments=SPHERE,
        torque=lambda t, omega: [0.0, -np.tanh(omega[1] / width), 0.0],
    )
    found = solve(scene, [1.0, 1.5, 1.9])
    assert found.ended == "complete"
    assert found.omega[:, 1] == pytest.approx([0.5, 0.25, 0.05], rel=1e-2 if width > 1e-3 else 1e-9)
