"""Integrations by SciPy's `solve_ivp` under one work limit, and their check by Taylor series.

SciPy may step over a short change of a recorded torque. If its results differ from the series, the
series limits its steps.
"""

import contextlib
import itertools
import math
import threading
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pyharness.engine.steps.step_nodes import MOST_STEPS, STEP_NODES, steps_output
from pyharness.engine.steps.stepped import steps_to
from pyharness.engine.system.kernel_input import rows_trajectory
from pyharness.engine.system.recorded import outputs_at
from pyharness.model.dense_output import DenseOutput, Pieces
from pyharness.model.effort import advice
from pyharness.model.errors import InputError, TimedError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import N_INPUTS, SWITCHES, Linear
from pyharness.model.trajectory import Array, Trajectory

RightHandSide = Callable[[float, Sequence[float]], list[float]]

# solve_ivp accepts no relative tolerance below 100 times the machine epsilon.
FINEST_STEP = 2.222e-14
# Radians; a larger phase has hardly a correct digit in binary64. An omega that still grows there
# becomes infinite in finite time, and LSODA would not return.
LARGEST_PHASE = 1e13
# LSODA squares the time span (s) to choose its first step, and does not advance if the square
# underflows, below 1e-150 s.
_SHORTEST_SPAN = 2.0**-300
# LSODA in older versions of SciPy has one state for all threads, and fails if two integrations
# alternate. The lock is reentrant, so that a torque may integrate too.
_ALONE = {"LSODA": threading.RLock()}
# Ratio of SciPy's longest step to the steps of the series; LSODA evaluates the torque only once in
# a step.
_PART = 0.5
# Stiff equations need more steps of the series; they are not checked.
_MOST_STEPS = 20_000
# After each so many steps, the series ends if as many as the last would be too many.
_FORECAST = 500
# Largest ratio of two steps of the series in a span.
_RATIO = 8.0
# Tolerance of a step of the series, relative to the tolerance of the result.
_FINER = 0.01
_FINEST = 1e-13  # tolerance of the steps that end at switches


class NoNumberError(Exception):
    """An integration can't continue, for example after a NaN in Radau."""


class Run:
    """The integrations of one problem from 0 to `end` (s) by `solve_ivp`.

    Together they may evaluate `most` right-hand sides.
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
        # `rate`, the largest Euler coefficient, times omega and time is the phase (rad).
        self.start, self.slopes, self.rate = tuple(start), slopes, rate
        self.end, self.effort, self.most = end, effort, most
        self.label = name.lower()
        self.evaluations = 0
        self.solutions: list[Any] = []  # SciPy's dense outputs of the last integration
        self.has_steps = True  # whether SciPy can return them
        # Unit of time (s): a power of 2 near the span if that is tiny, else 1.
        self.unit = 1.0 if abs(end) >= _SHORTEST_SPAN else math.ldexp(1.0, math.frexp(end)[1])

    def after_step(self, time: float, state: Sequence[float]) -> None:
        """Do nothing; subclasses may act at time 0, after each step, and within the last step."""

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
        """Return SciPy's result by method `name`, with times in units of `self.unit` s."""
        from scipy.integrate import solve_ivp

        def phase_left(time: float, state: Sequence[float]) -> float:
            self.after_step(time * self.unit, state)
            return LARGEST_PHASE - self.rate * abs(time * self.unit) * max(map(abs, state[:3]))

        phase_left.terminal = True  # type: ignore[attr-defined]
        # LSODA's warning only repeats that results are missing.
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
                if with_steps and "strictly" in str(error):
                    # SciPy has no dense output if two steps end at one time.
                    self.has_steps = False
                    return self.solved(name, relative, absolute, times, longest, begin, state)
                raise InputError(
                    f"{self.label} failed: {error}; use a shorter time, slower motion or "
                    "smaller torques"
                ) from None

    def steps(self, scene: Scene) -> DenseOutput | None:
        """Return the last integration's steps as dense output; None for none or over 20 000."""
        edges, values = [0.0], []
        for sol in filter(None, self.solutions):
            for (first, last), step in zip(
                itertools.pairwise(sol.ts.tolist()), sol.interpolants, strict=True
            ):
                values.append(step(first + (last - first) * STEP_NODES).T)
                edges.append(last * self.unit)
        if not (self.has_steps and 0 < len(values) <= MOST_STEPS):
            return None
        order = 1 if self.end > 0.0 else -1
        nodes = np.array(values)[::order, ::order]
        return steps_output(scene, Pieces(np.array(edges)[::order], nodes))

    def phase_error(self, time: float) -> TimedError:
        """Return the exception for a phase above the limit at `time` (in `self.unit`)."""
        return TimedError(
            f"{self.label} stopped at t = {{time}} s: beyond {LARGEST_PHASE:.0e} radians the phase "
            "has hardly a correct digit; use a shorter time",
            time * self.unit,
        )

    def work_error(self, time: float) -> TimedError:
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
            raise NoNumberError  # SciPy's first step depends on rates, which may be NaN
        if self.evaluations > self.most:
            raise self.work_error(time * self.unit)
        if self.unit == 1.0:
            return self.slopes(time, state)
        return [self.unit * slope for slope in self.slopes(self.unit * time, state)]


