"""Gauss collocation with equal steps, which are halved until two solutions agree."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pyharness.engine.problem import normalized, trajectory_of
from pyharness.engine.rescaled import omega_by_torque
from pyharness.engine.sensitivity import is_sensitive, motion_growth, torque_noise
from pyharness.model.effort import Integrator, advice, waves
from pyharness.model.errors import TimedError
from pyharness.model.extension import COMPLETE, SENSITIVE, extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import ROUNDING, Array, Trajectory

# Work limit: right-hand sides of all trial integrations together, some ten seconds. A wave of
# the torque costs half as much as a right-hand side.
_MOST_EVALUATIONS = 200_000_000
_ORDER_THAT_SHOWS = 8  # highest order that the error estimate assumes
# Shorter steps do not reduce a relative difference of two solutions below this limit.
_ROUNDING = 16 * 2.0**-53
# The motion overflows if two solutions reach this omega (rad/s).
_NEAR_THE_END = 1e300


def gauss(stages: int) -> Integrator:
    """Return the solver by Gauss collocation with 1 to 8 `stages`; the order is twice their number.

    The estimated error of the finer of two solutions is 2 d / (r**p - 1), with a safety factor of
    2. Here d is their largest difference of omega, r <= 2 is the ratio of their steps, and p is the
    order, but at most 8. Beyond 8, steps are longer, and the error does not yet fall at the full
    order.
    """

    def solve(
        scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
    ) -> Trajectory:
        kernel = _kernel(scene, stages, times, effort)
        if times[-1] == 0.0:
            return trajectory_of(times, np.array([scene.omega]).T, 1, COMPLETE, 0, 0)
        scale = max(map(abs, scene.omega))
        start = max(scale, kernel.pushed)
        lengths = _lengths(times)
        step, spent, reached = _first_step(kernel.rate, float(lengths.min())), 0, 0.0
        most = kernel.most
        more = 1.0  # estimated steps of the final solution, over those of the next
        pace = 2.0 * stages  # right-hand sides per step
        before: _Solution | None = None
        last = math.inf  # the previous difference of two solutions (rad/s)
        growth: float | None = None
        counts = previous = kernel.counts(step)
        while True:
            # Each step takes at least two iterations.
            steps = float(counts.sum())
            if not step or spent + 2.0 * stages * steps > most:
                needed = spent + steps * (pace * (more - 1.0) + 2.0 * stages * more)
                enough = effort * max(needed, 0.5 * pace * more * steps) / most
                remedies = "use a shorter time, a larger tolerance or more stages"
                raise TimedError(
                    f"gauss-{stages} exceeded its work limit at t = {{time}} s after {spent} "
                    "right-hand sides; " + advice(remedies, effort, enough),
                    reached,
                )
            found = kernel.solution(step)
            spent += found.evaluations
            pace = max(pace, found.evaluations / steps)
            reached = float(found.reached[0])
            if before is not None and before.n_rows == found.n_rows:
                n = found.n_rows
                scale = max(scale, float(np.abs(found.rows[:, :n]).max(initial=0.0)))
                difference = found.difference(before, n)
                # With as many steps as before in an interval, the difference measures no error, and
                # `known` is 0.
                ratio = float((counts / previous).min(initial=2.0))
                known = ratio ** min(2 * stages, _ORDER_THAT_SHOWS) - 1.0
                count = int(counts.sum())
                noise = torque_noise(scene, scene.omega, times[-1], count, scale)
                floor = _ROUNDING * scale * (1.0 + noise)
                if growth is None and difference > 0.5 * last:
                    # Rounding dominates, or the steps are still too long.
                    growth = motion_growth(scene, times[-1])
                if growth is not None and is_sensitive(growth, tolerance, noise):
                    floor *= growth
                allowed = max(tolerance * scale * known / 2.0, floor)
                close = known > 0.0 and difference <= allowed
                last = difference
                if known > 0.0 and allowed > 0.0:
                    excess = difference / (allowed * (known + 1.0))
                    more = max(1.0, excess ** (1.0 / min(2 * stages, _ORDER_THAT_SHOWS)))
                if close and found.status == COMPLETE:
                    # The motion amplifies rounding errors of every method.
                    growth = motion_growth(scene, times[-1])
                    is_blurred = is_sensitive(growth, tolerance, noise)
                    status = SENSITIVE if is_blurred else COMPLETE
                    error = 2.0 * difference / (known * scale) if difference else 0.0
                    if difference > tolerance * scale * known / 2.0:
                        # The difference comes from rounding, which does not fall with the step.
                        error = difference / scale
                    error += ROUNDING * (growth or 1.0) * (1.0 + noise)
                    return trajectory_of(times, found.rows, n, status, count, spent, error, growth)
                if found.blows_up(before, start):
                    return trajectory_of(times, found.rows, n, found.status, count, spent)
            before, previous = found, counts
            step *= 0.5
            counts = kernel.counts(step)

    return solve


@dataclass(frozen=True)
class _Solution:
    rows: Array
    reached: Array
    n_rows: int
    status: int
    evaluations: int

    def difference(self, other: "_Solution", n: int) -> float:
        return float(np.abs(self.rows[:, :n] - other.rows[:, :n]).max(initial=0.0))

    def blows_up(self, coarser: "_Solution", start: float) -> bool:
        """Return whether this solution and a coarser one end because omega grows without bound.

        Both then end before the last time, nearly together. Let m be |omega| at the end. Either m
        exceeds 1e300 rad/s in both; or the finer m exceeds 1.5 times the coarser m, and this
        product exceeds 1000 times `start` (rad/s) and every |omega| at a requested time.
        """
        if COMPLETE in (self.status, coarser.status):
            return False
        # A slowly growing omega is larger in the finer solution only because this ends later.
        if abs(self.reached[0] - coarser.reached[0]) > 0.01 * abs(self.reached[0]):
            return False
        largest, before = (float(np.abs(x.reached[1:]).max()) for x in (self, coarser))
        so_far = float(np.abs(self.rows[:, : self.n_rows]).max(initial=start))
        return largest > 1.5 * before > 1e3 * so_far or min(largest, before) > _NEAR_THE_END


class _Kernel(NamedTuple):
    """Functions of the step size (s) for one scene and its times, and bounds for the steps."""

    solution: "Callable[[float], _Solution]"
    counts: Callable[[float], Array]  # steps in each interval
    rate: float  # largest frequency of motion and torque, rad/s
    pushed: float  # omega by the torque alone, rad/s
    most: float  # work limit, right-hand sides


def _kernel(scene: Scene, stages: int, times: Sequence[float], effort: float) -> _Kernel:
    given = normalized(scene)
    rate = max(map(abs, scene.euler_coefficients)) * max(map(abs, scene.omega))
    for amplitude, frequency in scene.law.sines + scene.law.cosines:
        if any(amplitude):
            rate = max(rate, abs(frequency))
    return _Kernel(
        lambda step: _Solution(
            *extension().gauss_solution(*given, scene.omega, times, stages, step, effort=effort)
        ),
        lambda step: _step_counts(_lengths(times), step),
        rate,
        omega_by_torque(scene, times[-1]),
        effort * _MOST_EVALUATIONS / (1.0 + 0.5 * waves(scene)),
    )


def _step_counts(lengths: Array, step: float) -> Array:
    """Return the number of steps in each interval; one may exceed `step` (s) by 1e-6 of it."""
    with np.errstate(over="ignore", divide="ignore"):
        return np.maximum(1.0, np.floor(np.minimum(lengths / step, 1e18) + (1.0 - 1e-6)))


def _lengths(times: Sequence[float]) -> Array:
    lengths = np.abs(np.diff(np.array(times, dtype=float), prepend=0.0))
    found: Array = lengths[lengths > 0.0]
    return found


def _first_step(rate: float, shortest: float) -> float:
    """Return a first step (s) of at most half a radian of phase: `shortest` over an integer."""
    return max(1e-300, shortest / max(1.0, math.ceil(min(1e18, 2.0 * rate * shortest))))
