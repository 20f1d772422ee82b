"""Methods with equal steps: Gauss collocation, and the methods of section III.2 of Jacobs 1982."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pyharness.engine.methods.sensitivity import is_sensitive, motion_growth, torque_noise
from pyharness.engine.problem.rescaled import omega_by_torque
from pyharness.engine.system.kernel_input import normalized, trajectory_of
from pyharness.model.effort import advice, waves
from pyharness.model.errors import TimedError
from pyharness.model.extension import COMPLETE, GAVE_UP, REFUSED, SENSITIVE, extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import ROUNDING, Array, Trajectory

# Work limit: evaluations of right-hand sides in all trial integrations, some ten seconds. A wave of
# the torque counts as half an evaluation.
_MOST_EVALUATIONS = 200_000_000
_ORDER_THAT_SHOWS = 8  # highest order that the error estimate assumes
# Shorter steps do not reduce a relative difference of two solutions below this limit.
_ROUNDING = 16 * 2.0**-53
# The motion overflows if two solutions reach this omega (rad/s).
_NEAR_THE_END = 1e300


class _Solution(NamedTuple):
    rows: Array
    reached: Array  # time and omega at the end
    n_rows: int
    status: int
    evaluations: int


def gauss(
    stages: int, scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    """Return the trajectory by Gauss collocation with 1 to 8 `stages`.

    Steps are halved until the estimated error meets the tolerance.
    """
    given, most = normalized(scene), effort * _MOST_EVALUATIONS / (1.0 + 0.5 * waves(scene))
    if times[-1] == 0.0:
        return trajectory_of(times, np.array([scene.omega]).T, 1, COMPLETE, 0, 0)
    scale = max(map(abs, scene.omega))
    start = max(scale, omega_by_torque(scene, times[-1]))
    # The largest frequency of motion and torque, rad/s.
    rate = max(map(abs, scene.euler_coefficients)) * scale
    for amplitude, frequency in scene.law.sines + scene.law.cosines:
        if any(amplitude):
            rate = max(rate, abs(frequency))
    lengths = np.abs(np.diff(np.array(times, dtype=float), prepend=0.0))
    lengths = lengths[lengths > 0.0]
    shortest = float(lengths.min())
    # The first step has at most half a radian of phase, and divides the shortest interval evenly.
    step = max(1e-300, shortest / max(1.0, math.ceil(min(1e18, 2.0 * rate * shortest))))
    spent, reached = 0, 0.0
    more = 1.0  # ratio of estimated steps of the final solution to steps of the next
    pace = 2.0 * stages  # right-hand sides per step
    order = min(2 * stages, _ORDER_THAT_SHOWS)
    before: _Solution | None = None
    last = math.inf  # the previous difference of two solutions (rad/s)
    growth: float | None = None
    counts = previous = _step_counts(lengths, step)
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
        found = _Solution(
            *extension().gauss_solution(*given, scene.omega, times, stages, step, effort=effort)
        )
        spent += found.evaluations
        pace = max(pace, found.evaluations / steps)
        reached = float(found.reached[0])
        if before is not None and before.n_rows == found.n_rows:
            n = found.n_rows
            scale = max(scale, float(np.abs(found.rows[:, :n]).max(initial=0.0)))
            difference = float(np.abs(found.rows[:, :n] - before.rows[:, :n]).max(initial=0.0))
            # The estimated error is 2 difference / known, with the safety factor 2. If an interval
            # has as many steps as before, the difference measures no error, and `known` is 0.
            known = float((counts / previous).min(initial=2.0)) ** order - 1.0
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
                more = max(1.0, (difference / (allowed * (known + 1.0))) ** (1.0 / order))
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
            if _blows_up(found, before, start):
                return trajectory_of(times, found.rows, n, found.status, count, spent)
        before, previous = found, counts
        step *= 0.5
        counts = _step_counts(lengths, step)


def _blows_up(finer: _Solution, coarser: _Solution, start: float) -> bool:
    """Return whether both solutions end nearly together because omega grows without bound."""
    if COMPLETE in (finer.status, coarser.status):
        return False
    # A slowly growing omega is larger in the finer solution only because this ends later.
    if abs(finer.reached[0] - coarser.reached[0]) > 0.01 * abs(finer.reached[0]):
        return False
    largest, before = (float(np.abs(x.reached[1:]).max()) for x in (finer, coarser))
    so_far = float(np.abs(finer.rows[:, : finer.n_rows]).max(initial=start))
    return largest > 1.5 * before > 1e3 * so_far or min(largest, before) > _NEAR_THE_END


def _step_counts(lengths: Array, step: float) -> Array:
    with np.errstate(over="ignore", divide="ignore"):
        return np.maximum(1.0, np.floor(np.minimum(lengths / step, 1e18) + (1.0 - 1e-6)))


def fixed_step(
    name: str, code: int, scene: Scene, times: Sequence[float], tolerance: float,
    effort: float = 1.0,
) -> Trajectory:  # fmt: skip
    """Return the trajectory by a method with a fixed step, without error control.

    A step that would pass a requested time ends there.
    """
    work = np.array([effort, 0.0])
    rows, n_rows, status, steps, evaluations = extension().fixed_step_solution(
        scene.euler_coefficients, *normalized(scene)[1:], scene.omega, times, code,
        scene.step_size, effort=work,
    )  # fmt: skip
    if status == REFUSED:
        raise NotImplementedError(f"{name} has no kernel in fortran/modern/fixed_step.fypp")
    if status == GAVE_UP:
        raise TimedError(
            f"{name}: {abs(times[-1]) / scene.step_size:.3g} steps of {{time}} s would "
            "take too long; " + advice("use a larger step or a shorter time", effort, work[1]),
            scene.step_size,
        )
    return trajectory_of(times, rows, n_rows, status, steps, evaluations)
