"""Bounds on the sum of the errors of a method's steps, derived without running it.

The bound is the tolerance, or with a fixed step follows from the order. The derivative of omega is
at most `a`, the largest Euler coefficient, times the product of two components. The k-th derivative
is therefore at most k! (a W)**k W, with W the largest omega, as for y' = a y**2, y(0) = W. Likewise
no term of the method's own power series exceeds its term for that equation.
"""

import math
from functools import cache

import numpy as np

from pyharness.checks.theory.schemes import SCHEMES, Series, constant
from pyharness.engine.registry import FIXED_STEP, REGISTRY, SCIPY_METHODS
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene

STEPS = Basis(
    "derived",
    "error of omega, energy and momentum: promised errors of all steps, and rounding errors, with "
    "the error amplification",
    "the tolerance, or a majorant series for fixed steps (`theory/promises.py`); first-order "
    "perturbations (`theory/conditioning.py`)",
)
"""Basis of limits from the promised errors of the steps."""


def steps_of(name: str, run_steps: int, evaluations: int) -> float:
    """Return how often omega is rounded: 0 if compensated; for SciPy's methods an estimate."""
    if name in SCIPY_METHODS:
        return evaluations / (1 if name == "lsoda" else 6)
    return float(run_steps) if name in FIXED_STEP or name == "quick" else 0.0


def fixed_step_sum(name: str, angle: float, steps: int) -> float:
    """Return a bound on the sum of the relative truncation errors of all fixed steps.

    `angle` (rad) is the product of the largest Euler coefficient, the largest omega and the step.
    From 0.5 on, the bound is infinite.
    """
    if angle >= 0.5:
        return math.inf
    order = REGISTRY[name].order
    own = sum(c * angle**k for k, c in enumerate(_series(name)) if k > order)
    return steps * (angle ** (order + 1) / (1.0 - angle) + own)


@cache
def _series(name: str) -> tuple[float, ...]:
    """Return the coefficients of powers of the step in one step of y' = y**2, y(0) = 1.

    This is one of Euler's equations with A = B = C = 1 and equal components.
    """
    ones = np.ones(3)
    equal = Scene("equal", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = SCHEMES[name].scheme(Series(equal), constant(ones))[:, 0]
    return tuple(found.tolist())
