"""The methods of `scipy.integrate.solve_ivp`.

SciPy controls the local error of a step. Our tolerance limits the error at the requested times,
which grows with the phase. A preliminary integration with few digits estimates |omega|, error
amplification and phase, which determine the local tolerance.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pyharness.engine.methods.linearised import growth, propagators
from pyharness.engine.methods.scipy_run import FINEST_STEP, NoNumberError, Run, rows_of
from pyharness.engine.methods.scipy_run import RightHandSide as RightHandSide
from pyharness.engine.methods.scipy_state import finest_of_state, solve_state
from pyharness.engine.methods.sensitivity import is_sensitive, torque_noise
from pyharness.engine.problem.rescaled import omega_by_torque
from pyharness.model.attitude import quaternion_rates
from pyharness.model.effort import Integrator, waves
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import ROUNDING, Trajectory

# Largest ratio of the error at the end to the local error: _SUM in a motion of a few radians;
# _SUM_A_RADIAN, times the error amplification, is added for each further radian. Both were measured
# on random scenes that the checks do not use, and increased by half.
_SUM = {"DOP853": 30.0, "RK45": 90.0, "Radau": 30.0, "LSODA": 90.0}
_SUM_A_RADIAN = {"DOP853": 0.05, "RK45": 0.15, "Radau": 0.05, "LSODA": 1.2}
# Added for each radian by which the body rotates, if the attitude is requested, because an error of
# omega changes the attitude until the end.
_SUM_A_TURN = {"DOP853": 5.5, "RK45": 2.5, "Radau": 0.5, "LSODA": 55.0}
# Largest error amplification for which the local tolerance compensates.
_SENSITIVE = 1e3
# Factor on the error bound for intermediate output, which SciPy interpolates without error control.
_ROWS = 4.0
# Longest step, in radians of a torque wave. A method that samples a fast wave always at the same
# phase treats it as a constant torque, although the error estimates are small.
_WAVE_STEP = 2.0
# Smallest tolerances that the methods claim to meet in motions of a few radians.
_A_FEW = 1.05
FINEST = {name: _A_FEW * FINEST_STEP * total for name, total in _SUM.items()}

_COARSE = 1e-3
# The preliminary integration is repeated if the expected omega exceeds its largest by this factor.
_FAR = 4.0
_MOST_GUESSES = 200
_NODES_PER_RADIAN = 4.0
_FEWEST_NODES, _MOST_NODES = 30, 20_000

# Work limit in evaluations of right-hand sides, five to ten seconds. Each wave of a torque adds an
# eighth to the work. Radau also solves linear systems.
_MOST_EVALUATIONS = 500_000
_RADAU_SHARE = 2


class _Ahead(NamedTuple):
    largest: float  # largest abs(omega) of any component from 0 to the end, rad/s
    # Phase (rad): integral of the largest coefficient times |omega|, plus limited phases of waves.
    radians: float
    growth: float  # error amplification until the end, at least 1
    turned: float = 0.0  # rad by which the body rotates, if its attitude is requested


def steps_sum(name: str, radians: float, growth: float, turned: float = 0.0) -> float:
    """Return a bound on the ratio of the error at the end to the local error of a step."""
    found = _SUM[name] + _SUM_A_RADIAN[name] * radians * min(growth, _SENSITIVE)
    return found + _SUM_A_TURN[name] * turned * min(growth, _SENSITIVE)


def finest_tolerance(name: str, scene: Scene, time: float) -> float:
    if isinstance(scene.torque, StateTorque):
        return max(FINEST[name], finest_of_state(name, scene, time, _most(name, 1.0)))
    ahead = _Run(scene, time, name).ahead()
    return FINEST_STEP * steps_sum(name, *ahead[1:])


def scipy_method(name: str) -> Integrator:
    """Return an integrator by SciPy's method `name` that chooses the local tolerance."""

    def solve(
        scene: Scene,
        times: Sequence[float],
        tolerance: float,
        effort: float = 1.0,
        with_steps: bool = False,
    ) -> Trajectory:
        if isinstance(scene.torque, StateTorque):
            most = _most(name, effort)
            return solve_state(name, scene, times, tolerance, effort, most, with_steps)
        if times[-1] == 0.0:
            return rows_of(times, np.array([state_of(scene)]), 0, 0, "complete")
        run = _Run(scene, times[-1], name, effort)
        try:
            ahead = run.ahead()
            if ahead.largest == 0.0:
                # The body rests, because no torque acts.
                rest = np.tile(state_of(scene), (len(times), 1))
                return rows_of(times, rest, run.evaluations, len(times), "complete")
            if scene.attitude is not None:
                run.start, run.slopes = state_of(scene), with_attitude(run.slopes)
            total = steps_sum(name, *ahead[1:])
            finest = FINEST_STEP * total
            if tolerance < finest * (1.0 - 1e-9):
                raise InputError(
                    f"tolerance is {tolerance:g}; {run.label} can't meet it over "
                    f"{ahead.radians:.3g} radians in which perturbations grow "
                    f"{ahead.growth:.3g} times; allowed for this motion: {finest * 1.06:.2g} to 1, "
                    "or a shorter time"
                )
            if len(times) > 1 or with_steps:
                total *= _ROWS
            step = max(FINEST_STEP, tolerance / total)
            noise = torque_noise(scene, scene.omega, times[-1], scale=ahead.largest)
            is_blurred = noise > 0.0 and is_sensitive(ahead.growth, tolerance, noise)
            if is_blurred:
                # The step-size control would search long for an error below the torque's rounding.
                step = max(step, ROUNDING * noise)
            allowed = step * ahead.largest
            # The fastest wave that can change omega by more than the local tolerance limits the
            # step.
            waves_that_count = (f for push, f in _pushes(scene) if push * abs(times[-1]) > allowed)
            fastest = max(waves_that_count, default=0.0)
            longest = _WAVE_STEP / fastest if fastest > 0.0 else math.inf
            sizes = [allowed] * 3 + [step] * (len(run.start) - 3)
            result = run.solved(name, step, sizes, times, longest, with_steps=with_steps)
            low, high = min(scene.euler_coefficients), max(scene.euler_coefficients)
            if result.status == 1 and low <= 0.0 <= high:
                # Omega is bounded, but its phase has no digit beyond this time.
                raise run.phase_error(float(result.t_events[0][0]))
        except NoNumberError:
            nothing = np.empty((0, len(run.start)))
            return rows_of([], nothing, run.evaluations, len(times), "overflow")
        rows = result.y.T if len(result.t) else np.empty((0, len(run.start)))
        finite = np.isfinite(rows).all(axis=1)
        count = len(rows) if finite.all() else int(np.argmin(finite))
        ended = "complete" if count == len(times) else "overflow"
        grows = ahead.growth > _SENSITIVE
        if ended == "complete" and (is_blurred or grows):
            ended = "sensitive"
        # SciPy does not report the number of steps.
        found = rows_of(times[:count], rows[:count], run.evaluations, len(times), ended)
        if with_steps and ended != "overflow":
            run.solutions.append(result.sol)
            found = found.with_values(sol=run.steps(scene))
        if ended != "sensitive":
            return found
        reason = (
            f"a coarse integration estimates an error amplification of {ahead.growth:.2g}; above "
            f"{_SENSITIVE:g}, {run.label} may miss its tolerance"
        )
        if not grows:
            reason = "parts of the torque cancel, with rounding errors above the tolerance"
        return replace(found, reason=reason)

    return solve


