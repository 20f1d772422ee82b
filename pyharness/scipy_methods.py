"""`scipy.integrate.solve_ivp` as methods; SciPy is imported when one is used."""

import math
import warnings
from collections.abc import Callable, Sequence

import numpy as np

from pyharness.effort import Solver, advice, waves
from pyharness.errors import InputError, TimedError
from pyharness.scene import Scene
from pyharness.trajectory import Trajectory

RightHandSide = Callable[[float, Sequence[float]], list[float]]

# SciPy controls the error of a step, a tolerance here is on the error at the times asked for:
# a thirtieth kept every method within it in all seven cases (tests/test_methods.py), which are
# motions of a few radians. Errors of steps add up, so that longer motions get less a step; LSODA,
# which takes the most steps and whose errors are the nearest to what it is allowed, sooner.
_STEP_SHARE = 1.0 / 30.0
RADIANS = {"DOP853": 30.0, "RK45": 30.0, "Radau": 30.0, "LSODA": 8.0}
# solve_ivp takes no smaller one.
_FINEST_STEP = 7e-13 * _STEP_SHARE

# A phase of so many radians has hardly a digit left in binary64. What still grows there is on
# its way to infinity in finite time, and LSODA would never come back from it.
_LARGEST_PHASE = 1e13
# Five to ten seconds of Python; each wave of a torque adds an eighth to what a right-hand side
# costs, and Radau solves linear systems besides.
_MOST_EVALUATIONS = 500_000
_RADAU_SHARE = 2
# LSODA squares the span for its first step: below 1e-150 s that is none at all, and it stands.
_SHORTEST_SPAN = 2.0**-300


def scipy_method(name: str) -> Solver:
    """Return the solver by a method of `solve_ivp`, with the scene's own right-hand side.

    Its finest tolerance is for as many radians as `RADIANS` says; for more it grows with them.
    """

    def solve(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        from scipy.integrate import solve_ivp

        if times[-1] == 0.0:
            return rows_trajectory(times, np.array([scene.omega]), 0, 0, "complete")
        largest = max(map(abs, scene.omega))
        rate = max(map(abs, scene.euler_coefficients))
        radians = rate * largest * abs(times[-1])
        step_tolerance = tolerance * _STEP_SHARE
        if radians > RADIANS[name]:
            share = _STEP_SHARE * RADIANS[name] / radians
            step_tolerance = max(_FINEST_STEP, tolerance * share)
        unit = _unit(times[-1])
        right_hand_side = _in_units(scene.right_hand_side(), unit)
        evaluations = 0
        most = int(effort * _MOST_EVALUATIONS * 8 / (8 + waves(scene)))
        if name == "Radau":
            most //= _RADAU_SHARE

        def counted(time: float, omega: Sequence[float]) -> list[float]:
            nonlocal evaluations
            evaluations += 1
            if evaluations > most:
                raise TimedError(
                    f"{name} gave up at t = {{time}} s after {most} right-hand sides; "
                    + advice(
                        "take a shorter time or a larger tolerance",
                        effort,
                        effort * times[-1] / (time * unit) if time else None,
                    ),
                    time * unit,
                )
            return right_hand_side(time, omega)

        def phase_left(time: float, omega: Sequence[float]) -> float:
            return _LARGEST_PHASE - rate * abs(time * unit) * max(map(abs, omega))

        phase_left.terminal = True  # type: ignore[attr-defined]
        # LSODA warns of what the rows that are missing say already.
        with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
            try:
                result = solve_ivp(
                    counted,
                    (0.0, times[-1] / unit),
                    scene.omega,
                    method=name,
                    t_eval=[time / unit for time in times],
                    events=phase_left,
                    rtol=step_tolerance,
                    atol=step_tolerance * (largest or 1.0),
                )
            except InputError:
                raise
            except (ValueError, ArithmeticError) as error:
                # Radau's linear algebra refuses what has left the range of numbers.
                if "infs or NaNs" in str(error):
                    rows = np.empty((0, 3))
                    return rows_trajectory([], rows, evaluations, len(times), "overflow")
                raise InputError(
                    f"{name} gave up: {error}; take a shorter time, slower motion or smaller "
                    "torques"
                ) from None
        rows = result.y.T if len(result.t) else np.empty((0, 3))
        finite = np.isfinite(rows).all(axis=1)
        count = len(rows) if finite.all() else int(np.argmin(finite))
        ended = "complete" if count == len(times) else "overflow"
        # The result does not carry the steps taken; right-hand sides are what it counts.
        return rows_trajectory(times[:count], rows[:count], int(result.nfev), len(times), ended)

    return solve


def _unit(span: float) -> float:
    """Return the unit of time in which a span is no tiny number, a power of 2; 1 for most."""
    return 1.0 if abs(span) >= _SHORTEST_SPAN else math.ldexp(1.0, math.frexp(span)[1])


def _in_units(right_hand_side: RightHandSide, unit: float) -> RightHandSide:
    """Return the same equations in another unit of time."""
    if unit == 1.0:
        return right_hand_side
    return lambda time, omega: [unit * slope for slope in right_hand_side(unit * time, omega)]


def rows_trajectory(
    times: Sequence[float], omega: np.ndarray, evaluations: int, steps: int, ended: str
) -> Trajectory:
    """Return a trajectory without velocity, recorded at its true times."""
    time = np.array(times, dtype=float)
    return Trajectory(time, time, omega, None, steps, evaluations, ended)
