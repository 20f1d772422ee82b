"""`scipy.integrate.solve_ivp` as methods; SciPy is imported when one is used.

SciPy controls the error of a step, a tolerance here is on the error at the times asked for. A
coarse run ahead tells what lies between the two: the largest omega, to which both are relative;
how far the motion goes, over which errors of steps add up; and how it multiplies them.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pyharness.methods.linearised import growth, propagators
from pyharness.methods.problem import rows_trajectory
from pyharness.methods.sensitivity import is_sensitive, torque_noise
from pyharness.model.effort import Integrator, advice, waves
from pyharness.model.errors import InputError, TimedError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import ROUNDING, Array, Trajectory
from pyharness.scenes.rescaled import omega_by_torque

RightHandSide = Callable[[float, Sequence[float]], list[float]]

# What errors of steps add up to until the end, in those of one step, at the most: so much in a
# motion of a few radians, and so much more for each radian times the factor by which a difference
# grows. Measured on random scenes other than those that check it, with half as much again.
_SUM = {"DOP853": 30.0, "RK45": 90.0, "Radau": 30.0, "LSODA": 90.0}
_SUM_A_RADIAN = {"DOP853": 0.05, "RK45": 0.15, "Radau": 0.05, "LSODA": 1.2}
# Likewise for each radian that the body turns, where its attitude is wanted: an error of omega
# turns it all the way.
_SUM_A_TURN = {"DOP853": 5.5, "RK45": 2.5, "Radau": 0.5, "LSODA": 55.0}
# Growth beyond which a tolerance is left to be multiplied by it, as it is by every method's.
_SENSITIVE = 1e3
# Rows on the way are read off a polynomial in each step, whose error is not controlled.
_ROWS = 4.0
# Radians of a wave that no step may pass over: a method that meets a fast wave always in the same
# place takes it for a constant torque, however small the differences that it sees.
_WAVE_STEP = 2.0
# solve_ivp takes none below 100 times the rounding of 1; what is claimed with it is for motions
# of a few radians.
_FINEST_STEP = 2.222e-14
_A_FEW = 1.05
FINEST = {name: _A_FEW * _FINEST_STEP * total for name, total in _SUM.items()}

_COARSE = 1e-3
# A scale that is so many times too large is no scale for a coarse run.
_FAR = 4.0
_MOST_GUESSES = 200
_NODES_PER_RADIAN = 4.0
_FEWEST_NODES, _MOST_NODES = 30, 20_000

# A phase of so many radians has hardly a digit left in binary64. What still grows there is on
# its way to infinity in finite time, and LSODA would never come back from it.
_LARGEST_PHASE = 1e13
# Five to ten seconds of Python; each wave of a torque adds an eighth to what a right-hand side
# costs, and Radau solves linear systems besides.
_MOST_EVALUATIONS = 500_000
_RADAU_SHARE = 2
# LSODA squares the span for its first step: below 1e-150 s that is none at all, and it stands.
_SHORTEST_SPAN = 2.0**-300


class _Ahead(NamedTuple):
    """What a scene makes of the errors of steps, as a coarse run sees it."""

    largest: float  # abs(omega) of any component from 0 to the end, rad/s
    # The largest coefficient times omega, summed over the time; and the waves of the torque, as far
    # as they move it.
    radians: float
    growth: float  # the most by which a small difference on the way reaches the end, at least 1
    turned: float = 0.0  # radians that the body turns, where its attitude is wanted


def steps_sum(name: str, radians: float, growth: float, turned: float = 0.0) -> float:
    """Return what errors of steps of a method of SciPy add up to, in those of one step."""
    found = _SUM[name] + _SUM_A_RADIAN[name] * radians * min(growth, _SENSITIVE)
    return found + _SUM_A_TURN[name] * turned * min(growth, _SENSITIVE)


def finest_tolerance(name: str, scene: Scene, time: float) -> float:
    """Return the smallest tolerance that a method of SciPy can meet from 0 to `time` (s)."""
    ahead = _Run(scene, time, name).ahead()
    return _FINEST_STEP * steps_sum(name, *ahead[1:])


def scipy_method(name: str) -> Integrator:
    """Return the solver by a method of `solve_ivp`, with the scene's own right-hand side."""

    def solve(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        if times[-1] == 0.0:
            return _rows_of(times, np.array([state_of(scene)]), 0, 0, "complete")
        run = _Run(scene, times[-1], name, effort)
        try:
            ahead = run.ahead()
            if ahead.largest == 0.0:
                # At rest, and nothing that would move it.
                rest = np.tile(state_of(scene), (len(times), 1))
                return _rows_of(times, rest, run.evaluations, len(times), "complete")
            run.carry_attitude()
            total = steps_sum(name, *ahead[1:])
            finest = _FINEST_STEP * total
            if tolerance < finest * (1.0 - 1e-9):
                raise InputError(
                    f"tolerance is {tolerance:g}; {run.label} can't meet it over "
                    f"{ahead.radians:.3g} radians in which small differences grow "
                    f"{ahead.growth:.3g} times; allowed for this motion: {finest * 1.06:.2g} to 1, "
                    "or a shorter time"
                )
            if len(times) > 1:
                total *= _ROWS
            step = max(_FINEST_STEP, tolerance / total)
            noise = torque_noise(scene, scene.omega, times[-1], scale=ahead.largest)
            is_blurred = noise > 0.0 and is_sensitive(ahead.growth, tolerance, noise)
            if is_blurred:
                # No step errs less than the rounding of the torque, and the search for one is long.
                step = max(step, ROUNDING * noise)
            allowed = step * ahead.largest
            # No step is longer than that of a wave which over the whole time would count.
            waves_that_count = (f for push, f in _pushes(scene) if push * abs(times[-1]) > allowed)
            fastest = max(waves_that_count, default=0.0)
            longest = _WAVE_STEP / fastest if fastest > 0.0 else math.inf
            sizes = [allowed] * 3 + [step] * (len(run.start) - 3)
            result = run.solved(name, step, sizes, times, longest)
            low, high = min(scene.euler_coefficients), max(scene.euler_coefficients)
            if result.status == 1 and low <= 0.0 <= high:
                # It is not on its way to infinity: it turns, and no one can tell how far.
                raise TimedError(
                    f"{run.label} gave up at t = {{time}} s: beyond {_LARGEST_PHASE:.0e} radians "
                    "the phase has hardly a digit left; take a shorter time",
                    float(result.t_events[0][0]) * run.unit,
                )
        except _NoNumberError:
            nothing = np.empty((0, len(run.start)))
            return _rows_of([], nothing, run.evaluations, len(times), "overflow")
        rows = result.y.T if len(result.t) else np.empty((0, len(run.start)))
        finite = np.isfinite(rows).all(axis=1)
        count = len(rows) if finite.all() else int(np.argmin(finite))
        ended = "complete" if count == len(times) else "overflow"
        if ended == "complete" and is_blurred:
            ended = "sensitive"
        # The result does not carry the steps taken; right-hand sides are what is counted, those of
        # the coarse run too.
        return _rows_of(times[:count], rows[:count], run.evaluations, len(times), ended)

    return solve


def state_of(scene: Scene) -> tuple[float, ...]:
    """Return omega at time 0, and the attitude of a scene that has one."""
    return (*scene.omega, *(scene.attitude or ()))


def turning(slopes: RightHandSide) -> RightHandSide:
    """Return the right-hand side of omega, and with it q (0, omega)/2."""

    def both(time: float, state: Sequence[float]) -> list[float]:
        x, y, z, a, b, c, d = state
        return [
            *slopes(time, (x, y, z)),
            -0.5 * (b * x + c * y + d * z),
            0.5 * (a * x + c * z - d * y),
            0.5 * (a * y + d * x - b * z),
            0.5 * (a * z + b * y - c * x),
        ]

    return both


def _rows_of(
    times: Sequence[float], rows: Array, evaluations: int, steps: int, ended: str
) -> Trajectory:
    """Return a trajectory of rows of omega, or of omega and attitude."""
    found = rows_trajectory(times, rows[:, :3], evaluations, steps, ended)
    if rows.shape[1] == 3:
        return found
    attitude = rows[:, 3:]
    return replace(found, attitude=attitude / np.linalg.norm(attitude, axis=1, keepdims=True))


class _NoNumberError(Exception):
    """Linear algebra met what has left the range of numbers."""


class _Run:
    """Calls of `solve_ivp` for one scene and time; all their right-hand sides are counted."""

    def __init__(self, scene: Scene, end: float, name: str, effort: float = 1.0) -> None:
        self.scene, self.end, self.effort = scene, end, effort
        self.label = name.lower()
        self.evaluations = 0
        # A power of 2 in which a span is no tiny number; 1 for most.
        self.unit = 1.0 if abs(end) >= _SHORTEST_SPAN else math.ldexp(1.0, math.frexp(end)[1])
        self.rate = max(map(abs, scene.euler_coefficients))
        self.start: tuple[float, ...] = scene.omega
        self.slopes = scene.right_hand_side()
        self.most = int(effort * _MOST_EVALUATIONS * 8 / (8 + waves(scene)))
        if name == "Radau":
            self.most //= _RADAU_SHARE

    def carry_attitude(self) -> None:
        """Go on with seven unknowns, where the scene has an attitude; a coarse run needs none."""
        if self.scene.attitude is not None:
            self.start = state_of(self.scene)
            self.slopes = turning(self.slopes)

    def solved(
        self,
        name: str,
        relative: float,
        absolute: float | Sequence[float],
        times: Sequence[float] | None = None,
        longest: float = math.inf,
    ) -> Any:
        """Return what `solve_ivp` finds at `times`; with its dense output where none are given."""
        from scipy.integrate import solve_ivp

        def phase_left(time: float, omega: Sequence[float]) -> float:
            return _LARGEST_PHASE - self.rate * abs(time * self.unit) * max(map(abs, omega[:3]))

        phase_left.terminal = True  # type: ignore[attr-defined]
        # LSODA warns of what the rows that are missing say already.
        with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
            try:
                return solve_ivp(
                    self._counted,
                    (0.0, self.end / self.unit),
                    self.start,
                    method=name,
                    t_eval=None if times is None else [time / self.unit for time in times],
                    dense_output=times is None,
                    events=phase_left,
                    rtol=relative,
                    atol=absolute,
                    max_step=longest / self.unit,
                )
            except InputError:
                raise
            except (ValueError, ArithmeticError) as error:
                # Radau's linear algebra refuses what has left the range of numbers.
                if "infs or NaNs" in str(error):
                    raise _NoNumberError from None
                raise InputError(
                    f"{self.label} gave up: {error}; take a shorter time, slower motion or smaller "
                    "torques"
                ) from None

    def _scale_by_torque(self) -> float:
        """Return the largest omega that torque alone can give, 1 where that is no number."""
        bound = omega_by_torque(self.scene, self.end)
        return bound if math.isfinite(bound) else 1.0

    def _counted(self, time: float, omega: Sequence[float]) -> list[float]:
        self.evaluations += 1
        if self.evaluations > self.most:
            raise TimedError(
                f"{self.label} gave up at t = {{time}} s after {self.most} right-hand sides; "
                + advice(
                    "take a shorter time or a larger tolerance",
                    self.effort,
                    self.effort * self.end / (time * self.unit) if time else None,
                ),
                time * self.unit,
            )
        if self.unit == 1.0:
            return self.slopes(time, omega)
        return [self.unit * slope for slope in self.slopes(self.unit * time, omega)]

    @np.errstate(over="ignore", invalid="ignore")
    def ahead(self) -> _Ahead:
        """Look ahead in a coarse run, whose own scale is found on the way.

        Where omega leaves every bound, what start or torque alone would give is the scale, and
        nothing is known of the rest.
        """
        scale = max(map(abs, self.scene.omega)) or self._scale_by_torque()
        if scale == 0.0:
            return _Ahead(0.0, 0.0, 1.0)
        for _ in range(_MOST_GUESSES):
            coarse = self.solved("RK45", _COARSE, _COARSE * scale)
            sizes = np.nan_to_num(np.abs(coarse.y), nan=0.0, posinf=0.0)
            largest = float(sizes.max(initial=0.0))
            if not 0.0 < largest < scale / _FAR:
                break
            scale = largest
        if coarse.status != 0:
            # It leaves every bound, or loses its phase: no tolerance is met to the end.
            return _Ahead(max(scale, self._scale_by_torque()), 0.0, 1.0)
        length = abs(float(coarse.t[-1]) * self.unit)
        count = math.ceil(_NODES_PER_RADIAN * 2.0 * min(1e9, self.rate * largest * length))
        times = np.linspace(0.0, float(coarse.t[-1]), max(_FEWEST_NODES, min(_MOST_NODES, count)))
        omega = np.nan_to_num(coarse.sol(times).T)
        sizes = np.abs(omega).max(axis=1)
        largest = max(largest, float(sizes.max()))
        radians = self.rate * length * float(np.mean(sizes)) + _turned(self.scene, length, largest)
        turned = 0.0
        if self.scene.attitude is not None:
            turned = length * float(np.linalg.norm(omega, axis=1).mean())
        with np.errstate(all="ignore"):
            flow = propagators(self.scene, times * self.unit, omega)
        return _Ahead(largest, radians, growth(np.nan_to_num(flow)), turned)


def _pushes(scene: Scene) -> list[tuple[float, float]]:
    """Return the largest torque over moment (1/s2) of each wave, and how fast it turns (rad/s)."""
    moments = scene.moments or (1.0, 1.0, 1.0)
    return [
        (max(abs(a) / moment for a, moment in zip(amplitude, moments, strict=True)), abs(frequency))
        for amplitude, frequency in scene.torque.sines + scene.torque.cosines
    ]


def _turned(scene: Scene, span: float, largest: float) -> float:
    """Return the radians by which waves turn, each as far as it moves so large an omega."""
    found = 0.0
    for push, frequency in _pushes(scene):
        found += min(frequency * span, push * span / largest if largest > 0.0 else 0.0)
    return found
