"""Linearisation of Euler's equations along a solution: state-transition matrices and their norms.

The equations are numbers 13-15 of the thesis.
"""

import numpy as np

from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_HUGE = 1e100  # limit of a matrix element, which keeps products finite


def propagators(scene: Scene, times: Array, omega: Array) -> Array:
    """Return the state-transition matrix of omega from each time to the last, shape (n, 3, 3).

    Each matrix is the derivative of omega at the last time with respect to omega at the earlier
    time. `omega` (rad/s, shape (n, 3)) is the solution of the scene at `times` (s); it must change
    little from each time to the next.
    """
    middle = 0.5 * (omega[1:] + omega[:-1])
    # The Jacobian hardly changes from a time to the next. Therefore its exponential, after
    # multiplication by the interval, is the state-transition matrix over this interval.
    pieces = exponentials(np.diff(times)[:, None, None] * jacobians(scene, middle))
    found = np.empty((len(times), 3, 3))
    found[-1] = np.eye(3)
    for k in range(len(pieces) - 1, -1, -1):
        found[k] = np.clip(found[k + 1] @ pieces[k], -_HUGE, _HUGE)
    return found


def growth(propagators: Array) -> float:
    """Return the error amplification: the largest row-sum norm of the propagators, at least 1.

    `propagators` are state-transition matrices, shape (n, 3, 3).
    """
    return float(max(1.0, np.abs(propagators).sum(axis=2).max()))


def exponentials(small: Array) -> Array:
    """Return the exponentials of matrices of norm below 1, by the Taylor polynomial of degree 8.

    `small` contains the matrices, shape (n, 3, 3). The norm of the truncation error is below
    3.1e-6.
    """
    total = np.broadcast_to(np.eye(3), small.shape)
    for k in range(8, 0, -1):
        total = np.eye(3) + small @ total / k
    return total


def jacobians(scene: Scene, omega: Array) -> Array:
    """Return the Jacobian matrix (1/s) of Euler's equations at each omega, shape (n, 3, 3).

    `omega` has shape (n, 3), rad/s. The right-hand sides of equations 13-15 of the thesis are
    differentiated with respect to omega.
    """
    a, b, c = scene.euler_coefficients
    x, y, z = omega.T
    zero = np.zeros(len(omega))
    rows = [[zero, a * z, a * y], [b * z, zero, b * x], [c * y, c * x, zero]]
    return np.array(rows).transpose(2, 0, 1)
