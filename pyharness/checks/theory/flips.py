"""The time between flips of torque-free bodies, in closed form.

At a flip, omega about the middle axis changes its sign.
"""

import numpy as np
from numpy.typing import ArrayLike

from pyharness.model.trajectory import Array

# Enough iterations of the arithmetic-geometric mean for two numbers with a ratio of 1e-300.
_LEVELS = 16
# Relative difference below which, in binary64, the arithmetic mean equals the arithmetic-geometric
# mean.
_NEAR = 2.0**-27


def flip_times(moments: ArrayLike, omega0: ArrayLike) -> Array:
    """Return the time (s) between flips of each body, shape (n,), infinite without flips.

    The `moments` may have any order.
    """
    bodies, omega = np.broadcast_arrays(np.atleast_2d(moments), np.atleast_2d(omega0))
    order = np.argsort(bodies, axis=1, kind="stable")
    i1, i2, i3 = np.take_along_axis(bodies, order, axis=1).T
    w1, w2, w3 = np.abs(np.take_along_axis(omega, order, axis=1)).T
    s1, s2, s3 = (i3 - i2) / i1, (i3 - i1) / i2, (i2 - i1) / i3
    # Omega encircles axis 1 or 3, whichever has the larger rate. With equal rates the motion is on
    # the separatrix and never returns.
    about1, about3 = np.sqrt(s2 * s3) * w1, np.sqrt(s1 * s2) * w3
    upper = np.hypot(np.sqrt(s1 * s3) * w2, np.maximum(about1, about3))
    lower = np.sqrt(np.abs(about1 - about3)) * np.sqrt(about1 + about3)
    turns = (lower > 0.0) & ((w2 > 0.0) | ((w1 > 0.0) & (w3 > 0.0)))
    with np.errstate(divide="ignore", invalid="ignore"):
        # Half the period is pi divided by the arithmetic-geometric mean of two rates (1/s).
        return np.where(turns, np.pi / mean(upper, lower), np.inf)


def mean(upper: Array, lower: Array) -> Array:
    """Return the arithmetic-geometric mean of each pair of non-negative numbers."""
    for _ in range(_LEVELS):
        # Leave a converged pair unchanged, so that its result does not depend on the others.
        left = ~(np.abs(upper - lower) <= _NEAR * upper)
        if not left.any():
            break
        means = 0.5 * (upper + lower), np.sqrt(upper) * np.sqrt(lower)
        upper, lower = np.where(left, means, (upper, lower))
    return 0.5 * (upper + lower)