def rows_of(
    times: Sequence[float], rows: Array, evaluations: int, steps: int, ended: str
) -> Trajectory:
    """Return a trajectory from n states, (n, 3) or (n, 7); quaternions are normalised."""
    attitude = None
    if rows.shape[1] > 3:
        attitude = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    return rows_trajectory(times, rows[:, :3], evaluations, steps, ended, attitude=attitude)


class Span(NamedTuple):
    """A part of an integration: its end (s), and SciPy's longest step in it (s)."""

    end: float
    longest: float


class Beside(NamedTuple):
    """States by Taylor series, and the resulting limits of SciPy's steps."""

    rows: Array  # shape (n, 3) or (n, 7)
    spans: list[Span]


# Stands for a series that needs too many steps, as for a stiff torque.
TOO_LONG = Beside(np.empty((0, 3)), [])


def bounds_of(scene: Scene, end: float) -> list[float]:
    """Return `end` and earlier times (s) at which a table or switch of the torque changes."""
    torque = scene.torque
    assert isinstance(torque, StateTorque)
    breaks = [] if torque.tape is None else torque.tape.breaks
    if torque.tape is not None and torque.tape.n_switches:
        # The ends of the series' steps at which the result of a switch changes.
        operations = enumerate(torque.tape.operations, N_INPUTS)
        slots = [slot for slot, each in operations if each.kind in SWITCHES]
        results = replace(torque.tape, outputs=tuple(Linear(0.0, ((x, 1.0),)) for x in slots))
        ends, middles, states = [], [], []
        attitude = scene.attitude is not None
        for before, stepper in steps_to(scene, attitude, end, _FINEST, _MOST_STEPS):
            ends.append(stepper.time)
            middles.append(0.5 * before + 0.5 * stepper.time)
            states.append(stepper.at(middles[-1]))
        if ends:
            found = outputs_at(results, np.array(middles), np.array(states))
            changed = (found[1:] != found[:-1]).any(axis=1)
            breaks = breaks + [time for time, x in zip(ends, changed.tolist(), strict=False) if x]
    return sorted({*(time for time in breaks if 0.0 < time / (end or 1.0) < 1.0), end}, key=abs)


def series_beside(scene: Scene, times: Sequence[float], tolerance: float) -> Beside | None:
    """Return states by Taylor series at `times` (s), and spans; or None, or `TOO_LONG`.

    None means that the series ends early.
    """
    end, bounds = times[-1], bounds_of(scene, times[-1])
    attitude = scene.attitude is not None
    rows = [[*scene.omega, *(scene.attitude or ())]] if times[0] == 0.0 else []
    lengths: dict[float, float] = {}
    reached = earlier = 0.0
    for before, stepper in steps_to(scene, attitude, end, _FINER * tolerance, _MOST_STEPS):
        reached = stepper.time
        lengths[reached] = abs(reached - before)
        after = len(rows)
        while after < len(times) and abs(times[after]) <= abs(reached):
            after += 1
        rows += stepper.at(times[len(rows) : after]).T.tolist()
        if stepper.steps % _FORECAST == 0:
            left = (_MOST_STEPS - stepper.steps) / _FORECAST
            if abs(reached - earlier) * left < abs(end - reached):
                return TOO_LONG
            earlier = reached
    if reached != end:
        return TOO_LONG if len(lengths) == _MOST_STEPS else None
    return Beside(np.array(rows), _spans(lengths, bounds))


def _spans(lengths: dict[float, float], bounds: Sequence[float]) -> list[Span]:
    spans: list[Span] = []
    least, most, last = math.inf, 0.0, 0.0
    for time, length in lengths.items():
        if time in bounds:
            # The length of a step that ends at a bound is no measure of the torque.
            spans.append(Span(time, _PART * (length if least == math.inf else least)))
            least, most, last = math.inf, 0.0, 0.0
            continue
        if max(most, length) > _RATIO * min(least, length) and last:
            spans.append(Span(last, _PART * least))
            least, most = math.inf, 0.0
        least, most, last = min(least, length), max(most, length), time
    return spans
