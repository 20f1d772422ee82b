"""SciPy's methods for torques that depend on the state, recorded or opaque.

Because the error amplification is unknown, the local tolerance is reduced until two integrations
show that the second meets the tolerance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pyharness.engine.methods.scipy_defects import has_small_defects
from pyharness.engine.methods.scipy_run import FINEST_STEP, TOO_LONG, rows_of, series_beside
from pyharness.engine.methods.scipy_state_run import StateRows, StateRun, with_unit_attitude
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory

# Ratio of the tolerance to the first local tolerance, as usual in motions of a few radians.
_FIRST = {"DOP853": 4.0, "RK45": 8.0, "Radau": 4.0, "LSODA": 25.0}
# Smallest and largest ratio of a local tolerance to the next.
_RATIO, _LARGEST_RATIO = 8.0, 1e3
# The estimated error of the second of two integrations is their difference times _SAFETY, divided
# by the ratio of the local tolerances; but at least _LEAST_FRACTION of the difference. The fraction
# is 1 if errors are not in proportion to local tolerances, as with LSODA, which also changes its
# order, or a torque that jumps.
_SAFETY = 4.0
_LEAST_FRACTION = {"DOP853": 0.25, "RK45": 0.25, "Radau": 0.25, "LSODA": 1.0}
_WITHIN = np.array([0.2, 0.5, 0.8])  # parts of a step at which interpolants are compared
# Largest difference from the series of a recorded torque, in tolerances.
_AGREEMENT = 0.5
# Local tolerances of the two integrations that determine the smallest tolerance.
_TRIAL = (1e-7, 1e-8)


def solve_state(
    name: str,
    scene: Scene,
    times: Sequence[float],
    tolerance: float,
    effort: float,
    most: float,
    with_steps: bool = False,
) -> Trajectory:
    """Return the trajectory under a state-dependent torque by SciPy's method `name`.

    `most` is the work limit in torque-free right-hand sides.
    """
    run = StateRun(scene, times[-1], name, effort, most)
    run.with_steps = with_steps
    nothing = np.empty((0, len(run.start)))
    if run.is_singular():
        run.check_undefined()
        return rows_of([], nothing, 1, len(times), "overflow")
    if times[-1] == 0.0:
        return rows_of(times, np.array([run.start]), 1, 0, "complete")
    beside = series_beside(scene, times, tolerance) if run.is_smooth else None
    is_stiff = beside is TOO_LONG
    beside = None if is_stiff else beside
    run.is_limited, run.with_steps = beside is None, with_steps or is_stiff
    run.compares_steps = with_steps
    found = _refined(run, times, tolerance)
    if beside is not None and not _agree(found, beside.rows, tolerance):
        run.is_limited = True
        found = _refined(run, times, tolerance)
        if not _agree(found, beside.rows, tolerance):
            run.spans = beside.spans
            found = _refined(run, times, tolerance)
    if not found.is_complete:
        run.check_undefined()
    count = len(found.state)
    is_judged = (
        beside is not None
        or not run.is_smooth
        or (is_stiff and has_small_defects(run, scene, found, tolerance))
    )
    ended = "overflow" if not found.is_complete else "complete" if is_judged else "unchecked"
    result = rows_of(times[:count], found.state, run.evaluations, len(times), ended)
    return replace(result, sol=run.steps(scene)) if ended == "complete" and with_steps else result


def finest_of_state(name: str, scene: Scene, time: float, most: float) -> float:
    """Return an estimate of the smallest possible tolerance; 0 if `time` (s) is not reached."""
    run = StateRun(scene, time, name, 1.0, most)
    scale = 0.0 if run.is_singular() else run.expected_omega()
    if scale == 0.0:
        return 0.0
    first, second = (run.rows([time], local, scale) for local in _TRIAL)
    if not (first.is_complete and second.is_complete):
        return 0.0
    return 1.5 * _SAFETY * FINEST_STEP * _difference(first, second) / _TRIAL[0]


def _refined(run: StateRun, times: Sequence[float], tolerance: float) -> StateRows:
    """Return states at `times` (s) with an estimated error that meets `tolerance`."""
    scale = run.expected_omega()
    if scale == 0.0:
        # The body rests, because no torque acts.
        return StateRows(np.tile(run.start, (len(times), 1)), is_complete=True, largest=0.0)
    local = max(tolerance / _FIRST[run.name], _RATIO * FINEST_STEP)
    before, ratio = run.rows(times, local, scale), _RATIO
    while True:
        finer = max(FINEST_STEP, local / ratio)
        after = run.rows(times, finer, scale)
        difference = _difference(before, after, run.compares_steps)
        ratio = local / finer
        least = _LEAST_FRACTION[run.name] if run.is_smooth else 1.0
        error = difference * min(1.0, max(least, _SAFETY / ratio))
        same_end = before.is_complete == after.is_complete
        if error <= tolerance and same_end and len(before.state) == len(after.state):
            return after
        if finer == FINEST_STEP:
            if not (before.is_complete or after.is_complete):
                # Near the time at which omega becomes infinite, no state meets the tolerance.
                n = min(len(before.state), len(after.state))
                while n and _differences(before, after, n).max() > tolerance:
                    n -= 1
                return after._replace(state=after.state[:n])
            allowed = f"{2.0 * error:.2g} to 1" if 0.0 < error < 0.5 else "a larger tolerance"
            raise InputError(
                f"tolerance is {tolerance:g}; {run.label} can't meet it here, because two "
                "integrations with the smallest local tolerances "
                + (f"differ by {difference:.2g}; " if same_end else "end at different times; ")
                + f"allowed for this motion: {allowed}, or a shorter time"
            )
        # Aim at a quarter of the allowed error.
        ratio = min(_LARGEST_RATIO, max(_RATIO, 4.0 * difference / (ratio * tolerance)))
        before, local = after, finer


def _agree(found: StateRows, rows: Array, tolerance: float) -> bool:
    """Return whether SciPy's states are those of the series."""
    largest = max(found.largest, _largest_of(rows))
    both = found._replace(largest=largest), StateRows(rows, is_complete=True, largest=largest)
    return len(found.state) >= len(rows) and _difference(*both) <= _AGREEMENT * tolerance


