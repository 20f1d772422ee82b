"""Linear algebra in exact fractions."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Exact = list[list[Fraction]]
Fractions = NDArray[np.object_]

_UNIT = Fraction(1, 2**53)


def inverse(matrix: Fractions) -> Fractions:
    """Return the exact inverse, by Gauss-Jordan elimination."""
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
    """Return an array of floats as exact fractions."""
    exact: Any = np.vectorize(Fraction, otypes=[object])
    found: Fractions = exact(floats)
    return found


def gamma(count: int) -> Fraction:
    """Return n u / (1 - n u), u = 2**-53, the bound of n roundings (Higham 2002, lemma 3.1)."""
    return count * _UNIT / (1 - count * _UNIT)


def norm(matrix: Fractions) -> Fraction:
    """Return the row-sum norm."""
    largest: Fraction = abs(matrix).sum(axis=1).max()
    return largest


def collocation_matrix(points: Sequence[Fraction]) -> Fractions:
    """Return the matrix of derivatives of t, t**2, ..., t**n, one row per point (eq. 36)."""
    rows = [[(j + 1) * point**j for j in range(len(points))] for point in points]
    return np.array(rows, dtype=object)
