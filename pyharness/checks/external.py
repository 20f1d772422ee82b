"""Checks of every method against published results.

The limit is the sum of the published number's accuracy, a bound on the method's error, and the
effect of rounding the problem's numbers to binary64.
"""

import math
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from functools import partial
from typing import Any, TypeVar

import numpy as np

from pyharness.checks.check import REFUSED, Check, Name, may_hold, selected
from pyharness.checks.compare.candidates import (
    method_candidate,
    prepared_candidate,
    program_candidate,
)
from pyharness.checks.external_file import UNITS, Problem, Value, problems
from pyharness.engine.plan.registry import METHODS, REGISTRY
from pyharness.engine.solve import finest
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.attitude import angle_between
from pyharness.model.basis import Basis
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import Array
from pyharness.thesis.programs import PROGRAM_REGISTRY

__all__ = ["external_checks", "problems"]

# These methods' finest tolerances would take too long.
_TOLERANCES = {"radau": 1e-8, "rk45": 1e-11, "quick": 1e-9}
_SOLVED = (
    "reference",
    *(
        name
        for name, each in REGISTRY.items()
        if name != "reference" and not (each.is_fixed_step or each.weak_torque)
    ),
)
_FEWEST_STEPS, _MOST_STEPS = 4, 2**16
_HALF_ULP = 2.0**-53
# Two roundings: when a number is read, and when a method uses it.
_ROUNDING = 2.0 * _HALF_ULP
_STEP_ASIDE = 2.0**-30  # relative change of a number, to measure its effect
# These methods must solve users' problems too.
_MAY_NOT_REFUSE = ("auto", "closed-form")

_PUBLISHED = Basis(
    "derived",
    "difference from a published result: its accuracy, the method's error, and rounded data",
    "first-order effects of rounding each number; for programs, twice the error that the last "
    "halving of the step shows (`checks/external.py`)",
)

_Row = TypeVar("_Row")
# Omega at one time, and a bound on the error of each component (rad/s).
_Result = tuple[Array, float]


def perturbed(scene: Scene, part: float) -> Iterator[Scene]:
    """Yield copies of the scene, each with one nonzero number multiplied by 1 + `part`."""
    change: Any = replace
    for name in ("moments", "coefficients", "omega"):
        for triple in _triples(getattr(scene, name), part):
            yield change(scene, **{name: triple})
    law = scene.law
    for name in ("constant", "rate"):
        for triple in _triples(getattr(law, name), part):
            yield change(scene, torque=change(law, **{name: triple}))
    for name in ("sines", "cosines"):
        waves = getattr(law, name)
        for place, (amplitude, frequency) in enumerate(waves):
            faster = (amplitude, frequency * (1.0 + part))
            for wave in (*((triple, frequency) for triple in _triples(amplitude, part)), faster):
                changed = (*waves[:place], wave, *waves[place + 1 :])
                yield change(scene, torque=change(law, **{name: changed}))


def _triples(triple: Triple | None, part: float) -> Iterator[Triple]:
    for axis, x in enumerate(triple or ()):
        if x:
            yield (np.array(triple) * (1.0 + part * (np.arange(3) == axis))).tolist()


def external_checks(problems: Sequence[Problem], only: Sequence[str] = ()) -> Iterator[Check]:
    """Yield checks of methods and programs, with ids ``external/<problem>/<time>/<method>``."""
    for problem in problems:
        # Values are always solved together, so that a repeated check gives the same bits.
        for side in (1.0, -1.0):
            values = [value for value in problem.values if float(value.time) * side > 0.0]
            values.sort(key=lambda value: abs(float(value.time)))
            if any(may_hold(f"external/{problem.name}/{value.time}", only) for value in values):
                bare = replace(problem, scene=replace(problem.scene, attitude=None))
                yield from _side(bare, [each for each in values if any(each.omega)], only)
                yield from _pointings(problem, [each for each in values if each.pointing], only)


def _names(
    problem: Problem, values: Sequence[Value], method: str, only: Sequence[str], quantity: str = ""
) -> list[tuple[int, Name]]:
    given = "" if problem.path is None else f" --external {shlex.quote(problem.path)}"
    own = partial(Name, "external", method, quantity=quantity, command=f"verify{given}")
    names = enumerate(own(f"{problem.name}/{value.time}") for value in values)
    asked = [(row, name) for row, name in names if selected(name.id, only)]
    accepted, scene = True, problem.scene
    if asked and method == "closed-form":
        accepted = closed_form(scene) is not None
    elif asked and method == "quick":
        end = prepared_candidate(method, _TOLERANCES[method]).end(scene, float(values[0].time))
        accepted = end.ended != "refused"
    elif asked and method in PROGRAMS:
        accepted = float(values[0].time) > 0.0
    return asked if accepted else []


