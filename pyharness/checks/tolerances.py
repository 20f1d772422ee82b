"""Tolerances at which the checks run each method, within a work limit."""

import math

from pyharness.checks.scenes.extreme import speed
from pyharness.checks.theory.conditioning import Conditioning
from pyharness.engine.methods.scipy_ivp import steps_sum
from pyharness.engine.plan.registry import FIXED_STEP, GAUSS, METHODS, REGISTRY, SCIPY_METHODS
from pyharness.engine.solve import finest as finest_of
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.scene import Scene

# Tolerances in the cases of Table 1; SciPy's methods run only at two that take less than a second.
OF_CASES = (1e-3, 1e-6, 1e-9, 1e-12)
_SCIPY_OF_CASES = (1e-6, 1e-9)
_OF_SELF_TEST = 1e-9
# Smallest tolerance for `quick`.
FEW_DIGITS = 1e-7
# A medium tolerance, and those to try if a finer one is not possible.
MIDDLING = 1e-6
_LADDER = (1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-9, 1e-7, MIDDLING, 1e-5, 1e-4, 1e-3)
# Methods that take minutes at their finest tolerances.
_ONLY_MIDDLING = ("quick", "rk45", "radau")
# Work limits (numbers of right-hand sides), and the factor by which the coarsest tolerance may
# exceed them.
_BUDGETS = {**dict.fromkeys(GAUSS, 1_000_000.0), **dict.fromkeys(SCIPY_METHODS, 4_000.0)}
_PATIENCE = 10.0
_ORDERS = {"dop853": 8, "lsoda": 8, "radau": 5, "rk45": 5}
_STAGES = {"dop853": 12, "lsoda": 2, "radau": 20, "rk45": 6}


def of_case(name: str, thin: bool) -> list[float]:
    """Return a method's tolerances in a case of Table 1, but only one if `thin`."""
    finest = METHODS[name].finest
    if name in SCIPY_METHODS:
        return [_SCIPY_OF_CASES[0]] if thin else list(_SCIPY_OF_CASES)
    if thin:
        return [max(finest, _OF_SELF_TEST)]
    return [*(each for each in OF_CASES if each > finest), finest]


def finest(name: str, scene: Scene, time: float) -> float:
    """Return the finest tolerance, at most 1, at which a method is checked until `time` (s)."""
    met = finest_of(name, scene, time)
    claimed = REGISTRY[name].finest
    return claimed if met <= claimed else min((t for t in _LADDER if t >= 1.1 * met), default=1.0)


def finest_and_middling(name: str, scene: Scene, time: float) -> list[float]:
    """Return a method's finest tolerance and, if coarser, 1e-6; for slow methods only 1e-6."""
    if name in _ONLY_MIDDLING:
        return [MIDDLING]
    least = finest(name, scene, time)
    return sorted({least, max(least, MIDDLING)})


def affordable(name: str, scene: Scene, time: float, flow: Conditioning) -> list[float | None]:
    """Return the tolerances at which a method is fast enough to check; None is a fixed step."""
    if name in FIXED_STEP:
        return [None]
    if name == "closed-form" or (name == "auto" and closed_form(scene)):
        return [METHODS["closed-form"].finest]
    least = FEW_DIGITS if name == "quick" else finest(name, scene, time)
    if name in GAUSS:
        # Gauss collocation compares two solutions, whose rounding must not exceed the tolerance.
        meetable = [each for each in _LADDER if each >= 4.0 * flow.rounding]
        least = max(least, min(meetable, default=math.inf))
    radians = speed(scene, flow.largest) * abs(time)
    most, coarsest = _BUDGETS.get(name, math.inf), _LADDER[-1]
    tried = [each for each in sorted({least, *_LADDER}) if least <= each <= coarsest]
    costs = {each: _cost(name, each, radians, flow.amplification) for each in tried}
    allowed = [each for each, cost in costs.items() if cost <= most]
    found = sorted({*allowed[:1], *({MIDDLING} & set(allowed))})
    if not allowed and least <= coarsest and costs[coarsest] <= _PATIENCE * most:
        found = [coarsest]
    return [*found, None] if name in GAUSS else [*found]


def _cost(name: str, tolerance: float, radians: float, amplification: float) -> float:
    """Return the estimated number of right-hand sides, or 0 if the method has no work limit."""
    if name in GAUSS:
        stages = int(name[-1])
        # Steps of z radians cause the error amplification * radians * z**order.
        z = math.pow(tolerance / (max(radians, 1.0) * amplification), 0.5 / stages)
        return 12.0 * stages * radians / min(z, 1.0)
    if name in SCIPY_METHODS:
        a_step = tolerance / steps_sum(SCIPY_METHODS[name], radians, amplification)
        return _STAGES[name] * radians / math.pow(a_step, 1.0 / (_ORDERS[name] + 1))
    return 0.0
