"""The function `solve`, which computes the trajectory of a scene by any method.

It integrates both ways from time 0, in a unit of time that avoids overflow and underflow.
"""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from pyharness.engine.continuous import solution_of, with_events, with_events_reversed
from pyharness.engine.events.event_functions import EventFunction, event_functions
from pyharness.engine.events.events import FoundEvents
from pyharness.engine.methods.parameter_sensitivity import checked_names, sensitivities_at
from pyharness.engine.methods.scipy_ivp import finest_tolerance
from pyharness.engine.plan.registry import (
    METHODS,
    SCIPY_METHODS,
    check_torque,
    computes_attitude,
    requested_tolerance,
)
from pyharness.engine.prepared.ends import keep_end, kept_end
from pyharness.engine.problem.problem import Problem, problem_of
from pyharness.engine.problem.rescaled import integrate, is_ordinary, rescaling_factor, scaled
from pyharness.engine.problem.sides import in_reverse, joined
from pyharness.engine.start_time import solve_from_zero
from pyharness.engine.steps.stepped import with_reason
from pyharness.engine.system.switch_text import with_text
from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import InputError, known
from pyharness.model.keywords import with_hints
from pyharness.model.row_errors import AGAIN
from pyharness.model.scene import Scene, any_scene, most_steps
from pyharness.model.state_torque import is_opaque
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import (
    Number,
    Numbers,
    boolean,
    checked_effort,
    number,
    number_list,
    unit_of,
)

_OF_DIFFERENCES = 1e-13  # tolerance of solutions whose differences are derivatives
# Phase (rad) at the end of the first trial integration to a terminal event, by our methods and by
# SciPy's, which are slow; and the ratio of the end times of successive trials.
_PHASES, _LONGER = (200.0, 10.0), 4.0


@with_hints
def solve(
    scene: Scene,
    times: Number | Numbers,
    method: str = "auto",
    tolerance: Number | None = None,
    *,
    effort: float = 1.0,
    attitude: bool | None = None,
    dense_output: bool = False,
    events: object = None,
    sensitivities: Iterable[str] | None = None,
) -> Trajectory:
    """Return the trajectory of a scene at requested times.

    Parameters
    ----------
    scene : Scene
        The body, its torque and its state at time 0.
    times : float or iterable of float, shape (n,)
        Times of the results (s), strictly monotonic, on one or both sides of 0.
    method : str
        A name in `pyharness.engine.plan.registry.METHODS`. `auto` uses a closed form if there is
        one, else the Taylor series; for a torque made by ``opaque``, `dop853`.
    tolerance : float
        Largest allowed error at `times`: for a component of omega, relative to the largest |omega|
        since time 0; for the attitude, an angle (rad). The default depends on the method; for
        `auto` it is 1e-9. Methods with a fixed step take no tolerance.
    effort : float
        Factor on the work limit; 1 means some ten seconds.
    attitude : bool, optional
        Whether to compute the attitude, from the scene's initial attitude, else from (1, 0, 0, 0).
        By default it is computed if the torque needs it, or the scene has one and the method can
        compute it.
    dense_output : bool
        Whether to return `sol`, the solution as a function of time between 0 and `times`, to within
        the tolerance; for methods with a fixed step, a cubic polynomial on each step. Some methods
        need further integrations for it.
    events : callable, Event, or list of these
        Functions of (t, omega) or (t, omega, attitude), or events of `pyharness.events`. Their
        roots between 0 and `times` become `t_events`, and the states there `y_events`. A function
        may have the attributes `terminal` and `direction`, as in SciPy's `solve_ivp`; rows after a
        terminal event are removed. A root at time 0 is no event, nor is one before the function
        first exceeds its error; so a run can continue from a state in `y_events`. Functions that
        accept arrays are called with arrays.
    sensitivities : iterable of str
        Names of the parameters with respect to which omega and the quaternion are differentiated:
        `omega` (at time 0), `attitude` (small initial rotations about the body axes, rad),
        `moments`, `coefficients`, `inertia` (columns I11, I22, I33, I12, I13, I23) or
        `torque.NAME`. NAME is a constant of a scene file's expressions, or a function's keyword
        argument with a number as default; for a TorqueLaw, `constant`, `rate`, `sines` or `cosines`
        (four columns per wave: three amplitudes, frequency). The method must be `auto`, `taylor` or
        `closed-form`.

    Returns
    -------
    Trajectory
        The states, one row per time in the order of `times`; there are no rows after an overflow.

    Raises
    ------
    InputError
        If the method is unknown, or can't solve the scene or its attitude; if the torque needs the
        attitude, and `attitude` is false; if the times are not in order; if a changing moment of
        inertia reaches 0; if the tolerance can't be met within `effort`; or if dense output, events
        or sensitivities can't be computed.
    NotBuiltError
        If the method needs the extension, and it is not built.

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> solve(case_scene(1), [1.0, 2.0]).omega
    array([[3.5, 3.5, 3.5],
           [6. , 6. , 6. ]])
    """
    plain = dense_output is False and events is None and sensitivities is None
    key = method, tolerance, effort, attitude
    if plain and (known_end := kept_end(scene, times, key)) is not None:
        return known_end
    any_scene(scene)
    dense_output = boolean("dense_output", dense_output)
    method = known("method", method, METHODS)
    asked = method
    attitude = computes_attitude(scene, method, attitude)
    if scene.t0:
        functions = None if events is None else event_functions(events, attitude, scene.states)
        values, turned = ascending_times(times)
        again = partial(
            solve, method=method, tolerance=tolerance, effort=effort, attitude=attitude,
            dense_output=dense_output,
        )  # fmt: skip
        ordered = values[::-1] if turned else values
        found = solve_from_zero(scene, ordered, functions, sensitivities, again)
        return _solved_again(found, scene, method, effort)
    if method == "auto" and is_opaque(scene.torque):
        method = "dop853"
    chosen = METHODS[method]
    tolerance = requested_tolerance(method, tolerance)
    if chosen.is_fixed_step and tolerance != 1.0:
        raise InputError(
            f"tolerance is {tolerance:g}; {method} has a fixed step and no tolerance; give none"
        )
    if not chosen.finest <= tolerance <= 1.0:
        raise InputError(
            f"tolerance is {tolerance:g}; allowed for {method}: {chosen.finest:.2g} to 1"
        )
    check_torque(scene, method, attitude)
    if scene.states and any(scene.omega) and not is_ordinary(scene.omega):
        raise InputError(
            f"omega is {scene.omega}; allowed in a scene with states of its own: 0, or a largest "
            "component from 2**-300 to 2**300 rad/s"
        )
    functions = None if events is None else event_functions(events, attitude, scene.states)
    names = None if sensitivities is None else checked_names(scene, sensitivities, asked, attitude)
    values, turned = ascending_times(times)
    problem = problem_of(scene, attitude, exactly=method == "reference")
    problem.check(values[0], values[-1])
    effort = checked_effort(effort)
    call = _Call(problem, method, tolerance, effort, dense_output, functions)
    if functions is None:
        found, _ = call.trajectory(values)
    else:
        found = _to_terminal_events(call, values)
        if turned or (len(values) == 1 and values[0] < 0.0):
            found = with_events_reversed(found)
    found = in_reverse(found) if turned else found
    if names is not None:
        states = partial(_states_of_changed, found.time, effort, found.attitude is not None)
        slopes = sensitivities_at(scene, found, names, effort, states)
        found = found.with_values(sensitivities=slopes)
    found = _solved_again(found, scene, asked, effort)
    if plain and found.ended == "complete":
        keep_end(problem, key, method, tolerance, effort, found.__dict__[AGAIN])
    return found