def _without(problem: Problem, name: Name, refusal: str, value: Value) -> Check:
    """Return the check of a missing result, which passes only if a user's problem was refused."""
    given = problem.path is not None and name.subject not in _MAY_NOT_REFUSE
    if refusal:
        return name.judged(given, f"{REFUSED}{refusal}")
    return name.judged(False, f"ended before t = {float(value.time):g} s")


def _pointings(problem: Problem, values: Sequence[Value], only: Sequence[str]) -> Iterator[Check]:
    """Yield checks of published attitudes; value and limit are angles (rad)."""
    scene, times = problem.scene, [float(value.time) for value in values]
    for method in (name for name in _SOLVED if REGISTRY[name].attitude and values):
        asked = _names(problem, values, method, only, "attitude")
        if not asked:
            continue
        found, refusal, tolerance = np.empty((0, 4)), "", 0.0
        try:
            tolerance = max(_TOLERANCES.get(method, 0.0), finest(method, scene, times[-1]))
            attitude = method_candidate(method, tolerance).rows(scene, times).attitude
            found = found if attitude is None else attitude
        except InputError as reason:
            refusal = str(reason)
        rounding = _turns(scene, times) if len(found) else np.zeros(0)
        for row, name in asked:
            pointing = values[row].pointing
            if row < len(found) and pointing is not None:
                wanted = np.array([pointing.attitude])
                error = float(angle_between(found[row : row + 1], wanted)[0])
                limit = pointing.accuracy + tolerance + float(rounding[row])
                yield name.bounded(error, limit, _PUBLISHED, "angle, rad")
            else:
                yield _without(problem, name, refusal, values[row])


def _turns(scene: Scene, times: Sequence[float]) -> Array:
    """Return the change of the attitude (rad) at each time from rounding the scene's numbers."""
    # Start with the rounding of quaternions, and add the absolute effects of the numbers.
    turned = np.full(len(times), 8.0 * _HALF_ULP)
    run = method_candidate("auto", METHODS["auto"].finest).rows
    try:
        here = run(scene, times)
        others = [run(other, times).attitude for other in perturbed(scene, _STEP_ASIDE)]
    except InputError:
        return turned
    for there in others:
        if here.attitude is not None and there is not None and len(there) == len(times):
            turned += angle_between(there, here.attitude) * (_ROUNDING / _STEP_ASIDE)
    for row, time in enumerate(times[: len(here.omega)]):
        turned[row] += float(np.linalg.norm(here.omega[row])) * abs(time) * _ROUNDING
    return turned


def _side(problem: Problem, values: Sequence[Value], only: Sequence[str]) -> Iterator[Check]:
    rounding = _rounding(problem.scene, values)
    for method in (*_SOLVED, *PROGRAMS):
        asked = _names(problem, values, method, only)
        if not asked:
            continue
        results, refusal = _as_far_as_solved(partial(_results, problem, method), values)
        for row, name in asked:
            value = values[row]
            if row >= len(results):
                yield _without(problem, name, refusal, value)
            elif (result := results[row]) is not None:
                yield _check(name, problem.unit, value, result, rounding[value.time])
            else:
                # In the package's problems LEQT1F can solve the equations of the longest steps.
                note = "no step long enough for the linear equations"
                yield name.judged(problem.path is not None, note)


def _as_far_as_solved(
    solve: Callable[[Sequence[Value]], list[_Row]], values: Sequence[Value]
) -> tuple[list[_Row], str]:
    """Return the results of the leading values that `solve` accepts, and its refusal or ""."""
    try:
        return solve(values), ""
    except InputError as refusal:
        if len(values) == 1:
            return [], str(refusal)
    rows: list[_Row] = []
    for value in values:
        try:
            found = solve([value])
        except InputError as refusal:
            return rows, str(refusal)
        if not found:
            break
        rows += found
    return rows, ""


