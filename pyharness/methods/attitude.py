"""Attitude of a body without torque, in closed form."""

import math

import numpy as np

from pyharness.model.errors import InputError, TimedError
from pyharness.model.extension import COMPLETE, GAVE_UP, REFUSED, extension
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.model.values import Numbers, finite, several


def closed_form_attitude(
    moments: Numbers, omega0: Numbers, attitude0: Numbers, times: Numbers
) -> tuple[Array, Array]:
    """Return angular velocity (rad/s) and attitude at `times`, shapes (n, 3) and (n, 4).

    Parameters
    ----------
    moments : three numbers above 0
        Principal moments (kg m2).
    omega0 : three numbers
        Angular velocity at time 0 (rad/s), in principal axes.
    attitude0 : four numbers, not all zero
        Attitude at time 0: a quaternion, scalar first, that turns body into space. It is
        normalised. The attitude goes on from it without a change of sign.
    times : numbers
        In seconds, in any order, on either side of 0.

    Raises
    ------
    InputError
        For what is none of these, moments more than 1e30 apart, a disturbance of a spin about the
        middle axis too faint to square, and a time at which the phase has no digit left.
    """
    scene = Scene("", omega0, moments=moments)
    allowed = "allowed: four finite numbers, not all zero"
    start = [finite("attitude", each) for each in several("attitude", attitude0, allowed)]
    if len(start) != 4 or not any(start):
        raise InputError(f"attitude is {start}; {allowed}")
    instants = [finite("times", each) for each in several("times", times, "allowed: numbers")]
    rows, attitudes, n_rows, status = extension().torque_free_attitude_solution(
        scene.moments, scene.omega, start, instants
    )
    if status == REFUSED:
        raise InputError(
            "closed-form: moments too far apart, or a disturbance too faint to square; allowed: "
            "moments within a factor of 1e30, disturbances of the spin beyond 1e-120 of it, or 0"
        )
    if status == GAVE_UP:
        raise TimedError(
            "closed-form: at t = {time} s the phase is beyond 1e15 radians and has no digit left; "
            "take a shorter time",
            instants[n_rows],
        )
    if status != COMPLETE:
        raise TimedError(
            "closed-form: at t = {time} s an angular velocity is no number; "
            "take moments nearer to each other",
            instants[n_rows] if n_rows < len(instants) else math.nan,
        )
    return np.ascontiguousarray(rows.T), np.ascontiguousarray(attitudes.T)
