"""Stiff recorded torques by SciPy's implicit methods: as fast as opaque ones, and judged."""

from typing import Any

import numpy as np
import pytest

from pyharness import Scene, solve

RATE = 1e6


def slow(t: Any, w: Any) -> Any:
    return -RATE * w + np.array([0.1 * np.sin(t), 0.0, 0.0])


def damped(t: Any, w: Any) -> list[Any]:
    return [-1e4 * (w[0] - np.cos(t)), -50.0 * w[1], -1e3 * w[2]]


def with_pulse(t: Any, w: Any) -> list[Any]:
    pulse = 1e3 * np.exp(-(((t - 50.3) / 0.005) ** 2))
    return [-RATE * w[0] + 0.1 * np.sin(t) + pulse, -RATE * w[1], -RATE * w[2]]


def scene_of(torque: Any) -> Scene:
    return Scene("stiff", (0.3, 1.0, 0.2), moments=(1.0, 1.0, 1.0), torque=torque)


@pytest.mark.parametrize("method", ["radau", "lsoda"])
@pytest.mark.parametrize("dense", [False, True])
def test_slow_part_of_a_stiff_motion_is_followed(method: str, dense: bool) -> None:
    found = solve(scene_of(slow), [50.0, 100.0], method, dense_output=dense)
    assert found.ended == "complete"
    times = np.array([50.0, 100.0])
    right = 1e-7 * np.sin(times) - 1e-13 * np.cos(times)
    assert found.omega[:, 0] == pytest.approx(right, abs=1e-9)
    assert found.evaluations < 10_000
    if dense:
        assert found.sol(times)[0] == pytest.approx(right, abs=2e-9)


def test_components_of_different_stiffness() -> None:
    found = solve(scene_of(damped), [3.0, 20.0], "lsoda")
    assert found.ended == "complete"
    # The particular solution of w' = -k (w - cos t).
    k, times = 1e4, np.array([3.0, 20.0])
    right = (k * k * np.cos(times) + k * np.sin(times)) / (k * k + 1.0)
    assert found.omega[:, 0] == pytest.approx(right, abs=1e-8)


@pytest.mark.parametrize("method", ["radau", "lsoda"])
def test_pulse_that_scipy_steps_over_is_seen(method: str) -> None:
    found = solve(scene_of(with_pulse), [50.3, 100.0], method)
    right = 1e-3
    missed = abs(found.omega[0, 0] - right) > 1e-4
    assert found.ended == ("unchecked" if missed else "complete")
    assert missed or method == "lsoda"