class _Call(NamedTuple):
    """The checked arguments of `solve`."""

    problem: Problem
    method: str
    tolerance: float
    effort: float
    dense_output: bool
    functions: list[EventFunction] | None

    def trajectory(self, values: list[float]) -> tuple[Trajectory, FoundEvents | None]:
        problem, method, tolerance = self.problem, self.method, self.tolerance
        given, scene = problem.given, problem.scene
        chosen = METHODS[method]
        below = [t for t in values if t < 0.0]
        sides = (below[::-1], values[len(below) :])
        needs_steps = self.dense_output or self.functions is not None
        more = (True,) if chosen.gives_steps and needs_steps else ()
        parts = [
            integrate(chosen, scene, each, tolerance, self.effort, *more) for each in sides if each
        ]
        parts = [
            with_reason(scene, part, each[-1]) if part.ended in ("overflow", "stalled") else part
            for part, each in zip(parts, filter(None, sides), strict=True)
        ]
        if below:
            parts[0] = in_reverse(parts[0])
        found = parts[0] if len(parts) == 1 else joined(*parts)
        sol = problem.output_in_axes_of_scene(found.sol) if needs_steps else None
        found = problem.in_axes_of_scene(found)
        found = found.with_values(
            moments=problem.moments,
            tolerance=None if chosen.is_fixed_step else tolerance,
            scene=given,
            sol=sol if self.dense_output else None,
        )
        if found.ended == "unchecked" and needs_steps:
            raise InputError(
                f"dense output and events of {method} need the series of a recorded torque, which "
                "ends before the last time; allowed: a smooth torque, or opaque(function)"
            )
        if found.reason is not None:
            found = found.with_values(reason=with_text(found.reason, given))
        rows = partial(_more_rows, given, method, self.effort, found.attitude is not None)
        if needs_steps and sol is None:
            sol = solution_of(given, found, rows, method, tolerance)
            found = found.with_values(sol=sol) if self.dense_output else found
        if self.functions is None:
            return found, None
        assert sol is not None
        ends = values[0], values[-1]
        return with_events(given, found, sol, self.functions, ends, rows, method, tolerance)


