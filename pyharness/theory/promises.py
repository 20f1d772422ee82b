"""Bounds for the errors of the steps of each method, known before it is run.

Nothing here is fitted. For a method with a tolerance, the errors of its steps add up to the
tolerance. For a method with a fixed step, they follow from the order. If w' is at most `a` times a
product of two omegas, the k-th derivative is at most k! (a W)**k W, where W is the largest omega.
The solution of y' = a y**2 has these derivatives, and no other solution has larger ones. The
method's own series has no larger terms than it has for y' = a y**2.
"""

import math
from functools import cache

from numpy.polynomial import Polynomial

from pyharness.methods.registry import FIXED_STEP, REGISTRY, SCIPY_METHODS


def steps_of(name: str, run_steps: int, evaluations: int) -> float:
    """Return the number of steps after which a method rounds omega and drops the rounding error.

    `name` is the method, `run_steps` is the number of steps of the run, and `evaluations` is its
    number of right-hand sides. The result is 0 for a method that retains its rounding errors by
    compensated summation. For SciPy's methods it is estimated from `evaluations`.
    """
    if name in SCIPY_METHODS:
        return evaluations / (1 if name == "lsoda" else 6)
    return float(run_steps) if name in FIXED_STEP or name == "quick" else 0.0


def fixed_step_sum(name: str, angle: float, steps: int) -> float:
    """Return a bound of the sum of the relative errors of `steps` steps of a fixed-step method.

    The errors are truncation errors relative to the largest omega. `name` is the method. `angle` is
    the largest Euler coefficient times the largest omega times the step size. The bound is infinite
    if the angle is 0.5 or more.
    """
    if angle >= 0.5:
        return math.inf
    order = REGISTRY[name].order
    own = sum(c * angle**k for k, c in enumerate(_series(name)) if k > order)
    return steps * (angle ** (order + 1) / (1.0 - angle) + own)


@cache
def _series(name: str) -> tuple[float, ...]:
    """Return the coefficients, from power 0 of the step size, of a method's result after one step.

    The step starts from y(0) = 1 and integrates y' = y**2. The step size is the `angle` of
    `fixed_step_sum`.
    """
    if name == "taylor-3":
        return 1.0, 1.0, 1.0
    y, h = Polynomial([1.0]), Polynomial([0.0, 1.0])
    first = y * y
    if name == "improved-euler":
        result = y + 0.5 * h * (first + (y + h * first) ** 2)
    else:
        second = (y + 0.5 * h * first) ** 2
        third = (y + 0.5 * h * second) ** 2
        result = y + 1.0 / 6.0 * (h * (first + 2.0 * (second + third) + (y + h * third) ** 2))
    return tuple(result.coef.tolist())
