"""Linearisation of equations 13-15 along a solution: state-transition matrices and their norms."""

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
    # The Jacobian hardly changes between two times: its exponential is the matrix from one to the
    # next.
    pieces = exponentials(np.diff(times)[:, None, None] * jacobians(scene, middle))
    found = np.empty((len(times), 3, 3))
    found[-1] = np.eye(3)
    for k in range(len(pieces) - 1, -1, -1):
        found[k] = np.clip(found[k + 1] @ pieces[k], -_HUGE, _HUGE)
    return found


def growth(propagators: Array) -> float:
    """Return the error amplification: the largest row-sum norm of the matrices, at least 1."""
    return float(max(1.0, np.abs(propagators).sum(axis=2).max()))


def exponentials(small: Array) -> Array:
    """Return the exponentials of matrices of norm below 1, by the Taylor polynomial of degree 8.

    Its truncation error is below 3.1e-6 in norm.
    """
    total = np.broadcast_to(np.eye(3), small.shape)
    for k in range(8, 0, -1):
        total = np.eye(3) + small @ total / k
    return total


def jacobians(scene: Scene, omega: Array) -> Array:
    """Return the Jacobian matrix of equations 13-15 at each omega, 1/s, shape (n, 3, 3)."""
    a, b, c = scene.euler_coefficients
    x, y, z = omega.T
    zero = np.zeros(len(omega))
    rows = [[zero, a * z, a * y], [b * z, zero, b * x], [c * y, c * x, zero]]
    return np.array(rows).transpose(2, 0, 1)
