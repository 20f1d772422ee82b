"""Principal moments and principal axes of full inertia matrices."""

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pyharness.model.diagonal import diagonalised
from pyharness.model.errors import InputError
from pyharness.model.values import Matrix as Matrix
from pyharness.model.values import Triple, converted, number_list, three

Exact = tuple[Fraction, Fraction, Fraction]
Array = NDArray[np.float64]

SYMMETRIC = 1e-12  # allowed asymmetry of elements, over the largest element
_KEPT = 256  # number of cached principal frames


@dataclass(frozen=True, eq=False)
class PrincipalFrame:
    """The principal moments (kg m2) and axes of one body, rounded, and to at least 30 digits.

    Each axis, a column of `axes`, is near the body's own axis of the same number; they form a
    right-handed frame. `moments_low` is the exact minus the rounded moments.
    """

    moments: Triple
    moments_low: Triple
    axes: Array
    exact_moments: Exact
    exact_axes: tuple[Exact, Exact, Exact]

    def into(self, vector: Exact) -> Exact:
        """Return the exact components of a vector about the principal axes."""
        first, second, third = (
            sum((x * v for x, v in zip(axis, vector, strict=True)), Fraction(0))
            for axis in self.exact_axes
        )
        return first, second, third


def checked_inertia(where: str, values: object) -> Matrix:
    """Return a user's inertia matrix (kg m2), made exactly symmetric, or raise InputError."""
    matrix = symmetric_matrix(where, values)
    least = min(principal_frame(matrix).exact_moments)
    if not least > 0:
        raise InputError(
            f"{where}: its least principal moment is {nearest_float(least):g}; allowed: a positive "
            "definite matrix"
        )
    return matrix


def symmetric_matrix(where: str, values: object) -> Matrix:
    """Return a user's symmetric matrix, or raise InputError; moments are not checked."""
    allowed = "allowed: three rows of three finite numbers, kg m2"
    rows = list(number_list(where, values, allowed))
    if any(isinstance(converted(row), float) for row in rows):
        raise InputError(f"{where}: numbers instead of rows; {allowed}; for three moments: moments")
    given = [three(where, row) for row in rows]
    if len(given) != 3:
        raise InputError(f"{where}: {len(given)} rows; {allowed}")
    largest = max(abs(x) for row in given for x in row)
    for i in range(3):
        for j in range(i):
            if abs(given[i][j] - given[j][i]) > SYMMETRIC * largest:
                raise InputError(
                    f"{where}: not symmetric, row {i + 1} column {j + 1} is {given[i][j]:g} and "
                    f"row {j + 1} column {i + 1} is {given[j][i]:g}; allowed: equal numbers"
                )
    half = [[0.5 * given[i][j] + 0.5 * given[j][i] for j in range(3)] for i in range(3)]
    (a, b, c), (d, e, f), (g, h, k) = half
    return (a, b, c), (d, e, f), (g, h, k)


@lru_cache(maxsize=_KEPT)
def principal_frame(inertia: Matrix) -> PrincipalFrame:
    """Return the principal frame; moments are unsorted, each accurate to its last digit."""
    found = diagonalised(inertia)
    order: list[int] = []
    # Each body axis gets the nearest remaining eigenvector.
    for row in range(3):
        left = [k for k in range(3) if k not in order]
        order.append(max(left, key=lambda k: abs(found.vectors[k][row])))
    axes = [found.vectors[k] for k in order]
    axes = [_reverse(axis) if axis[n] < 0 else axis for n, axis in enumerate(axes)]
    if _determinant(axes) < 0:
        least = min(range(3), key=lambda n: abs(axes[n][n]))
        axes[least] = _reverse(axes[least])
    first, second, third = (found.values[k] for k in order)
    exact = first, second, third
    rounded = nearest_float(first), nearest_float(second), nearest_float(third)
    low = (
        _round_off(first, rounded[0]),
        _round_off(second, rounded[1]),
        _round_off(third, rounded[2]),
    )
    columns = np.array([[float(x) for x in axis] for axis in axes]).T
    columns.flags.writeable = False
    return PrincipalFrame(rounded, low, columns, exact, (axes[0], axes[1], axes[2]))


def principal_axes(inertia: Matrix) -> tuple[Triple, Array]:
    """Return the principal moments (kg m2), and the axes as columns of a (3, 3) array."""
    found = principal_frame(inertia)
    return found.moments, found.axes.copy()


def _reverse(axis: Exact) -> Exact:
    return -axis[0], -axis[1], -axis[2]


def _determinant(axes: list[Exact]) -> float:
    (a, b, c), (d, e, f), (g, h, k) = ([float(x) for x in axis] for axis in axes)
    return a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g)


def nearest_float(value: Fraction) -> float:
    """Return the float nearest to a fraction, perhaps infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _round_off(value: Fraction, rounded: float) -> float:
    return float(value - Fraction(rounded)) if math.isfinite(rounded) else 0.0
