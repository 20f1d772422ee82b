"""Integrations by SciPy's `solve_ivp` under one work limit."""

import contextlib
import math
import threading
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pyharness.engine.problem import rows_trajectory
from pyharness.model.effort import advice
from pyharness.model.errors import InputError, TimedError
from pyharness.model.trajectory import Array, Trajectory

RightHandSide = Callable[[float, Sequence[float]], list[float]]

# solve_ivp accepts no relative tolerance below 100 times the machine epsilon.
FINEST_STEP = 2.222e-14
# A phase of so many radians has hardly a correct digit in binary64. An omega that still grows there
# becomes infinite in finite time, and LSODA would not return.
LARGEST_PHASE = 1e13
# LSODA squares the time span to choose its first step, and does not advance if the square
# underflows, below 1e-150 s.
_SHORTEST_SPAN = 2.0**-300
# LSODA of older versions of SciPy has one state for all threads, and raises an exception if two
# integrations alternate. The lock is reentrant, so that a torque may integrate too.
_ALONE = {"LSODA": threading.RLock()}


class NoNumberError(Exception):
    """The exception for an integration that can't continue, as with a NaN in Radau."""


class Run:
    """The integrations of one problem from 0 to `end` (s) by `solve_ivp`, with one work limit.

    The limit is `most` right-hand sides. The state begins with omega (rad/s). The phase (rad) is
    `rate`, the largest Euler coefficient, times omega and time.
    """

    def __init__(
        self,
        start: Sequence[float],
        slopes: RightHandSide,
        rate: float,
        end: float,
        name: str,
        effort: float,
        most: int,
    ) -> None:
        self.start, self.slopes, self.rate = tuple(start), slopes, rate
        self.end, self.effort, self.most = end, effort, most
        self.label = name.lower()
        self.evaluations = 0
        # Unit of time (s): a power of 2 near the span if that is tiny, else 1.
        self.unit = 1.0 if abs(end) >= _SHORTEST_SPAN else math.ldexp(1.0, math.frexp(end)[1])

    def after_step(self, time: float, state: Sequence[float]) -> None:
        """Do nothing, unless overridden; called at time 0, after each step, and within the last."""

    def solved(
        self,
        name: str,
        relative: float,
        absolute: float | Sequence[float],
        times: Sequence[float] | None = None,
        longest: float = math.inf,
        begin: float = 0.0,
        state: Sequence[float] | None = None,
        with_steps: bool = False,
    ) -> Any:
        """Return SciPy's result by its method `name`.

        It has dense output if `with_steps`, or without `times`. Its times are in units of
        `self.unit` seconds, the arguments in s. Raise NoNumberError if Radau's linear algebra
        refuses a number, or the time is NaN.
        """
        from scipy.integrate import solve_ivp

        def phase_left(time: float, state: Sequence[float]) -> float:
            self.after_step(time * self.unit, state)
            return LARGEST_PHASE - self.rate * abs(time * self.unit) * max(map(abs, state[:3]))

        phase_left.terminal = True  # type: ignore[attr-defined]
        # LSODA's warning only repeats that rows are missing.
        with (
            np.errstate(all="ignore"),
            warnings.catch_warnings(action="ignore"),
            _ALONE.get(name, contextlib.nullcontext()),
        ):
            try:
                return solve_ivp(
                    self._counted,
                    (begin / self.unit, (self.end if times is None else times[-1]) / self.unit),
                    self.start if state is None else state,
                    method=name,
                    t_eval=None if times is None else [time / self.unit for time in times],
                    dense_output=with_steps or times is None,
                    events=phase_left,
                    rtol=relative,
                    atol=absolute,
                    max_step=longest / self.unit,
                )
            except InputError:
                raise
            except (ValueError, ArithmeticError) as error:
                if "infs or NaNs" in str(error):
                    raise NoNumberError from None
                raise InputError(
                    f"{self.label} failed: {error}; use a shorter time, slower motion or "
                    "smaller torques"
                ) from None

    def phase_error(self, time: float) -> TimedError:
        """Return the exception for a phase above the limit at `time`, in units of `self.unit`."""
        return TimedError(
            f"{self.label} stopped at t = {{time}} s: beyond {LARGEST_PHASE:.0e} radians the phase "
            "has hardly a digit left; use a shorter time",
            time * self.unit,
        )

    def work_error(self, time: float) -> TimedError:
        """Return the exception for an exceeded work limit at `time` (s)."""
        return TimedError(
            f"{self.label} exceeded its work limit at t = {{time}} s after {self.most} "
            "right-hand sides; "
            + advice(
                "use a shorter time or a larger tolerance",
                self.effort,
                self.effort * self.end / time if time else None,
            ),
            time,
        )

    def _counted(self, time: float, state: Sequence[float]) -> list[float]:
        self.evaluations += 1
        if math.isnan(time):
            raise NoNumberError  # the first step follows from the rates, which may be NaN after 0
        if self.evaluations > self.most:
            raise self.work_error(time * self.unit)
        if self.unit == 1.0:
            return self.slopes(time, state)
        return [self.unit * slope for slope in self.slopes(self.unit * time, state)]


def rows_of(
    times: Sequence[float], rows: Array, evaluations: int, steps: int, ended: str
) -> Trajectory:
    """Return a trajectory from omega, (n, 3), or with an attitude of any norm, (n, 7)."""
    attitude = None
    if rows.shape[1] > 3:
        attitude = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    return rows_trajectory(times, rows[:, :3], evaluations, steps, ended, attitude=attitude)
