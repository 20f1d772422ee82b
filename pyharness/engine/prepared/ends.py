"""Repeated solutions of a scene until one time, by solvers that are kept with it."""

import math
from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from pyharness.engine.methods.sensitivity import (
    calm_until,
    closed_form_estimate,
    is_calm,
    judge_ending,
)
from pyharness.engine.plan.plan import plan
from pyharness.engine.prepared.solver import Solver
from pyharness.engine.problem.problem import Problem, kept_of
from pyharness.engine.system.kernel_input import rows_trajectory
from pyharness.model.extension import COMPLETE
from pyharness.model.row_errors import AGAIN
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory

_MOST_KEPT = 16  # problems and functions of a scene
_WITH_END = ("auto", "taylor", "closed-form")
# Of method, tolerance, effort and attitude.
_TYPES = set(product((str,), (float, type(None)), (float,), (bool, type(None))))
End = Callable[[float], Trajectory | None]


def _end(problem: Problem, method: str, tolerance: float, effort: float, again: Any) -> End:
    """Return a function that solves until one time; None means that `solve` must judge."""
    scene, omega = problem.scene, np.array(problem.scene.omega)
    chosen = plan(scene, method, tolerance, rows=True)
    solver: Any = Solver(scene, chosen, tolerance, method, effort, problem.with_attitude)
    calm = calm_until(scene) if scene.torque.is_zero else 0.0
    kind = "closed" if chosen.closed_form else ""
    known = {"moments": problem.moments, "tolerance": tolerance, "scene": problem.given}

    def solve_until(time: float) -> Trajectory | None:
        problem.check(time, time)
        state = solver(omega, time)
        number, steps, _, _, spent, *_ = solver._ending
        attitude = error = growth = None
        if problem.with_attitude:
            state, attitude = state[0], state[1][None]
        is_later = kind and not steps and number == COMPLETE
        # Before `calm`, no kernel needs to be asked.
        if is_later and abs(time) >= calm:
            is_later = is_calm(scene, scene.omega, time, tolerance)
        if not is_later:
            status, error, growth = judge_ending(scene, kind, tolerance, solver._ending)
            if status != "complete":
                return None
        found = rows_trajectory(
            (time,), state[None], int(spent) if steps else 0, steps or 1, "complete",
            attitude=attitude, error=error, growth=growth, **known,
        )  # fmt: skip
        if is_later:
            found.estimate_later(partial(closed_form_estimate, scene, scene.omega, time))
        found = problem.in_axes_of_scene(found)
        found.__dict__[AGAIN] = again
        return found

    return solve_until


def keep_end(
    problem: Problem, key: Any, method: str, tolerance: float, effort: float, again: Any
) -> None:
    """Let `kept_end` solve with the arguments `key` of `solve`; `again` is that of its results."""
    kept = kept_of(problem.given)
    is_known = tuple(map(type, key)) in _TYPES
    if is_known and method in _WITH_END and not problem.given.states and key not in kept:
        if len(kept) >= _MOST_KEPT:
            kept.clear()

        def first(time: float) -> Trajectory | None:
            end = kept[key] = _end(problem, method, tolerance, effort, again)
            return end(time)

        kept[key] = first


def kept_end(scene: Any, time: Any, key: tuple[Any, ...]) -> Trajectory | None:
    """Return the result at one time, if an earlier call had these arguments of these types."""
    if not isinstance(scene, Scene) or type(time) is not float or not 0.0 < abs(time) < math.inf:
        return None
    # Equal numbers of other types may be refused.
    if tuple(map(type, key)) not in _TYPES:
        return None
    end: End | None = kept_of(scene).get(key)
    return None if end is None else end(time)
