"""Equations 13-15 linearised along a solution: what becomes of a small difference."""

import numpy as np

from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

_HUGE = 1e100  # a factor beyond which none says more


def propagators(scene: Scene, times: Array, omega: Array) -> Array:
    """Return the derivative of omega at the last time by omega at each time, shape (n, 3, 3).

    Omega (rad/s, shape (n, 3)) solves the scene, and turns little from each time (s) to the next.
    """
    middle = 0.5 * (omega[1:] + omega[:-1])
    # Between nodes the Jacobian hardly changes: its exponential is the propagator.
    pieces = exponentials(np.diff(times)[:, None, None] * jacobians(scene, middle))
    found = np.empty((len(times), 3, 3))
    found[-1] = np.eye(3)
    for k in range(len(pieces) - 1, -1, -1):
        found[k] = np.clip(found[k + 1] @ pieces[k], -_HUGE, _HUGE)
    return found


def growth(propagators: Array) -> float:
    """Return the largest factor by which a difference of any omega reaches the end, at least 1."""
    return float(max(1.0, np.abs(propagators).sum(axis=2).max()))


def exponentials(small: Array) -> Array:
    """Return the exponentials of matrices below 1 in norm, to seven digits."""
    total = np.broadcast_to(np.eye(3), small.shape)
    for k in range(8, 0, -1):
        total = np.eye(3) + small @ total / k
    return total


def jacobians(scene: Scene, omega: Array) -> Array:
    """Return the derivatives of equations 13-15 at each omega, shape (n, 3, 3)."""
    a, b, c = scene.euler_coefficients
    x, y, z = omega.T
    zero = np.zeros(len(omega))
    rows = [[zero, a * z, a * y], [b * z, zero, b * x], [c * y, c * x, zero]]
    return np.array(rows).transpose(2, 0, 1)
