"""The time between flips of bodies without torque, half the period of omega, in closed form."""

import numpy as np
from numpy.typing import ArrayLike

from pyharness.model.trajectory import Array

# Iterations of the arithmetic-geometric mean, enough for ratios of 1e-300. Each iteration halves
# the logarithm of the ratio, and doubles the number of digits once the two numbers are close.
_LEVELS = 16
_NEAR = 2.0**-27  # relative difference of the two numbers at which their mean is exact


def flip_times(moments: ArrayLike, omega0: ArrayLike) -> Array:
    """Return the time between changes of sign of the component about the middle axis, s.

    It is half the period of omega without torque, pi over the arithmetic-geometric mean of two
    rates. It is infinite on the separatrix and for a steady rotation.

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
    # Omega circles the axis of the larger value. If the values are equal, it never returns.
    about1, about3 = np.sqrt(s2 * s3) * w1, np.sqrt(s1 * s2) * w3
    upper = np.hypot(np.sqrt(s1 * s3) * w2, np.maximum(about1, about3))
    lower = np.sqrt(np.abs(about1 - about3)) * np.sqrt(about1 + about3)
    with np.errstate(divide="ignore"):
        return np.where(lower > 0.0, np.pi / mean(upper, lower), np.inf)


def mean(upper: Array, lower: Array) -> Array:
    """Return the arithmetic-geometric mean of each pair of non-negative `upper` and `lower`."""
    for _ in range(_LEVELS):
        if (np.abs(upper - lower) <= _NEAR * upper).all():
            break
        upper, lower = 0.5 * (upper + lower), np.sqrt(upper) * np.sqrt(lower)
    return 0.5 * (upper + lower)
