"""Conversion of scenes to arguments of the Fortran kernels, and of results to trajectories.

A torque over moments is four arrays: constant (rad/s2), rate (rad/s3), sines and cosines, whose
columns have three amplitudes (rad/s2) and a frequency (rad/s).
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.extension import ENDS, columns
from pyharness.model.scene import Scene, Triple
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import WITH_ALL_ROWS, Array, Trajectory

_NOT_FINITE = (
    "a coefficient A, B, C or a torque divided by its moment is not finite; use moments nearer "
    "to each other, or smaller torques"
)


def normalized(scene: Scene) -> tuple[Array, Array, Array, Array, Array]:
    """Return A, B, C, and the torque divided by moments, all finite."""
    law, moments = scene.body_torque, np.array(scene.moments or (1.0, 1.0, 1.0))
    vectors = np.array([scene.euler_coefficients, law.constant, law.rate])
    # A wave of amplitude 0 would only take time.
    sines, cosines = (
        columns(tuple(wave for wave in waves if any(wave[0]))) for waves in (law.sines, law.cosines)
    )
    with np.errstate(over="ignore"):
        vectors[1:] /= moments
        for waves in (sines, cosines):
            if waves.size:
                waves[:3] /= moments[:, None]
    if not all(np.isfinite(each).all() for each in (vectors, sines, cosines) if each.size):
        raise InputError(_NOT_FINITE)
    coefficients, constant, rate = vectors
    return coefficients, constant, rate, sines, cosines


def remainders(scene: Scene) -> Triple:
    """Return the exact coefficients A, B, C minus their values in binary64."""
    # Without them, a closed form has an error of 1e-10 rad at a phase of 1e6 rad.
    found, moments = scene.euler_coefficients, scene.moments
    # Under a torque, no kernel uses the remainders.
    if moments is None or not scene.torque.is_zero or not all(map(math.isfinite, found)):
        return 0.0, 0.0, 0.0
    return _exact_remainders(moments, scene.moments_low, found)


@lru_cache(maxsize=64)
def _exact_remainders(moments: Triple, moments_low: Triple, found: Triple) -> Triple:
    from fractions import Fraction

    i1, i2, i3 = (Fraction(x) + Fraction(y) for x, y in zip(moments, moments_low, strict=True))
    a, b, c = map(Fraction, found)
    return float((i2 - i3) / i1 - a), float((i3 - i1) / i2 - b), float((i1 - i2) / i3 - c)


def estimate_or_none(estimate: float) -> float | None:
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
    **more: Any,
) -> Trajectory:
    ended = ENDS[status] if ENDS[status] in (*WITH_ALL_ROWS, "sliding", "stalled") else "overflow"
    if ended in WITH_ALL_ROWS:
        for name, value in (("error", error), ("growth", growth)):
            if value is not None and value >= 0.0:
                more[name] = float(value)
    attitude = None if attitudes is None else attitudes.T[:n_rows]
    return rows_trajectory(
        times[:n_rows], rows.T[:n_rows], evaluations, steps, ended, attitude=attitude, **more
    )


def rows_trajectory(
    times: Sequence[float], omega: Array, evaluations: int, steps: int, ended: str, **more: Any
) -> Trajectory:
    """Return a trajectory from omega (rad/s, shape (n, 3)) at `times` (s)."""
    time = np.array(times, dtype=float)
    return Trajectory.create(
        time=time, recorded_time=time, omega=omega, velocity=None, steps=steps,
        evaluations=evaluations, ended=ended, **more,
    )  # fmt: skip


def closed_form(scene: Scene) -> str | None:
    """Return the kind of a scene's closed form: ``sphere``, ``symmetric``, ``elliptic`` or None."""
    law = scene.torque
    if not isinstance(law, TorqueLaw) or law.in_space or scene.changing is not None:
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
        # Omega oscillates if the other two have opposite signs. Otherwise it may grow without
        # bound.
        rest = [x for x in (a, b, c) if x != 0.0]
        return "symmetric" if len(rest) == 2 and rest[0] * rest[1] < 0.0 else None
    return None if min(a, b, c) > 0.0 or max(a, b, c) < 0.0 else "elliptic"
