"""Rounding rules: sum, product and quotient of two numbers of a floating-point format.

A number m 2**e is a pair of integers (m, e); m has p bits, or fewer if subnormal. If m is 0, e is
the value as a float: 0.0, -0.0, inf, -inf or nan. Operands of an `Operation` have m other than 0.
No library has all these rules: mpmath and gmpy2 do not limit exponents, SoftFloat and numpy have
only IEEE 754, and none has the rules of the CDC machines.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

Pair = tuple[int, Any]
Rounding = Callable[[int, int], Pair]
Operation = Callable[[int, int, int, int], Pair]
# Exponents of an integer coefficient, for the octal exponent fields 0000 and 3776 of a CDC word.
_LEAST, _MOST = -1023, 1022


class Rules(NamedTuple):
    """The arithmetic of a format, as functions of integers m and e.

    `nearest` (ties to even) is for square roots, sines, cosines and literals, `cut` (towards zero)
    for literals if the word truncates them. A difference is the sum with the negative; `difference`
    is for comparisons only: numbers are equal if it is zero.
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

    The integer m may have any length. Rounding is towards zero if `cut`, else to nearest, ties to
    even. A larger exponent gives infinity; a smaller one underflows to zero or, if `gradual`,
    gradually as in IEEE 754.
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
    """Return the rules of IEEE 754 for p-bit coefficients and numbers below 2**(largest + 1).

    If `cut`, sums, products and quotients are truncated towards zero. A result that is then too
    large becomes infinite, as on machines that truncated; IEEE 754 requires the largest number.
    """
    least, most = 2 - largest - p, largest - p + 1
    fit = rounding(p, least, most, cut, gradual=True)

    def add(xm: int, xe: int, ym: int, ye: int) -> Pair:
        if xe < ye:
            xm, xe, ym, ye = ym, ye, xm, xe
        apart = xe - ye
        if apart > p + 2:
            # All y below an eighth of the last unit of x, with the same sign, have the same effect.
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


def cdc(p: int, rounds: bool) -> Rules:
    """Return the arithmetic of the CDC 6600 and CYBER 70 for p-bit coefficients.

    The source is the CYBER 170 hardware reference, CDC 60463560. A number is an integer coefficient
    of p = 48 bits and an exponent; a sum is formed in a register of 2 p bits, the frame. Without
    `rounds` it is `FX`, truncating sum, difference, product and quotient (octal 30, 31, 40 and 44);
    with it `RX`, rounding ones (34, 35, 41 and 45). There is no guard bit: the bits below the unit
    of the larger operand are truncated before NX (24) normalises a sum.

    Literals are rounded to nearest, an assumption: no source states how CDC's FTN converted them.
    """
    settled = rounding(p, _LEAST, _MOST, cut=True, gradual=False)
    quarter = 1 << p - 2 if rounds else 0
    third = (1 << p) // 3 if rounds else 0

    def multiply(xm: int, xe: int, ym: int, ye: int) -> Pair:
        product = abs(xm * ym) + quarter
        return settled(product if (xm < 0) == (ym < 0) else -product, xe + ye)

    def divide(xm: int, xe: int, ym: int, ye: int) -> Pair:
        quotient = ((abs(xm) << p) + third) // abs(ym)
        return settled(quotient if (xm < 0) == (ym < 0) else -quotient, xe - ye - p)

    def sum_with(rounds: bool) -> Operation:
        def add(xm: int, xe: int, ym: int, ye: int) -> Pair:
            frame, e = framed(p, rounds, xm, xe, ym, ye)
            return settled(_cut(frame, p), e)

        return add

    nearest = rounding(p, _LEAST, _MOST, cut=False, gradual=False)
    plain, add = sum_with(False), sum_with(rounds)
    return Rules(nearest, settled, add, multiply, divide, plain, signed_zero=False)


def framed(p: int, rounds: bool, xm: int, xe: int, ym: int, ye: int) -> tuple[int, int]:
    """Return the sum of xm 2**xe and ym 2**ye before normalisation, as a pair (frame, e).

    The frame is in units of 2**(e - p), where e is the larger exponent; coefficients have p bits.
    The smaller operand is shifted and truncated. If `rounds`, half a unit in the last place is
    first added to each operand, as RX does.
    """
    if xe <= ye:
        xm, xe, ym, ye = ym, ye, xm, xe
    apart = xe - ye
    large, small = abs(xm) << p, abs(ym) << p >> apart
    if rounds:
        half = 1 << p - 1
        large += half
        small += half >> apart
    return (large if xm > 0 else -large) + (small if ym > 0 else -small), xe
