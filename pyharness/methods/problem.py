"""Conversion of a scene to arguments of the modern kernels, and of their results to a trajectory.

The modern kernels are the Fortran procedures of the methods that are not programs of the thesis.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, columns
from pyharness.model.scene import Scene, TorqueLaw, Triple
from pyharness.model.trajectory import WITH_ALL_ROWS, Array, Trajectory

_NOT_FINITE = (
    "a coefficient A, B, C or a torque divided by its moment is not finite; use moments nearer "
    "to each other, or smaller torques"
)


def normalized(scene: Scene) -> tuple[Array, Array, Array, Array, Array]:
    """Return a scene's coefficients and torques over moments, the arguments of the modern kernels.

    The five arrays are the coefficients A, B, C of Euler's equations, the constant torque over
    moment (1/s2), its rate (1/s3), the sines and the cosines of the torque. Sines and cosines have
    shape (4, n), with columns of amplitude (1/s2) and frequency (rad/s). Raise InputError if a
    value is not finite.
    """
    return _over(scene, scene.body_torque, np.array(scene.moments or (1.0, 1.0, 1.0)))


def normalized_in_space(scene: Scene) -> tuple[Array, ...]:
    """Return a scene's arguments of the kernel for a torque about the axes of space.

    The six arrays are the coefficients A, B, C, the largest moment over each moment, and the four
    arrays of torques as in `normalized`, but divided by the largest moment. The scene must have
    moments. Raise InputError if a value is not finite.
    """
    moments = np.array(scene.moments)
    largest = moments.max()
    coefficients, *torque = _over(scene, scene.torque, np.full(3, largest))
    with np.errstate(over="ignore"):
        ratios = largest / moments
    if not np.isfinite(ratios).all():
        raise InputError(_NOT_FINITE)
    return coefficients, ratios, *torque


def series_kernel(scene: Scene) -> tuple[str, tuple[Array, ...]]:
    """Return the name of the kernel that solves a scene by Taylor series, and its arguments."""
    if scene.torque.in_space:
        return "space_torque_rows", normalized_in_space(scene)
    return "taylor_rows", normalized(scene)


def _over(scene: Scene, law: TorqueLaw, moments: Array) -> tuple[Array, Array, Array, Array, Array]:
    # A wave without amplitude has no effect, but its sine and cosine would take time.
    sines, cosines = (
        columns(tuple(wave for wave in waves if any(wave[0]))) for waves in (law.sines, law.cosines)
    )
    with np.errstate(over="ignore"):
        sines[:3] /= moments[:, None]
        cosines[:3] /= moments[:, None]
        constant, rate = np.array(law.constant) / moments, np.array(law.rate) / moments
    found = np.array(scene.euler_coefficients), constant, rate, sines, cosines
    if not all(np.isfinite(each).all() for each in found):
        raise InputError(_NOT_FINITE)
    return found


def remainders(scene: Scene) -> Triple:
    """Return the exact coefficients A, B, C of a scene minus their values in binary64.

    Without these remainders a phase of 1e6 radians has an error of 1e-10. The remainders are 0 if
    the body is given by coefficients. They are also 0 under torque, because no kernel uses them
    there.
    """
    found, moments = scene.euler_coefficients, scene.exact_moments
    if moments is None or not scene.torque.is_zero or not all(map(math.isfinite, found)):
        return 0.0, 0.0, 0.0
    i1, i2, i3 = moments
    from fractions import Fraction

    a, b, c = map(Fraction, found)
    return float((i2 - i3) / i1 - a), float((i3 - i1) / i2 - b), float((i1 - i2) / i3 - c)


def known(estimate: float) -> float | None:
    """Return a kernel's estimate, or None if it is negative, because this means unknown."""
    return float(estimate) if estimate >= 0.0 else None


def trajectory_of(
    times: Sequence[float],
    rows: Array,
    n_rows: int,
    status: int,
    steps: int,
    evaluations: int,
    error: float | None = None,
    growth: float | None = None,
    attitudes: Array | None = None,
) -> Trajectory:
    """Return a trajectory that is built from the results of a kernel at `times` (s).

    `rows` is omega (rad/s), shape (3, n), with one column for each time. `attitudes` are
    quaternions, shape (4, n). Only the first `n_rows` columns are results. `status` is an integer
    of `Statuses`. `error` and `growth` (error amplification) apply to the last time. They are
    dropped if the kernel did not reach it.
    """
    ended = ENDS[status] if ENDS[status] in WITH_ALL_ROWS else "overflow"
    found = rows_trajectory(times[:n_rows], rows.T[:n_rows], evaluations, steps, ended)
    if attitudes is not None:
        found = replace(found, attitude=attitudes.T[:n_rows])
    return replace(found, error=error, growth=growth) if found.has_all_rows else found


def rows_trajectory(
    times: Sequence[float], omega: Array, evaluations: int, steps: int, ended: str
) -> Trajectory:
    """Return a trajectory from omega (rad/s, shape (n, 3)) at `times` (s), without velocity.

    Its recorded times are the true times. `evaluations` is the number of right-hand sides, and
    `ended` is the text that states how the integration ended.
    """
    time = np.array(times, dtype=float)
    return Trajectory(time, time, omega, None, steps, evaluations, ended)


def closed_form(scene: Scene) -> str | None:
    """Return the name of the closed form that solves a scene, or None if there is none.

    The names are `sphere`, `symmetric` and `elliptic`.
    """
    if scene.torque.in_space:
        return None
    a, b, c = scene.euler_coefficients
    # The closed form of the attitude needs the angular momentum, which is unknown for a body given
    # by coefficients.
    if scene.attitude is not None and (not scene.torque.is_zero or scene.moments is None):
        return None
    if a == b == c == 0.0:
        return "sphere"
    if not scene.torque.is_zero:
        return None
    if 0.0 in (a, b, c):
        # With two coefficients of opposite sign omega oscillates. With two of one sign, or with one
        # alone, it may grow without bound.
        rest = [x for x in (a, b, c) if x != 0.0]
        return "symmetric" if len(rest) == 2 and rest[0] * rest[1] < 0.0 else None
    return None if min(a, b, c) > 0.0 or max(a, b, c) < 0.0 else "elliptic"
