"""Least distances of floating-point numbers from multiples of pi/2, by continued fractions."""

from fractions import Fraction
from functools import cache

from flint import arb, ctx

from pyharness.truth.balls import fraction

_BITS = 700


@cache
def half_pi() -> tuple[Fraction, Fraction]:
    """Return two fractions below and above pi/2, less than 2**-680 apart."""
    with ctx.workprec(_BITS):
        value = arb.pi() / 2
        middle, radius = fraction(value), fraction(value.rad())
    return middle - radius, middle + radius


def exponent(x: Fraction) -> int:
    """Return the least n with x <= 2**n, for x above 0."""
    n = x.numerator.bit_length() - x.denominator.bit_length() - 1
    while x > Fraction(2) ** n:
        n += 1
    return n


@cache
def least_distance(digits: int, power: int) -> Fraction:
    """Return a lower bound of |x - n pi/2| for all n > 0 and all x up to 2**power.

    Each x is m 2**e, where m has at most `digits` bits and e is `power` - `digits`. By the law
    of best approximation no m below 2**digits makes |m c - n|, where c = 2**e 2/pi, smaller than
    the last convergent n/m of c whose m is below it.
    """
    scale = Fraction(2) ** (power - digits)
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


def hard_angle(digits: int, power: int) -> Fraction:
    """Return a number of `digits` bits below 2**power that is near a multiple of pi/2."""
    scale = Fraction(2) ** (power - digits)
    x = scale / half_pi()[0]
    before, last = (0, 1), (1, 0)
    while last[1] < 2**digits:
        whole = x.numerator // x.denominator
        before, last = last, (whole * last[0] + before[0], whole * last[1] + before[1])
        x = 1 / (x - whole)
    return before[1] * scale
