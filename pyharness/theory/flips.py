"""How often a body without torque turns over: the period of omega, by a closed form, of many."""

import numpy as np
from numpy.typing import ArrayLike

from pyharness.model.trajectory import Array

# Of the arithmetic-geometric mean: its digits double each time once the two are near each other,
# and before that the ratio's logarithm halves. Ratios of 1e-300 take as many.
_LEVELS = 16
_NEAR = 2.0**-27  # where the next mean is exact


def flip_times(moments: ArrayLike, omega0: ArrayLike) -> Array:
    """Return the time between changes of sign of the component about the middle axis, s.

    It is half the period of omega without torque, pi over the arithmetic-geometric mean of two
    rates. Infinite on the separatrix, and where omega stays as it is.

    Parameters
    ----------
    moments : array_like, shape (n, 3) or (3,)
        Principal moments, kg m2, in any order.
    omega0 : array_like, shape (n, 3) or (3,)
        Angular velocities, rad/s.

    Returns
    -------
    ndarray, shape (n,)
        Seconds.
    """
    bodies, omega = np.broadcast_arrays(np.atleast_2d(moments), np.atleast_2d(omega0))
    order = np.argsort(bodies, axis=1, kind="stable")
    i1, i2, i3 = np.take_along_axis(bodies, order, axis=1).T
    w1, w2, w3 = np.abs(np.take_along_axis(omega, order, axis=1)).T
    s1, s2, s3 = (i3 - i2) / i1, (i3 - i1) / i2, (i2 - i1) / i3
    # The motion goes about the axis of the larger one; where they are equal it never comes back.
    about1, about3 = np.sqrt(s2 * s3) * w1, np.sqrt(s1 * s2) * w3
    upper = np.hypot(np.sqrt(s1 * s3) * w2, np.maximum(about1, about3))
    lower = np.sqrt(np.abs(about1 - about3)) * np.sqrt(about1 + about3)
    with np.errstate(divide="ignore"):
        return np.where(lower > 0.0, np.pi / mean(upper, lower), np.inf)


def mean(upper: Array, lower: Array) -> Array:
    """Return the arithmetic-geometric mean of numbers that are not negative."""
    for _ in range(_LEVELS):
        if (np.abs(upper - lower) <= _NEAR * upper).all():
            break
        upper, lower = 0.5 * (upper + lower), np.sqrt(upper) * np.sqrt(lower)
    return 0.5 * (upper + lower)
