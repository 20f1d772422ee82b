"""What each method promises before it is run: the errors that its steps make.

Nothing here is fitted. Of a method with a tolerance the errors of its steps add up to the
tolerance. Of a method with a fixed step they follow from the order: the k-th derivative of a
solution of w' = a products is at most k! (a W)**k W, W the largest omega (the solution of
y' = a y**2 has these derivatives, and larger ones than any other), and the method's own series
has no larger terms than it has for y' = a y**2.
"""

import math
from functools import cache

from numpy.polynomial import Polynomial

from pyharness.methods.registry import FIXED_STEP, REGISTRY, SCIPY_METHODS


def steps_of(name: str, run_steps: int, evaluations: int) -> float:
    """Return the steps after which a method rounds omega and forgets what it took off."""
    if name in SCIPY_METHODS:
        return evaluations / (1 if name == "lsoda" else 6)
    return float(run_steps) if name in FIXED_STEP or name == "quick" else 0.0


def fixed_step_sum(name: str, angle: float, steps: int) -> float:
    """Return the sum of the errors of the steps of a fixed-step method, relative.

    `angle` is the largest coefficient times the largest omega times the step.
    """
    if angle >= 0.5:
        return math.inf
    order = REGISTRY[name].order
    own = sum(c * angle**k for k, c in enumerate(_series(name)) if k > order)
    return steps * (angle ** (order + 1) / (1.0 - angle) + own)


@cache
def _series(name: str) -> tuple[float, ...]:
    """Return the method's own series in the angle for y' = y**2, y(0) = 1."""
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
