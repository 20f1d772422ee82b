"""Sine, cosine, pi, series, vectors and fractions in the current decimal context."""

import decimal
import math
from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction
from functools import cache
from operator import mul
from typing import Any

Row = list[Decimal]


def sine_cosine(angle: Decimal) -> tuple[Decimal, Decimal]:
    """Return sine and cosine of an angle (rad) of any size."""
    with decimal.localcontext() as context:
        context.prec += 12 + max(0, angle.adjusted())
        angle = angle.remainder_near(2 * pi(context.prec))
        halvings = 8
        x = angle / 2**halvings
        square = x * x
        sine = _alternating(x, square, 1)
        # The versine, 1 - cosine, loses no digits if the cosine is near 1.
        versine = _alternating(square / 2, square, 2)
        for _ in range(halvings):
            sine, versine = 2 * sine * (1 - versine), 2 * versine * (2 - versine)
        cosine = 1 - versine
    return +sine, +cosine


def _alternating(term: Decimal, square: Decimal, n: int) -> Decimal:
    """Return term - term x**2/((n + 1) (n + 2)) + ..., where `square` is x**2."""
    total = term
    while abs(term) > Decimal(1).scaleb(-decimal.getcontext().prec):
        n += 2
        term = -term * square / (n * (n - 1))
        total += term
    return total


def arctan(x: Decimal) -> Decimal:
    with decimal.localcontext() as context:
        context.prec += 10
        angle = Decimal(math.atan(x))
        # Each step doubles the number of correct digits, at first 16.
        digits = 15
        while digits < context.prec:
            sine, cosine = sine_cosine(angle)
            angle += (x * cosine - sine) / (cosine + x * sine)
            digits *= 2
    return +angle


def arcsin(x: Decimal) -> Decimal:
    """Return the angle (rad) whose sine is x; raise ArithmeticError if abs(x) > 1."""
    if abs(x) >= 1:
        if abs(x) > 1:
            raise decimal.InvalidOperation
        return (pi(decimal.getcontext().prec) / 2).copy_sign(x)
    with decimal.localcontext() as context:
        context.prec += 10
        angle = arctan(x / (1 - x * x).sqrt())
    return +angle


@cache
def pi(digits: int) -> Decimal:
    """Return pi to `digits` significant digits, by Machin's formula."""
    with decimal.localcontext(prec=digits + 5):
        return 16 * _arctan_inverse(5) - 4 * _arctan_inverse(239)


def _arctan_inverse(n: int) -> Decimal:
    power = Decimal(1) / n
    total, k = power, 1
    while abs(power) > Decimal(1).scaleb(-decimal.getcontext().prec):
        power = -power / (n * n)
        k += 2
        total += power / k
    return total


def product(x: Row, reversed_y: Row) -> Decimal:
    """Return coefficient k of a product of two series, given coefficients 0 to k and k to 0."""
    if x and not x[-1]:
        # Series of polynomials end in many zeros, which change no digit of the sum.
        n = len(x) - 1
        while n and not x[n - 1]:
            n -= 1
        x = x[:n]
    return sum(map(mul, x, reversed_y), Decimal(0))


def value_at(series: Sequence[Any], offset: Any) -> Any:
    total: Any = 0
    for term in reversed(series):
        total = total * offset + term
    return total


def unit(row: Row) -> Row:
    length = sum((x * x for x in row), Decimal(0)).sqrt()
    return [x / length for x in row]


def to_decimal(x: Fraction) -> Decimal:
    return Decimal(x.numerator) / x.denominator
