"""Recognition of an integrator's known faults by its errors and orders of convergence."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pyharness.checks.compare.orders import ORDER_SLACK
from pyharness.checks.integrators.faults import FAULTS, OUTPUTS, Fault, State
from pyharness.checks.integrators.problem import Judged, convergence, drift_of, errors_between

# A fault is recognised if it explains all but the part `_UNEXPLAINED` of the error, and if this
# part decreases at least with the power `_FALLS` of the step size or tolerance.
_UNEXPLAINED = 0.1
_FALLS = 1.0 - ORDER_SLACK
_OF_MOTIONS = 1e-10  # relative error of the computed faulty motions
_CONSERVED = 8.0  # most rounding errors per step of a conserved quantity

FIRST_ORDER = {
    "first-order": "omega converges with order 1 only",
    "first-order-splitting": "omega converges with order 1 only, although the magnitude of the "
    "angular momentum is conserved: the parts of a step are composed without symmetry (first-order "
    "splitting)",
    "first-order-attitude": "the attitude converges with order 1, and omega with a higher order: "
    "the attitude advances with the omega of one end of the step (first-order splitting)",
    "torque-held": "the order is 1 under a torque that varies with time, and higher otherwise: "
    "the torque of a step is that at one end of the step, or at another wrong time",
}
"""Sentences on the faults that measured orders of convergence reveal."""
SAYS = {each.name: each.says for each in FAULTS} | FIRST_ORDER
"""Sentences on all known faults."""
UNKNOWN = "unknown"
"""Name of an unknown fault."""


@dataclass(frozen=True)
class Finding:
    """A recognised fault, a sentence on it, and the problems that show it."""

    name: str
    text: str
    problems: tuple[str, ...]


def recognised(results: Sequence[Judged]) -> list[Finding]:
    """Return the faults that explain the errors or, without any, the orders of convergence."""
    explained = [(judged, _explained(judged)) for judged in results]
    pairs = [(name, judged.problem.name) for judged, names in explained for name in names]
    pairs += _by_orders([judged for judged, names in explained if not names])
    where: dict[str, list[str]] = {}
    for name, problem in pairs:
        where.setdefault(name, []).append(problem)
    listed = [Finding(name, SAYS[name], tuple(problems)) for name, problems in where.items()]
    return sorted(listed, key=lambda each: -len(each.problems))


def _explained(judged: Judged) -> list[str]:
    """Return a fault that explains all errors, else one of omega with faults of the output."""
    true = judged.convergences
    if judged.lost or all(each.is_higher for each in true):
        return []
    converges = all(each.converges for each in true)
    if converges and judged.finest.control == "tolerance":
        return []
    # Motions of other faults do not converge to the true motion.
    known = [(f, state) for f, state in judged.problem.faulty if f.of_step or not converges]
    both = _best(judged, known, range(len(true)))
    if both is not None:
        return [both.name]
    # Without such a fault, seek one of omega, and any of the output.
    base = None if true[0].is_higher or len(true) == 1 else _best(judged, known, range(1))
    if base is None:
        return []

    def states(output: Fault, level: int) -> State:
        return output.state(judged.problem.faulty_states(base, level), judged.problem.scene)

    outputs = [fault for fault, _ in judged.problem.faulty if fault.name in OUTPUTS]
    seen = [x for x in outputs if _approaches(judged, base, partial(states, x), range(2))]
    return [base.name, *(each.name for each in seen)]


def _best(
    judged: Judged, known: Sequence[tuple[Fault, State]], parts: Sequence[int]
) -> Fault | None:
    most = _UNEXPLAINED * max(judged.convergences[k].errors[-1] for k in parts)
    scored = []
    for fault, state in known:
        left = errors_between(state, judged.finest)
        scored.append((max(left[k] or 0.0 for k in parts), fault))
    for worst, fault in sorted(scored, key=lambda each: each[0]):
        states = partial(judged.problem.faulty_states, fault)
        if worst <= most and _approaches(judged, fault, states, parts):
            return fault
    return None


def _approaches(
    judged: Judged, fault: Fault, states: Callable[[int], State], parts: Sequence[int]
) -> bool:
    errors = [errors_between(states(k), motion) for k, motion in enumerate(judged.answers)]
    floor = max(judged.problem.floor(judged.finest.rounding), _OF_MOTIONS)
    for k in parts:
        true = judged.convergences[k]
        values = [x if x is not None else math.inf for x in (each[k] for each in errors)]
        least = _FALLS
        if fault.of_step and true.order is not None and not true.is_higher:
            least += max(true.order, 0.0)
        measure = partial(convergence, true.part, true.settings, values, floor)
        orders = [measure(overall).order for overall in (True, False)]
        if values[-1] > floor and any(order is None or order < least for order in orders):
            return False
    return True


def _by_orders(results: Sequence[Judged]) -> list[tuple[str, str]]:
    found = []
    calm = [each for each in results if not each.problem.has_waves]
    calm_is_higher = any(each.convergences[0].is_higher for each in calm)
    for judged in results:
        omega, attitude = judged.order_of("omega"), judged.order_of("attitude")
        if judged.finest.control == "tolerance" or judged.lost or omega is None:
            continue
        problem = judged.problem
        if omega.is_first and problem.has_waves and calm_is_higher:
            found.append(("torque-held", problem.name))
        elif omega.is_first:
            name = "first-order-splitting" if _conserves_momentum(results) else "first-order"
            found.append((name, problem.name))
        elif omega.is_higher and attitude is not None and attitude.is_first:
            found.append(("first-order-attitude", problem.name))
    return found


def _conserves_momentum(results: Sequence[Judged]) -> bool:
    found = []
    for judged in (each for each in results if each.problem.scene.torque.is_zero):
        problem, motion = judged.problem, judged.finest
        drift = np.abs(drift_of(problem.scene, problem.times, motion).named["momentum"]).max()
        found.append(drift <= _CONSERVED * motion.rounding * problem.most_steps)
    return bool(found) and all(found)