def _results(problem: Problem, method: str, values: Sequence[Value]) -> list[_Result | None]:
    """Return omega and its error bound (rad/s) for each value, or None without a result."""
    if method in PROGRAMS:
        return [_program(problem, value, method) for value in values]
    scene, times = problem.scene, [float(value.time) for value in values]
    tolerance = _TOLERANCES.get(method, 0.0)
    if method == "quick":
        ends = [prepared_candidate(method, tolerance).end(scene, time) for time in times]
        if refused := next((end.ended for end in ends if end.is_refused), ""):
            raise InputError(f"{method} {refused}")
        rows = np.array([end.omega for end in ends])
    else:
        tolerance = max(tolerance, finest(method, scene, times[-1]))
        rows = method_candidate(method, tolerance).rows(scene, times).omega
    return [(omega, tolerance * _scale(scene, omega)) for omega in rows]


def _program(problem: Problem, value: Value, program: str) -> _Result | None:
    """Return a corrected program's omega and its estimated error (rad/s) at the time of `value`.

    Return None if no two successive runs were complete.
    """
    scene, time = problem.scene, float(value.time)
    finest_print = min(figure.accuracy for figure in value.omega if figure is not None)
    accuracy = finest_print * UNITS[problem.unit]
    run = program_candidate(Listing.corrected(program), may_stop=False, velocity=False).rows
    order = PROGRAM_REGISTRY[program].order
    result, before, steps, ended, previous = None, None, _FEWEST_STEPS, "", 0.0
    while steps <= _MOST_STEPS:
        rows = run(replace(scene, step_size=time / steps, steps=steps))
        if rows.ier is not None and rows.ier.any():
            # LEQT1F finds the matrices of small steps singular; the program then has order 1.
            break
        ended = rows.ended
        omega = rows.omega[-1] if ended == "complete" else None
        if omega is not None and before is not None:
            halving = 2.0 * float(np.abs(omega - before).max()) / (2.0**order - 1.0)
            rounding = steps * _HALF_ULP * _scale(scene, omega)
            result = omega, halving + rounding
            # Two coarse runs may agree by chance, so the estimate must also decrease.
            if halving <= max(0.1 * accuracy, rounding) and 2.0 * halving <= previous:
                break
            previous = halving
        before, steps = omega, 2 * steps
    if ended not in ("", "complete"):
        raise InputError(f"{program} in steps of {time / _MOST_STEPS:g} s: {ended}")
    return result


def _check(name: Name, unit: str, value: Value, result: _Result, rounding: Array) -> Check:
    factor, (omega, error), judged = UNITS[unit], result, []
    for axis, figure in enumerate(value.omega):
        if figure is not None:
            # The published number may have more digits than binary64.
            distance = abs(float(Decimal(float(omega[axis]) / factor) - figure.value))
            limit = figure.accuracy + float(error + rounding[axis]) / factor
            judged.append((distance, limit, f"w{axis + 1}, {unit}"))
    # NaN counts as the largest distance.
    distance, limit, note = max(judged, key=lambda each: (math.isnan(each[0]), each[0] / each[1]))
    return name.bounded(distance, limit, _PUBLISHED, note)


def _scale(scene: Scene, omega: Array) -> float:
    return max(*map(abs, scene.omega), float(np.abs(omega).max()))


def _rounding(scene: Scene, values: Sequence[Value]) -> dict[str, Array]:
    """Return, by printed time, the change of omega (rad/s) from rounding the scene's numbers."""

    def solve(values: Sequence[Value]) -> list[Array]:
        times = [float(value.time) for value in values]
        try:
            return [*_moves(scene, times, "taylor")]
        except InputError:
            # A closed form reaches later times than a series.
            return [*_moves(scene, times, "auto")]

    rows, _ = _as_far_as_solved(solve, values)
    rows += [np.zeros(3)] * (len(values) - len(rows))
    return {value.time: row for value, row in zip(values, rows, strict=True)}


def _moves(scene: Scene, times: Sequence[float], method: str) -> Array:
    moved = np.zeros((len(times), 3))
    run = method_candidate(method, METHODS[method].finest).rows
    here = run(scene, times).omega
    for other in perturbed(scene, _STEP_ASIDE):
        there = run(other, times).omega
        rows = min(len(here), len(there))
        moved[:rows] += np.abs(there[:rows] - here[:rows]) * (_ROUNDING / _STEP_ASIDE)
    slope = scene.right_hand_side()
    for row, (time, omega) in enumerate(zip(times, here, strict=False)):
        moved[row] += np.abs(slope(time, omega.tolist())) * abs(time) * _ROUNDING
    return moved
