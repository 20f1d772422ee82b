"""The recognition of known faults of an integrator, by its errors and its orders of convergence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pyharness.checks.integrators.faults import OUTPUTS, State, as_output, motions
from pyharness.checks.integrators.problem import LEVELS, Judged, drift_of, errors_between

# A motion is that of a known fault if it explains all but this part of the error.
_UNEXPLAINED = 0.1
_CONSERVED = 8.0  # rounding errors in a step, of a quantity that is conserved

FIRST_ORDER = {
    "first-order": "omega converges with order 1 only",
    "first-order-splitting": "omega converges with order 1 only, although the magnitude of the "
    "angular momentum is conserved: the parts of a step are composed without symmetry (first-order "
    "splitting)",
    "first-order-attitude": "the attitude converges with order 1, and omega with a higher order: "
    "the attitude advances with the omega of one end of the step (first-order splitting)",
    "torque-held": "the order is 1 under a torque that varies with time, and higher otherwise: "
    "the torque of a step is that at one end of the step",
}
"""The faults that measured orders show, each with a sentence that says what is wrong."""


@dataclass(frozen=True)
class Finding:
    """A known fault that was recognised, a sentence about it, and the problems that show it."""

    name: str
    says: str
    problems: tuple[str, ...]


def recognised(results: Sequence[Judged]) -> list[Finding]:
    """Return the known faults that explain the errors of an integrator.

    The faults of most problems are first.

    A fault explains the errors in a problem if its motion leaves at most a tenth of them. In the
    problems that no such fault explains, the orders of convergence are interpreted.
    """
    names: dict[str, tuple[str, list[str]]] = {}

    def add(name: str, says: str, problem: str) -> None:
        names.setdefault(name, (says, []))[1].append(problem)

    rest = []
    for judged in results:
        found = _explained(judged)
        for name, says in found:
            add(name, says, judged.problem.name)
        if not found:
            rest.append(judged)
    for name, problem in _by_orders(rest):
        add(name, FIRST_ORDER[name], problem)
    listed = [Finding(name, says, tuple(where)) for name, (says, where) in names.items()]
    return sorted(listed, key=lambda each: -len(each.problems))


def _explained(judged: Judged) -> list[tuple[str, str]]:
    """Return names and sentences of the faults that explain the errors in one problem."""
    if all(each.is_higher for each in judged.convergences):
        return []
    problem, motion = judged.problem, judged.finest
    errors = [x for x in problem.errors(motion) if x is not None]
    known = list(motions(problem.scene, problem.times, problem.step_size(LEVELS - 1)))
    scores = []
    for fault, state in known:
        left = [x for x in errors_between(state, motion) if x is not None]
        scores.append((max(left), fault, left, state))
    worst, fault, left, _ = min(scores, key=lambda each: each[0])
    if worst <= _UNEXPLAINED * max(errors):
        return [(fault.name, fault.says)]
    # One fault of omega, and one of the attitude that is given out.
    omega_is_right = judged.convergences[0].is_higher
    assert problem.truth.attitude is not None
    true = State(problem.truth.omega, problem.truth.attitude)
    _, first, left, state = min(scores, key=lambda each: each[2][0])
    named = []
    if not omega_is_right:
        if left[0] > _UNEXPLAINED * errors[0]:
            return []
        named.append((first.name, first.says))
    if motion.attitude is not None:
        base = true if omega_is_right else state
        for name in OUTPUTS:
            other = State(base.omega, as_output(name, base.attitude, problem.scene))
            angle = errors_between(other, motion)[1]
            if angle is not None and angle <= _UNEXPLAINED * errors[1]:
                named.append((name, next(f.says for f, _ in known if f.name == name)))
    return named


def _by_orders(results: Sequence[Judged]) -> list[tuple[str, str]]:
    """Return pairs of a fault in `FIRST_ORDER` and the name of a problem whose orders show it."""
    found = []
    calm_is_higher = any(
        each.convergences[0].is_higher for each in results if each.problem.kind != "wave"
    )
    for judged in results:
        omega, attitude = judged.of("omega"), judged.of("attitude")
        if judged.finest.control == "tolerance" or omega is None:
            continue
        name = ""
        if omega.is_first:
            name = "first-order-splitting" if _conserves_momentum(results) else "first-order"
            if judged.problem.kind == "wave" and calm_is_higher:
                name = "torque-held"
        elif omega.is_higher and attitude is not None and attitude.is_first:
            name = "first-order-attitude"
        if name:
            found.append((name, judged.problem.name))
    return found


def _conserves_momentum(results: Sequence[Judged]) -> bool:
    """Return whether |L| is constant, up to rounding, in all problems without torque."""
    free = [each for each in results if each.problem.scene.torque.is_zero]
    for judged in free:
        problem, motion = judged.problem, judged.finest
        drift = np.abs(drift_of(problem.scene, problem.times, motion).momentum).max()
        if not drift <= _CONSERVED * motion.rounding * problem.most_steps:
            return False
    return bool(free)
