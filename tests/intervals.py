"""Fixed-point intervals on Python's integers, and their 3x3 matrices; every rounding is outward."""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from mpmath import iv, libmp

_MORE_BITS = 32  # bits of sine and cosine beyond those of the interval


class Interval:
    """A closed interval whose bounds are the integers `lo` and `hi` over 2**`bits`."""

    __slots__ = ("bits", "hi", "lo")

    def __init__(self, lo: int, hi: int, bits: int) -> None:
        """Store the bounds; raise ValueError if they are in the wrong order."""
        if lo > hi:
            raise ValueError("the lower bound of an interval exceeds the upper bound")
        self.lo, self.hi, self.bits = lo, hi, bits

    @classmethod
    def around(cls, low: Fraction, high: Fraction, bits: int) -> "Interval":
        """Return the smallest interval with these bits that contains [low, high]."""
        return cls(math.floor(low * (1 << bits)), math.ceil(high * (1 << bits)), bits)

    def __repr__(self) -> str:
        """Return the bounds as floats, and the number of bits."""
        low, high = (float(x) for x in self.bounds())
        return f"Interval([{low:.17g}, {high:.17g}], {self.bits} bits)"

    def __add__(self, other: "Interval") -> "Interval":
        """Return the sum, which is exact."""
        return Interval(self.lo + other.lo, self.hi + other.hi, self.bits)

    def __neg__(self) -> "Interval":
        """Return the interval of the opposite numbers."""
        return Interval(-self.hi, -self.lo, self.bits)

    def __sub__(self, other: "Interval") -> "Interval":
        """Return the difference, which is exact."""
        return Interval(self.lo - other.hi, self.hi - other.lo, self.bits)

    def __mul__(self, other: "Interval") -> "Interval":
        """Return the product, rounded outward."""
        return dot([self], [other])

    def over(self, divisor: int) -> "Interval":
        """Return the quotient by a positive integer, rounded outward."""
        return Interval(self.lo // divisor, -(-self.hi // divisor), self.bits)

    def hull(self, other: "Interval") -> "Interval":
        """Return the smallest interval that contains both."""
        return Interval(min(self.lo, other.lo), max(self.hi, other.hi), self.bits)

    def contains(self, other: "Interval") -> bool:
        """Return whether the other interval is a subset."""
        return self.lo <= other.lo and other.hi <= self.hi

    def middle(self) -> "Interval":
        """Return an interval of one number, the midpoint or the next number below it."""
        number = (self.lo + self.hi) // 2
        return Interval(number, number, self.bits)

    def wider(self) -> "Interval":
        """Return an interval that is wider by an eighth on each side."""
        more = (self.hi - self.lo) // 8 + 1
        return Interval(self.lo - more, self.hi + more, self.bits)

    def width(self) -> float:
        """Return the width, rounded to a float."""
        return (self.hi - self.lo) / (1 << self.bits)

    def bounds(self) -> tuple[Fraction, Fraction]:
        """Return the bounds as exact fractions."""
        return Fraction(self.lo, 1 << self.bits), Fraction(self.hi, 1 << self.bits)


Vector = list[Interval]
Matrix = list[Vector]


def dot(first: Sequence[Interval], second: Sequence[Interval]) -> Interval:
    """Return the scalar product of two vectors: exact products and sums, one outward rounding."""
    low = high = 0
    for x, y in zip(first, second, strict=True):
        a, b, c, d = x.lo * y.lo, x.lo * y.hi, x.hi * y.lo, x.hi * y.hi
        low += min(a, b, c, d)
        high += max(a, b, c, d)
    bits = first[0].bits
    return Interval(low >> bits, -(-high >> bits), bits)


def total(terms: Sequence[Interval]) -> Interval:
    """Return the sum of intervals, which is exact."""
    return Interval(sum(x.lo for x in terms), sum(x.hi for x in terms), terms[0].bits)


def product(first: Matrix, second: Matrix) -> Matrix:
    """Return the product of two matrices, rounded outward."""
    return [[dot(row, column) for column in zip(*second, strict=True)] for row in first]


def sine_and_cosine(angle: Interval) -> tuple[Interval, Interval]:
    """Return intervals that contain sine and cosine of all angles (rad) in an interval."""
    ends = to_mpmath(angle)._mpi_
    cosine, sine = libmp.mpi_cos_sin(ends, angle.bits + _MORE_BITS)

    def rounded(pair: tuple[Any, Any]) -> Interval:
        low, high = (Fraction(*libmp.to_rational(end)) for end in pair)
        return Interval.around(low, high, angle.bits)

    return rounded(sine), rounded(cosine)


def inverse(matrix: Matrix) -> Matrix:
    """Return an enclosure of the inverse of a 3x3 matrix of exact numbers, by its adjugate.

    The division is the only rounding. Raise ZeroDivisionError if the matrix is singular.
    """
    assert all(x.lo == x.hi for row in matrix for x in row)
    m = [[x.lo for x in row] for row in matrix]
    bits = matrix[0][0].bits

    def cofactor(i: int, j: int) -> int:
        return m[i - 2][j - 2] * m[i - 1][j - 1] - m[i - 2][j - 1] * m[i - 1][j - 2]

    determinant = sum(m[0][j] * cofactor(0, j) for j in range(3))
    exact = [[Fraction(cofactor(j, i) << bits, determinant) for j in range(3)] for i in range(3)]
    return [[Interval.around(x, x, bits) for x in row] for row in exact]


def orthogonal(images: Matrix, spread: Vector) -> Matrix:
    """Return exact numbers near an orthogonal matrix, the axes of the next set.

    The first axis is along the longest edge of the image of the set, as Lohner recommends. Rounding
    errors are irrelevant here, because the inverse is enclosed.
    """
    middle = [[x.middle().lo / (1 << x.bits) for x in row] for row in images]
    widths = np.array([x.width() for x in spread])
    lengths = np.linalg.norm(middle, axis=0) * widths
    q = np.linalg.qr(np.array(middle)[:, np.argsort(-lengths)])[0]
    bits = spread[0].bits
    return [[Interval.around(Fraction(x), Fraction(x), bits).middle() for x in row] for row in q]


def to_mpmath(interval: Interval) -> Any:
    """Return the same interval as an `mpmath.iv.mpf`, exact at any precision of `iv`."""
    ends = (libmp.from_man_exp(end, -interval.bits) for end in (interval.lo, interval.hi))
    return iv.make_mpf(tuple(ends))


def decimals(interval: Any, places: int) -> tuple[str, str]:
    """Return the bounds of an `mpmath.iv.mpf` with some decimals, rounded outward."""
    low, high = (Fraction(*libmp.to_rational(end)) * 10**places for end in interval._mpi_)

    def written(number: int) -> str:
        whole, rest = divmod(abs(number), 10**places)
        return f"{'-' if number < 0 else ''}{whole}.{rest:0{places}}"

    return written(math.floor(low)), written(math.ceil(high))
