"""Functions of torques that depend on more than their arguments are refused."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyharness import InputError, Scene, Taylor

SOURCE = np.random.default_rng(0)


def noise(t: Any, w: Any) -> Any:
    return -0.1 * w + 1e-2 * SOURCE.standard_normal(3)


class Integral:
    """A controller that adds the omega of all its calls."""

    def __init__(self) -> None:
        """Begin with 0."""
        self.total: Any = 0.0

    def __call__(self, t: Any, w: Any) -> Any:
        """Return the torque."""
        self.total = self.total + 0.01 * w
        return -0.1 * w - 0.05 * self.total


class Hold:
    """A controller that keeps its first omega."""

    def __init__(self) -> None:
        """Begin without one."""
        self.first: Any = None

    def __call__(self, t: Any, w: Any) -> Any:
        """Return the torque."""
        if self.first is None:
            self.first = w
        return -0.1 * self.first


class Counter:
    """A function that counts its calls, which its result does not depend on."""

    def __init__(self) -> None:
        """Begin with 0."""
        self.calls = 0

    def __call__(self, t: Any, w: Any) -> Any:
        """Return the torque."""
        self.calls += 1
        return -0.1 * w


@pytest.mark.parametrize("function", [noise, Integral(), Hold()])
def test_function_with_a_memory_is_refused(function: Any) -> None:
    with pytest.raises(InputError, match="two calls of the function differ, or it keeps") as caught:
        Scene("", (0.1, 0.2, 0.3), moments=(1.0, 2.0, 3.0), torque=function)
    assert "held_torque of a Stepper" in str(caught.value)


def test_right_hand_side_of_solve_ivp_with_a_memory_is_refused() -> None:
    def fun(t: Any, y: Any) -> Any:
        return [SOURCE.standard_normal() * y[0]]

    with pytest.raises(InputError, match="fun: two calls of the function differ"):
        solve_ivp(fun, (0.0, 1.0), [1.0], method=Taylor)


def test_function_that_counts_its_calls_is_taken() -> None:
    counter = Counter()
    Scene("", (0.1, 0.2, 0.3), moments=(1.0, 2.0, 3.0), torque=counter)
    assert counter.calls == 2