def state_of(scene: Scene) -> tuple[float, ...]:
    return (*scene.omega, *(scene.attitude or ()))


def with_attitude(slopes: RightHandSide) -> RightHandSide:
    def both(time: float, state: Sequence[float]) -> list[float]:
        x, y, z, *q = state
        return [*slopes(time, (x, y, z)), *quaternion_rates((x, y, z), q)]

    return both


def _most(name: str, effort: float) -> float:
    return effort * _MOST_EVALUATIONS / (_RADAU_SHARE if name == "Radau" else 1)


class _Run(Run):
    def __init__(self, scene: Scene, end: float, name: str, effort: float = 1.0) -> None:
        self.scene = scene
        rate = max(map(abs, scene.euler_coefficients))
        most = int(_most(name, effort) * 8 / (8 + waves(scene)))
        super().__init__(scene.omega, scene.right_hand_side(), rate, end, name, effort, most)

    def _scale_by_torque(self) -> float:
        bound = omega_by_torque(self.scene, self.end)
        return bound if math.isfinite(bound) else 1.0

    @np.errstate(over="ignore", invalid="ignore")
    def ahead(self) -> _Ahead:
        # The absolute tolerance is relative to an estimate of the largest |omega|. For a body at
        # rest, the first estimate may be far too large.
        scale = max(map(abs, self.scene.omega)) or self._scale_by_torque()
        if scale == 0.0:
            return _Ahead(0.0, 0.0, 1.0)
        for _ in range(_MOST_GUESSES):
            coarse = self.solved("RK45", _COARSE, _COARSE * scale)
            sizes = np.nan_to_num(np.abs(coarse.y), nan=0.0, posinf=0.0)
            largest = float(sizes.max())
            if not 0.0 < largest < scale / _FAR:
                break
            scale = largest
        if coarse.status != 0:
            # Omega grows without bound, or its phase has no correct digit; no tolerance can be met.
            return _Ahead(max(scale, self._scale_by_torque()), 0.0, 1.0)
        length = abs(float(coarse.t[-1]) * self.unit)
        count = math.ceil(_NODES_PER_RADIAN * 2.0 * min(1e9, self.rate * largest * length))
        times = np.linspace(0.0, float(coarse.t[-1]), max(_FEWEST_NODES, min(_MOST_NODES, count)))
        omega = np.nan_to_num(coarse.sol(times).T)
        sizes = np.abs(omega).max(axis=1)
        largest = max(largest, float(sizes.max()))
        radians, phases = self.rate * length * float(np.mean(sizes)), 0.0
        for push, frequency in _pushes(self.scene):
            # A wave adds its phase, but at most the omega that it can cause, divided by `largest`.
            phases += min(frequency * length, push * length / largest if largest > 0.0 else 0.0)
        turned = 0.0
        if self.scene.attitude is not None:
            turned = length * float(np.linalg.norm(omega, axis=1).mean())
        with np.errstate(all="ignore"):
            flow = propagators(self.scene, times * self.unit, omega)
        return _Ahead(largest, radians + phases, growth(np.nan_to_num(flow)), turned)


def _pushes(scene: Scene) -> list[tuple[float, float]]:
    """Return each wave's largest amplitude over moment (rad/s2), and frequency (rad/s)."""
    moments = scene.moments or (1.0, 1.0, 1.0)
    return [
        (max(abs(a) / moment for a, moment in zip(amplitude, moments, strict=True)), abs(frequency))
        for amplitude, frequency in scene.law.sines + scene.law.cosines
    ]
