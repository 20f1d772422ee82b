"""Linear algebra in exact fractions, without rounding; a matrix is an array of fractions."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Exact = list[list[Fraction]]
Fractions = NDArray[np.object_]

_UNIT = Fraction(1, 2**53)


def inverse(matrix: Fractions) -> Fractions:
    """Return the exact inverse of a regular matrix of fractions, by Gauss-Jordan elimination."""
    count = len(matrix)
    rows = np.hstack([matrix, np.eye(count, dtype=object)])
    for j in range(count):
        pivot = j + int(abs(rows[j:, j]).argmax())
        rows[[j, pivot]] = rows[[pivot, j]]
        rows[j] = rows[j] / rows[j, j]
        others = np.arange(count) != j
        rows[others] -= np.outer(rows[others, j], rows[j])
    return rows[:, count:]


def fractions(floats: ArrayLike) -> Fractions:
    """Return the fractions that are exactly equal to an array of floats, in the same shape."""
    exact: Any = np.vectorize(Fraction, otypes=[object])
    found: Fractions = exact(floats)
    return found


def gamma(count: int) -> Fraction:
    """Return n u / (1 - n u), the bound of the relative error of n successive roundings.

    Here n is `count`, and u = 2**-53 is the bound of one relative rounding error in binary64. The
    bound is that of lemma 3.1 of Higham 2002.
    """
    return count * _UNIT / (1 - count * _UNIT)


def norm(matrix: Fractions) -> Fraction:
    """Return the row-sum norm of a matrix: the largest sum of absolute elements of any row."""
    largest: Fraction = abs(matrix).sum(axis=1).max()
    return largest


def collocation_matrix(points: Sequence[Fraction]) -> Fractions:
    """Return the thesis's collocation matrix (equation 36), with a row for each point t.

    A row contains the derivatives of t, t**2, ..., t**n with respect to t at its collocation point
    t, where n is the number of points.
    """
    rows = [[(j + 1) * point**j for j in range(len(points))] for point in points]
    return np.array(rows, dtype=object)
