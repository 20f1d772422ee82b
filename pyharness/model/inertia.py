"""Principal moments and axes of inertia matrices, diagonalised in integers.

In binary64, a small eigenvalue would have few correct digits. Elements are integer multiples of a
power of 2, u, and a regular matrix has an absolute determinant of at least u**3. This
bounds the smallest eigenvalue from below, and determines how many bits are enough.
"""

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.values import Matrix as Matrix
from pyharness.model.values import Triple, converted, number_list, three, triple

Exact = tuple[Fraction, Fraction, Fraction]

SYMMETRIC = 1e-12  # allowed asymmetry of elements, relative to the largest
_KEPT = 256  # number of cached principal frames
# Least number of bits of an eigenvalue that is not 0; more than the 106 bits of double-double
# numbers.
_BITS = 128
_PAIRS = ((0, 1), (0, 2), (1, 2))
_NOISE = 8  # an off-diagonal element below 2**_NOISE units of its last bit is rounding error
_MOST_ROTATIONS = 500  # about ten suffice, because the convergence is quadratic


@dataclass(frozen=True, eq=False)
class PrincipalFrame:
    """Principal moments (kg m2) and axes, as floats and as fractions of 30 or more digits."""

    moments: Triple
    moments_low: Triple  # `exact_moments` minus `moments`
    axes: Array  # columns of a right-handed frame, each nearest to its body axis
    exact_moments: Exact
    exact_axes: tuple[Exact, Exact, Exact]

    def into(self, vector: Exact) -> Exact:
        """Return the exact components of a vector about the principal axes."""
        return triple(
            sum((x * v for x, v in zip(axis, vector, strict=True)), Fraction(0))
            for axis in self.exact_axes
        )


def checked_inertia(where: str, values: object) -> Matrix:
    """Return a user's inertia matrix (kg m2), made exactly symmetric."""
    matrix = symmetric_matrix(where, values)
    least = min(principal_frame(matrix).exact_moments)
    if not least > 0:
        raise InputError(
            f"{where}: its least principal moment is {nearest_float(least):g}; allowed: a positive "
            "definite matrix"
        )
    return matrix


def symmetric_matrix(where: str, values: object) -> Matrix:
    """Return a user's symmetric matrix, which need not be positive definite."""
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
    return triple(triple(row) for row in half)


@lru_cache(maxsize=_KEPT)
def principal_frame(inertia: Matrix) -> PrincipalFrame:
    """Return the principal frame, with moments correct to the last digit."""
    values, vectors = diagonalised(inertia)
    order: list[int] = []
    # Each body axis gets the nearest remaining eigenvector.
    for row in range(3):
        left = [k for k in range(3) if k not in order]
        order.append(max(left, key=lambda k: abs(vectors[k][row])))
    axes = [vectors[k] for k in order]
    axes = [_reverse(axis) if axis[n] < 0 else axis for n, axis in enumerate(axes)]
    if np.linalg.det([list(map(float, axis)) for axis in axes]) < 0.0:
        least = min(range(3), key=lambda n: abs(axes[n][n]))
        axes[least] = _reverse(axes[least])
    exact = triple(values[k] for k in order)
    rounded = triple(map(nearest_float, exact))
    low = triple(map(_round_off, exact, rounded))
    columns = np.array([[float(x) for x in axis] for axis in axes]).T
    columns.flags.writeable = False
    return PrincipalFrame(rounded, low, columns, exact, triple(axes))


def _reverse(axis: Exact) -> Exact:
    return triple(-x for x in axis)


def nearest_float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _round_off(value: Fraction, rounded: float) -> float:
    return float(value - Fraction(rounded)) if math.isfinite(rounded) else 0.0


def diagonalised(
    matrix: tuple[tuple[float, float, float], ...],
) -> tuple[Exact, tuple[Exact, Exact, Exact]]:
    """Return eigenvalues and orthonormal eigenvectors of a symmetric matrix.

    Relative errors of eigenvalues are at most 2**-100; zero eigenvalues are exact.
    """
    exponent = min((_last_bit(x) for row in matrix for x in row if x), default=0)
    whole = [[int(Fraction(x) / Fraction(2) ** exponent) for x in row] for row in matrix]
    size = max(abs(x) for row in whole for x in row).bit_length()
    # The absolute determinant of `whole` is 0 or at least 1; eigenvalues are below 3 * 2**size.
    fraction = 2 * size + 4 + _BITS
    bits = size + fraction
    a = [[x << fraction for x in row] for row in whole]
    vectors = [[(1 << bits) if i == j else 0 for j in range(3)] for i in range(3)]
    for _ in range(_MOST_ROTATIONS):
        p, q = max(_PAIRS, key=lambda pair: abs(a[pair[0]][pair[1]]))
        if abs(a[p][q]) >> _NOISE == 0:
            break
        _rotate(a, vectors, p, q, bits)
    unit = Fraction(2) ** (exponent - fraction)
    values = triple(
        a[k][k] * unit if abs(a[k][k]) >> (_BITS // 2) else Fraction(0) for k in range(3)
    )
    one = Fraction(1, 1 << bits)
    return values, triple(triple(x * one for x in vector) for vector in vectors)


def _rotate(a: list[list[int]], vectors: list[list[int]], p: int, q: int, bits: int) -> None:
    """Make a[p][q] 0 in place by Jacobi's smaller rotation (Rutishauser 1966); unit 2**-bits."""
    r = 3 - p - q
    gap, twice = a[q][q] - a[p][p], 2 * a[p][q]
    root = math.isqrt(gap * gap + twice * twice)
    sense = -1 if gap < 0 else 1
    tangent = sense * (twice << bits) // (abs(gap) + root)
    cosine = math.isqrt(((root + abs(gap)) << 2 * bits) // (2 * root))
    sine = tangent * cosine >> bits
    change = tangent * a[p][q] >> bits
    a[p][p] -= change
    a[q][q] += change
    a[p][q] = a[q][p] = 0
    first, second = a[r][p], a[r][q]
    a[r][p] = a[p][r] = (cosine * first - sine * second) >> bits
    a[r][q] = a[q][r] = (sine * first + cosine * second) >> bits
    before, after = vectors[p], vectors[q]
    vectors[p] = [(cosine * x - sine * y) >> bits for x, y in zip(before, after, strict=True)]
    vectors[q] = [(sine * x + cosine * y) >> bits for x, y in zip(before, after, strict=True)]


def _last_bit(x: float) -> int:
    numerator, denominator = x.as_integer_ratio()
    if denominator > 1:
        return 1 - denominator.bit_length()
    return (numerator & -numerator).bit_length() - 1
