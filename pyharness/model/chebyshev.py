"""Polynomials through values at Chebyshev points, on many intervals at once.

The formulas are in Trefethen 2013, Approximation Theory and Approximation Practice, chapters 2 to
5.
"""

import numpy as np

from pyharness.model.array_type import Array


def points(count: int) -> Array:
    """Return Chebyshev points of the second kind, ascending, symmetric to the last bit."""
    found: Array = np.sin(np.pi * np.arange(1 - count, count, 2) / (2 * (count - 1)))
    return found


def to_coefficients(count: int) -> Array:
    """Return the matrix that converts values at the `points` to Chebyshev coefficients."""
    # Angles up to pi have the smallest rounding errors.
    turns = np.outer(np.arange(count), np.arange(count)[::-1]) % (2 * count - 2)
    angles = np.pi * np.minimum(turns, 2 * count - 2 - turns) / (count - 1)
    weights = np.full(count, 2.0 / (count - 1))
    weights[[0, -1]] /= 2.0
    matrix: Array = np.cos(angles) * weights
    matrix[[0, -1]] /= 2.0
    return matrix


def nodes(low: Array, high: Array, at: Array) -> Array:
    """Return the points `at`, from -1 to 1, mapped to each interval; one row per interval."""
    middle, half = 0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low
    found: Array = middle[:, None] + half[:, None] * at
    found[:, 0], found[:, -1] = low, high
    return found
