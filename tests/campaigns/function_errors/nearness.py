"""Least distances of floating-point numbers from multiples of pi/2, by continued fractions."""

from fractions import Fraction
from functools import cache

_BITS = 700


@cache
def half_pi() -> tuple[Fraction, Fraction]:
    """Return two fractions below and above pi/2, less than 2**-680 apart (Machin's formula)."""
    one = 1 << _BITS

    def arctan(n: int) -> int:
        total, power, k = 0, one // n, 0
        while power:
            total += (-1) ** k * power // (2 * k + 1)
            power //= n * n
            k += 1
        return total

    # Each of some 450 terms is truncated twice, by less than a unit, and counts 8 times at most.
    value, error = 2 * (4 * arctan(5) - arctan(239)), 1 << 13
    return Fraction(value - error, one), Fraction(value + error, one)


@cache
def least_distance(digits: int, exponent: int) -> Fraction:
    """Return a lower bound of |x - n pi/2| for all n > 0 and all x up to 2**exponent.

    Each x is m 2**e, where m has at most `digits` bits and e is `exponent` - `digits`. By the law
    of best approximation no m below 2**digits makes |m c - n|, where c = 2**e 2/pi, smaller than
    the last convergent n/m of c whose m is below it.
    """
    scale = Fraction(2) ** (exponent - digits)
    low, high = (scale / end for end in reversed(half_pi()))
    # Convergents of the middle are those of c as long as both ends of its enclosure share them.
    before, last = (0, 1), (1, 0)
    a, b = low, high
    while True:
        whole = a.numerator // a.denominator
        if whole != b.numerator // b.denominator:
            raise ArithmeticError("pi/2 has too few digits")
        before, last = last, (whole * last[0] + before[0], whole * last[1] + before[1])
        if last[1] >= 2**digits:
            break
        a, b = 1 / (b - whole), 1 / (a - whole)
    n, m = before
    distance = min(abs(m * low - n), abs(m * high - n))
    assert (m * low - n) * (m * high - n) > 0
    return distance * half_pi()[0]


def hard_angle(digits: int, exponent: int) -> Fraction:
    """Return a number of `digits` bits below 2**exponent that is near a multiple of pi/2."""
    scale = Fraction(2) ** (exponent - digits)
    x = scale / half_pi()[0]
    before, last = (0, 1), (1, 0)
    while last[1] < 2**digits:
        whole = x.numerator // x.denominator
        before, last = last, (whole * last[0] + before[0], whole * last[1] + before[1])
        x = 1 / (x - whole)
    return before[1] * scale
