"""Linearisation of Euler's equations (13-15 in Jacobs 1982) along a solution."""

import numpy as np

from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_HUGE = 1e100  # largest matrix element, which keeps products finite


def propagators(scene: Scene, times: Array, omega: Array) -> Array:
    """Return the state-transition matrices of omega, (n, 3, 3), from each time to the last.

    The times (s) are closely spaced.
    """
    return transitions(times, jacobians(scene, 0.5 * (omega[1:] + omega[:-1])))


def transitions(times: Array, slopes: Array) -> Array:
    """Return the state-transition matrices from each of n times (s) to the last, (n, m, m).

    `slopes` are the intervals' Jacobians (1/s).
    """
    # The Jacobian hardly changes in an interval, so that exp(interval * Jacobian) is the
    # state-transition matrix.
    pieces = exponentials(np.diff(times)[:, None, None] * slopes)
    size = slopes.shape[-1]
    found = np.empty((len(times), size, size))
    found[-1] = np.eye(size)
    for k in range(len(pieces) - 1, -1, -1):
        found[k] = np.clip(found[k + 1] @ pieces[k], -_HUGE, _HUGE)
    return found


def growth(propagators: Array) -> float:
    """Return the error amplification: the matrices' largest row-sum norm, at least 1."""
    return float(max(1.0, np.abs(propagators).sum(axis=2).max()))


def exponentials(small: Array) -> Array:
    """Return the exponentials of matrices of norm below 1, by Taylor's polynomial of degree 8.

    The truncation error is below 3.1e-6.
    """
    one = np.eye(small.shape[-1])
    total = np.broadcast_to(one, small.shape)
    for k in range(8, 0, -1):
        total = one + small @ total / k
    return total


def jacobians(scene: Scene, omega: Array) -> Array:
    """Return the Jacobian matrices (1/s) at n omegas (rad/s), (n, 3, 3)."""
    a, b, c = scene.euler_coefficients
    x, y, z = omega.T
    zero = np.zeros(len(omega))
    rows = [[zero, a * z, a * y], [b * z, zero, b * x], [c * y, c * x, zero]]
    return np.array(rows).transpose(2, 0, 1)
