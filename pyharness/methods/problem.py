"""A scene as the modern kernels take it, and a trajectory of what they give."""

from collections.abc import Sequence

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.extension import COMPLETE, columns
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array, Trajectory


def normalized(scene: Scene) -> tuple[Array, Array, Array, Array, Array]:
    """Return what the modern kernels take: everything divided by the moments.

    Returns
    -------
    coefficients, m_constant, m_rate : ndarray, shape (3,)
        A, B, C; torque over moment (1/s2) and its rate (1/s3).
    sines, cosines : ndarray, shape (4, n)
        Columns of amplitude (1/s2) and frequency (rad/s).

    Raises
    ------
    InputError
        Where one of them is too large for binary64.
    """
    law = scene.torque
    moments = np.array(scene.moments or (1.0, 1.0, 1.0))
    # A wave without amplitude has no effect, and would cost its sine and cosine.
    sines, cosines = (
        columns(tuple(wave for wave in waves if any(wave[0]))) for waves in (law.sines, law.cosines)
    )
    with np.errstate(over="ignore"):
        sines[:3] /= moments[:, None]
        cosines[:3] /= moments[:, None]
        found = (
            np.array(scene.euler_coefficients),
            np.array(law.constant) / moments,
            np.array(law.rate) / moments,
            sines,
            cosines,
        )
    if not all(np.isfinite(each).all() for each in found):
        raise InputError(
            "A, B, C or torque over moment is not finite; take moments nearer to each other, or "
            "smaller torques"
        )
    return found


def trajectory_of(
    times: Sequence[float], rows: Array, n_rows: int, status: int, steps: int, evaluations: int
) -> Trajectory:
    """Return the rows of a kernel, which come in columns, as a trajectory."""
    time = np.array(times[:n_rows], dtype=float)
    ended = "complete" if status == COMPLETE else "overflow"
    return Trajectory(time, time, rows.T[:n_rows], None, steps, evaluations, ended)


def rows_trajectory(
    times: Sequence[float], omega: np.ndarray, evaluations: int, steps: int, ended: str
) -> Trajectory:
    """Return a trajectory without velocity, recorded at its true times."""
    time = np.array(times, dtype=float)
    return Trajectory(time, time, omega, None, steps, evaluations, ended)
