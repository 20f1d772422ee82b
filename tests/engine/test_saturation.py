"""Bounded torques whose exponentials overflow are solved, and true overflows are not."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import Scene, Stepper, Taylor, prepare, solve, solve_many
from pyharness.model.state_torque import recorded
from pyharness.truth.reference import reference

CENTRE, WIDTH = 20.0, 0.02


def _x(t: Any) -> Any:
    return (t - CENTRE) / WIDTH


# Each adds 0.5 rad/s between 0 and 25 s.
BOUNDED: dict[str, Callable[[Any], Any]] = {
    "logistic": lambda t: 0.1 / (1.0 + np.exp(-_x(t))),
    "logistic derivative": lambda t: 0.5 / WIDTH * np.exp(-_x(t)) / (1.0 + np.exp(-_x(t))) ** 2,
    "1/cosh": lambda t: 0.5 / (math.pi * WIDTH) / np.cosh(_x(t)),
    "1/cosh squared": lambda t: 0.25 / WIDTH / np.cosh(_x(t)) ** 2,
    "sinh/cosh": lambda t: 0.05 * (1.0 + np.sinh(_x(t)) / np.cosh(_x(t))),
    "Fermi's function": lambda t: 0.1 - 0.1 / (np.exp(_x(t)) + 1.0),
}


def _scene(torque: Callable[[Any], Any]) -> Scene:
    return Scene("", (0.0, 0.0, 0.0), moments=(1, 1, 1), torque=lambda t, w: [torque(t), 0.0, 0.0])


@pytest.mark.parametrize("name", BOUNDED)
def test_bounded_torque_is_solved(name: str) -> None:
    scene = _scene(BOUNDED[name])
    found: Any = solve(scene, [5.0, 25.0], tolerance=1e-8)
    assert found.ended == "complete"
    assert found.omega[:, 0] == pytest.approx([0.0, 0.5], abs=1e-8)
    assert abs(found.omega[1, 0] - 0.5) / 0.5 <= found.error < 1e-8
    assert prepare(scene, tolerance=1e-8)((0.0, 0.0, 0.0), 25.0)[0] == pytest.approx(0.5, abs=1e-8)
    many = solve_many(scene, 25.0, omega=np.zeros((3, 3)), tolerance=1e-8)
    assert many.omega[:, 0] == pytest.approx(0.5, abs=1e-8)
    stepper = Stepper(scene, 1e-10)
    stepper.until(25.0)
    assert stepper.omega[0] == pytest.approx(0.5, abs=1e-6)
    series = solve_ivp(
        lambda t, y: [BOUNDED[name](t)], (0.0, 25.0), [0.0], method=Taylor, rtol=1e-9, atol=1e-9
    )
    assert series.y[0, -1] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("name", BOUNDED)
def test_value_in_floats(name: str) -> None:
    torque = recorded(lambda t, w: [BOUNDED[name](t), 0.0, 0.0])
    for time in (0.0, 19.9, 20.0, 20.3, 45.0):
        x = _x(time)
        bell, half = (1.0 / math.cosh(max(-700.0, min(700.0, part * x))) for part in (1.0, 0.5))
        wanted = {
            "1/cosh": 0.5 / (math.pi * WIDTH) * bell,
            "1/cosh squared": 0.25 / WIDTH * bell**2,
            "logistic derivative": 0.125 / WIDTH * half**2,
        }.get(name, 0.05 * (1.0 + math.tanh(x if name == "sinh/cosh" else 0.5 * x)))
        found = torque.at(time, (0, 0, 0), (1, 0, 0, 0))[0]
        assert found == pytest.approx(wanted, rel=1e-13, abs=1e-16)


@pytest.mark.parametrize("torque", [
    lambda t: 0.01 * np.exp(50.0 * t),
    lambda t: 1e5 + 1e-300 * np.exp(100.0 * t),
    lambda t: np.exp(50.0 * t) / (1.0 + np.exp(49.0 * t)),
    lambda t: 0.01 * np.exp(50.0 * t) / np.exp(50.0 * t + 1.0),  # which is constant
])  # fmt: skip
def test_torque_that_depends_on_the_exponential_is_an_overflow(torque: Any) -> None:
    for method in ("auto", "dop853"):
        assert solve(_scene(torque), 25.0, method, 1e-6).ended == "overflow"


# Torques of omega3, and whether their values in floats are numbers.
RATIOS: dict[str, tuple[Callable[..., Any], bool]] = {
    "to one": (lambda t, w: np.exp(690.0 * w) / (np.exp(700.0 * w) - 1.0), True),
    "of ratios": (
        lambda t, w: np.exp(700 * w) / np.exp(699 * w) - np.exp(701 * w) / np.exp(699.5 * w),
        True,
    ),
    "of time": (lambda t, w: np.cos(5 * t) * np.exp(800 * w) / (1.0 + np.exp(800 * w)), True),
    "times 0": (lambda t, w: np.sin(t) * np.exp(698 * w) / (1.0 + np.exp(700 * w)), True),
    "of a pole": (lambda t, w: (np.exp(800 * w) + 1.0) / (np.exp(800 * w) - 1.0), True),
    "lost": (lambda t, w: np.exp(900.0 * w) * np.exp(-899.0 * w), False),
    "lost and times 0": (lambda t, w: np.sin(t) * np.exp(898 * w) / np.exp(900 * w), False),
}


@pytest.mark.sampled
@pytest.mark.parametrize("method", ["auto", "dop853"])
@pytest.mark.parametrize("name", RATIOS)
def test_ratio_of_exponentials_is_right_or_an_overflow(name: str, method: str) -> None:
    torque, is_number = RATIOS[name]
    scene = Scene(
        "", (0.0, 0.0, 0.99), moments=(1, 1, 1), torque=lambda t, w: [0.0, 0.0, torque(t, w[2])]
    )
    found = solve(scene, [0.1], method, 1e-11)
    assert found.ended == ("complete" if is_number else "overflow")
    if is_number:
        assert found.omega == pytest.approx(reference(scene, [0.1]).omega, abs=1e-9)