def _to_terminal_events(call: _Call, values: list[float]) -> Trajectory:
    """Return the trajectory, computed only little beyond a terminal event."""
    spent, low, high = 0, values[0], values[-1]
    for end in _trial_ends(call, max(-low, high)):
        some = [t for t in values if -end < t < end]
        some = [*([-end] if low <= -end else []), *some, *([end] if high >= end else [])]
        found, events = call.trajectory(some)
        assert events is not None
        spent += found.evaluations
        # An event at an end of a trial may differ from one within a longer integration.
        if (low > -end or -end < events.first) and (high < end or events.last < end):
            return replace(found, evaluations=spent)
    found, _ = call.trajectory(values)
    return replace(found, evaluations=spent + found.evaluations)


def _trial_ends(call: _Call, last: float) -> Iterator[float]:
    """Yield the end times (s) of trial integrations, well before `last`."""
    is_terminal = any(g.limit < math.inf for g in call.functions or ())
    if not is_terminal or METHODS[call.method].is_fixed_step:
        return
    scene, has_attitude = call.problem.given, call.problem.with_attitude
    attitude = (scene.attitude or IDENTITY) if has_attitude else ()
    state = np.array([[*scene.omega, *attitude, *(each.start for each in scene.states)]])
    try:
        slopes = np.abs(problem_of(scene, has_attitude).rates(np.zeros(1), state)[0, :3])
    except Exception:  # the integration reports what an opaque torque raises
        return
    fastest = max(*map(abs, scene.omega), math.sqrt(slopes.max()))
    end = _PHASES[call.method in SCIPY_METHODS] / fastest if fastest > 0.0 else math.inf
    while 0.0 < _LONGER * end <= last:
        yield end
        end *= _LONGER


def _solved_again(found: Trajectory, scene: Scene, method: str, effort: float) -> Trajectory:
    again = partial(_more_rows, scene, method, effort, found.attitude is not None)
    return found.with_values(**{AGAIN: again})


def _more_rows(
    scene: Scene, method: str, effort: float, attitude: bool, times: Array, tolerance: float
) -> Trajectory:
    return solve(scene, times, method, tolerance, effort=effort, attitude=attitude)


def _states_of_changed(times: Array, effort: float, attitude: bool, scene: Scene) -> Array:
    found = solve(scene, times, "taylor", _OF_DIFFERENCES, effort=effort, attitude=attitude)
    if len(found.time) < len(times):
        raise InputError(
            f"sensitivities: the motion of a changed scene ends before t = {times[-1]:g} s; "
            "allowed: earlier times"
        )
    return found.y.T


def finest(method: str, scene: Scene, time: float) -> float:
    """Return the smallest tolerance that a method can meet from 0 to `time` (s)."""
    claimed = METHODS[method].finest
    if method not in SCIPY_METHODS or time == 0.0:
        return claimed
    factor = rescaling_factor(scene, time)
    # The tolerance grows with phase and amplification, because local errors are at least 2e-14.
    met = finest_tolerance(SCIPY_METHODS[method], scaled(scene, factor), time / factor)
    return max(claimed, met)


def ascending_times(times: object) -> tuple[list[float], bool]:
    """Return ascending times (s), and whether they were descending."""
    if unit_of(times):
        number("times", times)
    most = most_steps()
    if isinstance(times, np.ndarray) and (times.dtype, times.ndim) == (np.float64, 1):
        is_finite = 0 < len(times) <= most and np.isfinite(times).all()
        if is_finite and (np.diff(times) > 0.0).all():
            return times.tolist(), False
    if not isinstance(times, Iterable) or getattr(times, "shape", None) == ():
        times = (times,)
    if isinstance(times, np.ndarray) and times.dtype.kind in "iuf":
        times = times.tolist()
    entries = number_list("times", times, "allowed: a number, or numbers in order")
    values = [number("times", each) for each in itertools.islice(entries, most + 1)]
    if not values:
        raise InputError("times: none is given; give at least one time")
    if len(values) > most:
        raise InputError(
            f"times: more than {most} times, which this machine's memory can't hold; use fewer"
        )
    if not all(map(math.isfinite, values)):
        raise InputError("times: a number is not finite; allowed: finite numbers")
    turned = values[0] > values[-1]
    if turned:
        values.reverse()
    if not all(t1 < t2 for t1, t2 in itertools.pairwise(values)):
        raise InputError("times: not strictly monotonic; give increasing or decreasing times")
    return values, turned
