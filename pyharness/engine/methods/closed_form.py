"""Closed forms: spheres under a TorqueLaw, and other bodies without torque (elliptic functions)."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from pyharness.engine.methods.sensitivity import (
    closed_form_estimate,
    growth_of_rounding,
    is_calm,
    is_sensitive,
    torque_noise,
)
from pyharness.engine.problem.problem import problem_of
from pyharness.engine.system.kernel_input import normalized, remainders, trajectory_of
from pyharness.model.effort import advice, waves
from pyharness.model.errors import InputError, TimedError
from pyharness.model.extension import COMPLETE, GAVE_UP, REFUSED, SENSITIVE, extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory

_CALM = 1e3
_MOST_ROWS = 16


def period_of(scene: Scene) -> float:
    """Return the period of omega (s); 0 if aperiodic, or with a torque or a changing inertia."""
    if scene.changing is not None or not scene.torque.is_zero:
        return 0.0
    bare = problem_of(scene, with_attitude=False, exactly=True).turned
    found = extension().torque_free_period(bare.euler_coefficients, remainders(bare), bare.omega)
    return float(found)


def _largest_estimate(
    scene: Scene, times: Sequence[float], noise: float
) -> tuple[float | None, float | None]:
    """Return estimated error and amplification at the end, or maxima over up to 16 times."""
    error, growth = closed_form_estimate(scene, scene.omega, times[-1], noise)
    if error is None or growth is None or growth < _CALM:
        return error, growth
    rows = {*np.linspace(0, len(times) - 1, _MOST_ROWS).astype(int).tolist()}
    both = [closed_form_estimate(scene, scene.omega, times[row], noise) for row in rows]
    errors, growths = zip(*both, strict=True)
    return (None, None) if None in errors else (max(errors), max(growths))


def known_solution(
    scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0
) -> Trajectory:
    """Return the trajectory at `times` (s) in closed form."""
    work = np.array([effort, 0.0])
    attitudes = None
    if scene.attitude is not None:
        if not scene.torque.is_zero or scene.moments is None:
            raise InputError(
                "closed-form: there is no closed form of the attitude with a torque, or of a "
                "body given by coefficients; allowed: moments, and no torque"
            )
        rows, attitudes, n_rows, status = extension().torque_free_attitude_solution(
            scene.moments, scene.omega, scene.attitude, times, moments_low=scene.moments_low
        )
    elif not any(scene.euler_coefficients):
        rows, n_rows, status = extension().sphere_solution(
            *normalized(scene)[1:], scene.omega, times, effort=work
        )
        if status == GAVE_UP:
            raise InputError(
                f"closed-form: {waves(scene)} waves at {len(times)} times would take too long; "
                + advice("use fewer times", effort, work[1])
            )
    elif not scene.torque.is_zero:
        raise InputError(
            "closed-form: the scene has a torque, and its body is not a sphere; allowed: a "
            "sphere, or no torque"
        )
    else:
        rows, n_rows, status = extension().torque_free_solution(
            scene.euler_coefficients, scene.omega, times, coefficients_low=remainders(scene)
        )
    if status == REFUSED:
        raise InputError(
            "closed-form: the motion is not bounded, or the square of a component "
            "underflows; allowed: "
            "coefficients A, B, C not all of one sign, none of them zero between equal signs"
        )
    if status == GAVE_UP:
        raise TimedError(
            "closed-form: at t = {time} s the phase is above 1e15 radians and has no correct "
            "digit; use a shorter time",
            times[n_rows],
        )
    if status != COMPLETE:
        return trajectory_of(times, rows, n_rows, status, len(times), 0, attitudes=attitudes)
    noise = torque_noise(scene, scene.omega, times[-1])
    if is_calm(scene, scene.omega, times[-1], tolerance):
        found = trajectory_of(times, rows, n_rows, COMPLETE, len(times), 0, attitudes=attitudes)
        return found.estimate_later(partial(_largest_estimate, scene, times, noise))
    error, growth = _largest_estimate(scene, times, noise)
    amplified = growth_of_rounding(scene, growth)
    status = SENSITIVE if is_sensitive(amplified, tolerance, noise) else COMPLETE
    return trajectory_of(times, rows, n_rows, status, len(times), 0, error, growth, attitudes)
