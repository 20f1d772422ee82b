"""Bounds on the sum of the errors of a method's steps, known before the method is run.

No bound is fitted to results. For a method with a tolerance, the bound of the sum is the tolerance.
For a method with a fixed step, the bound follows from its order and from a bound on derivatives.
The derivative of omega is at most a number `a` times the product of two components. Therefore the
k-th derivative is at most k! (a W)**k W, where W is the largest omega. The solution of y' = a y**2
with y(0) = W attains this limit. Likewise, no term of the method's own power series exceeds the
term that the method yields for y' = a y**2.
"""

import math
from functools import cache

import numpy as np

from pyharness.methods.registry import FIXED_STEP, REGISTRY, SCIPY_METHODS
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.theory.schemes import SCHEMES, Series, constant

STEPS = Basis(
    "derived",
    "error of omega, energy and momentum: promised errors of all steps, and rounding errors, with "
    "the error amplification",
    "the tolerance, or a majorant series for fixed steps (`theory/promises.py`); first-order "
    "perturbations (`theory/conditioning.py`)",
)
"""Basis of the limits that follow from the promised errors of the steps."""


def steps_of(name: str, run_steps: int, evaluations: int) -> float:
    """Return how often a run of a method rounds omega to binary64 at the end of a step.

    `name` is the method, `run_steps` is the number of steps of the run, and `evaluations` is the
    number of right-hand sides that it evaluated. The result is 0 for a method that retains the
    rounding errors of omega by compensated summation. For SciPy's methods the result is estimated
    from `evaluations`.
    """
    if name in SCIPY_METHODS:
        return evaluations / (1 if name == "lsoda" else 6)
    return float(run_steps) if name in FIXED_STEP or name == "quick" else 0.0


def fixed_step_sum(name: str, angle: float, steps: int) -> float:
    """Return a bound of the sum of the relative errors of `steps` steps of a fixed-step method.

    The errors are truncation errors relative to the largest omega. `name` is the method. `angle`
    (rad) is the product of the largest Euler coefficient, the largest omega and the step size. The
    bound is infinite if the angle is 0.5 or more.
    """
    if angle >= 0.5:
        return math.inf
    order = REGISTRY[name].order
    own = sum(c * angle**k for k, c in enumerate(_series(name)) if k > order)
    return steps * (angle ** (order + 1) / (1.0 - angle) + own)


@cache
def _series(name: str) -> tuple[float, ...]:
    """Return the coefficients of the powers of the step size in a method's result after one step.

    The step starts from y(0) = 1 and integrates y' = y**2, which is Euler's equations with A = B =
    C = 1 for three equal components.
    """
    ones = np.ones(3)
    equal = Scene("equal", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = SCHEMES[name].scheme(Series(equal), constant(ones))[:, 0]
    return tuple(found.tolist())
