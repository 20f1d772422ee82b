"""A scene as the modern kernels take it, and a trajectory of what they give."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, columns
from pyharness.model.scene import Scene, TorqueLaw, Triple
from pyharness.model.trajectory import WITH_ALL_ROWS, Array, Trajectory

_NOT_FINITE = (
    "A, B, C or torque over moment is not finite; take moments nearer to each other, or smaller "
    "torques"
)


def normalized(scene: Scene) -> tuple[Array, Array, Array, Array, Array]:
    """Return what the modern kernels take: everything divided by the moments.

    A, B, C; torque over moment (1/s2) and its rate (1/s3); sines and cosines, each of shape (4, n):
    columns of amplitude (1/s2) and frequency (rad/s). InputError where one is no number.
    """
    return _over(scene, scene.body_torque, np.array(scene.moments or (1.0, 1.0, 1.0)))


def normalized_in_space(scene: Scene) -> tuple[Array, ...]:
    """Return what the kernel of a torque about the axes of space takes; of a scene with moments.

    A, B, C; the largest moment over each; torque over the largest moment, as in `normalized`.
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
    """Return the name of the kernel that solves a scene by series, and what it takes of it."""
    if scene.torque.in_space:
        return "space_torque_rows", normalized_in_space(scene)
    return "taylor_rows", normalized(scene)


def _over(scene: Scene, law: TorqueLaw, moments: Array) -> tuple[Array, Array, Array, Array, Array]:
    # A wave without amplitude has no effect, and would cost its sine and cosine.
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
    """Return what rounding takes off A, B, C: without it a phase of 1e6 radians has lost 1e-10.

    Zeros where coefficients are given as such, and under torque, where no kernel asks.
    """
    found, moments = scene.euler_coefficients, scene.exact_moments
    if moments is None or not scene.torque.is_zero or not all(map(math.isfinite, found)):
        return 0.0, 0.0, 0.0
    i1, i2, i3 = moments
    from fractions import Fraction

    a, b, c = map(Fraction, found)
    return float((i2 - i3) / i1 - a), float((i3 - i1) / i2 - b), float((i1 - i2) / i3 - c)


def known(estimate: float) -> float | None:
    """Return what a kernel estimated; None where it is below 0, which it is where unknown."""
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
    """Return the rows of a kernel, which come in columns, as a trajectory.

    Error and growth are those at the last of the times, and unknown where that was not reached.
    """
    ended = ENDS[status] if ENDS[status] in WITH_ALL_ROWS else "overflow"
    found = rows_trajectory(times[:n_rows], rows.T[:n_rows], evaluations, steps, ended)
    if attitudes is not None:
        found = replace(found, attitude=attitudes.T[:n_rows])
    return replace(found, error=error, growth=growth) if found.has_all_rows else found


def rows_trajectory(
    times: Sequence[float], omega: Array, evaluations: int, steps: int, ended: str
) -> Trajectory:
    """Return a trajectory without velocity, recorded at its true times."""
    time = np.array(times, dtype=float)
    return Trajectory(time, time, omega, None, steps, evaluations, ended)


def closed_form(scene: Scene) -> str | None:
    """Name the closed form that solves a scene, None where there is none."""
    if scene.torque.in_space:
        return None
    a, b, c = scene.euler_coefficients
    # A body that is given by coefficients has no angular momentum to turn about.
    if scene.attitude is not None and (not scene.torque.is_zero or scene.moments is None):
        return None
    if a == b == c == 0.0:
        return "sphere"
    if not scene.torque.is_zero:
        return None
    if 0.0 in (a, b, c):
        # Two coefficients of opposite sign turn; of one sign, or one alone, they run away.
        rest = [x for x in (a, b, c) if x != 0.0]
        return "symmetric" if len(rest) == 2 and rest[0] * rest[1] < 0.0 else None
    return None if min(a, b, c) > 0.0 or max(a, b, c) < 0.0 else "elliptic"
