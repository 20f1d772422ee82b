"""What each method promises before it is run: the errors that it makes on the way, and its cost.

Nothing here is fitted. Of a method with a tolerance the errors made on the way add up to the
tolerance. Of a method with a fixed step they follow from the order: the k-th derivative of a
solution of w' = a products is at most k! (a W)**k W, W the largest omega (the solution of
y' = a y**2 has these derivatives, and larger ones than any other), and the method's own series
has no larger terms than it has for y' = a y**2.
"""

import math
from functools import cache

from numpy.polynomial import Polynomial

from pyharness.methods.problem import closed_form
from pyharness.methods.registry import FIXED_STEP, GAUSS, REGISTRY, SCIPY_METHODS
from pyharness.methods.scipy_ivp import steps_sum
from pyharness.methods.solve import finest as finest_of
from pyharness.model.scene import Scene

METHODS = ("closed-form", "auto", "taylor", "quick", *GAUSS, *SCIPY_METHODS, *FIXED_STEP)

LADDER = (1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
COARSE = 1e-6
_PATIENCE = 10.0  # times the budget, for the coarsest tolerance
_SERIES = ("taylor", "auto", "prepared-auto")
_TOO_MANY_RADIANS = 1e8  # of a wave, for a series
_ORDERS = {"dop853": 8, "lsoda": 8, "radau": 5, "rk45": 5}
_STAGES = {"dop853": 12, "lsoda": 2, "radau": 20, "rk45": 6}


def speed(scene: Scene, largest: float) -> float:
    """Return the largest coefficient times the largest omega (1/s)."""
    return max(map(abs, scene.euler_coefficients)) * largest


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


def finest(name: str, scene: Scene, time: float) -> float:
    """Return the finest tolerance at which a method is tried until `time` (s).

    The one that it claims; where `solve_ivp` can't meet that in the scene, the next of the ladder.
    """
    met = finest_of(name, scene, time)
    claimed = REGISTRY[name].finest
    return claimed if met <= claimed else min((t for t in LADDER if t >= 1.1 * met), default=1.0)


def tolerances(name: str, least: float, radians: float, amplification: float) -> list[float]:
    """Return the tolerances from `least` at which a method is tried on so many radians.

    The finest that costs no more than its budget, and a coarse one.
    """
    allowed = [
        each
        for each in sorted({least, *LADDER})
        if least <= each <= LADDER[-1] and _cost(name, each, radians, amplification) <= _most(name)
    ]
    if not allowed and least <= (coarsest := LADDER[-1]):
        is_borne = _cost(name, coarsest, radians, amplification) <= _PATIENCE * _most(name)
        return [coarsest] if is_borne else []
    return sorted({*allowed[:1], *({COARSE} & set(allowed))})


def _most(name: str) -> float:
    return 1_000_000.0 if name in GAUSS else 4_000.0 if name in SCIPY_METHODS else math.inf


def _cost(name: str, tolerance: float, radians: float, amplification: float) -> float:
    """Estimate the right-hand sides that a tolerance takes: no bound, only a budget."""
    if name in GAUSS:
        stages = int(name[-1])
        # The error of steps of z radians each, amplified: radians z**order.
        z = math.pow(tolerance / (max(radians, 1.0) * amplification), 0.5 / stages)
        return 12.0 * stages * radians / min(z, 1.0)
    if name in SCIPY_METHODS:
        a_step = tolerance / steps_sum(SCIPY_METHODS[name], radians, amplification)
        return _STAGES[name] * radians / math.pow(a_step, 1.0 / (_ORDERS[name] + 1))
    return 0.0


def may_refuse(name: str, scene: Scene, time: float) -> bool:
    """Whether a method may refuse a scene; anything else that refuses is at fault.

    `closed-form` where there is none. `quick`, which takes three products and leaves to the series
    what takes too many steps. The series where a wave turns more often than anyone waits for.
    """
    if name == "closed-form":
        return closed_form(scene) is None
    waves = scene.torque.sines + scene.torque.cosines
    radians = max((abs(frequency * time) for _, frequency in waves), default=0.0)
    return name == "quick" or (name in _SERIES and radians > _TOO_MANY_RADIANS)
