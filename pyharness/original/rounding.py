"""Rounding rules: the sum, the product and the quotient of two numbers of a word.

A number is a pair (m, e) of integers with the value m 2**e. m has p bits, or fewer for a subnormal
number. If m is 0, e is the float that the pair represents: 0.0, -0.0, inf, -inf or nan. An
`Operation` takes none of these, but may return them.

No library of software floating point has all these rules. mpmath and gmpy2 round correctly and have
no exponent range of their own. SoftFloat and numpy have only the formats of IEEE 754. None has the
CDC's (`cdc.py`).
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

Pair = tuple[int, Any]
Rounding = Callable[[int, int], Pair]
Operation = Callable[[int, int, int, int], Pair]


class Rules(NamedTuple):
    """The arithmetic of a word.

    Attributes
    ----------
    nearest : Rounding
        Rounding to nearest, ties to even, of functions and literals.
    cut : Rounding
        Truncation towards zero, of literals in a word that truncates them.
    add, multiply, divide : Operation
        Operations on two numbers; a difference is the sum with the negative.
    difference : Operation
        The sum of a number and the negative of another; the two compare equal if it is zero.
    signed_zero : bool
        Whether there is -0.0.
    """

    nearest: Rounding
    cut: Rounding
    add: Operation
    multiply: Operation
    divide: Operation
    difference: Operation
    signed_zero: bool


def rounding(p: int, least: int, most: int, cut: bool, gradual: bool) -> Rounding:
    """Return a function that rounds m 2**e to p bits and an exponent from `least` to `most`.

    m may have any length. The function truncates towards zero if `cut`, else it rounds to nearest,
    ties to even. A value too large becomes infinite. A value too small underflows gradually, as in
    IEEE 754, if `gradual`, else it becomes zero.
    """
    shortened = _cut if cut else _to_even

    def rounded(m: int, e: int) -> Pair:
        if not m:
            return 0, 0.0
        shift = m.bit_length() - p
        if e + shift < least:
            return small(m, e)
        if shift > 0:
            m = shortened(m, shift)
            if m.bit_length() > p:
                m >>= 1
                e += 1
        elif shift:
            m <<= -shift
        e += shift
        return (m, e) if e <= most else (0, math.copysign(math.inf, m))

    def small(m: int, e: int) -> Pair:
        if not gradual:
            return 0, 0.0
        short = shortened(m, least - e) if e < least else m << (e - least)
        return (short, least) if short else (0, math.copysign(0.0, m))

    return rounded


def _cut(m: int, shift: int) -> int:
    return m >> shift if m > 0 else -(-m >> shift)


def _to_even(m: int, shift: int) -> int:
    return (m + (1 << shift - 1) - 1 + (m >> shift & 1)) >> shift


def ieee(p: int, largest: int, cut: bool) -> Rules:
    """Return the rules of IEEE 754 for p bits and numbers below 2**(largest + 1).

    If `cut`, sums, products and quotients are truncated towards zero. A truncated result too large
    is then infinite, as on machines that truncated; in IEEE 754 it is the largest number.
    """
    least, most = 2 - largest - p, largest - p + 1
    fit = rounding(p, least, most, cut, gradual=True)

    def add(xm: int, xe: int, ym: int, ye: int) -> Pair:
        if xe < ye:
            xm, xe, ym, ye = ym, ye, xm, xe
        apart = xe - ye
        if apart > p + 2:
            # y is below an eighth of x's last unit: any such number of its sign rounds the same.
            return fit((xm << 3) + (1 if ym > 0 else -1), xe - 3)
        return fit((xm << apart) + ym, ye)

    def multiply(xm: int, xe: int, ym: int, ye: int) -> Pair:
        return fit(xm * ym, xe + ye)

    def divide(xm: int, xe: int, ym: int, ye: int) -> Pair:
        shift = p + 2 + ym.bit_length() - xm.bit_length()
        quotient, rest = divmod(abs(xm) << shift, abs(ym))
        quotient = quotient << 1 | (rest > 0)
        return fit(quotient if (xm < 0) == (ym < 0) else -quotient, xe - ye - shift - 1)

    nearest, towards_zero = (rounding(p, least, most, each, gradual=True) for each in (False, True))
    return Rules(nearest, towards_zero, add, multiply, divide, add, signed_zero=True)
