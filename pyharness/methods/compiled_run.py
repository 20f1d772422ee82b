"""Integrations under a torque of a compiled function, without Python."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pyharness.methods.scipy_run import LARGEST_PHASE
from pyharness.model.array_type import Array
from pyharness.model.compiled_torque import CompiledTorque
from pyharness.model.extension import extension
from pyharness.model.scene import Scene

_WIDTH = 7  # omega and attitude


class CompiledRows(NamedTuple):
    """The results of one integration."""

    state: Array  # shape (n, 3) or (n, 7), at the first n times
    status: int  # of pyharness.model.codes.Statuses
    evaluations: int
    reached: float  # s
    largest: float  # largest |omega| (rad/s)


def integrated(
    scene: Scene,
    function: CompiledTorque,
    times: Sequence[float],
    relative: float,
    absolute: Sequence[float],
    longest: float,
    most: int,
) -> CompiledRows:
    """Return the state at `times` (s), by Dormand and Prince's Runge-Kutta method of order 8.

    Local tolerances are as in SciPy's DOP853; `longest` is in s, `most` in calls.
    """
    n = 3 if scene.attitude is None else _WIDTH
    # A function that takes the attitude without saying so returns NaN.
    start = np.full(_WIDTH, np.nan)
    start[:n] = [*scene.omega, *(scene.attitude or ())]
    sizes = np.ones(_WIDTH)
    sizes[:n] = absolute
    rows, n_rows, status, evaluations, (reached, largest) = extension().compiled_torque_rows(
        [function.address, function.data],
        scene.euler_coefficients,
        scene.moments or (1.0, 1.0, 1.0),
        *_tableau(),
        n,
        start,
        [relative, longest, LARGEST_PHASE],
        sizes,
        most,
        times,
    )
    return CompiledRows(rows.T[:n_rows, :n], status, evaluations, reached, largest)


@lru_cache(maxsize=1)
def _tableau() -> tuple[Array, Array, Array, Array]:
    """Return SciPy's coefficients, as `runge_kutta_853.f90` reads them."""
    from scipy.integrate import DOP853

    n, last = DOP853.n_stages, DOP853.D.shape[1]
    matrix = np.zeros((last, last))
    matrix[:n, :n], matrix[n, :n], matrix[n + 1 :] = DOP853.A, DOP853.B, DOP853.A_EXTRA
    nodes = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA])
    errors = np.zeros((last, 2))
    errors[: n + 1] = np.array([DOP853.E5, DOP853.E3]).T
    return matrix.T, nodes, errors, DOP853.D.T
