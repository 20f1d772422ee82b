"""Diagonalisation of symmetric 3 x 3 matrices in integers, with high relative accuracy.

In binary64 a small eigenvalue would have few correct digits. The elements are integer multiples of
a power of 2, the unit. The absolute determinant of a regular matrix is hence at least the cube of
the unit. This bounds its smallest absolute eigenvalue from below, and so determines the number of
bits.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

Row = tuple[Fraction, Fraction, Fraction]

# Least number of bits of an eigenvalue that is not 0. A double-double number has only 106 bits.
_BITS = 128
_PAIRS = ((0, 1), (0, 2), (1, 2))
# An off-diagonal element below 2**_NOISE, in units of its last bit, is only rounding error.
_NOISE = 8
# Limit of the number of rotations. The convergence is quadratic; about ten suffice.
_MOST_ROTATIONS = 500


@dataclass(frozen=True)
class Diagonal:
    """The eigenvalues of a symmetric matrix, and orthonormal eigenvectors `vectors[k]`.

    They are fractions with relative errors of at most 2**-100; a zero eigenvalue is exactly 0.
    """

    values: Row
    vectors: tuple[Row, Row, Row]


def diagonalised(matrix: tuple[tuple[float, float, float], ...]) -> Diagonal:
    """Return the eigenvalues and eigenvectors by Jacobi's method in integers.

    For a diagonal matrix they are in the order of its elements.
    """
    exponent = min((_last_bit(x) for row in matrix for x in row if x), default=0)
    whole = [[_in_unit(x, exponent) for x in row] for row in matrix]
    size = max(abs(x) for row in whole for x in row).bit_length()
    # The determinant is at least 1 in this unit, and the other eigenvalues are below 3 * 2**size.
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
    first, second, third = (
        a[k][k] * unit if abs(a[k][k]) >> (_BITS // 2) else Fraction(0) for k in range(3)
    )
    one = Fraction(1, 1 << bits)
    x, y, z = ((v[0] * one, v[1] * one, v[2] * one) for v in vectors)
    return Diagonal((first, second, third), (x, y, z))


def _rotate(a: list[list[int]], vectors: list[list[int]], p: int, q: int, bits: int) -> None:
    """Make a[p][q] 0 in place by the smaller Jacobi rotation (Rutishauser 1966); unit 2**-bits."""
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
    """Return the exponent of the lowest nonzero bit of a number."""
    numerator, denominator = x.as_integer_ratio()
    if denominator > 1:
        return 1 - denominator.bit_length()
    return (numerator & -numerator).bit_length() - 1


def _in_unit(x: float, exponent: int) -> int:
    numerator, denominator = x.as_integer_ratio()
    shift = exponent + denominator.bit_length() - 1
    return numerator >> shift if shift >= 0 else numerator << -shift