def _difference(before: StateRows, after: StateRows, with_steps: bool = False) -> float:
    """Return the largest relative difference of omega, or angle (rad) between attitudes."""
    n = min(len(before.state), len(after.state))
    found = float(_differences(before, after, n).max(initial=0.0))
    if not (with_steps and before.solutions and before.is_complete and after.is_complete):
        return found
    # Where a torque has a kink, SciPy's dense outputs are inaccurate within a step.
    for one in after.solutions:
        ends = one.ts[:-1, None]
        times = (ends + np.diff(one.ts)[:, None] * _WITHIN).ravel()
        first, second = (each._replace(state=_state_at(each, times)) for each in (before, after))
        found = max(found, float(_differences(first, second, len(times)).max(initial=0.0)))
    return found


def _state_at(rows: StateRows, times: Array) -> Array:
    """Return the states at n monotonic times by SciPy's dense outputs, shape (n, m)."""
    last = np.array([each.ts[-1] for each in rows.solutions])
    which = np.searchsorted(np.abs(last), np.abs(times)).clip(max=len(last) - 1)
    parts = [rows.solutions[k](times[which == k]).T for k in np.unique(which)]
    return with_unit_attitude(np.concatenate(parts))


def _differences(before: StateRows, after: StateRows, n: int) -> Array:
    first, second = before.state[:n], after.state[:n]
    if before.is_complete and after.is_complete:
        largest = min(before.largest, after.largest)
    else:
        # Omega becomes infinite at the end; only the states before give a finite scale.
        largest = _largest_of(second)
    apart = np.abs(first[:, :3] - second[:, :3]).max(axis=1, initial=0.0)
    found: Array = np.divide(apart, largest, out=np.zeros(n), where=apart > 0.0)
    if first.shape[1] > 3:
        # The angle is twice the distance of two unit quaternions on the sphere.
        turned = 2.0 * np.linalg.norm(first[:, 3:] - second[:, 3:], axis=1)
        found = np.maximum(found, turned)
    return found


def _largest_of(rows: Array) -> float:
    return float(np.abs(rows[:, :3]).max(initial=0.0))
