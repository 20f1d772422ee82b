"""Scenes as methods integrate them, made once, and kept with the scenes."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from pyharness.engine.plan import plan
from pyharness.engine.problem import rows_trajectory
from pyharness.engine.sensitivity import calm_until, closed_form_estimate, judge_ending
from pyharness.engine.solver import Solver
from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY
from pyharness.model.constant_body import integrated, with_constant_body
from pyharness.model.extension import COMPLETE
from pyharness.model.inertia import principal_frame
from pyharness.model.principal import PrincipalScene, in_scene_axes, principal
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Trajectory
from pyharness.model.waves import with_merged_waves

_KEPT = "_problems"  # an attribute of a scene that is no field
_MOST_KEPT = 16  # problems and functions of a scene
_WITH_END = ("auto", "taylor", "closed-form")
# Of method, tolerance, effort and attitude.
_TYPES = set(product((str,), (float, type(None)), (float,), (bool, type(None))))
End = Callable[[float], Trajectory | None]


class Problem:
    """A scene with or without attitude, about axes and with a torque that kernels take."""

    def __init__(self, given: Scene, with_attitude: bool, exactly: bool) -> None:
        start = (given.attitude or IDENTITY) if with_attitude else None
        scene = given if start is given.attitude else replace(given, attitude=start)
        self.given, self.with_attitude = given, with_attitude
        self.axes: Array | None = None
        self.moments: Any = given.changing or given.moments
        if given.inertia is not None:
            frame = principal_frame(given.inertia)
            self.axes, self.moments = frame.axes.copy(), frame.moments
            scene = principal(scene)[0] if exactly else integrated(scene)
        # The reference has equations of its own for an inertia that changes, and must not round
        # amplitudes, as merging does.
        if given.changing is not None and not exactly:
            scene = with_constant_body(scene)
        if not exactly and isinstance(scene.torque, TorqueLaw):
            scene = with_merged_waves(scene)
        self.scene = scene

    def check(self, first: float, last: float) -> None:
        """Raise an InputError if a changing moment of inertia reaches 0 between times (s)."""
        if self.given.changing is not None:
            self.given.changing.check((first, last))

    def in_axes_of_scene(self, found: Trajectory) -> Trajectory:
        """Return a trajectory about the body axes, with the principal axes."""
        if self.axes is None:
            return found
        if isinstance(self.scene, PrincipalScene):
            return in_scene_axes(found, self.axes)
        return found.with_values(axes=self.axes.copy())

    def end(self, method: str, tolerance: float, effort: float) -> End:
        """Return a function that solves until one time; None means that `solve` must judge."""
        scene, omega = self.scene, np.array(self.scene.omega)
        chosen = plan(scene, method, tolerance, rows=True)
        solver: Any = Solver(scene, chosen, tolerance, method, effort, self.with_attitude)
        kind = "closed" if chosen.closed_form else ""
        calm = calm_until(scene, tolerance) if scene.torque.is_zero else 0.0
        known = {"moments": self.moments, "tolerance": tolerance, "scene": self.given}

        def solve_until(time: float) -> Trajectory | None:
            self.check(time, time)
            state = solver(omega, time)
            number, steps, _, _, spent, *_ = solver._ending
            attitude = error = growth = None
            if self.with_attitude:
                state, attitude = state[0], state[1][None]
            is_later = kind and not steps and number == COMPLETE and abs(time) < calm
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
            return self.in_axes_of_scene(found)

        return solve_until


def problem_of(scene: Scene, with_attitude: bool, exactly: bool = False) -> Problem:
    """Return the scene's problem; `exactly` for the method `reference`."""
    if _KEPT not in scene.__dict__:
        object.__setattr__(scene, _KEPT, {})
    kept = scene.__dict__[_KEPT]
    found: Problem | None = kept.get((with_attitude, exactly))
    if found is None:
        found = kept[with_attitude, exactly] = Problem(scene, with_attitude, exactly)
    return found


def keep_end(problem: Problem, key: Any, method: str, tolerance: float, effort: float) -> None:
    """Let `kept_end` solve with the arguments `key` of `solve`."""
    kept = problem.given.__dict__[_KEPT]
    is_known = tuple(map(type, key)) in _TYPES
    if is_known and method in _WITH_END and not problem.given.states and key not in kept:
        if len(kept) >= _MOST_KEPT:
            kept.clear()

        def first(time: float) -> Trajectory | None:
            end = kept[key] = problem.end(method, tolerance, effort)
            return end(time)

        kept[key] = first


def kept_end(scene: Any, time: Any, key: tuple[Any, ...]) -> Trajectory | None:
    """Return the result at one time, if an earlier call had these arguments of these types."""
    kept = getattr(scene, _KEPT, None)
    if kept is None or type(time) is not float or not 0.0 < abs(time) < math.inf:
        return None
    # Equal numbers of other types may be refused.
    if tuple(map(type, key)) not in _TYPES:
        return None
    end: End | None = kept.get(key)
    return None if end is None else end(time)
